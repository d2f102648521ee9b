"""Ways between measuring postures that are free of collision, through other postures if need be."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.stiffness.sample import SamplingPlan

AreFree = Callable[[FloatArray, FloatArray], BoolArray]
"""Joint angles (m, 6) from and to [rad]: is the straight PTP between them free (m,)."""
_NEIGHBOURS = 8


def with_free_ways(
    plan: SamplingPlan, are_free: AreFree | None
) -> tuple[SamplingPlan, tuple[str, ...], tuple[int, ...], tuple[int, ...]]:
    """Return the plan with ways that are free.

    Where the straight motion to the next posture collides, the way goes through other postures of
    the plan. Postures without any free way to the largest connected group are left out.

    Returns:
        The plan; names of postures left out; the way of one pass: 1-based numbers of postures,
        negative to pass without reading; and the numbers to pass on the way back to the first.
    """
    if are_free is None:
        return plan, (), tuple(range(1, len(plan) + 1)), ()
    kept, _, way, back = free_ways(plan.q, are_free)
    lost = np.setdiff1d(np.arange(len(plan)), kept)
    part = plan.rows(kept) if len(lost) else plan
    return part, tuple(plan.name(int(i)) for i in lost), way, back


def free_ways(
    q: FloatArray, are_free: AreFree, via: FloatArray | None = None
) -> tuple[IntArray, FloatArray, tuple[int, ...], tuple[int, ...]]:
    """Return ways through postures (n, 6) in their order, each straight where that is free.

    Args:
        q: postures to stop at [rad].
        are_free: whether straight ways are free.
        via: (m, 6) further postures that ways may go through.

    Returns:
        The postures kept (k,), those of the largest connected group; all postures (j, 6) that ways
        lead through, those kept first; the way: numbers of the latter from 1, negative to pass
        without stopping; and the numbers to pass on the way back to the first.
    """
    n = len(q)
    everything = np.arange(n, dtype=np.int32)
    straight = tuple(range(1, n + 1))
    if n < 2:
        return everything, q, straight, ()
    ring = np.column_stack([everything, np.roll(everything, -1)])
    if bool(np.all(are_free(q[ring[:, 0]], q[ring[:, 1]]))):
        return everything, q, straight, ()
    nodes = q if via is None else np.vstack([q, via])
    pairs = np.unique(np.sort(np.vstack([ring, _near(nodes)]), axis=1), axis=0)
    open_ = pairs[are_free(nodes[pairs[:, 0]], nodes[pairs[:, 1]])]
    group = _largest_group(open_, len(nodes), n)
    number = np.full(len(nodes), -1)
    number[group] = np.arange(len(group))
    inside = open_[np.isin(open_, group).all(axis=1)]
    kept = group[group < n]
    before = _predecessors(number[inside], nodes[group])
    way = [1]
    for i in range(1, len(kept)):
        way += [-(k + 1) for k in _between(before, i - 1, i)] + [i + 1]
    back = tuple(k + 1 for k in _between(before, len(kept) - 1, 0))
    return kept, nodes[group], tuple(way), back


def _near(q: FloatArray) -> IntArray:
    """Return pairs (m, 2) of each posture and its nearest ones by the largest joint motion."""
    from scipy.spatial import cKDTree

    count = min(_NEIGHBOURS + 1, len(q))
    _, near = cKDTree(q).query(q, k=count, p=np.inf)
    first = np.repeat(np.arange(len(q)), count - 1)
    return np.column_stack([first, np.asarray(near)[:, 1:].reshape(-1)]).astype(np.int32)


def _largest_group(pairs: IntArray, n: int, stops: int) -> IntArray:
    """Return the nodes of the group that holds most of the first ``stops``."""
    from scipy.sparse.csgraph import connected_components

    label = connected_components(_graph(pairs, np.ones(len(pairs)), n), directed=False)[1]
    return np.flatnonzero(label == np.bincount(label[:stops]).argmax()).astype(np.int32)


def _predecessors(pairs: IntArray, q: FloatArray) -> IntArray:
    """Return (n, n): the posture before j on the shortest way from i."""
    from scipy.sparse.csgraph import dijkstra

    length = np.max(np.abs(q[pairs[:, 0]] - q[pairs[:, 1]]), axis=1) + 1e-6
    before: IntArray = dijkstra(
        _graph(pairs, length, len(q)), directed=False, return_predecessors=True
    )[1]
    return before


def _graph(pairs: IntArray, length: FloatArray, n: int):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from scipy.sparse import coo_array

    return coo_array((length, (pairs[:, 0], pairs[:, 1])), shape=(n, n)).tocsr()


def _between(before: IntArray, start: int, end: int) -> list[int]:
    """Return the postures between start and end on the shortest way."""
    way: list[int] = []
    at = int(before[start, end])
    while at not in (start, -9999):
        way.append(at)
        at = int(before[start, at])
    return way[::-1]
