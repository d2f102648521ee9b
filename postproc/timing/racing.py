"""Samples of joint paths so fine that the largest speed of an axis between them is known.

The rate of an axis on a path peaks within millimetres where the wrist is nearly straight, the wrist
centre passes near axis 1, or the arm is nearly stretched: a mean over a longer piece hides that.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray

PlacesAt = Callable[[IndexArray, FloatArray, FloatArray], FloatArray]
"""Places (k, d) at shares (k,) of motions (k,), near to places (k, d); NaN out of reach."""
_RACING = 0.2
"""A motion is looked at more closely where an axis needs this share of its speed."""
_FEWEST = 4
"""With fewer pieces the speeds of neighbouring ones do not show where an axis races."""
_ERROR = 0.02
"""Share of the largest speed of a motion that pieces may miss."""
_HALVINGS = 14


def resolved(
    samples: tuple[IndexArray, FloatArray, FloatArray],
    time: FloatArray,
    top: FloatArray,
    places_at: PlacesAt,
) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Return samples with more between them until the largest speed of each motion is known.

    Mean speeds over two neighbouring pieces tell that where they meet; a piece is halved while this
    exceeds the largest mean of its motion. Motions on which no axis comes near its speed keep
    their samples.

    Args:
        samples: motion (s,) and share of it (s,) 0..1 of each sample, both rising, the start of
            each motion included, and places of the axes (s, d) [rad or m].
        time: (m,) of each motion [s].
        top: (d,) largest speeds [rad/s or m/s].
        places_at: where the axes are in between.
    """
    for _ in range(_HALVINGS):
        row, share, places = samples
        first = np.flatnonzero(_unresolved(samples, time, top))
        if not len(first):
            break
        middle = 0.5 * (share[first] + share[first + 1])
        near = 0.5 * (places[first] + places[first + 1])
        between = places_at(row[first], middle, near)
        known = np.isfinite(between).all(axis=1)
        first, middle, between = first[known], middle[known], between[known]
        samples = (
            np.insert(row, first + 1, row[first]),
            np.insert(share, first + 1, middle),
            np.insert(places, first + 1, between, axis=0),
        )
    return samples


def _unresolved(
    samples: tuple[IndexArray, FloatArray, FloatArray], time: FloatArray, top: FloatArray
) -> BoolArray:
    """Return which pieces (s - 1,) between samples may hide a higher speed than is known."""
    row, share, places = samples
    same = row[1:] == row[:-1]
    seconds = np.diff(share) * time[row[:-1]]
    same &= seconds > 0.0
    chord = np.diff(places, axis=0) / top / np.where(same, seconds, np.inf)[:, None]
    mean = np.nan_to_num(np.abs(chord).max(axis=1, initial=0.0))
    best, pieces = np.zeros(len(time)), np.bincount(row[:-1][same], minlength=len(time))
    np.maximum.at(best, row[:-1][same], mean[same])
    peak = mean.copy()
    inner = np.flatnonzero(same[1:] & same[:-1])  # pieces that another of their motion follows
    bend = np.abs(chord[inner + 1] - chord[inner]) / (seconds[inner] + seconds[inner + 1])[:, None]
    for piece in (inner, inner + 1):
        reached = np.abs(chord[piece]) + bend * seconds[piece][:, None]
        np.maximum.at(peak, piece, np.nan_to_num(reached.max(axis=1, initial=0.0)))
    largest = best[row[:-1]]
    unsure = (pieces[row[:-1]] < _FEWEST) | (peak > (1.0 + _ERROR) * largest)
    return np.asarray(same & (np.maximum(peak, largest) > _RACING) & unsure)
