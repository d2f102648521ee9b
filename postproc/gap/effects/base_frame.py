"""The robot's foot does not stand where the cell says."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register


@register
class BaseFrame(Effect):
    """Rigid motion of the whole arm: shift, and turn about the robot root."""

    name = "base_frame"
    title = "the robot's base frame is off"
    source = "rigid registration; always confounded with a zero offset of axis 1"
    action = "measure the robot root again against the workpiece and correct BASE"
    kind = "measurement"
    conditions = ("position",)
    layout = (("xyz_mm", 3), ("rotation_deg", 3))

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return shift [m] and rotation vector [rad]."""
        del arm, setting
        shift = tuple(Parameter(f"shift_{axis}", 5e-4) for axis in "xyz")
        return shift + tuple(Parameter(f"turn_{axis}", 3e-4) for axis in "xyz")

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Move frame 0."""
        del setting
        link = np.zeros((len(samples), 7, 6, 6))
        link[:, 0, 3:, :3] = np.eye(3)
        link[:, 0, :3, 3:] = np.eye(3)
        return Basis(link=link)
