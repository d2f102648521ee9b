"""The robot's foot does not stand where the cell says."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, base_moved, register
from postproc.geometry import rotation_from_vector, transform
from postproc.model import Registration


@register
class BaseFrame(Effect):
    """Rigid motion of the whole arm: shift, and turn about the robot root."""

    name = "base_frame"
    title = "the robot's base frame is off"
    source = "rigid registration; always confounded with a zero offset of axis 1"
    action = "measure the robot root again against the workpiece and correct BASE"
    kind = Kind.REGISTRATION
    conditions = ("position",)
    geometric = True
    layout = (("xyz_mm", 3), ("rotation_deg", 3))
    parameter_list = (
        *(Parameter(f"shift_{axis}", 5e-4) for axis in "xyz"),
        *(Parameter(f"turn_{axis}", 3e-4, family="turn") for axis in "xyz"),
    )
    """Shift [m] and rotation vector [rad]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0."""
        del setting
        return Basis(link=base_moved(np.ones((len(samples), 1))))

    def registered(self, registration: Registration, theta: FloatArray) -> Registration:
        """Move the measured frame of the robot root, at every station."""
        moved = transform(rotation_from_vector(theta[3:]), theta[:3])
        return replace(
            registration,
            T_measured_robroot=registration.T_measured_robroot @ moved,
            stations={name: T @ moved for name, T in registration.stations.items()},
        )
