"""Attitudes between the grid: state costs and travel made as small as they locally get.

The grid search finds the right valley; inside it the cost is smooth. One Newton step for all tags
at once is a tridiagonal system, because a tag meets only its two neighbours. Tags that move beside
each other take their step together; those that cannot stand there take less of it, and where the
sum does not fall those that lose by it. So no step raises the sum. Tags at rest beside tags at rest
are not looked at again.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, Table, taken
from postproc.planning.states import Problem, evaluate
from postproc.records import dataclass
from postproc.units import DEG

REFINED_GRID = 0.001 * DEG
"""Refined angles are rounded to this, far coarser than what differs between machines."""
_PROBE = 0.25 * DEG
_ROUNDS = 12
_SHARES = np.array([1.0, 0.5, 0.25, 0.1, 0.03, 0.01, 0.0])
"""Shares of its step that a tag takes, one after the other."""
_AT_ONCE = 400
"""So many poses are worked out nearly as fast as one: smaller shares are, before they are asked."""


@dataclass(slots=True)
class TagPoses(Table):
    """An attitude and a branch for each of n tags, with the joints that follow [rad].

    ``attitude`` (n, 3): spin, lead, side tilt. ``weight`` (n,): of the squared joint change into
    each tag, 0 where it is free; ``share`` (n,): of its own cost; ``best`` (n,): index of
    the best state [N/m].
    """

    tags: IndexArray
    attitude: FloatArray
    branch: IndexArray
    q: FloatArray
    weight: FloatArray
    share: FloatArray
    best: FloatArray

    def weighted(self, weight: FloatArray) -> TagPoses:
        """Return the same poses with another weight of travel."""
        return replace(self, weight=weight)

    def standing_as(self, other: TagPoses, rows: BoolArray) -> TagPoses:
        """Return the same poses, but those of some tags (n,) as in another."""
        attitude = np.where(rows[:, None], other.attitude, self.attitude)
        return replace(
            self,
            attitude=attitude,
            branch=np.where(rows, other.branch, self.branch),
            q=np.where(rows[:, None], other.q, self.q),
        )

    def travel(self, q: FloatArray) -> FloatArray:
        """Return the weighted squared joint change (n,) into each tag along joints (n, 6)."""
        leap = np.diff(q, axis=0, prepend=q[:1])
        return np.asarray(self.weight * np.einsum("ij,ij->i", leap, leap))


@dataclass(slots=True)
class Bounds(Table):
    """Where the poses of tags may move: ``free`` (n, 3), ``low`` and ``high`` (n, 3) [rad].

    One column for each angle of the attitude.
    """

    free: BoolArray
    low: FloatArray
    high: FloatArray


@dataclass(frozen=True, slots=True)
class _Angle:
    """One angle of the attitude that is moved, the others held: column, largest step [rad]."""

    column: int
    bound: float

    def moved(self, attitude: FloatArray, step: FloatArray | float) -> FloatArray:
        """Return attitudes (n, 3) with the angle moved."""
        result = attitude.copy()
        result[:, self.column] += step
        return result


class _Now(NamedTuple):
    """Where n tags stand: attitude (n, 3), joints (n, 6) [rad], cost (n,). Changed in place."""

    attitude: FloatArray
    q: FloatArray
    cost: FloatArray

    def put(
        self, rows: IndexArray, good: BoolArray | bool, values: tuple[FloatArray, ...], else_: _Now
    ) -> None:
        """Set tags ``rows`` (m,) to values where good (m,), else to those they have elsewhere."""
        for mine, value, other in zip(self, values, else_, strict=True):
            fits = np.reshape(good, (-1,) + (1,) * (value.ndim - 1))
            mine[rows] = np.where(fits, value, taken(other, rows))


def refine(
    problem: Problem, poses: TagPoses, bounds: Bounds, awake: BoolArray | None = None
) -> TagPoses:
    """Return the poses with the attitudes of free tags moved to a local optimum.

    One angle after the other, the spin last: it mostly ends at a bound of reach, where tags would
    no longer tilt together.

    Args:
        problem: what is asked.
        poses: on the grid.
        bounds: which tags may move, and how far.
        awake: (n,) the tags to begin with, where the others are at rest already; None: all.
    """
    wishes = problem.cell.optimize
    steps = (wishes.step, wishes.tilt.step, wishes.tilt.step)
    angles = [_Angle(column, 0.5 * step) for column, step in enumerate(steps)]
    awake = np.ones(len(poses.tags), dtype=np.bool_) if awake is None else awake
    tilts = [angle for angle in angles[1:] if bounds.free[:, angle.column].any()]
    rows = np.flatnonzero(within(awake, _ROUNDS + 1))  # nothing moves farther off than that
    part, own, awake = poses.rows(rows), bounds.rows(rows), awake[rows]
    part.weight[1:][np.diff(rows) > 1] = 0.0
    for angle in [*tilts, angles[0]]:
        part = _refined(problem, part, own, angle, awake)
    attitude, q = poses.attitude.copy(), poses.q.copy()
    attitude[rows], q[rows] = part.attitude, part.q
    return replace(poses, attitude=attitude, q=q)


def within(rows: BoolArray, reach: int, run: IndexArray | None = None) -> BoolArray:
    """Return tags (n,) with up to ``reach`` to each side, of the same run (n,) if that is given."""
    if reach < 0:
        return np.zeros_like(rows)
    every = np.arange(len(rows))
    low, high = np.maximum(every - reach, 0), np.minimum(every + reach + 1, len(rows))
    if run is not None:
        low = np.maximum(low, np.searchsorted(run, run, side="left"))
        high = np.minimum(high, np.searchsorted(run, run, side="right"))
    count = np.append(0, np.cumsum(rows))
    return np.asarray(count[high] > count[low])


def _refined(
    problem: Problem, poses: TagPoses, bounds: Bounds, angle: _Angle, awake: BoolArray
) -> TagPoses:
    """Return the poses with one angle of the attitudes moved to a local optimum."""
    attitude, q, at = poses.attitude.copy(), poses.q.copy(), angle.column
    free, low, high = bounds.free[:, at], bounds.low[:, at], bounds.high[:, at]
    now, met = _Now(attitude, q, np.zeros(len(q))), np.zeros(len(q), dtype=np.bool_)
    for _ in range(_ROUNDS):
        rows = np.flatnonzero(awake & free)
        if not len(rows):
            break
        new = rows[~met[rows]]
        T_base_tcp = problem.placement.tcp(poses.tags[new], attitude[new])
        now.cost[new] = _costs(problem, poses, new, T_base_tcp, attitude[new], q[new])
        met[new] = True
        step = np.zeros(len(q))
        step[rows] = _newton(problem, poses, angle, now, rows)
        step = np.clip(attitude[:, at] + step, low, high) - attitude[:, at]
        step[np.abs(step) < REFINED_GRID] = 0.0
        awake = within(_descend(problem, poses, angle, now, step), 1)
    rows = np.flatnonzero(met)
    rounded = poses.attitude[rows]
    fine = np.round(attitude[rows, at] / REFINED_GRID) * REFINED_GRID
    rounded[:, at] = np.clip(fine, low[rows], high[rows])
    T_base_tcp = problem.placement.tcp(poses.tags[rows], rounded)
    solved, good = _joints(problem, poses, rows, T_base_tcp, q[rows], with_strokes=True)
    attitude[rows] = np.where(good[:, None], rounded, poses.attitude[rows])
    q[rows] = np.where(good[:, None], solved, poses.q[rows])
    return replace(poses, attitude=attitude, q=q)


def _descend(
    problem: Problem, poses: TagPoses, angle: _Angle, now: _Now, step: FloatArray
) -> BoolArray:
    """Move tags by the largest shares of steps (n,) that lower the sum; return which moved (n,).

    Runs of tags that move beside each other are judged together, each run by itself.
    """
    n, moves = len(step), step != 0.0
    run = np.cumsum(moves & ~np.append(False, moves[:-1] & (poses.weight[1:] > 0.0)))
    run[~moves] = 0
    # what a step into a tag costs counts for the run that moves either end of it
    into = np.where(moves, run, np.append(0, run[:-1]))
    trial, travel = _Now(*(values.copy() for values in now)), poses.travel(now.q)
    tries = _Tries(problem, poses, angle, now, step)
    fell, todo = np.zeros(int(run.max(initial=0)) + 1, dtype=np.bool_), moves.copy()
    level = np.zeros(n, dtype=np.int64)
    for _ in _SHARES:
        rows = np.flatnonzero(todo)
        values, good = tries.at(rows, level[rows])
        trial.put(rows, good, values, now)
        way = poses.travel(trial.q) - travel
        change = trial.cost - now.cost
        total = np.bincount(run, change, len(fell)) + np.bincount(into, way, len(fell))
        fell = total < 0.0
        change += 0.5 * (way + np.append(way[1:], 0.0))
        loses = moves & ~fell[run] & (change > 0.0)
        loses[rows[~good]] = True
        todo = loses & (level + 1 < len(_SHARES))
        level[todo] += 1
        if not todo.any():
            break
    moved = moves & fell[run] & (trial.attitude != now.attitude).any(axis=1)
    now.put(np.flatnonzero(moved), True, tuple(values[moved] for values in trial), now)
    return np.asarray(moved)


class _Tries:
    """What becomes of tags (n,) that take shares of their steps, each worked out once."""

    def __init__(
        self, problem: Problem, poses: TagPoses, angle: _Angle, now: _Now, step: FloatArray
    ) -> None:
        self._given = problem, poses, angle, now, step
        shape = (len(_SHARES), len(step))
        self._values = np.empty((*shape, 3)), np.empty((*shape, 6)), np.empty(shape)
        self._good, self._known = np.zeros((2, *shape), dtype=np.bool_)

    def at(self, rows: IndexArray, level: IndexArray) -> tuple[tuple[FloatArray, ...], BoolArray]:
        """Return attitude, joints and cost of tags at shares by number, and which can be."""
        fresh = ~self._known[level, rows]
        if fresh.any():
            self._work_out(rows[fresh], level[fresh])
        values = tuple(values[level, rows] for values in self._values)
        return values, np.asarray(self._good[level, rows])

    def _work_out(self, rows: IndexArray, level: IndexArray) -> None:
        """Work out shares of tags (m,), and as many smaller ones as come nearly for free."""
        problem, poses, angle, now, step = self._given
        ahead = np.arange(max(1, _AT_ONCE // len(rows)))
        numbers = (level[:, None] + ahead).ravel()
        rows = np.repeat(rows, len(ahead))[numbers < len(_SHARES)]
        level = numbers[numbers < len(_SHARES)]
        attitude = angle.moved(taken(now.attitude, rows), _SHARES[level] * step[rows])
        T_base_tcp = problem.placement.tcp(poses.tags[rows], attitude)
        q, good = _joints(problem, poses, rows, T_base_tcp, taken(now.q, rows), with_strokes=True)
        cost = _costs(problem, poses, rows, T_base_tcp, attitude, q)
        for mine, found in zip(self._values, (attitude, q, cost), strict=True):
            mine[level, rows] = found
        self._good[level, rows], self._known[level, rows] = good, True


def _newton(
    problem: Problem, poses: TagPoses, angle: _Angle, now: _Now, rows: IndexArray
) -> FloatArray:
    """Return the Newton steps (m,) [rad] of tags ``rows`` (m,), 0 where a tag cannot move."""
    q, w, m = now.q, poses.weight, len(rows)
    beside = np.concatenate([angle.moved(now.attitude[rows], d) for d in (-_PROBE, _PROBE)])
    both = np.tile(rows, 2)
    T_base_tcp = problem.placement.tcp(poses.tags[both], beside)
    known = taken(q, both)
    solved, good = _joints(problem, poses, both, T_base_tcp, known)
    moving = good[:m] & good[m:]
    solved = np.where(np.tile(moving, 2)[:, None], solved, known)
    below, above = solved[:m], solved[m:]
    cost = _costs(problem, poses, both, T_base_tcp, beside, solved)
    cost_below, cost_above = cost[:m], cost[m:]
    rate = (above - below) / (2.0 * _PROBE)
    square = np.einsum("ij,ij->i", rate, rate)
    leap = taken(np.diff(q, axis=0, prepend=q[:1]), rows)
    behind = taken(np.diff(q, axis=0, append=q[-1:]), rows)
    into, out = 2.0 * w[rows], 2.0 * np.append(w[1:], 0.0)[rows]
    gradient = (cost_above - cost_below) / (2.0 * _PROBE)
    gradient += into * np.einsum("ij,ij->i", leap, rate)
    gradient -= out * np.einsum("ij,ij->i", behind, rate)
    bend = (cost_above - 2.0 * now.cost[rows] + cost_below) / _PROBE**2
    diagonal = np.maximum(bend, 0.0) + 1e-9 + (into + out) * square
    mixed = -into[1:] * np.einsum("ij,ij->i", rate[1:], rate[:-1])
    mixed[~(moving[1:] & moving[:-1] & (np.diff(rows) == 1))] = 0.0
    diagonal[~moving], gradient[~moving] = 1.0, 0.0
    step = tridiagonal(diagonal, mixed, -gradient)
    return np.clip(step, -angle.bound, angle.bound)


def _joints(
    problem: Problem,
    poses: TagPoses,
    rows: IndexArray,
    T_base_tcp: FloatArray,
    q: FloatArray,
    *,
    with_strokes: bool = False,
) -> tuple[FloatArray, BoolArray]:
    """Return joints (m, 6) near ``q`` of tags ``rows`` (m,), and whether they can stand there.

    ``with_strokes``: and at the ends of their strokes.
    """
    tags, branch = poses.tags[rows], poses.branch[rows]
    T = problem.placement.flange(T_base_tcp, problem.placement.external[tags])
    solved, good = problem.solve_flange(T, branch, q)
    good &= problem.within(solved) & problem.regular(solved)
    for height in problem.strokes.levels(tags) if with_strokes else ():
        end, reached = problem.solve_flange(problem.placement.backed_off(T, height), branch, solved)
        good &= reached & problem.within(end) & problem.regular(end)
    return np.where(good[:, None], solved, q), good


def _costs(
    problem: Problem,
    poses: TagPoses,
    rows: IndexArray,
    T_base_tcp: FloatArray,
    attitude: FloatArray,
    q: FloatArray,
) -> FloatArray:
    """Return the costs (m,) of tags ``rows`` (m,) in other attitudes (m, 3)."""
    cost, index = evaluate(problem, poses.tags[rows], attitude[:, 0], T_base_tcp, q)
    price = problem.settings.weights.price(1.0 - index / poses.best[rows])
    return poses.share[rows] * (cost + price)


def tridiagonal(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric tridiagonal system.

    Args:
        diagonal: (n,).
        beside: (n-1,) entries beside the diagonal.
        right: (n,) right-hand side.
    """
    d, e, r = diagonal.tolist(), beside.tolist(), right.tolist()
    for i in range(1, len(d)):
        factor = e[i - 1] / d[i - 1]
        d[i] -= factor * e[i - 1]
        r[i] -= factor * r[i - 1]
    x = [0.0] * len(d)
    for i in range(len(d) - 1, -1, -1):
        x[i] = (r[i] - (e[i] * x[i + 1] if i + 1 < len(d) else 0.0)) / d[i]
    return np.array(x)
