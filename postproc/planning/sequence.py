"""A quick order for holes whose order is free: nearest neighbour, then 2-opt, by joint time.

Only runs of holes inside one operation are put in order; everything else keeps its place. The time
between two holes is that of the slowest axis at its largest speed, between poses that each hole
would take by itself in the branch that most of them share.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from postproc.model.arrays import FloatArray
from postproc.model.toolpath import MotionKind, ToolPath
from postproc.planning.candidates import sample
from postproc.planning.costs import TRAVEL_UNIT
from postproc.planning.ladder import IndexArray
from postproc.planning.problem import Problem

_NEIGHBOURS = 12
_PASSES = 30


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


def reordered(toolpath: ToolPath, order: IndexArray) -> ToolPath:
    """Return the toolpath with its tags in another order; events stay at their place."""
    columns = ("points", "axes", "kind", "feed", "line", "operation", "tool", "arc", "cycle")
    changes: dict[str, object] = {name: getattr(toolpath, name)[order] for name in columns}
    for name in ("rotations", "joints"):
        value = getattr(toolpath, name)
        if value is not None:
            changes[name] = value[order]
    changes["extra"] = {
        name: [values[tag] for tag in order.tolist()] if len(values) == len(order) else values
        for name, values in toolpath.extra.items()
    }
    names = [toolpath.tag_name(tag) for tag in order.tolist()]
    return replace(toolpath, names=tuple(names), **changes)  # type: ignore[arg-type]


def _runs(toolpath: ToolPath) -> list[tuple[int, int]]:
    """Return stretches [low, high) of holes of one operation without events between."""
    n = len(toolpath)
    hole = np.asarray(toolpath.kind) == MotionKind.HOLE
    parted = np.ones(n + 1, dtype=np.bool_)
    if n:
        parted[1:n] = (
            (hole[1:] != hole[:-1])
            | (np.diff(np.asarray(toolpath.operation)) != 0)
            | (np.diff(np.asarray(toolpath.tool)) != 0)
        )
    for event in toolpath.events:
        parted[event.index] = True
    edges = np.nonzero(parted)[0].tolist()
    pairs = itertools.pairwise(edges)
    return [(low, high) for low, high in pairs if hole[low] and high - low > 3]


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
