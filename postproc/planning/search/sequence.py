"""A quick order for holes whose order is free: nearest neighbour, then 2-opt, by joint time.

Only runs of holes inside one operation are put in order; everything else keeps its place. The time
between two holes is that of the slowest axis at its largest speed, between poses that each hole
would take by itself in the branch that most of them share.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.model import ToolPath
from postproc.planning.states import TRAVEL_UNIT, Problem, sample
from postproc.process import hole_runs

_NEIGHBOURS = 12
_PASSES = 30
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
    """Return an order (n,) of points (n, d) that starts at the first, short by largest coordinate.

    Nearest neighbour, then 2-opt over the nearest neighbours of each point until nothing improves.
    """
    n = len(points)
    left = np.ones(n, dtype=np.bool_)
    order = [0]
    left[0] = False
    for _ in range(n - 1):
        rest = np.nonzero(left)[0]
        gap = np.abs(points[rest] - points[order[-1]]).max(axis=1)
        chosen = int(rest[np.argmin(gap)])
        order.append(chosen)
        left[chosen] = False
    return _two_opt(points, np.array(order))


def _two_opt(points: FloatArray, order: IndexArray) -> IndexArray:
    n = len(order)
    place = np.empty(n, dtype=np.int64)
    near = _neighbours(points, min(_NEIGHBOURS, n - 1))
    for _ in range(_PASSES):
        improved = False
        for i in range(n - 1):
            place[order] = np.arange(n)
            a, b = order[i], order[i + 1]
            step = np.abs(points[b] - points[a]).max()
            ends = place[near[a]]
            ends = ends[ends > i + 1]
            if not len(ends):
                continue
            # Turn round the stretch i+1..j: the ways (a, b) and (c, d) become (a, c) and (b, d).
            c = order[ends]
            last = ends == n - 1
            d = order[np.where(last, ends, np.minimum(ends + 1, n - 1))]
            gain = step - np.abs(points[c] - points[a]).max(axis=1)
            behind = np.abs(points[d] - points[c]).max(axis=1)
            across = np.abs(points[d] - points[b]).max(axis=1)
            gain += np.where(last, 0.0, behind - across)
            best = int(np.argmax(gain))
            if gain[best] > 1e-12:
                j = int(ends[best])
                order[i + 1 : j + 1] = order[i + 1 : j + 1][::-1]
                improved = True
        if not improved:
            break
    return order


def _neighbours(points: FloatArray, count: int) -> IndexArray:
    """Return the ``count`` nearest points (n, count) of each, by largest coordinate."""
    near = np.empty((len(points), count), dtype=np.int64)
    for i, point in enumerate(points):
        gap = np.abs(points - point).max(axis=1)
        gap[i] = np.inf
        near[i] = np.argpartition(gap, count - 1)[:count]
    return near
