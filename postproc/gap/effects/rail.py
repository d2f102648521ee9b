"""The rail that carries the robot is not straight, not parallel, or not as long as it says."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, State, base_moved, register
from postproc.model import ModelFile, entry
from postproc.units import MM

_SHIFTS, _TURNS = 4, 2
"""Highest degree of the polynomials along the way: of a shift, of a turn."""
_FORMS = (("shift_mm", _SHIFTS), ("turn_deg", _TURNS))


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

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the way, and the shifts and turns of each polynomial."""
        del arm
        parts = np.split(np.nan_to_num(state.theta).reshape(-1, 3), [_SHIFTS])
        ends = {key: entry(f"{key}_mm", state.setting[key]) for key in ("start", "end")}
        table = {key: entry(key, part) for (key, _), part in zip(_FORMS, parts, strict=True)}
        return {f"{key}_mm": value for key, value in ends.items()} | table

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the rail of a table."""
        del arm
        model.require_known(self.name, ["start_mm", "end_mm", *(key for key, _ in _FORMS)])
        ends = {k: float(np.asarray(model.values(self.name, f"{k}_mm"))) for k in ("start", "end")}
        parts = [np.asarray(model.values(self.name, key, (count, 3))) for key, count in _FORMS]
        return State(np.concatenate(parts).ravel(), ends)


def _place(samples: Samples) -> FloatArray:
    """Return (n,) the place on the rail [m]."""
    return np.asarray(samples.column("e1_mm"), dtype=np.float64) * MM
