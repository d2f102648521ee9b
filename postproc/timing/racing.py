"""Samples of joint paths so fine that the largest speed of an axis between them is known.

The rate of an axis on a path peaks within millimetres where the wrist is nearly straight, the wrist
centre passes near axis 1, or the arm is nearly stretched: a mean over a longer piece hides that.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from postproc.arrays import AT_ONCE, BoolArray, FloatArray, IndexArray, Rows, taken

PlacesAt = Callable[[IndexArray, FloatArray, FloatArray], FloatArray]
"""Places (k, d) at shares (k,) of motions (k,), near to places (k, d); NaN out of reach."""
_RACING = 0.05
"""A motion is looked at more closely where an axis needs this share of its speed: next to the
stretched arm A3 needs twenty times its mean speed over a centimetre."""
_FEWEST = 4
"""With fewer pieces the speeds of neighbouring ones do not show where an axis races."""
_ERROR = 0.02
"""Share of the largest speed of a motion that pieces may miss."""
_HALVINGS = 14


class Samples(NamedTuple):
    """Motion (s,) and share of it (s,) 0..1, both rising; places (s, d) of the axes [rad or m]."""

    row: IndexArray
    share: FloatArray
    places: FloatArray

    def of(self, mine: Rows) -> Samples:
        """Return those samples."""
        return Samples(self.row[mine], self.share[mine], taken(self.places, mine))

    @classmethod
    def joined(cls, parts: list[Samples]) -> Samples:
        """Return the samples of all parts."""
        row, share, places = zip(*parts, strict=True)
        return cls(np.concatenate(row), np.concatenate(share), np.concatenate(places))


def resolved(samples: Samples, time: FloatArray, top: FloatArray, places_at: PlacesAt) -> Samples:
    """Return samples with more between them until the largest speed of each motion is known.

    Mean speeds over two neighbouring pieces tell that where they meet; a piece is halved while this
    exceeds the largest mean of its motion. Motions on which that shows no higher speed keep their
    samples.

    Args:
        samples: of all motions, the start of each included.
        time: (m,) of each motion [s]; infinite where nothing is asked of its speed.
        top: (d,) largest speeds [rad/s or m/s].
        places_at: where the axes are in between.
    """
    # whole motions at a time, so that memory stays bounded
    starts = np.unique(np.searchsorted(samples.row, samples.row[:: 10 * AT_ONCE]))
    own = [slice(*ends) for ends in pairwise([*starts.tolist(), len(samples.row)])]
    parts = [Samples(samples.row[one], samples.share[one], samples.places[one]) for one in own]
    finer = [_resolved(part, time, top, places_at) for part in parts]
    if all(one is other for one, other in zip(finer, parts, strict=True)):
        return samples
    return Samples.joined(finer)


def _resolved(samples: Samples, time: FloatArray, top: FloatArray, places_at: PlacesAt) -> Samples:
    known, unsure = _speeds(samples, time, top)
    fine, found = samples, known
    open_ = np.zeros(len(time), dtype=np.bool_)
    done = []
    for _ in range(_HALVINGS):
        if not unsure.any():
            break
        open_[:] = False
        open_[fine.row[:-1][unsure]] = True
        mine = open_[fine.row]
        done.append(fine.of(~mine))
        first = (np.cumsum(mine) - 1)[np.flatnonzero(unsure)]
        fine = _halved(fine.of(mine), first, places_at)
        best, unsure = _speeds(fine, time, top)
        found = np.maximum(found, best)
    more = found > (1.0 + _ERROR) * known
    if not more.any():
        return samples
    parts = [samples.of(~more[samples.row]), *(part.of(more[part.row]) for part in [*done, fine])]
    joined = Samples.joined(parts)
    return joined.of(np.lexsort((joined.share, joined.row)))


def _halved(samples: Samples, first: IndexArray, places_at: PlacesAt) -> Samples:
    """Return the samples with one more in the middle behind each of those (k,)."""
    row, share, places = samples
    middle = 0.5 * (share[first] + share[first + 1])
    between = places_at(row[first], middle, 0.5 * (taken(places, first) + taken(places, first + 1)))
    known = np.isfinite(between).all(axis=1)
    at = first[known] + 1
    return Samples(
        np.insert(row, at, row[at - 1]),
        np.insert(share, at, middle[known]),
        np.insert(places, at, between[known], axis=0),
    )


def _speeds(samples: Samples, time: FloatArray, top: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Return the largest share (m,) of axis speed, and pieces (s - 1,) that may hide more."""
    row, share, places = samples
    best, unsure = np.zeros(len(time)), np.zeros(max(len(row) - 1, 0), dtype=np.bool_)
    seconds = np.diff(share) * time[row[:-1]]
    piece = np.flatnonzero((row[1:] == row[:-1]) & (seconds > 0.0) & np.isfinite(seconds))
    seconds, motion = seconds[piece, None], row[piece]
    chord = np.nan_to_num((taken(places, piece + 1) - taken(places, piece)) / top / seconds)
    mean = np.abs(chord).max(axis=1, initial=0.0)
    np.maximum.at(best, motion, mean)
    after = np.flatnonzero(motion[1:] == motion[:-1])
    bend = np.abs(taken(chord, after + 1) - taken(chord, after))
    bend /= seconds[after] + seconds[after + 1]
    peak = mean.copy()
    for beside in (after, after + 1):
        reached = np.abs(taken(chord, beside)) + bend * seconds[beside]
        peak[beside] = np.maximum(peak[beside], reached.max(axis=1, initial=0.0))
    few = np.bincount(motion, minlength=len(time))[motion] < _FEWEST
    largest = best[motion]
    unsure[piece] = few | (peak > (1.0 + _ERROR) * largest)
    unsure[piece] &= np.maximum(peak, largest) > _RACING
    return best, unsure
