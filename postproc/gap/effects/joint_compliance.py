"""The joints give way under an outside load."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import (
    Basis,
    Effect,
    Parameter,
    Setting,
    State,
    diagonal,
    per_joint,
    register,
    unseen_joints,
)
from postproc.model import ModelFile, entry

KEY = "stiffness_Nmm_per_rad"


@register
class JointCompliance(Effect):
    """Each joint is a linear torsion spring that the wrench on the tool turns.

    Parameters are compliances as multiples of the reference; the file holds stiffness.
    """

    name = "joint_compliance"
    title = "the joints give way under the load on the tool"
    source = "Jiao et al. 2022, Eq. (1): D = J K^-1 J^T F"
    action = "compensate with model.toml, or lower the process force"
    needs = ("wrench",)
    conditions = ("load",)
    equilibrium = True
    layout = ((KEY, 6),)

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return six relative compliances, never negative."""
        del arm, setting
        return per_joint(1.0, lower=0.0)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its torque times the reference compliance."""
        del setting
        return Basis(joint=diagonal(samples.load_torque() * samples.arm.reference.c_joint))

    def objection(self, theta: FloatArray, deviation: FloatArray, arm: Arm) -> str:
        """Refuse a joint that moves against its load."""
        del arm
        wrong = theta < -4.0 * deviation - 0.05
        return "a joint would move against its load" if bool(np.any(wrong)) else ""

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the stiffness; infinite for a joint that gives nothing."""
        with np.errstate(divide="ignore"):
            stiffness: FloatArray = 1.0 / (state.theta * arm.reference.c_joint)
        table: dict[str, Any] = {KEY: entry(KEY, stiffness)}
        unseen = unseen_joints(state.theta)
        if unseen:
            table["unobservable_joints"] = unseen
        return table

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the compliances of a stiffness table."""
        state = super().read(model, arm)
        with np.errstate(divide="ignore"):
            return State(1.0 / (state.theta * arm.reference.c_joint))
