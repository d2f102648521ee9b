"""The measuring device of campaigns: how its errors lie, and what the user states of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray, frozen_floats
from postproc.cell.schema import MeasuringTable
from postproc.records import dataclass
from postproc.units import MM


@dataclass(frozen=True, slots=True)
class Instrument:
    """A tracker, where its two sigmas are given; else a device of which nothing is known.

    range_sigma: standard deviation along the beam [m], range_rate: what the distance adds to it;
    angle_sigma: across the beam, as an angle [rad]; stands: (3,) the tracker in the measured frame
    [m]. stated: what the user says of device, people and date, for reports.
    """

    range_sigma: float | None = None
    range_rate: float = 0.0
    angle_sigma: float | None = None
    stands: FloatArray = field(default_factory=lambda: np.zeros(3))
    stated: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "stands", (3,))

    @property
    def is_known(self) -> bool:
        """Whether it says how its errors lie."""
        return self.range_sigma is not None and self.angle_sigma is not None

    def principal_axes(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return axes in which the errors at points are independent, and their sigma.

        Args:
            points: (n, 3) in the measured frame [m]; a coordinate that is NaN was not measured.

        Returns:
            (n, 3, 3) unit axes in rows, the beam first, and (n, 3) sigma [m]; at points without
            three coordinates axes of the frame, with the spread along each.
        """
        if self.range_sigma is None or self.angle_sigma is None:
            raise ValueError("a device without sigmas")
        beam = np.where(np.isfinite(points), points - self.stands, 0.0)
        away = np.linalg.norm(beam, axis=1)
        beam = beam / np.maximum(away, 1e-9)[:, None]
        along = self.range_sigma + self.range_rate * away
        across = self.angle_sigma * away
        other = np.eye(3)[np.abs(beam).argmin(axis=1)]
        side = np.cross(beam, other)
        side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), 1e-9)
        axes = np.stack([beam, side, np.cross(beam, side)], axis=1)
        sigma = np.stack([along, across, across], axis=1)
        partial = np.asarray(~np.isfinite(points).all(axis=1))
        spread = np.sqrt(across[:, None] ** 2 + (along**2 - across**2)[:, None] * beam**2)
        return (
            np.where(partial[:, None, None], np.eye(3), axes),
            np.where(partial[:, None], spread, sigma),
        )


def instrument_of(table: MeasuringTable) -> Instrument:
    """Return the device of ``[measuring]``."""
    names = ("instrument", "serial", "calibrated", "operator", "date")
    stated = {name: getattr(table, name) for name in names}
    return Instrument(
        in_m(table.range_sigma_mm),
        table.range_sigma_mm_per_m * MM,
        in_m(table.angle_sigma_mm_per_m),
        np.array(table.stands_mm) * MM,
        {name: text for name, text in stated.items() if text is not None},
    )


def in_m(mm: float | None) -> float | None:
    """Return a length in m, None for none."""
    return None if mm is None else mm * MM
