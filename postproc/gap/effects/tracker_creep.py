"""The measuring device moves while it measures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, base_moved, register

_FORMS = ("line", "curve")
_SETTLING = 4.0
"""How many times the settling time a campaign is long, for the curve."""


class Creep(Effect):
    """Something that moves in the course of a campaign: straight with time, and settling.

    It begins at nothing: what is off from the start does not creep. Before and after the campaign
    it stays as it was at that end.
    """

    kind = Kind.MEASUREMENT
    needs = ("time",)
    setting_keys: ClassVar[Mapping[str, str]] = {"start": "start_s", "length": "length_s"}
    moves: ClassVar[tuple[tuple[str, float], ...]]
    """What moves, and the usual way to the end [m, rad]."""

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the way of each axis at the end, for both forms."""
        del arm, setting
        return tuple(
            Parameter(f"{what}_{axis}_{form}", size)
            for form in _FORMS
            for what, size in self.moves
            for axis in "xyz"
        )

    def prepare(self, samples: Samples) -> Setting:
        """Return start and length of the campaign [s]."""
        time = samples.column("time")
        return {"start": float(np.min(time)), "length": float(np.ptp(time)) or 1.0}

    @staticmethod
    def course(samples: Samples, setting: Setting) -> FloatArray:
        """Return both forms (n, 2) at the time of each row."""
        part = (samples.column("time") - setting["start"]) / setting["length"]
        part = np.clip(part, 0.0, 1.0)
        return np.column_stack([part, 1.0 - np.exp(-_SETTLING * part)])


@register
class TrackerCreep(Creep):
    """Shift and turn of the measured frame with time."""

    name = "tracker_creep"
    title = "the tracker's stand, or the fixture, moves with time"
    source = "t0 + t1 time, six degrees of freedom"
    action = "measure three fixed nests every 20 to 50 poses, poses in random order"
    conditions = ("time",)
    layout = tuple((f"{form}_{unit}", 3) for form in _FORMS for unit in ("mm", "deg"))
    moves = (("shift", 1e-4), ("turn", 5e-5))

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0 in the course of time."""
        return Basis(link=base_moved(self.course(samples, setting)))
