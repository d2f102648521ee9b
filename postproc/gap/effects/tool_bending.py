"""Tool or fixture give way under load (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Arm, Samples
from postproc.gap.effect import SYMMETRIC, Basis, Effect, Kind, Parameter, Setting, register


@register
class ToolBending(Effect):
    """A constant Cartesian compliance: in the flange (tool) and in the room (fixture)."""

    name = "tool_bending"
    title = "behaves like a tool or fixture that gives way under load"
    source = "displacement C F with C constant in the flange or in the room"
    action = "put an indicator between tool and flange, and between workpiece and floor"
    kind = Kind.ALTERNATIVE
    needs = ("wrench",)
    conditions = ("load",)
    mistaken_for = ("joint_compliance", "variable_stiffness")

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return six compliances in the flange, six in the room, relative to joint 2's."""
        del arm, setting
        return tuple(
            Parameter(f"{place}_{i}{j}", 0.1) for place in ("flange", "room") for i, j in SYMMETRIC
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Shift the point."""
        del setting
        unit = float(samples.arm.reference.c_joint[1])
        force = samples.column("wrench")[:, :3] * unit
        R = samples.frames[:, 6, :3, :3]
        local = np.einsum("nji,nj->ni", R, force)
        point = np.zeros((len(samples), 3, 12))
        for column, (i, j) in enumerate(SYMMETRIC):
            point[:, :, column] += R[:, :, i] * local[:, j, None]
            point[:, i, 6 + column] += force[:, j]
            if i != j:
                point[:, :, column] += R[:, :, j] * local[:, i, None]
                point[:, j, 6 + column] += force[:, i]
        return Basis(point=point)
