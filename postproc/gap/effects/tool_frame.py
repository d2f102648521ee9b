"""The tool point is not where TOOL_DATA says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, point_moved, register
from postproc.model import Registration


@register
class ToolFrame(Effect):
    """Constant shift of the measured point in the flange.

    A campaign at one orientation cannot see it: it is then a shift of the base.
    """

    name = "tool_frame"
    title = "the tool frame is off"
    source = "rigid registration; in the tool plane confounded with a zero offset of axis 6"
    action = "measure the tool again (XYZ 4-point) and correct TOOL_DATA"
    kind = Kind.REGISTRATION
    conditions = ("orientation",)
    geometric = True
    layout = (("xyz_mm", 3),)
    parameter_list = tuple(Parameter(f"shift_{axis}", 5e-4) for axis in "xyz")
    """The shift in axes of the flange [m]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move the point beyond joint 6."""
        del setting
        return Basis(link=point_moved(samples, np.ones((len(samples), 1))))

    def registered(self, registration: Registration, theta: FloatArray) -> Registration:
        """Move the measured point in the flange."""
        return replace(
            registration,
            p_flange_point=registration.p_flange_point + theta,
            reflectors={name: p + theta for name, p in registration.reflectors.items()},
        )
