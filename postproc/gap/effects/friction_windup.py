"""Friction holds the joints back in proportion to what they carry (a suspect, never a verdict)."""

from __future__ import annotations

import numpy as np

from postproc.gap.dataset import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register
from postproc.gap.loads import carried_torque


@register
class FrictionWindup(Effect):
    """Give against the last motion that grows with the torque the joint carries.

    The part that does not grow is backlash to any measurement.
    """

    name = "friction_windup"
    title = "behaves like friction wind-up: approach side times torque"
    source = "J (friction torque times sign of motion) / K"
    action = "vary speed and dwell before the reading, and measure again"
    kind = "suspect"
    needs = ("direction",)
    conditions = ("approach",)

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return for each joint the part that grows with the torque, and its square root."""
        del arm, setting
        return tuple(
            Parameter(f"joint_{i}_{way}", 1e-4, joint=i)
            for way in ("linear", "root")
            for i in range(1, 7)
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its side times its relative torque, mean taken out."""
        del setting
        side = samples.column("direction")
        torque = np.abs(carried_torque(samples))
        size = torque / (np.mean(torque, axis=0) + 1e-12)
        root = np.sqrt(size)
        joint = np.zeros((len(samples), 6, 12))
        for i in range(6):
            joint[:, i, i] = side[:, i] * (size[:, i] - 1.0)
            joint[:, i, 6 + i] = side[:, i] * (root[:, i] - np.mean(root[:, i]))
        return Basis(joint=joint)
