"""Measurements of a real robot, in columns, SI units, axes of robroot (or of the tracker)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field, replace
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows, frozen_floats, frozen_ints
from postproc.measurement.columns import LABELS, QUANTITIES
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Remark:
    """Something wrong in the rows that was worked around: what, in which rows, what was done."""

    kind: str
    ids: tuple[str, ...]
    text: str

    def entry(self) -> dict[str, Any]:
        """Return the remark as an entry of a JSON document."""
        return {"kind": self.kind, "ids": list(self.ids), "text": self.text}

    def line(self) -> str:
        """Return the remark as a sentence that names the first rows."""
        return f"Rows {', '.join(self.ids[:8])} ({len(self.ids)}): {self.text}."


@dataclass(frozen=True, slots=True)
class MeasurementSet:
    """Rows of a measuring campaign; a column that was not logged is None.

    Args:
        path: input file as given; line: (n,) 1-based source lines; ids: row names.
        q: (n, 6) commanded joints [rad]; position: (n, 3) measured tool point [m], NaN where a
            coordinate was not measured (``readings_of`` has every form as one).
        group: labels of rows taken together; abc: (n, 3) measured orientation [rad].
        along: (n,) reading along way (n, 3); length: (n,) from origin (n, 3), or from the unknown
            point ``from_id``; plane: name of the plane that was touched. NaN or "" without.
        time: (n,) [s]; temperature: (n,) [degC]; direction: (n, 6) -1, 0, +1; qd: (n, 6) [rad/s].
        wrench: (n, 6) ON the tool at the tool point, axes of robroot [N, N*m].
        sigma: (n,) standard deviation of the reading per axis, of the instrument [m]; sigmas:
            (n, 3) of each coordinate.
        station, reflector: labels of the set-up of the measuring device and of what it sees.
        extra: unknown columns by name, numbers or labels, offered as conditions.
        remarks: what was wrong in the rows and was worked around.
    """

    path: str
    line: IntArray
    ids: tuple[str, ...]
    q: FloatArray
    position: FloatArray
    group: tuple[str, ...] | None = None
    abc: FloatArray | None = None
    time: FloatArray | None = None
    temperature: FloatArray | None = None
    direction: FloatArray | None = None
    qd: FloatArray | None = None
    wrench: FloatArray | None = None
    sigma: FloatArray | None = None
    along: FloatArray | None = None
    way: FloatArray | None = None
    length: FloatArray | None = None
    origin: FloatArray | None = None
    sigmas: FloatArray | None = None
    station: tuple[str, ...] | None = None
    reflector: tuple[str, ...] | None = None
    from_id: tuple[str, ...] | None = None
    plane: tuple[str, ...] | None = None
    extra: Mapping[str, Any] = field(default_factory=dict)
    remarks: tuple[Remark, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "q", (None, 6))
        n = len(self.q)
        frozen_ints(self, "line", (n,))
        for part in QUANTITIES:
            frozen_floats(self, part.field, (n, len(part.names)) if len(part.names) > 1 else (n,))

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.q)

    def rows(self, index: Rows) -> MeasurementSet:
        """Return some of the rows (a mask, or their numbers)."""
        picked = np.flatnonzero(index) if np.asarray(index).dtype == bool else np.asarray(index)

        def some(values: Any) -> Any:  # noqa: ANN401 - numbers or labels
            if values is None or isinstance(values, np.ndarray):
                return None if values is None else values[picked]
            return tuple(values[int(k)] for k in picked)

        names = ("line", "ids", *(part.field for part in QUANTITIES), *LABELS)
        extra = {name: some(values) for name, values in self.extra.items()}
        return replace(self, **{n: some(getattr(self, n)) for n in names}, extra=extra)

    def with_remark(self, remark: Remark) -> MeasurementSet:
        """Return the rows with one more remark."""
        return replace(self, remarks=(*self.remarks, remark))


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
