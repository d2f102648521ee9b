"""Ways round by folding the arm: back from one end, over with the arm folded, out to the other.

What stands before a robot is mostly passed with the arm drawn back. A few such ways are looked at
for all connections at once, which costs about as much as one random tree, and spares most of them.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.paths import joint_times
from postproc.planning.states import Problem
from postproc.units import DEG

_FOLDS = np.array([(20.0, 20.0), (40.0, 20.0)]) * DEG
"""By how much A2 swings back and A3 down [rad]."""


def folded_ways(problem: Problem, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Return two points (w, m, 2, 6) [rad] of ways between ends (m, 6), the quickest ones first.

    A2 swings the upper arm back and A3 keeps the forearm about level, as far as limits let them;
    overhead the other way. Half way, near one end, where both points are the same, or near both.
    """
    margin = problem.cell.limits.joint_margin
    least = np.asarray(problem.kinematics.q_min) + margin
    most = np.asarray(problem.kinematics.q_max) - margin
    middle = 0.5 * (start + goal)
    near = [(middle, middle), (start, start), (goal, goal), (start, goal)] * len(_FOLDS)
    points = np.stack([np.stack(pair, axis=1) for pair in near])
    back = np.where(problem.kinematics.branches.reach(points) < 0.0, 1.0, -1.0)
    fold = np.repeat(_FOLDS, len(near) // len(_FOLDS), axis=0)
    folded = points.copy()
    folded[..., 1] += back * fold[:, :1, None]
    folded[..., 2] -= back * fold[:, 1:, None]
    folded = np.clip(folded, np.minimum(least, points), np.maximum(most, points))
    ends = np.broadcast_to(np.stack([start, goal], axis=1), folded.shape)
    stops = np.concatenate([ends[:, :, :1], folded, ends[:, :, 1:]], axis=2)
    order = np.argsort(way_times(problem, stops), axis=0, kind="stable")
    return np.asarray(np.take_along_axis(folded, order[:, :, None, None], axis=0))


def way_times(problem: Problem, stops: FloatArray) -> FloatArray:
    """Return the time (...) [s] of ways by joint moves from stop to stop (..., n, 6) [rad]."""
    start, end = stops[..., :-1, :], stops[..., 1:, :]
    share = problem.cell.motion.rapid
    time = joint_times(problem.cell, share, start.reshape(-1, 6), end.reshape(-1, 6))
    return np.asarray(time.reshape(start.shape[:-1]).sum(axis=-1))
