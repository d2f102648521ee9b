"""A quick order for holes whose order is free: always the nearest one left, by joint time.

Only runs of holes inside one operation are put in order; everything else keeps its place. The time
between two holes is that of the slowest axis at its largest speed, between poses that each hole
would take by itself in the branch that most of them share. A shorter tour (2-opt) takes a tenth of
a percent off the time of 200 holes: what the axes take to speed up and stop stays.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.model import ToolPath
from postproc.planning.states import TRAVEL_UNIT, Problem, sample
from postproc.process import hole_runs

_WORTH = 4


def ordered(problem: Problem) -> IndexArray:
    """Return the tags (n,) in the order to run them."""
    order = np.arange(len(problem))
    for low, high in _runs(problem.toolpath):
        q = _poses(problem, np.arange(low, high))
        speed = np.asarray(problem.cell.robot.qd_max)
        order[low:high] = low + shortest(q / speed)
    return order


def ordered_by_place(toolpath: ToolPath) -> IndexArray:
    """Return the tags (n,) in an order that is short in space, for arms that travel."""
    order = np.arange(len(toolpath))
    for low, high in _runs(toolpath):
        order[low:high] = low + shortest(np.asarray(toolpath.points)[low:high])
    return order


def _runs(toolpath: ToolPath) -> list[tuple[int, int]]:
    """Return stretches [low, high) of holes in which another order is worth looking for."""
    return [(low, high) for low, high in hole_runs(toolpath) if high - low >= _WORTH]


def _poses(problem: Problem, tags: IndexArray) -> FloatArray:
    """Return joints (n, 6) of each tag: nearest to spin 0 in the branch most tags have."""
    states = sample(problem, tags, problem.settings.spins)
    every = np.arange(len(states.q))
    row = states.tag_of(every)
    has = np.zeros((len(tags), 8), dtype=np.bool_)
    has[row, states.branch] = True
    branch = int(np.argmax(has.sum(axis=0)))
    cost = (states.spin_of(every) / TRAVEL_UNIT) ** 2 + 1e6 * (states.branch != branch)
    q = np.zeros((len(tags), 6))
    order = np.lexsort((cost, row))
    first = np.unique(row[order], return_index=True)
    q[first[0]] = states.q[order[first[1]]]
    missing = np.setdiff1d(np.arange(len(tags)), first[0])
    if len(missing) and len(first[0]):
        q[missing] = q[first[0][np.abs(missing[:, None] - first[0]).argmin(axis=1)]]
    return q


def shortest(points: FloatArray) -> IndexArray:
    """Return an order (n,) of points (n, d) from the first always to the nearest one left.

    Near by the largest coordinate.
    """
    left, order = np.arange(1, len(points)), [0]
    while len(left):
        nearest = int(np.abs(points[left] - points[order[-1]]).max(axis=1).argmin())
        order.append(int(left[nearest]))
        left = np.delete(left, nearest)
    return np.array(order)
