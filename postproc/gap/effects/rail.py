"""The rail that carries the robot is not straight, not parallel, or not as long as it says."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, base_moved, register
from postproc.units import MM

_SHIFTS, _TURNS = 4, 2
"""Highest degree of the polynomials along the way: of a shift, of a turn."""


@register
class Rail(Effect):
    """Shift and turn of the carriage along the way of the first external axis.

    Legendre polynomials of the place on the way that was measured: a straight shift is the scale
    and the direction, the others are how straight it is, a turn is roll, pitch and yaw. Beyond
    that way it is as at its end.
    """

    name = "rail"
    title = "the rail is not straight, not parallel, or of another scale"
    source = "t(e1) + w(e1) x p, polynomials of the place on the rail"
    action = "level and align the rail; enter its scale in the external axis' data"
    kind = Kind.MEASUREMENT
    needs = ("e1_mm",)
    conditions = ("e1_mm",)
    layout = (("shift_mm", (_SHIFTS, 3)), ("turn_deg", (_TURNS, 3)))
    setting_keys: ClassVar[Mapping[str, str]] = {"start": "start_mm", "end": "end_mm"}
    parameter_list = (
        *(
            Parameter(f"shift_{axis}_{n}", 2e-4, family="scale" if n == 1 else "straightness")
            for n in range(1, _SHIFTS + 1)
            for axis in "xyz"
        ),
        *(
            Parameter(f"turn_{axis}_{n}", 1.5e-4, family="angle")
            for n in range(1, _TURNS + 1)
            for axis in "xyz"
        ),
    )
    """Shifts [m] and turns [rad] of each polynomial, at its end."""

    def prepare(self, samples: Samples) -> Setting:
        """Return both ends of the way [m]."""
        place = _place(samples)
        return {"start": float(np.nanmin(place)), "end": float(np.nanmax(place))}

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0 by the polynomials; rows that do not say where they were stay."""
        half = max(0.5 * (setting["end"] - setting["start"]), 1e-6)
        x = (_place(samples) - setting["start"]) / half - 1.0
        f = np.polynomial.legendre.legvander(np.clip(x, -1.0, 1.0), _SHIFTS)[:, 1:]
        f = np.where(np.isfinite(x)[:, None], f, 0.0)
        size = len(samples), 7, 6
        each = base_moved(f).reshape(*size, _SHIFTS, 6)
        parts = each[..., :3], each[..., :_TURNS, 3:]
        return Basis(link=np.concatenate([part.reshape(*size, -1) for part in parts], axis=3))


def _place(samples: Samples) -> FloatArray:
    """Return (n,) the place on the rail [m]."""
    return np.asarray(samples.column("e1_mm"), dtype=np.float64) * MM
