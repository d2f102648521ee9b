"""Poses between two spins of the grid, at the edge of what can be reached: often the stiffest.

A stretched arm is stiff along itself, so stiffness mostly rises up to the edge of reach or to a
limit, and the edge lies between two spins of the grid. It is looked for where the rise leads to
more than the grid has.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import AT_ONCE, ROUNDING, BoolArray, FloatArray, IndexArray, Table
from postproc.kinematics import STRETCHED, elbow_distance
from postproc.planning.search.constants import EDGE_GAIN, EDGE_RISE, HALVINGS
from postproc.planning.states import BRANCHES, Problem, States, StrokeEnds, evaluate
from postproc.records import dataclass
from postproc.units import TURN


@dataclass(frozen=True, slots=True)
class Edges(Table):
    """For each of n tags the stiffest pose: index (n,) [N/m], spin (n,), branch (n,), q (n, 6).

    Angles [rad]. ``is_between`` (n,): it stands between two spins of the grid, at an edge; the
    other values but the index mean nothing where it does not.
    """

    index: FloatArray
    spin: FloatArray
    branch: IndexArray
    q: FloatArray
    is_between: BoolArray

    @classmethod
    def none(cls, index: FloatArray) -> Edges:
        """Return none between the spins of the grid, which has these indices (n,)."""
        n = len(index)
        where = np.zeros(n), np.zeros(n, dtype=np.int64), np.zeros((n, 6))
        return cls(index.astype(np.float64), *where, np.zeros(n, dtype=np.bool_))


def best_of(states: States) -> FloatArray:
    """Return the best index (n,) [N/m] among the states of each tag, NaN without."""
    best = np.full(len(states), np.nan)
    full = np.flatnonzero(np.diff(states.offsets))
    if len(full):
        best[full] = np.maximum.reduceat(states.index, states.offsets[full])
    return best


def edges_of(
    problem: Problem, tags: IndexArray, states: States, pinned: BoolArray, stride: int
) -> Edges:
    """Return the stiffest poses of tags (n,) within reach, collisions not asked.

    Args:
        problem: what is asked.
        tags: (n,).
        states: of these tags.
        pinned: (n,) tags whose spin is given.
        stride: every how many of the finest spins are in the grid.
    """
    n, found = len(tags), Edges.none(best_of(states))
    if problem.settings.weights.main is None:
        return found
    for low in range(0, n, AT_ONCE // BRANCHES):
        rows = np.arange(low, min(low + AT_ONCE // BRANCHES, n))
        at, column = _last_before_edges(problem, states, rows, stride, found)
        kept = ~pinned[at[0]]
        if kept.any():
            at = (at[0][kept], at[1][kept], at[2][kept])
            _halve(problem, tags[at[0]], states, at, column[kept] * stride, found)
    return found


def _last_before_edges(
    problem: Problem, states: States, rows: IndexArray, stride: int, found: Edges
) -> tuple[tuple[IndexArray, IndexArray, IndexArray], IndexArray]:
    """Return the states (m,) behind which the stiffest pose may stand, and in which sense (m,).

    Row of tag, branch and number of each; for the tags ``rows`` (k,), which follow each other.
    """
    ends = states.offsets[rows[0] : rows[-1] + 2]
    width = states.spins.shape[-1]
    all_columns = states.column[ends[0] : ends[-1]]
    kept = np.flatnonzero((all_columns < width) & (all_columns % stride == 0))
    own, count = ends[0] + kept, -(-width // stride)
    row = np.repeat(np.arange(len(rows)), np.diff(ends))[kept]
    place = (row, states.branch[own].astype(np.int64), all_columns[kept] // stride)
    index = np.full((len(rows), BRANCHES, count), -np.inf, dtype=np.float32)
    which = np.zeros(index.shape, dtype=np.int32)
    index[place], which[place] = states.index[own], own
    best = np.nan_to_num(found.index[rows], nan=np.inf)[:, None, None]
    low, high = problem.cell.optimize.range
    is_ring = high - low >= TURN - ROUNDING
    up, down = np.roll(index, -1, axis=2), np.roll(index, 1, axis=2)
    parts = []
    for sense, ahead, behind in ((1, up, down), (-1, down, up)):
        with np.errstate(invalid="ignore"):
            rise = np.where(np.isfinite(behind), np.maximum(index - behind, 0.0), 0.0)
            edge = np.isfinite(index) & ~np.isfinite(ahead) & (count > 1)
            edge &= index + EDGE_RISE * rise > EDGE_GAIN * best
        if not is_ring:
            edge[:, :, -1 if sense > 0 else 0] = False
        tag, branch, column = np.nonzero(edge)
        parts.append((rows[tag], branch, which[tag, branch, column], np.full(len(tag), sense)))
    row, branch, state, senses = (np.concatenate(column) for column in zip(*parts, strict=True))
    return (row, branch, state), senses


def _halve(
    problem: Problem,
    tag: IndexArray,
    states: States,
    at: tuple[IndexArray, IndexArray, IndexArray],
    columns: IndexArray,
    found: Edges,
) -> None:
    """Note the last poses that can be reached behind states, where they are the stiffest."""
    row, branch, state = at
    good_spin = states.spin_of(state)
    step = columns * _finest(states, row)
    q, reach = states.q[state].astype(np.float64), np.zeros(len(row))
    share = 1.0
    for _ in range(HALVINGS):
        share *= 0.5
        spin = good_spin + (reach + share) * step
        attitude = np.column_stack([spin, np.zeros((len(spin), 2))])
        T = problem.placement.tcp(tag, attitude)
        T_flange = problem.placement.flange(T, problem.placement.external[tag])
        solved, good = problem.solve_flange(T_flange, branch, q)
        solved = np.where(good[:, None], solved, q)
        good &= problem.within(solved) & problem.regular(solved)
        good &= elbow_distance(problem.kinematics, solved) >= STRETCHED  # nearer A3 races
        every = np.arange(len(spin))
        ends = StrokeEnds.of(problem, tag, T_flange, every, branch, solved)
        good &= ends.reached & ends.regular & ends.within(problem, every, solved, every)
        q[good] = solved[good]
        reach[good] += share
    beyond = np.flatnonzero(reach > 0.0)
    attitude = np.zeros((len(beyond), 3))
    attitude[:, 0] = good_spin[beyond] + reach[beyond] * step[beyond]
    T = problem.placement.tcp(tag[beyond], attitude)
    index = evaluate(problem, tag[beyond], attitude[:, 0], T, q[beyond])[1]
    for value, k in zip(index.tolist(), beyond.tolist(), strict=True):
        if value > found.index[row[k]]:
            found.index[row[k]], found.is_between[row[k]] = value, True
            found.spin[row[k]] = good_spin[k] + reach[k] * step[k]
            found.branch[row[k]], found.q[row[k]] = branch[k], q[k]


def _finest(states: States, row: IndexArray) -> FloatArray:
    """Return the step (m,) [rad] of the finest grid of spins of tags, by row."""
    spins = np.broadcast_to(states.spins, (len(states), states.spins.shape[-1]))
    return np.asarray(spins[row, 1] - spins[row, 0])
