"""Tool or fixture give way under load (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import (
    SYMMETRIC,
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    register,
    symmetric,
)


@register
class ToolBending(Effect):
    """A constant Cartesian compliance: in the flange (tool) and at rest (fixture)."""

    name = "tool_bending"
    title = "behaves like a tool or fixture that gives way under load"
    source = "displacement C F with C constant in the flange or in the robot root"
    action = "put an indicator between tool and flange, and between workpiece and floor"
    kind = Kind.ALTERNATIVE
    needs = ("wrench",)
    conditions = ("load",)
    parameter_list = tuple(
        Parameter(f"{place}_{i}{j}", 0.1) for place in ("flange", "robroot") for i, j in SYMMETRIC
    )
    """Six compliances in the flange, six in the robot root, relative to joint 2's."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Shift the point."""
        del setting
        unit = float(samples.arm.reference.c_joint[1])
        force = samples.column("wrench")[:, :3] * unit
        R = samples.frames[:, 6, :3, :3]
        local = np.einsum("nji,nj->ni", R, force)
        return Basis(point=np.concatenate([R @ symmetric(local), symmetric(force)], axis=2))
