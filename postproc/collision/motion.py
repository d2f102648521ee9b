"""Do the bodies collide anywhere along straight joint motions? Nothing is missed.

A motion is cut into spans. In the middle of a span each pair of bodies has a distance; if that is
more than the pair can approach on the way to either end (``sweep``), the pair is free over the
whole span. Cheap lower bounds of the distance settle most pairs, exact distances the rest. What
neither settles, the span is cut on both sides of the stretch that is proven, down to spans on
which nothing moves farther than the resolution; there the ends are checked and decide.

So a motion said to be free is free at every sample taken and at its ends, and between them nothing
is touched but by grazing contact in which no point moves farther than the resolution.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from postproc.collision.check import NO_PAIR, chunks
from postproc.collision.cull import SLACK
from postproc.collision.engine import CHUNK, Engine
from postproc.model.arrays import BoolArray, FloatArray

RESOLUTION = 1e-3
"""Default length [m] below which a span is not cut further."""
_WORTH = 0.05
"""Share of a span that a cheap bound must prove, else the exact distance is taken."""
_FINEST = 1e-6
"""Share of a curve below which samples are not taken nearer together."""


@dataclass(frozen=True, slots=True)
class MotionHits:
    """Answer for m motions.

    Args:
        hit: (m,) whether anything collides on the way.
        pair: (m,) index into ``pairs`` of a pair that does, -1 where none does.
        share: (m,) how far along the motion (0 to 1) it was found colliding, NaN where not; the
            collision may begin earlier.
        pairs: names of the tested pairs.
    """

    hit: BoolArray
    pair: NDArray[np.int64]
    share: FloatArray
    pairs: tuple[tuple[str, str], ...]

    @property
    def any(self) -> bool:
        """Whether any motion collides."""
        return bool(self.hit.any())

    def name(self, row: int) -> str:
        """Return ``A and B`` of the pair that collides in a motion, empty if none does."""
        return " and ".join(self.pairs[self.pair[row]]) if self.hit[row] else ""


@dataclass(frozen=True, slots=True)
class _Spans:
    """Stretches of motions still open: motion (s,), from and to (s,) 0..1, open pairs (p, s)."""

    motion: NDArray[np.int64]
    start: FloatArray
    end: FloatArray
    open: BoolArray

    def __len__(self) -> int:
        return len(self.motion)

    def take(self, index: np.ndarray | slice) -> _Spans:
        return _Spans(self.motion[index], self.start[index], self.end[index], self.open[:, index])

    @staticmethod
    def joined(parts: list[_Spans]) -> _Spans:
        return _Spans(
            np.concatenate([part.motion for part in parts]),
            np.concatenate([part.start for part in parts]),
            np.concatenate([part.end for part in parts]),
            np.concatenate([part.open for part in parts], axis=1),
        )


@dataclass(frozen=True, slots=True)
class _Found:
    """Collisions: motion (h,), pair (h,), share (h,)."""

    motion: NDArray[np.int64]
    pair: NDArray[np.int64]
    share: FloatArray


class MotionCheck:
    """Checks straight joint motions.

    Args:
        engine: the scene.
        resolution: length [m] below which spans are not cut further.

    Raises:
        ValueError: if the resolution is not above zero.
    """

    def __init__(self, engine: Engine, resolution: float = RESOLUTION) -> None:
        if not resolution > 0.0:
            raise ValueError(f"resolution is {resolution} m, expected above zero")
        self._engine = engine
        self._resolution = resolution

    def run(self, q_from: FloatArray, q_to: FloatArray, contact: BoolArray) -> MotionHits:
        """Check motions (m, 6) to (m, 6) [rad]; ``contact`` (m,): cutting solids may touch."""
        parts = [self._run(q_from[rows], q_to[rows], contact[rows]) for rows in chunks(len(q_from))]
        pair = np.concatenate([part[0] for part in parts] or [np.zeros(0, dtype=np.int64)])
        share = np.concatenate([part[1] for part in parts] or [np.zeros(0)])
        return MotionHits(pair != NO_PAIR, pair, share, self._engine.names)

    def _run(
        self, q_from: FloatArray, q_to: FloatArray, contact: BoolArray
    ) -> tuple[NDArray[np.int64], FloatArray]:
        m = len(q_from)
        wanted = np.broadcast_to(self._engine.wanted(contact), (len(self._engine.table), m))
        spans = _Spans(np.arange(m), np.zeros(m), np.ones(m), wanted)
        pair, share = np.full(m, NO_PAIR, dtype=np.int64), np.full(m, np.nan)
        while len(spans):
            steps = [
                self._step(q_from, q_to, spans.take(rows)) for rows in chunks(len(spans), CHUNK)
            ]
            for found, _ in steps:
                _note(pair, share, found)
            spans = _Spans.joined([rest for _, rest in steps])
            spans = spans.take(np.flatnonzero(pair[spans.motion] == NO_PAIR))
        return pair, share

    def _step(self, q_from: FloatArray, q_to: FloatArray, spans: _Spans) -> tuple[_Found, _Spans]:
        """Return collisions in the middle of spans, and the spans that are still open."""
        engine = self._engine
        middle = 0.5 * (spans.start + spans.end)
        way = (q_to - q_from)[spans.motion]
        placed = engine.place(q_from[spans.motion] + middle[:, None] * way)
        turn = np.abs(way) * (0.5 * (spans.end - spans.start))[:, None]
        approach = engine.sweep.of_pairs(placed, turn)
        margin = engine.table.margin[:, None]
        found = engine.candidates(placed, approach + margin, spans.open, fine=True)
        near = found.near
        moves = approach[near.pair, near.row]
        gap = near.bound - margin[near.pair, 0]
        unclear = np.flatnonzero((gap <= _WORTH * moves) | found.nested)
        gap[unclear] = engine.distances(found, unclear) - margin[near.pair[unclear], 0]
        hit = gap <= 0.0
        rest = np.flatnonzero(~hit & (gap <= moves + SLACK) & (spans.end > spans.start)[near.row])
        hits = _Found(spans.motion[near.row[hit]], near.pair[hit], middle[near.row[hit]])
        proven = np.maximum(gap[rest] - SLACK, 0.0) / np.maximum(moves[rest], SLACK)
        return hits, self._cut(spans, near.row[rest], near.pair[rest], moves[rest], proven)

    def _cut(
        self,
        spans: _Spans,
        row: np.ndarray,
        pair: np.ndarray,
        moves: FloatArray,
        proven: FloatArray,
    ) -> _Spans:
        """Return the open remains of spans.

        Args:
            spans: the spans.
            row: (k,) spans of entries that are not settled.
            pair: (k,) their pairs.
            moves: (k,) how far the pair can approach from the middle to an end [m].
            proven: (k,) share of that way on which it is free.
        """
        share = np.ones(len(spans))
        np.minimum.at(share, row, np.minimum(proven, 1.0))
        is_short = 2.0 * moves <= self._resolution
        middle = 0.5 * (spans.start + spans.end)
        half = 0.5 * (spans.end - spans.start) * share
        parts = []
        for short, low, high in (
            (False, spans.start, middle - half),
            (False, middle + half, spans.end),
            (True, spans.start, spans.start),
            (True, spans.end, spans.end),
        ):
            mine = np.flatnonzero(is_short == short)
            rows, place = np.unique(row[mine], return_inverse=True)
            open_ = np.zeros((spans.open.shape[0], len(rows)), dtype=bool)
            open_[pair[mine], place.ravel()] = True
            parts.append(_Spans(spans.motion[rows], low[rows], high[rows], open_))
        return _Spans.joined(parts)


def _note(pair: NDArray[np.int64], share: FloatArray, found: _Found) -> None:
    """Note collisions of a round: of each motion the first pair, at its earliest share."""
    order = np.lexsort((found.share, found.pair, found.motion))
    motion, first = np.unique(found.motion[order], return_index=True)
    chosen = order[first]
    is_better = (pair[motion] == NO_PAIR) | (found.pair[chosen] < pair[motion])
    pair[motion[is_better]] = found.pair[chosen[is_better]]
    share[motion[is_better]] = found.share[chosen[is_better]]


def samples_of_curve(
    engine: Engine,
    q_at: Callable[[FloatArray], FloatArray],
    count: int,
    resolution: float,
) -> tuple[FloatArray, FloatArray]:
    """Return shares (k,) and configurations (k, 6) that follow a curve within the resolution.

    Between two neighbours the joint-straight motion leaves the curve's middle by no more than the
    resolution, measured as the farthest motion of any body. For smooth curves, such as LIN and
    CIRC away from singularities, that is the largest deviation but for a factor near one.

    Args:
        engine: the scene.
        q_at: shares (k,) in [0, 1] to configurations (k, 6) [rad] on the curve.
        count: samples to begin with, at least 2.
        resolution: [m].

    A leap of the curve, such as a wrist that flips, ends the refinement there when the samples are
    ``_FINEST`` of the whole apart; it is then checked as a straight joint motion.
    """
    share = np.linspace(0.0, 1.0, max(2, count))
    q = q_at(share)
    todo = np.ones(len(share) - 1, dtype=bool)
    while (which := np.flatnonzero(todo & (np.diff(share) > _FINEST))).size:
        middle = 0.5 * (share[which] + share[which + 1])
        q_middle = q_at(middle)
        straight = 0.5 * (q[which] + q[which + 1])
        off = np.zeros(len(which))
        for rows in chunks(len(which)):
            placed = engine.place(q_middle[rows])
            turn = np.abs(q_middle[rows] - straight[rows])
            off[rows] = engine.sweep.of_pairs(placed, turn).max(axis=0, initial=0.0)
        added = off > resolution
        where = which[added] + 1
        share = np.insert(share, where, middle[added])
        q = np.insert(q, where, q_middle[added], axis=0)
        todo = np.zeros(len(share) - 1, dtype=bool)
        new = where + np.arange(len(where))
        todo[new - 1] = todo[new] = True
    return share, q
