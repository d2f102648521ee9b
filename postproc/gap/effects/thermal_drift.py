"""The arm grows and its joints drift as it gets warm."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, per_joint, register

SEGMENTS = {"column": (0, 1), "upper_arm": (2,), "forearm": (3, 4), "wrist": (5, 6)}
"""Frames whose outgoing piece grows together."""


@register
class ThermalDrift(Effect):
    """Everything in proportion to the arm's temperature above its nominal one."""

    name = "thermal_drift"
    title = "the arm grows and drifts as it warms up"
    source = "linear expansion of the links, drift of the zero positions, lean of the base"
    action = "warm the robot up before precise work, or measure a reference point regularly"
    needs = ("temperature",)
    conditions = ("temperature",)
    layout = (("growth_per_K", 4), ("joint_deg_per_K", 6), ("tilt_deg_per_K", 2))
    setting_keys: ClassVar[Mapping[str, str]] = {"reference": "reference_temp_C"}
    parameter_list = (
        *(Parameter(f"growth_{piece}", 1.5e-5, family="growth") for piece in SEGMENTS),
        *per_joint(1e-5),
        *(Parameter(f"tilt_{axis}", 3e-6, family="tilt") for axis in "xy"),
    )
    """Growth [1/K] of four pieces, drift of six joints and lean about x, y [rad/K]."""

    def prepare(self, samples: Samples) -> Setting:
        """Return the nominal temperature: that of the first row."""
        return {"reference": float(samples.column("temperature")[0])}

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Stretch the pieces, turn the joints, lean the base, each by its kelvins."""
        warm: FloatArray = samples.column("temperature") - setting["reference"]
        origins, _, _ = samples.arm.link_constants()
        link = np.zeros((7, 6, 12))
        for column, frames in enumerate(SEGMENTS.values()):
            for frame in frames:
                link[frame, 3:, column] = origins[frame]
        link[0, 0, 10] = link[0, 1, 11] = 1.0
        joint = np.zeros((len(samples), 6, 12))
        for i in range(6):
            joint[:, i, 4 + i] = warm
        return Basis(joint=joint, link=warm[:, None, None, None] * link)
