"""Candidate states of every tag: spin about the tool axis, IK branch, turns of the joints.

What cannot be reached, is over a joint limit or near a singular wrist is left out and counted, so
that a tag without any state can say why.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.model.arrays import FloatArray
from postproc.planning.costs import StateContext, state_costs
from postproc.planning.ladder import IndexArray
from postproc.planning.problem import Problem

BRANCHES = 8
_CHUNK = 2000
_FULL_TURN = 2.0 * np.pi


@dataclass(slots=True)
class States:
    """The states of tags behind each other; tag ``i`` has ``offsets[i]:offsets[i+1]``.

    Args:
        offsets: (n+1,).
        q: (N, 6) [rad], single precision: good to place a state, exact joints are solved anew.
        column: (N,) index of the spin in the tag's list; branch: (N,) 0..7.
        config: (N,) number of (tag, spin, branch): turn copies share it, and what collides.
        cost: (N,) of the objectives, the best of each tag is 0.
        index: (N,) stiffness along the objective's direction [N/m], NaN without.
        spins: (S,) or (n, S) [rad].
        refused: (n, 3) configurations out of reach, over a limit, near a singularity.
        tried: configurations per tag.
    """

    offsets: IndexArray
    q: NDArray[np.float32]
    column: NDArray[np.int16]
    branch: NDArray[np.int8]
    config: IndexArray
    cost: FloatArray
    index: NDArray[np.float32]
    spins: FloatArray
    refused: IndexArray
    tried: int

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.offsets) - 1

    def tag_of(self, states: IndexArray) -> IndexArray:
        """Return the tag (m,) of states (m,)."""
        tags: IndexArray = np.searchsorted(self.offsets, states, side="right") - 1
        return tags

    def spin_of(self, states: IndexArray) -> FloatArray:
        """Return the spin (m,) [rad] of states (m,)."""
        if self.spins.ndim == 1:
            return np.asarray(self.spins[self.column[states]])
        return np.asarray(self.spins[self.tag_of(states), self.column[states]])


def sample(
    problem: Problem,
    tags: IndexArray,
    spins: FloatArray,
    branch: IndexArray | None = None,
    near: FloatArray | None = None,
) -> States:
    """Return the states of tags (n,).

    Args:
        problem: what is asked.
        tags: (n,) indices of tags.
        spins: (S,) the same for every tag, or (n, S) [rad].
        branch: (n,) keep this branch only; None: all eight.
        near: (n, 6) keep only the turns nearest to these joints; None: all turns (or the
            principal ones, by the setting ``turns``).
    """
    width = spins.shape[-1]
    size = max(1, _CHUNK // width)
    parts = [
        _chunk(
            problem,
            tags[low : low + size],
            spins if spins.ndim == 1 else spins[low : low + size],
            None if branch is None else branch[low : low + size],
            None if near is None else near[low : low + size],
        )
        for low in range(0, len(tags), size)
    ]
    counts = np.concatenate([part.counts for part in parts]) if parts else np.zeros(0, np.int64)
    offsets = np.concatenate([[0], np.cumsum(counts)])
    configs = np.cumsum([0, *(part.configs for part in parts)])
    return States(
        offsets=offsets,
        q=_joined([part.q for part in parts], np.zeros((0, 6), np.float32)),
        column=_joined([part.column for part in parts], np.zeros(0, np.int16)),
        branch=_joined([part.branch for part in parts], np.zeros(0, np.int8)),
        config=_joined(
            [part.config + first for part, first in zip(parts, configs, strict=False)],
            np.zeros(0, np.int64),
        ),
        cost=_joined([part.cost for part in parts], np.zeros(0)),
        index=_joined([part.index for part in parts], np.zeros(0, np.float32)),
        spins=spins,
        refused=_joined([part.refused for part in parts], np.zeros((0, 3), np.int64)),
        tried=width * (BRANCHES if branch is None else 1),
    )


@dataclass(slots=True)
class _Part:
    counts: IndexArray
    configs: int
    q: NDArray[np.float32]
    column: NDArray[np.int16]
    branch: NDArray[np.int8]
    config: IndexArray
    cost: FloatArray
    index: NDArray[np.float32]
    refused: IndexArray


def _chunk(
    problem: Problem,
    tags: IndexArray,
    spins: FloatArray,
    branch: IndexArray | None,
    near: FloatArray | None,
) -> _Part:
    n, width = len(tags), spins.shape[-1]
    which = np.repeat(tags, width)
    turn = np.broadcast_to(spins, (n, width)).ravel()
    T_base_tcp = problem.placement.tcp(which, turn)
    slots, valid = problem.kinematics.ik(problem.placement.flange(T_base_tcp))
    valid &= problem.placement.given[which][:, None]
    if branch is not None:
        kept = np.zeros_like(valid)
        kept[np.arange(len(which)), np.repeat(branch, width)] = True
        valid &= kept
    pose, slot = np.nonzero(valid)
    q = slots[pose, slot]
    low, high = _turn_range(problem, q)
    inside = np.asarray((low <= high).all(axis=1))
    good = inside & problem.regular(q)
    refused = np.stack(
        [
            n_of(np.zeros(0, np.int64), n)
            + width * (BRANCHES if branch is None else 1)
            - n_of(pose // width, n),
            n_of(pose[~inside] // width, n),
            n_of(pose[inside & ~good] // width, n),
        ],
        axis=1,
    )
    pose, slot, q, low, high = pose[good], slot[good], q[good], low[good], high[good]
    if near is not None:
        q, source = _nearest(problem, q, near[pose // width])
    else:
        q, source = _copies(q, low, high, all_turns=problem.settings.turns)
    cost, index = _costs(problem, which[pose], turn[pose], T_base_tcp[pose], q, source)
    row = pose[source] // width
    _subtract_best(cost, row)
    return _Part(
        counts=n_of(row, n),
        configs=len(pose),
        q=q.astype(np.float32),
        column=(pose[source] % width).astype(np.int16),
        branch=slot[source].astype(np.int8),
        config=source.astype(np.int64),
        cost=cost,
        index=index.astype(np.float32),
        refused=refused,
    )


def n_of(rows: IndexArray, n: int) -> IndexArray:
    """Return how often each of ``0..n-1`` stands in ``rows``."""
    return np.bincount(rows, minlength=n).astype(np.int64)


def _turn_range(problem: Problem, q: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the fewest and the most whole turns (m, 6) that bring an angle within its limits."""
    margin = problem.cell.limits.joint_margin - 1e-9
    low = np.ceil((np.asarray(problem.kinematics.q_min) + margin - q) / _FULL_TURN)
    high = np.floor((np.asarray(problem.kinematics.q_max) - margin - q) / _FULL_TURN)
    return low.astype(np.int64), high.astype(np.int64)


def _copies(
    q: FloatArray, low: IndexArray, high: IndexArray, *, all_turns: bool
) -> tuple[FloatArray, IndexArray]:
    """Return every in-limit turn of configurations (m, 6), and the row each comes from.

    Ordered by row. Without ``all_turns`` only the turn nearest to the principal value stays.
    """
    best = np.clip(0, low, high)
    base = q + _FULL_TURN * best
    rows = np.arange(len(q))
    if not all_turns or not len(q):
        return base, rows
    wide = np.nonzero((high > low).any(axis=0))[0].tolist()
    copies, sources = [base], [rows]
    spans = [range(int(low[:, j].min()), int(high[:, j].max()) + 1) for j in wide]
    for shift in itertools.product(*spans):
        turns = np.array(shift, dtype=np.int64)
        fits = ((low[:, wide] <= turns) & (turns <= high[:, wide])).all(axis=1)
        fits &= (best[:, wide] != turns).any(axis=1)
        chosen = np.nonzero(fits)[0]
        if len(chosen):
            copy = base[chosen]
            copy[:, wide] = q[chosen][:, wide] + _FULL_TURN * turns
            copies.append(copy)
            sources.append(chosen)
    source = np.concatenate(sources)
    order = np.argsort(source, kind="stable")
    return np.concatenate(copies)[order], source[order]


def _nearest(problem: Problem, q: FloatArray, q_near: FloatArray) -> tuple[FloatArray, IndexArray]:
    moved = q + _FULL_TURN * np.round((q_near - q) / _FULL_TURN)
    kept = np.nonzero(problem.within(moved))[0]
    return moved[kept], kept


def _costs(
    problem: Problem,
    tag: IndexArray,
    spin: FloatArray,
    T_base_tcp: FloatArray,
    q: FloatArray,
    source: IndexArray,
) -> tuple[FloatArray, FloatArray]:
    """Return cost and index of every state; turn copies share what does not depend on the turn."""
    weights = problem.settings.weights
    if not weights.states or not len(q):
        return np.zeros(len(q)), np.full(len(q), np.nan)
    shared = all(part.is_stiffness for _, _, part in weights.states)
    first = np.searchsorted(source, np.arange(len(tag))) if shared else source
    if shared:
        present = np.isin(np.arange(len(tag)), source)
        first = np.minimum(first, len(q) - 1)
        rows, joints = np.arange(len(tag)), q[first]
    else:
        rows, joints = source, q
        present = np.ones(len(q), dtype=np.bool_)
    cost, index = evaluate(problem, tag[rows], spin[rows], T_base_tcp[rows], joints)
    if shared:
        cost[~present] = 0.0
        return cost[source], index[source]
    return cost, index


def evaluate(
    problem: Problem, tag: IndexArray, spin: FloatArray, T_base_tcp: FloatArray, q: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return cost (m,) and stiffness index (m,) of poses with known joints."""
    R_robroot_base = np.asarray(problem.placement.T_robroot_base)[:3, :3]
    context = StateContext(
        kinematics=problem.kinematics,
        cell=problem.cell,
        q=q,
        tag=tag,
        spin=spin,
        R_robroot_tcp=R_robroot_base @ T_base_tcp[:, :3, :3],
        normal=problem.normal[tag],
        c_joint=None if problem.c_joint is None else problem.c_joint(q),
    )
    return state_costs(problem.settings.weights, context)


def _subtract_best(cost: FloatArray, row: IndexArray) -> None:
    """Make the best cost of every row 0, in place; rows are sorted."""
    if not len(cost):
        return
    starts = np.nonzero(np.diff(row, prepend=-1))[0]
    best = np.minimum.reduceat(cost, starts)
    cost -= np.repeat(best, np.diff(np.append(starts, len(row))))


def _joined(parts: list[NDArray], empty: NDArray) -> NDArray:  # type: ignore[type-arg]
    return np.concatenate(parts) if parts else empty
