"""The arm grows and its joints drift as it gets warm."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, per_joint, register
from postproc.model import ModelFile, entry

SEGMENTS = {"column": (0, 1), "upper_arm": (2,), "forearm": (3, 4), "wrist": (5, 6)}
"""Frames whose outgoing piece grows together."""
_KEYS = (("growth_per_K", 4), ("joint_deg_per_K", 6), ("tilt_deg_per_K", 2))


@register
class ThermalDrift(Effect):
    """Everything in proportion to the arm's temperature above its nominal one."""

    name = "thermal_drift"
    title = "the arm grows and drifts as it warms up"
    source = "linear expansion of the links, drift of the zero positions, lean of the base"
    action = "warm the robot up before precise work, or measure a reference point regularly"
    needs = ("temperature",)
    conditions = ("temperature",)
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

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the rates and the temperature that they count from."""
        del arm
        theta = np.nan_to_num(state.theta)
        table: dict[str, Any] = {"reference_temp_C": state.setting["reference"]}
        start = 0
        for key, count in _KEYS:
            table[key] = entry(key, theta[start : start + count])
            start += count
        return table

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return rates and reference temperature."""
        del arm
        model.require_known(self.name, ["reference_temp_C", *(key for key, _ in _KEYS)])
        parts = []
        for key, count in _KEYS:
            values = model.values(self.name, key, (count,), optional=True)
            parts.append(np.zeros(count) if values is None else values)
        reference = float(np.asarray(model.values(self.name, "reference_temp_C")))
        return State(np.concatenate(parts), {"reference": reference})
