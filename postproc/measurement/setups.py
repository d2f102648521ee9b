"""Set-ups of a campaign: station and reflector of each row, and how their points scatter."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.measurement.rows import MeasurementSet
from postproc.records import dataclass

MEAN_LENGTH = 1.5958
"""Mean length of a Gaussian vector in space over its sd per axis: of chi with three freedoms."""
_MEDIAN_LENGTH = 1.5382


@dataclass(frozen=True, slots=True)
class SetUps:
    """Stations and reflectors of rows (n,), by number, and their names.

    labelled: whether the file names them; else there is one of each.
    """

    station: IntArray
    reflector: IntArray
    stations: tuple[str, ...]
    reflectors: tuple[str, ...]
    labelled: bool

    @property
    def several(self) -> bool:
        """Whether there is more than one of either."""
        return len(self.stations) > 1 or len(self.reflectors) > 1

    @property
    def unit(self) -> IntArray:
        """(n,) one number for each pair of station and reflector."""
        return np.asarray(self.station * len(self.reflectors) + self.reflector, dtype=np.int32)

    def rows(self, index: Rows) -> SetUps:
        """Return the labels of some rows; a station may be left without any."""
        return SetUps(
            self.station[index],
            self.reflector[index],
            self.stations,
            self.reflectors,
            self.labelled,
        )


def set_ups(measured: MeasurementSet) -> SetUps:
    """Return the set-ups of a campaign, in the order in which they appear.

    A file without the column is one station, named as the file.
    """
    n = len(measured)
    station, stations = _numbered(measured.station, Path(measured.path).stem, n)
    reflector, reflectors = _numbered(measured.reflector, "", n)
    labelled = measured.station is not None or measured.reflector is not None
    return SetUps(station, reflector, stations, reflectors, labelled)


def _numbered(
    labels: tuple[str, ...] | None, default: str, n: int
) -> tuple[IntArray, tuple[str, ...]]:
    if labels is None:
        return np.zeros(n, dtype=np.int32), (default,)
    names = tuple(dict.fromkeys(labels))
    number = {name: k for k, name in enumerate(names)}
    return np.array([number[label] for label in labels], dtype=np.int32), names


def robust_sigma(length: FloatArray) -> float:
    """Return the sd per axis from the lengths (n,) of errors; some of them may be faults."""
    return float(np.median(length)) / _MEDIAN_LENGTH
