"""Do the bodies collide anywhere within hulls of configurations? Nothing is missed.

A hull holds all mixtures of its configurations: those of a triangle, or of three triangles whose
corners are mixed in turn. As for motions: in its middle each pair of bodies has a distance; if that
is more than the pair can approach on the way to anywhere in the hull (``sweep``), it is free all
over. What is left is cut at its longest side, down to hulls in which nothing moves farther than the
resolution; there the middle decides. Axes may also be off their hull by a slack: a hull of that
size which is not proven free counts as colliding, and so does what takes too many cuts.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered
from postproc.collision.check import NO_PAIR, chunks
from postproc.collision.engine import CHUNK, Candidates, Engine
from postproc.collision.motion import MotionCheck, opened
from postproc.collision.sweep import Sway
from postproc.collision.tree import SLACK

MOST_OPEN = 4000
"""A corner of which so many pieces are undecided counts as colliding."""
COARSE = 1e-3
"""Hulls of mixed triangles in which nothing moves farther than this [m] are not cut further: what
is then not proven free counts as colliding."""

_ROW = 16
"""So many hulls that follow each other closely are first looked at as one ..."""
_APART = 0.02
"""... those whose axes stand no farther apart than this [rad or m] ..."""
_FEW = 4
"""... where there is no more than one row for so many hulls."""
_TOGETHER = 4 * CHUNK


class HullCheck(MotionCheck):
    """Checks hulls of configurations.

    Args:
        engine: the scene.
        resolution: length [m] below which triangles are not cut further.
        coarse: length [m] below which mixed triangles are not cut further.
    """

    def __init__(self, engine: Engine, resolution: float, coarse: float) -> None:
        super().__init__(engine, resolution)
        self._coarse = coarse

    def pairs_met(
        self, q: FloatArray, slack: FloatArray, contact: BoolArray, owner: IndexArray, count: int
    ) -> IndexArray:
        """Return a pair (c,) that collides in any hull of each owner, -1 where none does.

        Args:
            q: (t, 3, n, 6 + k) mixtures of the three of mixtures of the n.
            slack: (t, 6 + k) how far axes may be off.
            contact: (t,) cutting solids may touch the workpiece.
            owner: (t,) whose hulls they are, 0 to c - 1.
            count: c.
        """
        met = np.full(count, NO_PAIR, dtype=np.int64)
        for rows in chunks(len(q), _TOGETHER):
            wanted = self._engine.wanted(contact[rows])
            shape = (len(self._engine.table), rows.stop - rows.start)
            alive = np.flatnonzero(met[owner[rows]] == NO_PAIR)
            wanted = np.broadcast_to(wanted, shape)[:, alive]
            alive += rows.start
            hulls = q[alive], slack[alive]
            starts = _rows_of(hulls[0])
            first = len(starts) * _FEW >= len(alive)
            if not first:
                wanted = self._open_in_rows(*hulls, starts, wanted)
            self._search(*hulls, owner[alive], wanted, met, first=first)
        return met

    def _open_in_rows(
        self, q: FloatArray, slack: FloatArray, starts: IndexArray, wanted: BoolArray
    ) -> BoolArray:
        """Return wanted pairs (p, t) that are not free in all hulls of their row at once.

        ``starts`` (r,): the first of each row.
        """
        nodes = q.reshape(len(q), -1, q.shape[-1])
        box = nodes.min(axis=1) - slack, nodes.max(axis=1) + slack
        middle, count = 0.5 * (box[0] + box[1]), np.diff(np.append(starts, len(q)))
        row, step = numbered(count)
        share = step / np.maximum(count - 1, 1)[row]
        chord = middle[starts], middle[starts + count - 1]
        along = np.stack([share, share])
        of_row = np.logical_or.reduceat(wanted, starts, axis=1)
        open_ = self._open_along(box, chord, starts, along, of_row, self._near)
        return np.asarray(open_[:, row] & wanted)

    def _search(
        self,
        q: FloatArray,
        slack: FloatArray,
        owner: IndexArray,
        wanted: BoolArray,
        met: IndexArray,
        *,
        first: bool,
    ) -> None:
        """Set the pairs met (c,) by owners of hulls; ``wanted`` (p, t), ``first``: most pairs."""
        while len(owner):
            parts = []
            for rows in chunks(len(owner), CHUNK):
                pair, row, hit = self._undecided(q[rows], slack[rows], wanted[:, rows], first=first)
                row = row + rows.start
                met[owner[row[hit]]] = pair[hit]
                parts.append((pair[~hit], row[~hit]))
            pair, row = (np.concatenate(columns) for columns in zip(*parts, strict=True))
            crowded = np.bincount(owner[row], minlength=len(met))[owner[row]] > MOST_OPEN
            met[owner[row[crowded]]] = pair[crowded]
            alive = met[owner[row]] == NO_PAIR
            left, wanted = opened(wanted.shape, pair[alive], row[alive])
            q, wanted = np.concatenate(_cut(q[left])), np.tile(wanted, 2)
            owner, slack = np.tile(owner[left], 2), np.tile(slack[left], (2, 1))
            first = False

    def _undecided(
        self, q: FloatArray, slack: FloatArray, wanted: BoolArray, *, first: bool
    ) -> tuple[IndexArray, IndexArray, BoolArray]:
        """Return pair, row and whether it collides, of all that is not proven free."""
        ways = q.reshape(len(q), -1, q.shape[-1])
        middle = ways.mean(axis=1)
        ways = ways - middle[:, None]
        turn = np.abs(ways).max(axis=1)
        near = self._near if first else self._near_among
        found, moves = near(middle, Sway(turn + slack), wanted)
        moves = np.minimum(moves, self._straight(middle, ways, turn, slack, found))
        pair, row = found.near.pair, found.near.row
        small = turn.max(axis=1) <= slack.max(axis=1)
        coarse = (q.shape[2] > 1) & (2.0 * moves <= self._coarse)
        gap = self._gaps(found, moves, worth=1.0, exact=small[row] | coarse)
        close = gap <= moves + SLACK
        hit = (gap <= 0.0) | ((small[row] | coarse) & close)
        left = np.flatnonzero(hit | (close & (2.0 * moves > self._resolution)))
        return pair[left], row[left], hit[left]

    def _straight(
        self,
        middle: FloatArray,
        ways: FloatArray,
        turn: FloatArray,
        slack: FloatArray,
        found: Candidates,
    ) -> FloatArray:
        """Return how far the pairs (k,) can approach on the ways (t, v, 6 + k) from the middle."""
        near, frames = found.near, self._engine.frames(middle)
        sway = Sway(turn + slack, ways, slack)
        return self._engine.sweep.of_entries(frames, near.pair, near.row, sway)


def _rows_of(q: FloatArray) -> IndexArray:
    """Return where rows (r,) of hulls (t, 3, n, d) begin that follow each other closely."""
    leap = np.abs(np.diff(q[:, 0, 0], axis=0)).max(axis=1, initial=0.0) > _APART
    run = np.append(0, np.cumsum(leap))
    place = np.arange(len(q)) - np.searchsorted(run, run, side="left")
    return np.asarray(np.flatnonzero(place % _ROW == 0))


def _cut(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return both halves of hulls (t, 3, n, d), cut at the longest side of either triangle."""
    sides = _sides(q)
    if q.shape[2] == 1:
        return _cut_first(q, sides.argmax(axis=1))
    turned = np.swapaxes(q, 1, 2)
    other = _sides(turned)
    outer = sides.max(axis=1) >= other.max(axis=1)
    low, high = np.empty_like(q), np.empty_like(q)
    low[outer], high[outer] = _cut_first(q[outer], sides[outer].argmax(axis=1))
    halves = _cut_first(turned[~outer], other[~outer].argmax(axis=1))
    low[~outer], high[~outer] = (np.swapaxes(half, 1, 2) for half in halves)
    return low, high


def _sides(q: FloatArray) -> FloatArray:
    """Return the longest way (t, 3) along each side of the first triangle."""
    return np.asarray(np.linalg.norm(q - np.roll(q, -1, axis=1), axis=3).max(axis=2))


def _cut_first(q: FloatArray, side: IndexArray) -> tuple[FloatArray, FloatArray]:
    """Return both halves of hulls cut at a side (t,) of the first triangle."""
    turned = (np.arange(3) + side[:, None]) % 3
    a, b, c = np.moveaxis(q[np.arange(len(q))[:, None], turned], 1, 0)
    middle = 0.5 * (a + b)
    return np.stack([a, middle, c], axis=1), np.stack([middle, b, c], axis=1)
