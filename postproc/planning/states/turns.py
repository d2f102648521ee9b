"""Whole turns of joints: those within the limits of the arm and the margin of the cell."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered, taken
from postproc.planning.states.problem import Problem

_FULL_TURN = 2.0 * np.pi


def turn_range(
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


def turnable(problem: Problem) -> Callable[[int, FloatArray], BoolArray]:
    """Return which angles of a joint 0..5 [rad] have a turn within its limits."""
    room = np.asarray(problem.kinematics.q_max) - np.asarray(problem.kinematics.q_min)
    room -= 2.0 * problem.cell.limits.joint_margin

    def may(joint: int, angle: FloatArray) -> BoolArray:
        if room[joint] >= _FULL_TURN:
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
    copies = taken(base, source)
    for k, joint in reversed(list(enumerate(wide))):
        step, turn = np.divmod(step, count[:, k][source])
        copies[:, joint] = q[:, joint][source] + _FULL_TURN * (low[:, joint][source] + turn)
    return copies, source


def nearest_copies(
    problem: Problem, q: FloatArray, q_near: FloatArray
) -> tuple[FloatArray, IndexArray]:
    """Return the turn of configurations (m, 6) nearest to joints (m, 6) and the row of each kept.

    What is over a limit there is left out.
    """
    moved = q + _FULL_TURN * np.round((q_near - q) / _FULL_TURN)
    kept = np.nonzero(problem.within(moved))[0]
    return moved[kept], kept
