"""Keys of ``[measuring]``: how the errors of the device lie, and what the user states of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Self

import numpy as np

from postproc.arrays import FloatArray, frozen_floats
from postproc.cell.schema.table import Options, Text, Vector, key
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Instrument(Options):
    """The measuring device of campaigns.

    A tracker, where its two sigmas are given; else a device of which no more than a sigma is known.
    """

    sigma: float | None = key(
        None,
        "standard deviation of a reading per axis [mm], where none was repeated",
        "mm",
        gt=0.0,
        le=100.0,
    )
    range_sigma: float | None = key(
        None, "of a tracker: standard deviation along the beam [mm]", "mm", gt=0.0, le=100.0
    )
    range_rate: float = key(
        0.0,
        "of a tracker: what the distance adds to that [mm/m]",
        "mm_per_m",
        called="range_sigma_mm_per_m",
        ge=0.0,
        le=100.0,
    )
    angle_sigma: float | None = key(
        None,
        "of a tracker: standard deviation across the beam [mm/m]",
        "mm_per_m",
        gt=0.0,
        le=100.0,
    )
    stands: FloatArray = key(
        (0.0, 0.0, 0.0), "where the tracker stands in the measured frame [mm]", "mm", form=Vector
    )
    instrument: str | None = key(None, "name of the device, for reports", form=Text)
    serial: str | None = key(None, "its serial number, for reports", form=Text)
    calibrated: str | None = key(None, "its calibration, for reports", form=Text)
    operator: str | None = key(None, "who measured, for reports", form=Text)
    date: str | None = key(None, "when it was measured, for reports", form=Text)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "stands", (3,))

    def checked(self) -> Self:
        """Return the device; ValueError for half a tracker."""
        if (self.range_sigma is None) != (self.angle_sigma is None):
            raise ValueError("range_sigma_mm and angle_sigma_mm_per_m belong together, found one")
        return self

    @property
    def stated(self) -> Mapping[str, str]:
        """What the user says of device, people and date, for reports."""
        said = {made.name: getattr(self, made.name) for made in fields(self)}
        return {name: text for name, text in said.items() if isinstance(text, str)}

    @property
    def is_known(self) -> bool:
        """Whether it says how its errors lie."""
        return self.range_sigma is not None and self.angle_sigma is not None

    def principal_axes(self, points: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return axes (n, 3, 3) in which errors at points (n, 3) [m] are independent, sigma (n, 3).

        Unit axes in rows, the beam first; at points without three coordinates (NaN) axes of the
        frame, with the spread along each.
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
