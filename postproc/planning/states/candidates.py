"""Candidate states of every tag: spin about the tool axis, tilt of it, IK branch, turns of joints.

What cannot be reached, is over a joint limit or near a singular wrist is left out and counted, so
that a tag without any state can say why; so is what cannot run its stroke.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import (
    AT_ONCE,
    ROUNDING,
    BoolArray,
    FloatArray,
    IndexArray,
    least_by,
    numbered,
    taken,
)
from postproc.planning.states.postures import StrokeEnds
from postproc.planning.states.pricing import Orientation, as_given, costs_of
from postproc.planning.states.problem import Problem, nearest_turn
from postproc.planning.states.tilt import UPRIGHT
from postproc.records import dataclass
from postproc.units import TURN

BRANCHES = 8
"""Arm configurations: shoulder, elbow and wrist."""


@dataclass(slots=True)
class States:
    """The states of tags behind each other; tag ``i`` has ``offsets[i]:offsets[i+1]``.

    Args:
        offsets: (n+1,).
        q: (N, 6) [rad], single precision: good to place a state, exact joints are solved anew.
        column: (N,) number of the attitude: that of the tilt times S plus that of the spin;
            branch: (N,) 0..7.
        config: (N,) number of (tag, column, branch): turn copies share it, and what collides.
        cost: (N,) of the objectives, the best of each tag is 0.
        index: (N,) stiffness along the objective's direction [N/m], NaN without.
        spins: (S,) or (n, S) [rad]; tilts: (T, 2) lead and side [rad].
        refused: (n, 3) configurations out of reach, over a limit, near a singularity.
        tried: (n,) configurations of each tag.
    """

    offsets: IndexArray
    q: NDArray[np.float32]
    column: NDArray[np.int16]
    branch: NDArray[np.int8]
    config: NDArray[np.int32]
    cost: FloatArray
    index: NDArray[np.float32]
    spins: FloatArray
    tilts: FloatArray
    refused: IndexArray
    tried: IndexArray

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.offsets) - 1

    def tag_of(self, states: IndexArray) -> IndexArray:
        """Return the tag (m,) of states (m,)."""
        tags: IndexArray = np.searchsorted(self.offsets, states, side="right") - 1
        return tags

    def spin_of(self, states: IndexArray) -> FloatArray:
        """Return the spin (m,) [rad] of states (m,)."""
        spin = self.column[states] % self.spins.shape[-1]
        if self.spins.ndim == 1:
            return np.asarray(self.spins[spin])
        return np.asarray(self.spins[self.tag_of(states), spin])

    def attitude_of(self, states: IndexArray) -> FloatArray:
        """Return spin, lead and side tilt (m, 3) [rad] of states (m,)."""
        tilt = self.tilts[self.column[states] // self.spins.shape[-1]]
        return np.column_stack([self.spin_of(states), tilt])


_OF_STATE = ("q", "column", "branch", "cost", "index")
"""Columns of ``States`` that joined ones have behind each other as they are."""


def sample(
    problem: Problem,
    tags: IndexArray,
    spins: FloatArray,
    branch: IndexArray | None = None,
    near: FloatArray | None = None,
    tilts: FloatArray = UPRIGHT,
) -> States:
    """Return the states of tags (n,).

    Args:
        problem: what is asked.
        tags: (n,) indices of tags.
        spins: (S,) the same for every tag, or (n, S) [rad].
        branch: (n,) keep this branch only; None: all eight.
        near: (n, 6) keep only the turns nearest to these joints; None: all turns (or the
            principal ones, by the setting ``turns``).
        tilts: (T, 2) lead and side [rad], none at all first; tags that may not tilt take only that.
    """
    width = spins.shape[-1] * len(tilts)
    size = max(1, AT_ONCE // width)
    parts = [
        _chunk(
            problem,
            tags[low : low + size],
            spins if spins.ndim == 1 else spins[low : low + size],
            tilts,
            None if branch is None else branch[low : low + size],
            None if near is None else near[low : low + size],
        )
        for low in range(0, max(len(tags), 1), size)
    ]
    if len(parts) == 1:
        return parts[0]
    firsts = np.cumsum([0, *(part.config.max(initial=-1) + 1 for part in parts)]).tolist()
    counts = np.concatenate([np.diff(part.offsets) for part in parts])
    return States(
        offsets=np.concatenate([[0], np.cumsum(counts)]),
        config=np.concatenate(
            [part.config + np.int32(first) for part, first in zip(parts, firsts, strict=False)]
        ),
        spins=spins,
        tilts=tilts,
        refused=np.concatenate([part.refused for part in parts]),
        tried=np.concatenate([part.tried for part in parts]),
        **{name: np.concatenate([getattr(p, name) for p in parts]) for name in _OF_STATE},
    )


def _chunk(
    problem: Problem,
    tags: IndexArray,
    spins: FloatArray,
    tilts: FloatArray,
    branch: IndexArray | None,
    near: FloatArray | None,
) -> States:
    n = len(tags)
    row, column, attitude = _attitudes(problem, tags, spins, tilts)
    which = tags[row]
    T_base_tcp = problem.placement.tcp(which, attitude)
    T_robroot_flange = problem.placement.flange(T_base_tcp, problem.placement.external[which])
    wanted = np.ones((len(which), BRANCHES), dtype=np.bool_)
    if branch is not None:
        wanted = branch[row][:, None] == np.arange(BRANCHES)
    wanted &= problem.placement.given[which][:, None]
    pose, slot, q, valid = problem.kinematics.ik_where(T_robroot_flange, turnable(problem))
    if not wanted.all():
        kept = wanted[pose, slot]
        pose, slot, q, valid = pose[kept], slot[kept], q[kept], valid & wanted
    bent = np.flatnonzero(problem.regular(q))
    tried = n_of(row, n) * (BRANCHES if branch is None else 1)
    reached = np.bincount(row, valid.sum(axis=1), n).astype(np.int64)
    left = [tried, reached, n_of(row[pose], n), n_of(row[pose[bent]], n)]
    refused = -np.diff(np.stack(left, axis=1), axis=1)
    pose, slot, q = pose[bent], slot[bent], taken(q, bent)
    low, high = turn_range(problem, q)
    ends = StrokeEnds.of(problem, which, T_robroot_flange, pose, slot, q)
    for k, bad in ((0, ~ends.reached), (2, ends.reached & ~ends.regular)):
        refused[:, k] += n_of(row[pose[bad]], n)
    good = np.flatnonzero(ends.reached & ends.regular)
    pose, slot = pose[good], slot[good]
    q, low, high = (taken(values, good) for values in (q, low, high))
    if near is not None:
        q, source = nearest_copies(problem, q, near[row[pose]])
    else:
        q, source = copies_of(q, low, high, all_turns=problem.cell.optimize.turns)
    fits = ends.within(problem, good, q, source)
    stay = n_of(source[fits], len(pose)) > 0
    refused[:, 1] += n_of(row[pose[(n_of(source, len(pose)) > 0) & ~stay]], n)
    may = fits & as_given(problem, which[pose[source]], q)
    if not may.all():
        q, source = taken(q, may), source[may]
    orientation = Orientation.of(problem, which, T_base_tcp)
    cost, index = costs_of(problem, which, attitude[:, 0], orientation, pose, q, source)
    owner = row[pose[source]]
    cost -= least_by(cost, owner, n)[owner]
    return States(
        offsets=np.concatenate([[0], np.cumsum(n_of(owner, n))]),
        q=q.astype(np.float32),
        column=column[pose[source]].astype(np.int16),
        branch=slot[source].astype(np.int8),
        config=source.astype(np.int32),
        cost=cost,
        index=index.astype(np.float32),
        spins=spins,
        tilts=tilts,
        refused=refused,
        tried=tried,
    )


def _attitudes(
    problem: Problem, tags: IndexArray, spins: FloatArray, tilts: FloatArray
) -> tuple[IndexArray, IndexArray, FloatArray]:
    """Return row of ``tags`` (m,), column (m,) and attitude (m, 3) of all poses to try."""
    n, width = len(tags), spins.shape[-1]
    use = np.ones((n, len(tilts), width), dtype=np.bool_)
    use[:, 1:] = problem.placement.may_tilt[tags][:, None, None]
    row, tilt, column = np.nonzero(use)
    spin = np.broadcast_to(spins, (n, width))[row, column]
    return row, tilt * width + column, np.column_stack([spin, taken(tilts, tilt)])


def n_of(rows: IndexArray, n: int) -> IndexArray:
    """Return how often each of ``0..n-1`` stands in ``rows``."""
    return np.bincount(rows, minlength=n).astype(np.int64)


def turn_range(
    problem: Problem, q: FloatArray, joint: int | slice = slice(None)
) -> tuple[FloatArray, FloatArray]:
    """Return the fewest and the most whole turns that bring angles of joints within their limits.

    Of all joints (m, 6), or of one (m,).
    """
    margin = problem.cell.limits.joint_margin - ROUNDING
    q_min = np.asarray(problem.kinematics.q_min)[joint]
    q_max = np.asarray(problem.kinematics.q_max)[joint]
    low = np.ceil((q_min + margin - q) / TURN)
    high = np.floor((q_max - margin - q) / TURN)
    return low, high


def turnable(problem: Problem) -> Callable[[int, FloatArray], BoolArray]:
    """Return which angles of a joint 0..5 [rad] have a turn within its limits."""
    room = np.asarray(problem.kinematics.q_max) - np.asarray(problem.kinematics.q_min)
    room -= 2.0 * problem.cell.limits.joint_margin

    def may(joint: int, angle: FloatArray) -> BoolArray:
        if room[joint] >= TURN:
            return np.ones(angle.shape, dtype=np.bool_)
        low, high = turn_range(problem, angle, joint)
        return np.asarray(low <= high)

    return may


def copies_of(
    q: FloatArray, low: FloatArray, high: FloatArray, *, all_turns: bool
) -> tuple[FloatArray, IndexArray]:
    """Return every in-limit turn of configurations (m, 6), and the row each comes from.

    Ordered by row, that nearest to the principal value first; without ``all_turns`` it alone stays.
    """
    best = np.clip(0, low, high)
    base = q + TURN * best
    if not all_turns or not len(q):
        return base, np.arange(len(q))
    wide = np.flatnonzero((high > low).any(axis=0)).tolist()
    count = (high - low + 1.0).astype(np.int64)[:, wide]
    own = np.zeros(len(q), dtype=np.int64)  # number of the base among the turns of its row
    for k, joint in enumerate(wide):
        own = own * count[:, k] + (best - low)[:, joint].astype(np.int64)
    source, step = numbered(count.prod(axis=1))
    step = np.where(step == 0, own[source], step - (step <= own[source]))
    copies = taken(base, source)
    for k, joint in reversed(list(enumerate(wide))):
        step, turn = np.divmod(step, count[:, k][source])
        copies[:, joint] = q[:, joint][source] + TURN * (low[:, joint][source] + turn)
    return copies, source


def nearest_copies(
    problem: Problem, q: FloatArray, q_near: FloatArray
) -> tuple[FloatArray, IndexArray]:
    """Return the turn of configurations (m, 6) nearest to joints (m, 6) and the row of each kept.

    What is over a limit there is left out.
    """
    moved = nearest_turn(q, q_near)
    kept = np.nonzero(problem.within(moved))[0]
    return moved[kept], kept


@dataclass(frozen=True, slots=True)
class Merged:
    """States of the tags of two sets together.

    Args:
        states: of all tags, rising.
        tags: (n,) them; is_new: (n,) those whose states are new.
        source: (N,) the state before, -1 for a new one.
    """

    states: States
    tags: IndexArray
    is_new: BoolArray
    source: IndexArray


def sample_on(problem: Problem, tags: IndexArray, spins: FloatArray, stride: IndexArray) -> States:
    """Return the states of tags (n,), each on every ``stride``-th (n,) spin of the finest grid.

    Args:
        problem: what is asked.
        tags: (n,) rising.
        spins: (S,) or (n, S) [rad], the finest grid.
        stride: (n,).
    """
    width = spins.shape[-1]
    result: Merged | None = None
    for step in np.unique(stride)[::-1].tolist():
        rows = np.flatnonzero(stride == step)
        part = spins[::step] if spins.ndim == 1 else spins[rows][:, ::step]
        states = sample(problem, tags[rows], part, tilts=problem.tilts)
        fine = np.arange(len(states.tilts))[:, None] * width + step * np.arange(part.shape[-1])
        states.column = fine.ravel().astype(np.int16)[states.column]
        states.spins = spins if spins.ndim == 1 else spins[rows]
        if result is None:
            result = Merged(states, tags[rows], np.ones(len(rows), np.bool_), np.zeros(0, int))
        else:
            result = merged(result.states, result.tags, states, tags[rows])
    if result is None:
        return sample(problem, tags, spins, tilts=problem.tilts)
    return result.states


def merged(known: States, tags: IndexArray, new: States, new_tags: IndexArray) -> Merged:
    """Return the states of ``tags`` (n,) and ``new_tags`` (m,), of both lists the new ones."""
    kept = np.flatnonzero(~np.isin(tags, new_tags))
    both = np.concatenate([tags[kept], new_tags])
    order = np.argsort(both, kind="stable")
    is_new = (np.arange(len(both)) >= len(kept))[order]
    starts = np.concatenate([known.offsets[kept], new.offsets[:-1] + len(known.q)])[order]
    counts = np.concatenate([np.diff(known.offsets)[kept], np.diff(new.offsets)])[order]
    offsets = np.concatenate([[0], np.cumsum(counts)])
    pick = np.repeat(starts - offsets[:-1], counts) + np.arange(offsets[-1])
    first = int(known.config[-1]) + 1 if len(known.config) else 0
    config = np.concatenate([known.config, new.config + first])[pick]
    edges = np.flatnonzero(np.diff(config)) + 1
    ranks = np.zeros(len(config), dtype=np.int32)
    ranks[edges] = 1
    spins = known.spins
    if spins.ndim == 2:
        spins = np.concatenate([known.spins[kept], new.spins])[order]
    states = States(
        offsets=offsets,
        config=np.cumsum(ranks, dtype=np.int32),
        spins=spins,
        tilts=known.tilts,
        refused=np.concatenate([known.refused[kept], new.refused])[order],
        tried=np.concatenate([known.tried[kept], new.tried])[order],
        **{
            name: taken(np.concatenate([getattr(known, name), getattr(new, name)]), pick)
            for name in _OF_STATE
        },
    )
    source = np.where(pick < len(known.q), pick, -1)
    return Merged(states, both[order], is_new, source)
