"""Attitudes between the grid: state costs and travel made as small as they locally get.

The grid search finds the right valley; inside it the cost is smooth. One Newton step for all tags
at once is a tridiagonal system, because a tag meets only its two neighbours. A step is halved until
the sum falls, so the result is never worse than the grid's.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.states import Problem, evaluate
from postproc.units import DEG

REFINED_GRID = 0.001 * DEG
"""Refined angles are rounded to this, far coarser than what differs between machines."""
_PROBE = 0.25 * DEG
_ROUNDS = 12
_ENOUGH = 1e-7


@dataclass(slots=True)
class TagPoses:
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

    def travel(self, q: FloatArray) -> float:
        """Return the weighted sum of squared joint changes along joints (n, 6)."""
        return float((self.weight[1:] * (np.diff(q, axis=0) ** 2).sum(axis=1)).sum())

    def tcp(self, problem: Problem, attitude: FloatArray) -> FloatArray:
        """Return T_base_tcp (n, 4, 4) of the tags in other attitudes (n, 3)."""
        return problem.placement.tcp(self.tags, attitude)


@dataclass(slots=True)
class Bounds:
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


def refine(problem: Problem, poses: TagPoses, bounds: Bounds) -> TagPoses:
    """Return the poses with the attitudes of free tags moved to a local optimum.

    One angle after the other, the spin last: it mostly ends at a bound of reach, where tags would
    no longer tilt together.

    Args:
        problem: what is asked.
        poses: on the grid.
        bounds: which tags may move, and how far.
    """
    wishes = problem.cell.optimize
    steps = (wishes.step, wishes.tilt.step, wishes.tilt.step)
    angles = [_Angle(column, 0.5 * step) for column, step in enumerate(steps)]
    tilts = [angle for angle in angles[1:] if bounds.free[:, angle.column].any()]
    for angle in [*tilts, angles[0]]:
        poses = _refined(problem, poses, bounds, angle)
    return poses


def _refined(problem: Problem, poses: TagPoses, bounds: Bounds, angle: _Angle) -> TagPoses:
    """Return the poses with one angle of the attitudes moved to a local optimum."""
    attitude, q, at = poses.attitude.copy(), poses.q.copy(), angle.column
    free, low, high = bounds.free[:, at], bounds.low[:, at], bounds.high[:, at]
    cost = _costs(problem, poses, poses.tcp(problem, attitude), attitude, q)
    total = float(cost.sum()) + poses.travel(q)
    for _ in range(_ROUNDS):
        step = _newton(problem, poses, angle, (attitude, q, cost), free)
        step = np.clip(attitude[:, at] + step, low, high) - attitude[:, at]
        taken = _descend(problem, poses, angle, (attitude, q), step, total)
        if taken is None:
            break
        gain = total - taken[3]
        attitude, q, cost, total = taken
        if gain < _ENOUGH * max(1.0, abs(total)):
            break
    rounded = poses.attitude.copy()
    fine = np.where(free, np.round(attitude[:, at] / REFINED_GRID) * REFINED_GRID, rounded[:, at])
    rounded[:, at] = np.clip(fine, low, high)
    solved, good = _joints(problem, poses, poses.tcp(problem, rounded), q)
    return replace(
        poses,
        attitude=np.where(good[:, None], rounded, poses.attitude),
        q=np.where(good[:, None], solved, poses.q),
    )


def _descend(
    problem: Problem,
    poses: TagPoses,
    angle: _Angle,
    now: tuple[FloatArray, FloatArray],
    step: FloatArray,
    total: float,
) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Return attitude, joints, costs, sum after the largest halved step that lowers the sum."""
    attitude, q = now
    for share in (1.0, 0.5, 0.25, 0.1, 0.03):
        moved = angle.moved(attitude, share * step)
        T_base_tcp = poses.tcp(problem, moved)
        solved, good = _joints(problem, poses, T_base_tcp, q)
        if not good.all():
            moved = np.where(good[:, None], moved, attitude)
            solved = np.where(good[:, None], solved, q)
            T_base_tcp = poses.tcp(problem, moved)
        cost = _costs(problem, poses, T_base_tcp, moved, solved)
        new = float(cost.sum()) + poses.travel(solved)
        if new < total:
            return moved, solved, cost, new
    return None


def _newton(
    problem: Problem,
    poses: TagPoses,
    angle: _Angle,
    now: tuple[FloatArray, FloatArray, FloatArray],
    movable: BoolArray,
) -> FloatArray:
    """Return the Newton step (n,) [rad], 0 where a tag cannot move."""
    attitude, q, cost = now
    beside = [angle.moved(attitude, d) for d in (-_PROBE, _PROBE)]
    at = [poses.tcp(problem, moved) for moved in beside]
    sides = [_joints(problem, poses, T_base_tcp, q) for T_base_tcp in at]
    moving = movable & sides[0][1] & sides[1][1]
    below, above = (np.where(moving[:, None], solved, q) for solved, _ in sides)
    cost_below = _costs(problem, poses, at[0], beside[0], below)
    cost_above = _costs(problem, poses, at[1], beside[1], above)
    slope = np.where(moving, (cost_above - cost_below) / (2.0 * _PROBE), 0.0)
    bend = np.where(moving, (cost_above - 2.0 * cost + cost_below) / _PROBE**2, 0.0)
    rate = (above - below) / (2.0 * _PROBE)
    leap = np.diff(q, axis=0)
    w = poses.weight[1:]
    gradient = slope
    gradient[1:] += 2.0 * w * np.einsum("ij,ij->i", leap, rate[1:])
    gradient[:-1] -= 2.0 * w * np.einsum("ij,ij->i", leap, rate[:-1])
    square = np.einsum("ij,ij->i", rate, rate)
    diagonal = np.maximum(bend, 0.0) + 1e-9
    diagonal[1:] += 2.0 * w * square[1:]
    diagonal[:-1] += 2.0 * w * square[:-1]
    mixed = -2.0 * w * np.einsum("ij,ij->i", rate[1:], rate[:-1])
    diagonal[~moving] = 1.0
    gradient[~moving] = 0.0
    mixed[~(moving[1:] & moving[:-1])] = 0.0
    step = tridiagonal(diagonal, mixed, -gradient)
    return np.clip(step, -angle.bound, angle.bound)


def _joints(
    problem: Problem, poses: TagPoses, T_base_tcp: FloatArray, q: FloatArray
) -> tuple[FloatArray, BoolArray]:
    external = problem.placement.external[poses.tags]
    solved, reached = problem.solve(T_base_tcp, external, poses.branch, q)
    solved = np.where(reached[:, None], solved, q)
    return solved, reached & problem.within(solved) & problem.regular(solved)


def _costs(
    problem: Problem, poses: TagPoses, T_base_tcp: FloatArray, attitude: FloatArray, q: FloatArray
) -> FloatArray:
    cost, index = evaluate(problem, poses.tags, attitude[:, 0], T_base_tcp, q)
    return poses.share * (cost + problem.settings.weights.price(1.0 - index / poses.best))


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
