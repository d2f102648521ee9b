"""The joints give way under an outside load."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import (
    Basis,
    Effect,
    Setting,
    State,
    Table,
    diagonal,
    per_joint,
    register,
)
from postproc.model import ModelFile, entry
from postproc.stiffness import (
    STIFFNESS,
    ConstantField,
    Locate,
    StiffnessField,
    constant_of,
    constant_table,
)


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
    layout = ((STIFFNESS, 6),)
    parameter_list = per_joint(1.0, lower=0.0)
    """Six relative compliances, never negative."""

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
        return constant_table(state.theta * arm.reference.c_joint)

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the compliances of a stiffness table."""
        state = super().read(model, arm)
        with np.errstate(divide="ignore"):
            return State(1.0 / (state.theta * arm.reference.c_joint))

    def stiffness(self, model: ModelFile, locate: Locate | None) -> StiffnessField:
        """Return the one stiffness of each joint."""
        del locate
        return ConstantField(constant_of(model, self.name))

    def stiffness_table(self, field: StiffnessField, c_mean: FloatArray) -> Table:
        """Return the constant part; beside a field it is its mean."""
        del field
        return constant_table(c_mean)

    def completed(self, table: Table, joint_stiffness: FloatArray | None) -> Table:
        """Return the table with the cell's stiffness of joints that the data could not see.

        The process may load a joint although the measurement did not, and rigid would be worse.
        """
        k = np.asarray(table.get(STIFFNESS), dtype=np.float64)
        if joint_stiffness is None or k.shape != (6,) or not bool(np.any(np.isnan(k))):
            return table
        filled = np.where(np.isnan(k), entry(STIFFNESS, joint_stiffness), k)
        return {**table, STIFFNESS: filled.tolist()}
