"""Candidate states of every tag: spin about the tool axis, tilt of it, IK branch, turns of joints.

What cannot be reached, is over a joint limit or near a singular wrist is left out and counted, so
that a tag without any state can say why; so is what cannot run its stroke.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered
from postproc.planning.states.costs import StateContext, state_costs
from postproc.planning.states.given import as_given
from postproc.planning.states.problem import Problem, nearest_turn
from postproc.planning.states.tilt import UPRIGHT

BRANCHES = 8
_CHUNK = 2000
_FULL_TURN = 2.0 * np.pi


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
    size = max(1, _CHUNK // width)
    parts = [
        _chunk(
            problem,
            tags[low : low + size],
            spins if spins.ndim == 1 else spins[low : low + size],
            tilts,
            None if branch is None else branch[low : low + size],
            None if near is None else near[low : low + size],
        )
        for low in range(0, len(tags), size)
    ]
    counts = np.concatenate([part.counts for part in parts]) if parts else np.zeros(0, np.int64)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    configs = np.cumsum([0, *(part.configs for part in parts)], dtype=np.int32)
    return States(
        offsets=offsets,
        q=_joined([part.q for part in parts], np.zeros((0, 6), np.float32)),
        column=_joined([part.column for part in parts], np.zeros(0, np.int16)),
        branch=_joined([part.branch for part in parts], np.zeros(0, np.int8)),
        config=_joined(
            [part.config + first for part, first in zip(parts, configs, strict=False)],
            np.zeros(0, np.int32),
        ),
        cost=_joined([part.cost for part in parts], np.zeros(0)),
        index=_joined([part.index for part in parts], np.zeros(0, np.float32)),
        spins=spins,
        tilts=tilts,
        refused=_joined([part.refused for part in parts], np.zeros((0, 3), np.int64)),
        tried=_joined([part.tried for part in parts], np.zeros(0, np.int64)),
    )


@dataclass(slots=True)
class _Part:
    counts: IndexArray
    configs: int
    q: NDArray[np.float32]
    column: NDArray[np.int16]
    branch: NDArray[np.int8]
    config: NDArray[np.int32]
    cost: FloatArray
    index: NDArray[np.float32]
    refused: IndexArray
    tried: IndexArray


def _chunk(
    problem: Problem,
    tags: IndexArray,
    spins: FloatArray,
    tilts: FloatArray,
    branch: IndexArray | None,
    near: FloatArray | None,
) -> _Part:
    n = len(tags)
    row, column, attitude = _attitudes(problem, tags, spins, tilts)
    which = tags[row]
    T_base_tcp = problem.placement.tcp(which, attitude)
    T_robroot_flange = problem.placement.flange(T_base_tcp, problem.placement.external[which])
    slots, valid = problem.kinematics.ik(T_robroot_flange)
    valid &= problem.placement.given[which][:, None]
    if branch is not None:
        kept = np.zeros_like(valid)
        kept[np.arange(len(which)), branch[row]] = True
        valid &= kept
    reached = np.flatnonzero(valid)
    inside = _with_a_turn(problem, slots.reshape(-1, 6), reached)
    bent = inside[problem.regular(slots.reshape(-1, 6)[inside])]
    tried = n_of(row, n) * (BRANCHES if branch is None else 1)
    left = [tried, *(n_of(row[rows // BRANCHES], n) for rows in (reached, inside, bent))]
    refused = -np.diff(np.stack(left, axis=1), axis=1)
    pose, slot = np.divmod(bent, BRANCHES)
    q = slots[pose, slot]
    low, high = _turn_range(problem, q)
    ends = _StrokeEnds.of(problem, which, T_robroot_flange, pose, slot, q)
    for k, bad in ((0, ~ends.reached), (2, ends.reached & ~ends.regular)):
        refused[:, k] += n_of(row[pose[bad]], n)
    good = ends.reached & ends.regular
    pose, slot, q, low, high = pose[good], slot[good], q[good], low[good], high[good]
    if near is not None:
        q, source = _nearest(problem, q, near[row[pose]])
    else:
        q, source = _copies(q, low, high, all_turns=problem.cell.optimize.turns)
    fits = ends.within(problem, good, q, source)
    stay = n_of(source[fits], len(pose)) > 0
    refused[:, 1] += n_of(row[pose[(n_of(source, len(pose)) > 0) & ~stay]], n)
    may = fits & as_given(problem, which[pose[source]], q)
    if not may.all():
        q, source = q[may], source[may]
    orientation = _Orientation.of(problem, which, T_base_tcp)
    cost, index = _costs(problem, which, attitude[:, 0], orientation, pose, q, source)
    owner = row[pose[source]]
    _subtract_best(cost, owner)
    return _Part(
        counts=n_of(owner, n),
        configs=len(pose),
        q=q.astype(np.float32),
        column=column[pose[source]].astype(np.int16),
        branch=slot[source].astype(np.int8),
        config=source.astype(np.int32),
        cost=cost,
        index=index.astype(np.float32),
        refused=refused,
        tried=tried,
    )


@dataclass(frozen=True, slots=True)
class _StrokeEnds:
    """How configurations (m,) get to the ends of strokes: within reach, off a straight wrist.

    ``way``: (m, 6) [rad] by which the joints move there, for each end.
    """

    reached: BoolArray
    regular: BoolArray
    way: list[FloatArray]

    @classmethod
    def of(
        cls,
        problem: Problem,
        tags: IndexArray,
        T_robroot_flange: FloatArray,
        pose: IndexArray,
        slot: IndexArray,
        q: FloatArray,
    ) -> _StrokeEnds:
        """Return the ends of configurations (m,), rising by ``pose``.

        Args:
            problem: what is asked.
            tags: (k,) of the poses.
            T_robroot_flange: (k, 4, 4) of the poses.
            pose: (m,) each configuration's.
            slot: (m,) branch of each.
            q: (m, 6) joints [rad].
        """
        found = cls(np.ones(len(q), dtype=np.bool_), np.ones(len(q), dtype=np.bool_), [])
        for height in problem.strokes.levels(tags[pose]):
            T = problem.placement.backed_off(T_robroot_flange[pose], height)
            end, valid = problem.kinematics.ik_in(T, slot)
            found.reached[:] &= valid
            found.regular[:] &= problem.regular(end)
            found.way.append(nearest_turn(end, q) - q)
        return found

    def within(
        self, problem: Problem, kept: BoolArray, q: FloatArray, source: IndexArray
    ) -> BoolArray:
        """Return which turn copies (s, 6) of the configurations kept stay within limits."""
        fits = np.ones(len(q), dtype=np.bool_)
        for way in self.way:
            fits &= problem.within(q + way[kept][source])
        return fits


def _attitudes(
    problem: Problem, tags: IndexArray, spins: FloatArray, tilts: FloatArray
) -> tuple[IndexArray, IndexArray, FloatArray]:
    """Return row of ``tags`` (m,), column (m,) and attitude (m, 3) of all poses to try."""
    n, width = len(tags), spins.shape[-1]
    use = np.ones((n, len(tilts), width), dtype=np.bool_)
    use[:, 1:] = problem.placement.may_tilt[tags][:, None, None]
    row, tilt, column = np.nonzero(use)
    spin = np.broadcast_to(spins, (n, width))[row, column]
    return row, tilt * width + column, np.column_stack([spin, tilts[tilt]])


def n_of(rows: IndexArray, n: int) -> IndexArray:
    """Return how often each of ``0..n-1`` stands in ``rows``."""
    return np.bincount(rows, minlength=n).astype(np.int64)


def _turn_range(
    problem: Problem, q: FloatArray, joint: int | slice = slice(None)
) -> tuple[FloatArray, FloatArray]:
    """Return the fewest and the most whole turns that bring angles of joints within their limits.

    Of all joints (m, 6), or of one (m,).
    """
    margin = problem.cell.limits.joint_margin - 1e-9
    q_min = np.asarray(problem.kinematics.q_min)[joint]
    q_max = np.asarray(problem.kinematics.q_max)[joint]
    low = np.ceil((q_min + margin - q) / _FULL_TURN)
    high = np.floor((q_max - margin - q) / _FULL_TURN)
    return low, high


def _with_a_turn(problem: Problem, q: FloatArray, rows: IndexArray) -> IndexArray:
    """Return those of ``rows`` (m,) of q (k, 6) of which some turn lies within all limits."""
    room = np.asarray(problem.kinematics.q_max) - np.asarray(problem.kinematics.q_min)
    for joint in np.argsort(room, kind="stable").tolist():
        low, high = _turn_range(problem, q[rows, joint], joint)
        rows = rows[low <= high]
    return rows


def _copies(
    q: FloatArray, low: FloatArray, high: FloatArray, *, all_turns: bool
) -> tuple[FloatArray, IndexArray]:
    """Return every in-limit turn of configurations (m, 6), and the row each comes from.

    Ordered by row, that nearest to the principal value first; without ``all_turns`` it alone stays.
    """
    best = np.clip(0, low, high)
    base = q + _FULL_TURN * best
    if not all_turns or not len(q):
        return base, np.arange(len(q))
    wide = np.flatnonzero((high > low).any(axis=0)).tolist()
    count = (high - low + 1.0).astype(np.int64)[:, wide]
    own = np.zeros(len(q), dtype=np.int64)  # number of the base among the turns of its row
    for k, joint in enumerate(wide):
        own = own * count[:, k] + (best - low)[:, joint].astype(np.int64)
    source, step = numbered(count.prod(axis=1))
    step = np.where(step == 0, own[source], step - (step <= own[source]))
    copies = base[source]
    for k, joint in reversed(list(enumerate(wide))):
        step, turn = np.divmod(step, count[source, k])
        copies[:, joint] = q[source, joint] + _FULL_TURN * (low[source, joint] + turn)
    return copies, source


def _nearest(problem: Problem, q: FloatArray, q_near: FloatArray) -> tuple[FloatArray, IndexArray]:
    moved = q + _FULL_TURN * np.round((q_near - q) / _FULL_TURN)
    kept = np.nonzero(problem.within(moved))[0]
    return moved[kept], kept


@dataclass(frozen=True, slots=True)
class _Orientation:
    """How the tool stands in poses (m,): R_robroot_tcp (m, 3, 3), tilt (m,) [rad] or None."""

    R_robroot_tcp: FloatArray
    tilt: FloatArray | None

    @classmethod
    def of(cls, problem: Problem, tag: IndexArray, T_base_tcp: FloatArray) -> _Orientation:
        """Return the orientation of the tool in poses (m, 4, 4) at tags (m,)."""
        place = problem.placement
        R_robroot_base = place.base(place.external[tag])[..., :3, :3]
        return cls(R_robroot_base @ T_base_tcp[:, :3, :3], problem.tilt_of(tag, T_base_tcp))

    def rows(self, index: IndexArray) -> _Orientation:
        """Return some of them."""
        return _Orientation(
            self.R_robroot_tcp[index], None if self.tilt is None else self.tilt[index]
        )


def _costs(
    problem: Problem,
    tag: IndexArray,
    spin: FloatArray,
    orientation: _Orientation,
    pose: IndexArray,
    q: FloatArray,
    source: IndexArray,
) -> tuple[FloatArray, FloatArray]:
    """Return cost and index of every state; turn copies share what does not depend on the turn.

    Args:
        problem: what is asked.
        tag: (k,) of poses.
        spin: (k,) [rad].
        orientation: (k,).
        pose: (m,) of configurations.
        q: (s, 6) [rad] of states.
        source: (s,) their configurations, rising.
    """
    weights = problem.settings.weights
    if not weights.states or not len(q):
        return np.zeros(len(q)), np.full(len(q), np.nan)

    def context(states: IndexArray | slice) -> StateContext:
        rows = pose[source[states]]
        return _context(problem, tag[rows], spin[rows], orientation.rows(rows), q[states])

    of_pose, of_turn = weights.split()
    cost, index = np.zeros(len(q)), np.full(len(q), np.nan)
    if of_pose.states:
        first = np.flatnonzero(np.diff(source, prepend=-1))
        shared = state_costs(of_pose, context(first))
        count = np.diff(np.append(first, len(source)))
        cost, index = np.repeat(shared[0], count), np.repeat(shared[1], count)
    if of_turn.states:
        cost = cost + state_costs(of_turn, context(slice(None)))[0]
    return cost, index


def evaluate(
    problem: Problem, tag: IndexArray, spin: FloatArray, T_base_tcp: FloatArray, q: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return cost (m,) and stiffness index (m,) of poses with known joints."""
    context = context_of(problem, tag, spin, T_base_tcp, q)
    return state_costs(problem.settings.weights, context)


def context_of(
    problem: Problem, tag: IndexArray, spin: FloatArray, T_base_tcp: FloatArray, q: FloatArray
) -> StateContext:
    """Return what objectives and indices look at, for poses (m,) with known joints."""
    return _context(problem, tag, spin, _Orientation.of(problem, tag, T_base_tcp), q)


def _context(
    problem: Problem, tag: IndexArray, spin: FloatArray, orientation: _Orientation, q: FloatArray
) -> StateContext:
    return StateContext(
        kinematics=problem.kinematics,
        cell=problem.cell,
        q=q,
        tag=tag,
        spin=spin,
        R_robroot_tcp=orientation.R_robroot_tcp,
        normal=problem.normal[tag],
        c_joint=None if problem.c_joint is None else problem.c_joint(q),
        tilt=orientation.tilt,
    )


def _subtract_best(cost: FloatArray, row: IndexArray) -> None:
    """Make the best cost of every row 0, in place; rows are sorted."""
    if not len(cost):
        return
    starts = np.nonzero(np.diff(row, prepend=-1))[0]
    best = np.minimum.reduceat(cost, starts)
    cost -= np.repeat(best, np.diff(np.append(starts, len(row))))


def _joined(parts: list[NDArray], empty: NDArray) -> NDArray:  # type: ignore[type-arg]
    return np.concatenate(parts) if parts else empty
