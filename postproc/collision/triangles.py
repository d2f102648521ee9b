"""Do the bodies collide anywhere within triangles of configurations? Nothing is missed.

As for motions: in the middle of a triangle each pair of bodies has a distance; if that is more than
the pair can approach on the way to any corner (``sweep``), it is free over the whole triangle. What
is left is cut at its longest side, down to triangles in which nothing moves farther than the
resolution; there the middle decides. Axes may also be off their triangle by a slack: a triangle of
that size which is not proven free counts as colliding.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.collision.check import NO_PAIR, chunks
from postproc.collision.cull import SLACK
from postproc.collision.engine import CHUNK
from postproc.collision.motion import MotionCheck
from postproc.collision.sweep import Sway


class TriangleCheck(MotionCheck):
    """Checks triangles of configurations."""

    def pairs_met(self, q: FloatArray, slack: FloatArray, contact: BoolArray) -> IndexArray:
        """Return a pair (t,) that collides in each triangle (t, 3, 6 + k), -1 where none does.

        ``slack`` (t, 6 + k): how far axes may be off; ``contact`` (t,): cutting solids may touch
        the workpiece.
        """
        met = np.full(len(q), NO_PAIR, dtype=np.int64)
        for rows in chunks(len(q)):
            wanted = self._engine.wanted(contact[rows])
            shape = (len(self._engine.table), rows.stop - rows.start)
            met[rows] = self._of_chunk(q[rows], slack[rows], np.broadcast_to(wanted, shape))
        return met

    def _of_chunk(self, q: FloatArray, slack: FloatArray, wanted: BoolArray) -> IndexArray:
        met = np.full(len(q), NO_PAIR, dtype=np.int64)
        owner, first = np.arange(len(q)), True
        while len(owner):
            parts = []
            for rows in chunks(len(owner), CHUNK):
                middle = q[rows].mean(axis=1)
                turn = np.abs(q[rows] - middle[:, None]).max(axis=1)
                more = slack[owner[rows]]
                near = self._near if first else self._near_among
                found, moves = near(middle, Sway(turn + more), wanted[:, rows])
                gap = self._gaps(found, moves)
                pair, row = found.near.pair, rows.start + found.near.row
                small = turn.max(axis=1) <= more.max(axis=1)
                hit = (gap <= 0.0) | (small[found.near.row] & (gap <= moves + SLACK))
                met[owner[row[hit]]] = pair[hit]
                unsure = ~hit & (gap <= moves + SLACK) & (2.0 * moves > self._resolution)
                parts.append((pair[unsure], row[unsure]))
            pair, row = (np.concatenate(columns) for columns in zip(*parts, strict=True))
            alive = met[owner[row]] == NO_PAIR
            q, owner, wanted = _halved(q, owner, wanted.shape[0], pair[alive], row[alive])
            first = False
        return met


def _halved(
    q: FloatArray, owner: IndexArray, count: int, pair: IndexArray, row: IndexArray
) -> tuple[FloatArray, IndexArray, BoolArray]:
    """Return both halves of the triangles ``row``, their owners and the pairs left open in them."""
    rows, place = np.unique(row, return_inverse=True)
    open_ = np.zeros((count, len(rows)), dtype=np.bool_)
    open_[pair, place.reshape(-1)] = True
    part = q[rows]
    sides = np.linalg.norm(part - np.roll(part, -1, axis=1), axis=2)
    turned = (np.arange(3) + sides.argmax(axis=1)[:, None]) % 3
    a, b, c = np.moveaxis(part[np.arange(len(rows))[:, None], turned], 1, 0)
    middle = 0.5 * (a + b)
    halves = np.concatenate([np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)])
    return halves, np.tile(owner[rows], 2), np.tile(open_, 2)
