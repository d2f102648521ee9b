"""Steps of the external axes along a moving cut made a smooth way."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.planning.external.rating import BLOCKED, Rating
from postproc.planning.search import cubic, slopes
from postproc.process import AXIS_SHARE

CALM = 0.5
"""Steps on the grid are smoothed over so much way [m]; less where the arm cannot follow."""
_LEAST_CALM, _MOST_CALM = 0.02, 16.0
_MICRON = 6
"""Positions are rounded to so many digits [m or rad], as program text can hold them."""


def smoothed(
    rating: Rating, unit: int, stepped: FloatArray, loss: FloatArray, length: float
) -> FloatArray:
    """Return where the axes stand (n, k) at each tag of a moving cut; its ends stay.

    It is smoothed less where the arm would come to positions at which it has no free pose, as far
    as it has one where it is stepped, and more where an axis would be too slow for the feed.

    Args:
        rating: of the toolpath.
        unit: the cut.
        stepped: (m, k) where the axes stand at its knots, on the grid.
        loss: (m, g) of its knots at the positions of the grid.
        length: to smooth over [m].
    """
    low, high = rating.units[unit]
    knots, rows = rating.knots[rating.knots_of(unit)], np.arange(len(stepped))
    way = rating.way[knots]
    bound = loss[rows, rating.nearest(stepped)] + 0.5 * BLOCKED

    def over(length: float) -> tuple[FloatArray, bool]:
        value = _calmed(way, stepped, length)
        return value, bool((loss[rows, rating.nearest(value)] < bound).all())

    value, fits = over(length)
    while not fits and length >= 2.0 * _LEAST_CALM:
        length *= 0.5
        value, fits = over(length)
    while fits and length < _MOST_CALM and _too_fast(rating, knots, value):
        length *= 2.0
        calmer, fits = over(length)
        value = calmer if fits else value
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


def _tridiagonal(diagonal: FloatArray, beside: FloatArray, right: FloatArray) -> FloatArray:
    """Solve a symmetric tridiagonal system.

    Args:
        diagonal: (n,).
        beside: (n-1,) entries beside the diagonal.
        right: (n,) right-hand side.
    """
    d, e, r = diagonal.tolist(), beside.tolist(), right.tolist()
    for i in range(1, len(d)):
        factor = e[i - 1] / d[i - 1]
        d[i] -= factor * e[i - 1]
        r[i] -= factor * r[i - 1]
    x = [0.0] * len(d)
    for i in range(len(d) - 1, -1, -1):
        x[i] = (r[i] - (e[i] * x[i + 1] if i + 1 < len(d) else 0.0)) / d[i]
    return np.array(x)
