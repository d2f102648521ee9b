"""Spins between the grid: the sum of state costs and travel made as small as it locally gets.

The grid search finds the right valley; inside it the cost is smooth. One Newton step for all tags
at once is a tridiagonal system, because a tag meets only its two neighbours. A step is halved until
the sum falls, so the result is never worse than the grid's.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.model.arrays import BoolArray, FloatArray
from postproc.planning.candidates import evaluate
from postproc.planning.ladder import IndexArray
from postproc.planning.problem import Problem
from postproc.units import DEG

REFINED_GRID = 0.001 * DEG
"""Refined spins are rounded to this, far coarser than what differs between machines."""
_PROBE = 0.25 * DEG
_ROUNDS = 12
_ENOUGH = 1e-7


@dataclass(slots=True)
class Course:
    """A spin and a branch for each of n tags, with the joints that follow [rad].

    ``weight`` (n,): of the squared joint change into each tag, 0 where it is free.
    """

    tags: IndexArray
    spin: FloatArray
    branch: IndexArray
    q: FloatArray
    weight: FloatArray

    def travel(self, q: FloatArray) -> float:
        """Return the weighted sum of squared joint changes along joints (n, 6)."""
        return float((self.weight[1:] * (np.diff(q, axis=0) ** 2).sum(axis=1)).sum())


def refine(
    problem: Problem, course: Course, free: BoolArray, low: FloatArray, high: FloatArray
) -> Course:
    """Return the course with the spins of ``free`` (n,) tags moved to a local optimum.

    Args:
        problem: what is asked.
        course: a course on the grid.
        free: (n,) tags that may move.
        low: (n,) smallest spin [rad].
        high: (n,) largest.
    """
    spin, q = course.spin.copy(), course.q.copy()
    movable = free.copy()
    cost = _costs(problem, course, spin, q)
    total = float(cost.sum()) + course.travel(q)
    for _ in range(_ROUNDS):
        step = _newton(problem, course, spin, q, cost, movable)
        step = np.clip(spin + step, low, high) - spin
        taken = _descend(problem, course, spin, q, step, total)
        if taken is None:
            break
        gain = total - taken[3]
        spin, q, cost, total = taken
        if gain < _ENOUGH * max(1.0, abs(total)):
            break
    rounded = np.where(free, np.round(spin / REFINED_GRID) * REFINED_GRID, course.spin)
    rounded = np.clip(rounded, low, high)
    solved, good = _joints(problem, course, rounded, q)
    return Course(
        course.tags,
        np.where(good, rounded, course.spin),
        course.branch,
        np.where(good[:, None], solved, course.q),
        course.weight,
    )


def _descend(
    problem: Problem,
    course: Course,
    spin: FloatArray,
    q: FloatArray,
    step: FloatArray,
    total: float,
) -> tuple[FloatArray, FloatArray, FloatArray, float] | None:
    """Return spin, joints, costs and sum after the largest halved step that lowers the sum."""
    for share in (1.0, 0.5, 0.25, 0.1, 0.03):
        moved = spin + share * step
        solved, good = _joints(problem, course, moved, q)
        moved = np.where(good, moved, spin)
        solved = np.where(good[:, None], solved, q)
        cost = _costs(problem, course, moved, solved)
        new = float(cost.sum()) + course.travel(solved)
        if new < total:
            return moved, solved, cost, new
    return None


def _newton(
    problem: Problem,
    course: Course,
    spin: FloatArray,
    q: FloatArray,
    cost: FloatArray,
    movable: BoolArray,
) -> FloatArray:
    """Return the Newton step (n,) [rad], 0 where a tag cannot move."""
    sides = [_joints(problem, course, spin + side, q) for side in (-_PROBE, _PROBE)]
    moving = movable & sides[0][1] & sides[1][1]
    below, above = (np.where(moving[:, None], solved, q) for solved, _ in sides)
    cost_below = _costs(problem, course, spin - _PROBE, below)
    cost_above = _costs(problem, course, spin + _PROBE, above)
    slope = np.where(moving, (cost_above - cost_below) / (2.0 * _PROBE), 0.0)
    bend = np.where(moving, (cost_above - 2.0 * cost + cost_below) / _PROBE**2, 0.0)
    rate = (above - below) / (2.0 * _PROBE)
    leap = np.diff(q, axis=0)
    w = course.weight[1:]
    gradient = slope
    gradient[1:] += 2.0 * w * np.einsum("ij,ij->i", leap, rate[1:])
    gradient[:-1] -= 2.0 * w * np.einsum("ij,ij->i", leap, rate[:-1])
    square = np.einsum("ij,ij->i", rate, rate)
    diagonal = np.maximum(bend, 0.0) + 1e-9
    diagonal[1:] += 2.0 * w * square[1:]
    diagonal[:-1] += 2.0 * w * square[:-1]
    beside = -2.0 * w * np.einsum("ij,ij->i", rate[1:], rate[:-1])
    diagonal[~moving] = 1.0
    gradient[~moving] = 0.0
    beside[~(moving[1:] & moving[:-1])] = 0.0
    step = tridiagonal(diagonal, beside, -gradient)
    bound = 0.5 * problem.settings.step
    return np.clip(step, -bound, bound)


def _joints(
    problem: Problem, course: Course, spin: FloatArray, q: FloatArray
) -> tuple[FloatArray, BoolArray]:
    solved, reached = problem.solve(problem.placement.tcp(course.tags, spin), course.branch, q)
    solved = np.where(reached[:, None], solved, q)
    return solved, reached & problem.within(solved) & problem.regular(solved)


def _costs(problem: Problem, course: Course, spin: FloatArray, q: FloatArray) -> FloatArray:
    T_base_tcp = problem.placement.tcp(course.tags, spin)
    return evaluate(problem, course.tags, spin, T_base_tcp, q)[0]


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
