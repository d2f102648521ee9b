"""Do the bodies collide anywhere along straight joint motions? Nothing is missed.

A motion is cut into spans. In the middle of a span each pair of bodies has a distance; if that is
more than the pair can approach on the way to either end (``sweep``), the pair is free over the
whole span. Cheap lower bounds of the distance settle most pairs, exact distances the rest. What
neither settles, the span is cut on both sides of the stretch that is proven, down to spans on
which nothing moves farther than the resolution; there the ends are checked and decide.

Motions that follow each other, as the samples of a LIN or CIRC do, are first looked at as a whole,
and with them those of a LIN that goes back the same way: all of them stay near the straight motion
from the first start to the last end, by less than their largest deviation from it. Pairs that are
free over all of that need no further look; the others are looked at so by halves, down to motions.

So a motion said to be free is free at every sample taken and at its ends, and between them nothing
is touched but by grazing contact in which no point moves farther than the resolution.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered, renumbered, taken
from postproc.collision.check import NO_PAIR, chunks
from postproc.collision.engine import CHUNK, Candidates, Engine
from postproc.collision.sweep import Sway
from postproc.collision.tree import SLACK
from postproc.records import dataclass

RESOLUTION = 1e-3
"""Default length [m] below which a span is not cut further."""
_TOGETHER = 16 * CHUNK
"""Motions whose spans are cut together: the last rounds hold few spans of each thousand."""
_PIECE = 0.4
"""Largest joint motion [rad] of a span at first: over more than that most pairs come near."""
_NEAR = 1e-5
"""A track that begins and ends so near [rad or m] to the end and the start of the one before may
run back along it; the two are looked at as one then, and what they deviate by counts."""
_MERGED = 16
"""So many tracks of one short motion each are looked at as one where they lead on."""
_SHORT = 0.05
"""Longest way [rad or m] of an axis on such a motion."""
_WORTH = 0.05
"""Share of a span that a bound from boxes must prove, else the solids are looked at."""
_CLOSE = 1e-4
"""So near [m] to what they must keep the triangles of solids are looked at, not only hulls."""


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
    pair: IndexArray
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

    motion: IndexArray
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

    motion: IndexArray
    pair: IndexArray
    share: FloatArray


@dataclass(frozen=True, slots=True)
class _Laid:
    """Motions (m,) laid along their tracks; one that runs back along the one before lies on it.

    ``alone`` (a,): motions that are a track each; ``order`` (k,): those of the others by track and
    place, ``starts`` (t + 1,): where each track begins there. ``track`` (m,), ``place`` (m,): where
    each lies, of ``count`` (m,) places; ``low`` and ``high`` (m, 6): its ends, that of less place
    first.
    """

    alone: IndexArray
    order: IndexArray
    starts: IndexArray
    track: IndexArray
    place: IndexArray
    count: IndexArray
    low: FloatArray
    high: FloatArray

    @classmethod
    def of(cls, q_from: FloatArray, q_to: FloatArray, track: IndexArray | None) -> _Laid:
        """Return motions (m, 6) to (m, 6) [rad]; ``track`` (m,) as of ``MotionCheck.run``."""
        m = np.arange(len(q_from))
        if track is None:
            return cls(m, m[:0], m[:1], m, np.zeros_like(m), np.ones_like(m), q_from, q_to)
        starts = _merged(q_from, q_to, np.flatnonzero(np.diff(track, prepend=track[:1] - 1)))
        is_back = _run_back(q_from, q_to, starts)
        owner, place = numbered(np.diff(np.append(starts, len(m))))
        back, count = is_back[owner], np.bincount(owner)[owner]
        place = np.where(back, count - 1 - place, place)
        number = (np.cumsum(~is_back) - 1)[owner]
        size = np.bincount(number)
        order, single = np.lexsort((place, number)), size[number] == 1
        ends = (np.where(back[:, None], *both) for both in ((q_to, q_from), (q_from, q_to)))
        begins = np.append(0, np.cumsum(size[size > 1]))
        return cls(m[single], order[~single[order]], begins, number, place, count, *ends)


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

    def run(
        self,
        q_from: FloatArray,
        q_to: FloatArray,
        contact: BoolArray,
        track: IndexArray | None = None,
    ) -> MotionHits:
        """Check motions (m, 6) to (m, 6) [rad]; ``contact`` (m,): cutting solids may touch.

        ``track`` (m,): motions that stand together with the same number are looked at as one first.
        """
        pair = np.full(len(q_from), NO_PAIR, dtype=np.int64)
        share = np.full(len(q_from), np.nan)
        laid = _Laid.of(q_from, q_to, track)
        for part in chunks(len(laid.alone), _TOGETHER):
            todo = laid.alone[part]
            wanted = self._engine.wanted(contact[todo])
            wanted = np.broadcast_to(wanted, (len(wanted), len(todo)))
            found = self._run(q_from[todo], q_to[todo], wanted, is_first=True)
            pair[todo], share[todo] = found
        for together in chunks(len(laid.starts) - 1, _TOGETHER):
            starts = laid.starts[together.start : together.stop + 1]
            parts = [
                self._open_motions(laid, laid.order[starts[t.start] : starts[t.stop]], contact)
                for t in chunks(len(starts) - 1)
            ]
            todo, open_ = (np.concatenate(found, axis=-1) for found in zip(*parts, strict=True))
            found = self._run(q_from[todo], q_to[todo], open_, is_first=False)
            pair[todo], share[todo] = found
        return MotionHits(pair != NO_PAIR, pair, share, self._engine.names)

    def _open_motions(
        self, laid: _Laid, todo: IndexArray, contact: BoolArray
    ) -> tuple[IndexArray, BoolArray]:
        """Return motions (k,) that are not free as parts of tracks, and by which pairs (p, k).

        A track is looked at as a whole, what is open of it by halves, then by quarters, and so on.

        Args:
            laid: all motions.
            todo: (m,) those of some tracks, in order.
            contact: where cutting solids may touch.
        """
        wanted = self._engine.wanted(contact[todo])
        open_ = np.broadcast_to(wanted, (len(wanted), len(todo)))
        parts, near = 1, self._near
        left: list[tuple[IndexArray, BoolArray]] = []
        while len(todo):
            place, count = laid.place[todo], laid.count[todo]
            track, part = laid.track[todo], place * parts // count
            first = np.flatnonzero(np.diff(track, prepend=-1) | np.diff(part, prepend=-1))
            size = np.diff(np.append(first, len(todo)))
            last, of = first + size - 1, np.repeat(np.arange(len(first)), size)
            ends = taken(laid.low, todo), taken(laid.high, todo)
            chord = taken(ends[0], first), taken(ends[1], last)
            step = np.stack([place, place + 1]) - place[first][of]
            share = step / (place[last] + 1 - place[first])[of]
            wanted = np.logical_or.reduceat(open_, first, axis=1)
            found = self._open_along(ends, chord, first, share, wanted, near)
            open_ = open_ & found[:, of]
            some = open_.any(axis=0)
            done = some & ((size[of] == 1) | (parts >= count))
            left.append((todo[done], open_[:, done]))
            todo, open_ = todo[some & ~done], open_[:, some & ~done]
            parts, near = 2 * parts, self._near_among
        rows, opens = zip(*left, strict=True)
        return np.concatenate(rows), np.concatenate(opens, axis=1)

    def _open_along(
        self,
        ends: tuple[FloatArray, FloatArray],
        chord: tuple[FloatArray, FloatArray],
        starts: IndexArray,
        share: FloatArray,
        wanted: BoolArray,
        near: Callable[[FloatArray, Sway, BoolArray], tuple[Candidates, FloatArray]],
    ) -> BoolArray:
        """Return wanted pairs (p, t) that are not free all along tracks of boxes of joints.

        Args:
            ends: two corners (m, 6 + k) of each box that are opposite in every axis.
            chord: (t, 6 + k) where the straight motion along each track begins and ends.
            starts: (t,) first box of each track.
            share: (2, m) how far along the chord its corners are.
            wanted: (p, t).
            near: ``_near`` or ``_near_among``.
        """
        owner, _ = numbered(np.diff(np.append(starts, len(ends[0]))))
        a, b = chord
        off = np.zeros_like(ends[0])
        begin, step = taken(a, owner), taken(b - a, owner)
        for q, done in zip(ends, share, strict=True):
            np.maximum(off, np.abs(q - (begin + done[:, None] * step)), out=off)
        way = 0.5 * (b - a)
        sway = Sway(np.abs(way) + np.maximum.reduceat(off, starts), way)
        found, moves = near(a + way, sway, wanted)
        gap = self._gaps(found, moves)
        left = np.flatnonzero(gap <= moves + SLACK)
        open_ = np.zeros((len(wanted), len(starts)), dtype=np.bool_)
        open_[found.near.pair[left], found.near.row[left]] = True
        return open_

    def _run(
        self, q_from: FloatArray, q_to: FloatArray, wanted: BoolArray, *, is_first: bool
    ) -> tuple[IndexArray, FloatArray]:
        """Return pair and share (m,) of motions; ``wanted`` (p, m), ``is_first``: most pairs."""
        m = len(q_from)
        spans = _pieces(q_from, q_to, wanted, 1 if is_first else 2)  # as a whole it was looked at
        pair, share = np.full(m, NO_PAIR, dtype=np.int64), np.full(m, np.nan)
        while len(spans):
            steps = [
                self._step(q_from, q_to, spans.take(rows), is_first=is_first)
                for rows in chunks(len(spans), CHUNK)
            ]
            is_first = False
            for found, _ in steps:
                _note(pair, share, found)
            spans = _Spans.joined([rest for _, rest in steps])
            spans = spans.take(np.flatnonzero(pair[spans.motion] == NO_PAIR))
        return pair, share

    def _step(
        self, q_from: FloatArray, q_to: FloatArray, spans: _Spans, *, is_first: bool
    ) -> tuple[_Found, _Spans]:
        """Return collisions in the middle of spans, and the spans that are still open."""
        middle = 0.5 * (spans.start + spans.end)
        whole = taken(q_to - q_from, spans.motion)
        way = whole * (0.5 * (spans.end - spans.start))[:, None]
        q = taken(q_from, spans.motion) + middle[:, None] * whole
        sway = Sway(np.abs(way), way)
        if is_first:
            found, moves = self._near(q, sway, spans.open)
        else:
            found, moves = self._near_among(q, sway, spans.open)
        gap = self._gaps(found, moves)
        near = found.near
        hit = gap <= 0.0
        rest = np.flatnonzero(~hit & (gap <= moves + SLACK) & (spans.end > spans.start)[near.row])
        hits = _Found(spans.motion[near.row[hit]], near.pair[hit], middle[near.row[hit]])
        proven = np.maximum(gap[rest] - SLACK, 0.0) / np.maximum(moves[rest], SLACK)
        return hits, self._cut(spans, near.row[rest], near.pair[rest], moves[rest], proven)

    def _near(self, q: FloatArray, sway: Sway, wanted: BoolArray) -> tuple[Candidates, FloatArray]:
        """Return pairs (k) that may meet around q (n, 6 + k), and how far each can approach [m].

        For many wanted pairs (p, n) of each configuration.
        """
        engine = self._engine
        placed = engine.place(q)
        approach = engine.sweep.of_pairs(placed, sway)
        found = engine.candidates(placed, approach + engine.table.margin[:, None], wanted)
        return found, approach[found.near.pair, found.near.row]

    def _near_among(
        self, q: FloatArray, sway: Sway, wanted: BoolArray
    ) -> tuple[Candidates, FloatArray]:
        """Return the same as ``_near``, for few wanted pairs (p, n) of each configuration."""
        engine = self._engine
        row, pair = np.nonzero(wanted.T)
        frames = engine.frames(q)
        approach = engine.sweep.of_entries(frames, pair, row, sway)
        found = engine.candidates_among(frames, pair, row, approach + engine.table.margin[pair])
        at = np.searchsorted(
            row * len(wanted) + pair, found.near.row * len(wanted) + found.near.pair
        )
        return found, approach[at]

    def _gaps(
        self,
        found: Candidates,
        moves: FloatArray,
        worth: float = _WORTH,
        exact: BoolArray | None = None,
    ) -> FloatArray:
        """Return how far (k,) [m] pairs are apart beyond their margin, or a bound that serves.

        Args:
            found: the pairs.
            moves: (k,) [m] how far each can approach.
            worth: share of it that the bound from boxes must prove to be good enough.
            exact: (k,) where no bound is enough that leaves open whether they meet; None: nowhere.
        """
        near = found.near
        margin = self._engine.table.margin[near.pair]
        gap: FloatArray = near.bound - margin
        unclear = np.flatnonzero(gap <= worth * moves + SLACK)
        margin, enough = margin[unclear], (margin + moves)[unclear] + SLACK
        low = margin + _CLOSE
        if exact is not None:
            low[exact[unclear]] = enough[exact[unclear]]
        gap[unclear] = self._engine.distances(found, unclear, enough, low, margin) - margin
        return gap

    def _cut(
        self,
        spans: _Spans,
        row: np.ndarray,
        pair: np.ndarray,
        moves: FloatArray,
        proven: FloatArray,
    ) -> _Spans:
        """Return the open remains of spans, each in two.

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
        left, right = 0.5 * (spans.start + middle - half), 0.5 * (middle + half + spans.end)
        parts = []
        for short, low, high in (
            (False, spans.start, left),
            (False, left, middle - half),
            (False, middle + half, right),
            (False, right, spans.end),
            (True, spans.start, spans.start),
            (True, spans.end, spans.end),
        ):
            mine = np.flatnonzero(is_short == short)
            rows, open_ = opened(spans.open.shape, pair[mine], row[mine])
            parts.append(_Spans(spans.motion[rows], low[rows], high[rows], open_))
        return _Spans.joined(parts)


def opened(
    shape: tuple[int, ...], pair: IndexArray, row: IndexArray
) -> tuple[IndexArray, BoolArray]:
    """Return the rows (r,) that are left, each once, and which pairs (p, r) are open in them.

    Entries (k,) by their pair and row; ``shape``: of how many pairs and rows.
    """
    rows, place = renumbered(row, shape[1])
    open_ = np.zeros((shape[0], len(rows)), dtype=np.bool_)
    open_[pair, place] = True
    return rows, open_


def _merged(q_from: FloatArray, q_to: FloatArray, starts: IndexArray) -> IndexArray:
    """Return the first motions of tracks, short single motions that lead on made one track.

    Args:
        q_from: (m, 6) [rad].
        q_to: (m, 6) [rad].
        starts: (t,) first motion of each track.
    """
    way = (q_to - q_from)[starts]
    single = np.diff(np.append(starts, len(q_from))) == 1
    single &= np.abs(way).max(axis=1, initial=0.0) < _SHORT
    joined = (np.abs(taken(q_from, starts[1:]) - taken(q_to, starts[1:] - 1)) < _NEAR).all(axis=1)
    joined &= np.einsum("ij,ij->i", way[1:], way[:-1]) > 0.0
    run = np.append(0, np.cumsum(~(joined & single[1:] & single[:-1])))
    place = np.arange(len(starts)) - np.searchsorted(run, run, side="left")
    return np.asarray(starts[place % _MERGED == 0])


def _run_back(q_from: FloatArray, q_to: FloatArray, starts: IndexArray) -> BoolArray:
    """Return which tracks (t,) run back to where the one before began, as a drill does.

    Args:
        q_from: (m, 6) [rad].
        q_to: (m, 6) [rad].
        starts: (t,) first motion of each track.
    """
    count = np.diff(np.append(starts, len(q_from)))
    turns = starts + count - 1
    is_back = np.zeros(len(starts), dtype=np.bool_)
    is_back[1:] = count[1:] == count[:-1]
    for one, other in (
        (taken(q_from, starts[1:]), taken(q_to, turns[:-1])),
        (taken(q_to, turns[1:]), taken(q_from, starts[:-1])),
    ):
        is_back[1:] &= (np.abs(one - other) < _NEAR).all(axis=1)
    every = np.arange(len(starts))
    is_back &= (every - np.maximum.accumulate(np.where(is_back, 0, every))) % 2 == 1
    return is_back


def _pieces(q_from: FloatArray, q_to: FloatArray, wanted: BoolArray, least: int) -> _Spans:
    """Return motions (m,) cut into spans on which no joint moves farther than ``_PIECE``.

    As far as all spans are looked at together: with many motions most are better proven whole. Each
    is cut into ``least`` at least.
    """
    way = np.abs(q_to - q_from).max(axis=1, initial=0.0)
    most = max(least, CHUNK // max(1, len(way)))
    count = np.clip(np.ceil(way / _PIECE), least, most).astype(np.int64)
    motion, step = numbered(count)
    return _Spans(motion, step / count[motion], (step + 1) / count[motion], wanted[:, motion])


def _note(pair: IndexArray, share: FloatArray, found: _Found) -> None:
    """Note collisions of a round: of each motion the first pair, at its earliest share."""
    order = np.lexsort((found.share, found.pair, found.motion))
    motion, first = np.unique(found.motion[order], return_index=True)
    chosen = order[first]
    is_better = (pair[motion] == NO_PAIR) | (found.pair[chosen] < pair[motion])
    pair[motion[is_better]] = found.pair[chosen[is_better]]
    share[motion[is_better]] = found.share[chosen[is_better]]
