"""The smallest distance between bodies, by exact distances of the few pairs that can hold it."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.collision.check import check, chunks
from postproc.collision.engine import Engine


def clearance(
    engine: Engine, q: FloatArray, contact: BoolArray | None, most: float = np.inf
) -> FloatArray:
    """Return the smallest distance (n,) [m] over all pairs but those of two links; 0 in collision.

    Links of the robot keep distances from each other that no plan can change; they count only
    when they collide. Where contact is allowed, cutting solids against the workpiece do not count.

    Args:
        engine: the scene.
        q: (n, 6) [rad].
        contact: (n,) where cutting solids may touch the workpiece; None: nowhere.
        most: distances beyond this [m] are given as this, and cost less.
    """
    table = engine.table
    measured = ~table.is_self & table.out_of_contact
    result = np.full(len(q), most)
    for rows in chunks(len(q)):
        touch = None if contact is None else contact[rows]
        wanted = engine.wanted(touch) & measured[:, None]
        result[rows] = _smallest(engine, q[rows], wanted, most)
    hits = check(engine, q, contact, only=~measured)
    result[hits.hit] = 0.0
    return result


def _smallest(engine: Engine, q: FloatArray, wanted: BoolArray, most: float) -> FloatArray:
    placed = engine.place(q)
    n = len(placed)
    bound = np.where(wanted, engine.axis_aligned_bound(placed), np.inf)
    least = np.full(n, most)
    if not len(bound):
        return least
    # an upper bound first: the distance of the pair that looks nearest
    guess = np.zeros(bound.shape, dtype=bool)
    guess[bound.argmin(axis=0), np.arange(n)] = True
    guess &= bound < most
    _lower(engine, q, least, np.full((len(bound), 1), np.inf), guess)
    threshold = np.broadcast_to(least, bound.shape)
    _lower(engine, q, least, threshold, wanted & ~guess & (bound < threshold))
    return least


def _lower(
    engine: Engine, q: FloatArray, least: FloatArray, threshold: FloatArray, wanted: BoolArray
) -> None:
    """Lower ``least`` (n,) to the distances of wanted pairs, the most promising first, in place."""
    found = engine.candidates(
        engine.place(q), threshold, wanted, fine=bool(np.isfinite(threshold).all())
    )
    near = found.near
    least[near.row[found.nested]] = 0.0
    for entry in np.lexsort((near.bound, near.row)):
        row = near.row[entry]
        if near.bound[entry] < least[row]:
            least[row] = min(least[row], engine.distances(found, np.array([entry]))[0])
