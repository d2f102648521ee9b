"""An effect: the tracker reads all distances too long or too short by the same share.

What an effect owes: plain words for the shop floor, parameters in SI with a typical size, and what
one unit of each does to the tool point. Everything else (fit, selection, intervals, the model file)
follows; ``postproc.testing.check_effect`` holds it to that.
"""

from __future__ import annotations

from postproc.gap import Basis, Effect, Kind, Parameter, Samples, Setting


class TrackerScale(Effect):
    """Points move away from the robot root in proportion to their distance."""

    name = "tracker_scale"
    title = "the tracker's scale is off"
    source = "a wrong refractive index scales all distances by the same share"
    action = "enter air temperature and pressure at the tracker, and measure a scale bar"
    kind = Kind.MEASUREMENT
    conditions = ("pose",)
    layout = (("scale_ppm", 1),)
    parameter_list = (Parameter("scale", 20.0),)
    """The scale error in parts per million."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move each point outward by a millionth of its distance per unit."""
        del setting
        return Basis(point=1e-6 * samples.point[:, :, None])


TRACKER_SCALE = TrackerScale()
