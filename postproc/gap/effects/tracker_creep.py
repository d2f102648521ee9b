"""The measuring device moves while it measures (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register


@register
class TrackerCreep(Effect):
    """Shift and turn of the measured frame with time, straight and curved."""

    name = "tracker_creep"
    title = "behaves like a tracker station or fixture that moves with time"
    source = "t0 + t1 time, six degrees of freedom"
    action = "measure three fixed nests every 20 to 50 poses, poses in random order"
    kind = Kind.ALTERNATIVE
    needs = ("time",)
    conditions = ("time",)
    parameter_list = tuple(
        Parameter(f"{kind}_{axis}_{form}", size)
        for form in ("line", "curve")
        for kind, size in (("shift", 1e-4), ("turn", 5e-5))
        for axis in "xyz"
    )
    """Shift [m] and turn [rad] at the end, for two forms of time."""

    def prepare(self, samples: Samples) -> Setting:
        """Return start and length of the campaign [s], and the mean of both forms.

        The means are taken out: a frame that is off from the start is not a creeping one.
        """
        time = samples.column("time")
        start, length = float(np.min(time)), float(np.ptp(time)) or 1.0
        mean = [float(np.mean(form)) for form in _forms((time - start) / length)]
        return {"start": start, "length": length, "mean": mean}

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0 in the course of time."""
        part = (samples.column("time") - setting["start"]) / setting["length"]
        link = np.zeros((len(samples), 7, 6, 12))
        for index, (raw, mean) in enumerate(zip(_forms(part), setting["mean"], strict=True)):
            form = raw - mean
            for axis in range(3):
                link[:, 0, 3 + axis, 6 * index + axis] = form
                link[:, 0, axis, 6 * index + 3 + axis] = form
        return Basis(link=link)


def _forms(part: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return a straight line and a settling curve over the part 0..1 of the campaign."""
    return part, 1.0 - np.exp(-4.0 * part)
