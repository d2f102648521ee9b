"""The smallest distance between bodies, by exact distances of the few pairs that can hold it."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.collision.check import NO_PAIR, check, chunks
from postproc.collision.cull import Placed
from postproc.collision.engine import Engine


def clearance(
    engine: Engine, q: FloatArray, contact: BoolArray | None, most: float = np.inf
) -> tuple[FloatArray, IndexArray]:
    """Return the smallest distance (n,) [m] over all pairs that keep one, 0 in collision.

    Links of the robot keep distances from each other that no plan can change, and how near a
    cutting solid comes to the workpiece is asked for; they count only when they collide.

    Args:
        engine: the scene.
        q: (n, 6) [rad].
        contact: (n,) where cutting solids may touch the workpiece; None: nowhere.
        most: distances beyond this [m] are given as this, and cost less.

    Returns:
        The distances, and the pair (n,) that holds each, -1 where none is that near.
    """
    result, pair = np.full(len(q), most), np.full(len(q), NO_PAIR, dtype=np.int64)
    for rows in chunks(len(q)):
        result[rows], pair[rows] = _smallest(engine, q[rows], most)
    hits = check(engine, q, contact, only=~engine.keeps)
    result[hits.hit], pair[hits.hit] = 0.0, hits.pair[hits.hit]
    return result, pair


def _smallest(engine: Engine, q: FloatArray, most: float) -> tuple[FloatArray, IndexArray]:
    placed = engine.place(q)
    n = len(placed)
    least, pair = np.full(n, most), np.full(n, NO_PAIR, dtype=np.int64)
    if np.isfinite(most):
        threshold = np.full((len(engine.table), 1), most)
        _lower(engine, placed, least, pair, threshold, engine.keeps[:, None])
        return least, pair
    # an upper bound first: the distance of the pair that looks nearest
    bound = np.where(engine.keeps[:, None], engine.axis_aligned_bound(placed), np.inf)
    if not len(bound):
        return least, pair
    guess = np.zeros(bound.shape, dtype=bool)
    guess[bound.argmin(axis=0), np.arange(n)] = True
    guess &= bound < most
    _lower(engine, placed, least, pair, np.full((len(bound), 1), np.inf), guess)
    threshold = np.broadcast_to(least, bound.shape)
    wanted = engine.keeps[:, None] & ~guess & (bound < threshold)
    _lower(engine, placed, least, pair, threshold, wanted)
    return least, pair


def _lower(
    engine: Engine,
    placed: Placed,
    least: FloatArray,
    pair: IndexArray,
    threshold: FloatArray,
    wanted: BoolArray,
) -> None:
    """Lower ``least`` (n,) to the distances of wanted pairs, the most promising first, in place."""
    found = engine.candidates(placed, threshold, wanted)
    near = found.near
    order = np.lexsort((near.bound, near.row))
    place = np.arange(len(order)) - np.searchsorted(near.row[order], near.row[order])
    for turn in range(int(place.max(initial=-1)) + 1):  # one entry of each row
        entries = order[place == turn]
        entries = entries[near.bound[entries] < least[near.row[entries]]]
        known = least[near.row[entries]]
        distance = engine.distances(found, entries, known, known)
        nearer = distance < known
        rows = near.row[entries[nearer]]
        least[rows], pair[rows] = distance[nearer], near.pair[entries[nearer]]
