"""The search for where the external axes stand at each tag, and what plans teach it.

A cut stands at one position, or moves: on the grid from knot to knot, smooth in the end. What a
plan refuses is closed to the next.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import field

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.model import Plan
from postproc.planning.external.rating import (
    BLOCKED,
    KNOT,
    UNREACHED,
    Rating,
    Row,
    carrying,
    cheapest,
    moving_rows,
)
from postproc.process import AXIS_SHARE
from postproc.records import dataclass

CALM = 0.5
"""Steps on the grid are smoothed over so much way [m]; less where a plan was refused."""
_MOST_CALM = 16.0
_MICRON = 6
"""Positions are rounded to so many digits [m or rad], as program text can hold them."""


@dataclass(slots=True)
class Run:
    """Tags [low, high) between two moves of the external axes; ``external`` (n, k) at each."""

    low: int
    high: int
    external: FloatArray

    @property
    def moves(self) -> bool:
        """Whether the axes move along the run."""
        return bool((self.external != self.external[0]).any())


def run_of(runs: list[Run], tag: int) -> int:
    """Return the number of the run that a tag belongs to."""
    return next(i for i, run in enumerate(runs) if run.low <= tag < run.high)


@dataclass(slots=True)
class Positions:
    """The search for positions.

    Args:
        rating: what the toolpath loses at each position; collisions are added as it goes.

    Attributes:
        closed: (units, g) positions at which a unit that stands was refused.
        shut: (m, g) positions at which a knot of a moving unit was refused.
        calm: moving unit to the length [m] over which its way is smoothed.
        carried: carried unit to what standing away costs (m, g) its knots; it moves.
        refused: how many findings refused a unit while it moved.
    """

    rating: Rating
    closed: BoolArray = field(init=False)
    shut: BoolArray = field(init=False)
    calm: dict[int, float] = field(init=False, default_factory=dict)
    carried: dict[int, FloatArray] = field(init=False, default_factory=dict)
    refused: Counter[int] = field(init=False, default_factory=Counter)

    def __post_init__(self) -> None:
        """Let cuts move that no single position reaches, as far as any reaches them."""
        rating = self.rating
        self.shut = np.zeros(rating.loss.shape, dtype=np.bool_)
        self.closed = np.zeros((len(rating.units), len(rating.values)), dtype=np.bool_)
        for unit in range(len(rating.units)):
            reached = rating.loss_of(unit) < UNREACHED
            if not reached[reached.any(axis=1)].all(axis=0).any():
                self._set_moving(unit)

    def may_be_cut_moving(self, unit: int) -> bool:
        """Return whether the axes may move along a unit."""
        low, high = self.rating.units[unit]
        return bool(self.rating.may_move.any()) and high - low > 1

    def _set_moving(self, unit: int) -> bool:
        if not self.may_be_cut_moving(unit) or unit in self.calm:
            return False
        self.calm[unit] = CALM
        self.rating.avoid_collisions(unit)
        return True

    def carry(self, unit: int) -> bool:
        """Let the axes carry the work of a unit past an arm that keeps about its pose."""
        if not self.may_be_cut_moving(unit):
            return False
        self.calm[unit] = CALM
        self.rating.avoid_collisions(unit)
        self.carried[unit], _ = carrying(self.rating, unit)
        return True

    def _open_loss(self, unit: int) -> FloatArray:
        """Return what the knots of a unit lose (m, g), ``UNREACHED`` where they are shut."""
        at = self.rating.knots_of(unit)
        return np.where(self.shut[at], UNREACHED, self.rating.loss[at])

    def runs(self) -> list[Run]:
        """Return the runs of tags with where the axes stand, at least total cost."""
        rows = self._rows()
        chosen, _ = cheapest(self.rating, rows)
        runs: list[Run] = []
        for number, (row, position) in enumerate(zip(rows, chosen.tolist(), strict=True)):
            place = np.tile(self.rating.values[position], (row.high - row.low, 1))
            if runs and (row.slides or position == chosen[number - 1]):
                last = runs[-1]
                runs[-1] = Run(last.low, row.high, np.concatenate([last.external, place]))
            else:
                runs.append(Run(row.low, row.high, place))
        for unit, calm in self.calm.items():
            low, high = self.rating.units[unit]
            run = runs[run_of(runs, low)]
            stepped = run.external[self.rating.knots[self.rating.knots_of(unit)] - run.low]
            way = smoothed(self.rating, unit, stepped, calm)
            run.external[low - run.low : high - run.low] = way
        return runs

    def _rows(self) -> list[Row]:
        """Return the rows of the search: one of a unit, one of every knot of a moving one."""
        rows, rating = [], self.rating
        count = np.diff(np.append(rating.knots, len(rating.toolpath)))[:, None]
        for unit, (low, high) in enumerate(rating.units):
            if unit in self.calm:
                cost = self._open_loss(unit) + self.carried.get(unit, 0.0)
                rows += moving_rows(rating, unit, cost)
            else:
                cost = (count[rating.knots_of(unit)] * rating.loss_of(unit)).sum(axis=0)
                cost[self.closed[unit]] = UNREACHED
                rows.append(Row(low, high, np.minimum(cost, UNREACHED)))
        return rows

    def blame(self, run: Run, result: Plan) -> bool:
        """Close positions to what failed there; return whether there is another way."""
        ways, moving = dict[int, bool](), frozenset(self.calm)
        for finding in result.errors:
            if finding.tag_index is None:
                continue
            tag = run.low + finding.tag_index
            units = enumerate(self.rating.units)
            unit = next(i for i, (a, b) in units if a <= tag < b)
            position = int(self.rating.nearest(run.external[tag - run.low][None])[0])
            again = ways.get(unit, False)
            if unit in moving:
                self.refused[unit] += 1
                again |= self._close_knot(unit, tag, position)
            elif not self.closed[unit, position]:
                self.closed[unit, position] = True
                again |= self._elsewhere(unit, position)
            ways[unit] = again
        return any(way for unit, way in ways.items() if unit not in self.rating.walled)

    def _left(self, unit: int) -> BoolArray:
        """Return (g,) the positions at which a unit may still be done held."""
        reached = (self.rating.loss_of(unit) < UNREACHED).all(axis=0)
        return np.asarray(~self.closed[unit] & reached)

    def is_open(self, unit: int) -> bool:
        """Return whether a unit has ways that were not refused: held at a place, or moving."""
        if unit in self.rating.walled:
            return False
        can_move = (self._open_loss(unit) < UNREACHED).any(axis=1).all()
        return bool(self._left(unit).any() or (self.may_be_cut_moving(unit) and can_move))

    def _elsewhere(self, unit: int, position: int) -> bool:
        """Look for another way for a unit refused at a position; return whether there is one.

        Where the arm had no free pose at some knot another place may serve. Else it is the way from
        pose to pose that fails, as it will elsewhere: the axes carry the work along it.
        """
        self.rating.avoid_collisions(unit)
        left, loss = self._left(unit), self.rating.loss_of(unit)
        is_blocked = loss.max(axis=0) >= BLOCKED
        if is_blocked[position] and (left & ~is_blocked).any():
            return True
        if not self.refused[unit] and self.carry(unit):
            return True
        return bool(left.any()) or self._set_moving(unit)

    def _close_knot(self, unit: int, tag: int, position: int) -> bool:
        """Close a position to the knot before a tag of a moving cut; it moves less calmly then."""
        knot = int(np.searchsorted(self.rating.knots, tag, side="right")) - 1
        loss = self.rating.loss[knot]
        if self.shut[knot, position] or loss[position] >= UNREACHED:
            return False
        self.shut[knot, position] = True
        self.calm[unit] = max(0.7 * self.calm[unit], KNOT)
        return bool((~self.shut[knot] & (loss < UNREACHED)).any())


def smoothed(rating: Rating, unit: int, stepped: FloatArray, length: float) -> FloatArray:
    """Return where the axes stand (n, k) at each tag of a moving cut; its ends stay.

    It is smoothed more where an axis would be too slow for the feed.

    Args:
        rating: of the toolpath.
        unit: the cut.
        stepped: (m, k) where the axes stand at its knots, on the grid.
        length: to smooth over [m].
    """
    low, high = rating.units[unit]
    knots = rating.knots[rating.knots_of(unit)]
    way = rating.way[knots]
    value = _calmed(way, stepped, length)
    while length < _MOST_CALM and _too_fast(rating, knots, value):
        length *= 2.0
        value = _calmed(way, stepped, length)
    curve = _curve(way, value, rating.way[low:high])
    curve[[0, -1]] = stepped[[0, -1]]
    stands = np.ptp(stepped, axis=0) == 0.0  # digits would move it
    curve[:, stands] = stepped[0, stands]
    return curve


def _too_fast(rating: Rating, knots: IndexArray, value: FloatArray) -> bool:
    """Return whether an axis is too slow for its way (m, k) between knots (m,) at the feed."""
    feed = rating.feed[knots[1:]]
    rate = np.abs(np.diff(value, axis=0)) / np.diff(rating.way[knots])[:, None]
    return bool((np.nan_to_num(feed)[:, None] * rate > AXIS_SHARE * rating.speeds).any())


def _calmed(way: FloatArray, value: FloatArray, length: float) -> FloatArray:
    """Return values (m, k) at knots smoothed over a length [m], the first and the last kept.

    Twice the minimum of squared distances to the values plus those from knot to knot.
    """
    link = length**2 / np.diff(way)
    weight = np.gradient(way)
    weight[[0, -1]] = 1e9
    diagonal = weight.copy()
    diagonal[1:] += link
    diagonal[:-1] += link
    for _ in range(2):
        value = np.column_stack([_tridiagonal(diagonal, -link, weight * part) for part in value.T])
    return value


def _curve(knots: FloatArray, value: FloatArray, way: FloatArray) -> FloatArray:
    """Return the monotone cubics (n, k) through values (m, k) at knots (m,), at ``way`` (n,)."""
    at = np.clip(np.searchsorted(knots, way, side="right") - 1, 0, len(knots) - 2)
    h = np.diff(knots)[at]
    columns = []
    for part in value.T:
        slope = slopes(knots, part)
        ends = (part[at], part[at + 1], slope[at], slope[at + 1])
        columns.append(np.round(cubic((way - knots[at]) / h, h, ends), _MICRON))
    return np.column_stack(columns)


def slopes(x: FloatArray, y: FloatArray) -> FloatArray:
    """Return the slopes (k,) at knots of the monotone cubic through (x, y) (Fritsch, Carlson 1980).

    Args:
        x: (k,) rising.
        y: (k,).
    """
    h, d = np.diff(x), np.diff(y) / np.diff(x)
    result = np.zeros(len(x))
    if len(x) < 3:
        result[:] = d[0] if len(d) else 0.0
        return result
    left, right = 2.0 * h[1:] + h[:-1], h[1:] + 2.0 * h[:-1]
    same = d[:-1] * d[1:] > 0.0
    safe = np.where(same, d[:-1], 1.0), np.where(same, d[1:], 1.0)
    result[1:-1] = np.where(same, (left + right) / (left / safe[0] + right / safe[1]), 0.0)
    result[0], result[-1] = d[0], d[-1]
    return result


def cubic(share: FloatArray, length: FloatArray, ends: tuple[FloatArray, ...]) -> FloatArray:
    """Return values (k,) of the cubics with given ends at ``share`` of their length.

    Args:
        share: (k,) 0..1.
        length: (k,) of the spans.
        ends: value and value, slope and slope at start and end, (k,) each.
    """
    a, b, da, db = ends
    t, t2, t3 = share, share**2, share**3
    return np.asarray(
        a * (2.0 * t3 - 3.0 * t2 + 1.0)
        + b * (3.0 * t2 - 2.0 * t3)
        + length * (da * (t3 - 2.0 * t2 + t) + db * (t3 - t2))
    )


def _tridiagonal(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric tridiagonal system."""
    d, e, r = diagonal.tolist(), beside.tolist(), right.tolist()
    for i in range(1, len(d)):
        factor = e[i - 1] / d[i - 1]
        d[i] -= factor * e[i - 1]
        r[i] -= factor * r[i - 1]
    x = [0.0] * len(d)
    for i in range(len(d) - 1, -1, -1):
        x[i] = (r[i] - (e[i] * x[i + 1] if i + 1 < len(d) else 0.0)) / d[i]
    return np.array(x)
