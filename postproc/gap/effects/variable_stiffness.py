"""Joint stiffness that changes with the configuration."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, State, Table, register
from postproc.model import ModelFile
from postproc.stiffness import (
    Locate,
    StiffnessField,
    constant_of,
    field_table,
    is_field_table,
    whole_field,
)
from postproc.units import MM

TERMS = ("cos1", "sin1", "cos2", "sin2", "x", "y", "z", "mean")
"""Per joint: first and second harmonic of its own angle, linear in the place of the tool point,
and the small shift of the mean that a varying stiffness has against its average."""
_TYPICAL = (0.3, 0.3, 0.15, 0.15, 0.15, 0.15, 0.15, 0.05)


@register
class VariableStiffness(Effect):
    """Relative change of each joint's compliance: own angle, and place of the tool point.

    A grid over space alone explains nothing of a stiffness that follows the joints' own angles.
    The constant part is another effect, ``joint_compliance``. A table that ``postproc identify``
    wrote (kind grid or joint_space) holds the whole stiffness: it is one number, 1, times what
    its field gives beyond that constant.
    """

    name = "variable_stiffness"
    title = "joint stiffness changes with the configuration"
    source = "Jiao et al. 2022, Section 2 (space grid); own-angle terms of our own"
    action = "identify the stiffness per region (postproc identify --grid) and compensate"
    needs = ("wrench",)
    conditions = ("load", "pose")
    refines = ("joint_compliance",)
    equilibrium = True

    def prepare(self, samples: Samples) -> Setting:
        """Return centre and width of the measured points [m] and the mean of every term.

        The means are weighted by what each row says about the joint's give, so that a change of
        the mean is left to ``joint_compliance``.
        """
        centre = np.median(samples.point, axis=0)
        width = float(np.std(samples.point - centre) + MM)
        said = samples.load_torque()[:, None, :] * samples.jacobian
        weight = np.sum(said**2, axis=1) + 1e-12
        mean = np.stack(
            [
                np.average(_terms(samples, i, centre, width), axis=0, weights=weight[:, i])
                for i in range(6)
            ]
        )
        mean[:, -1] = 0.0
        return {"centre": centre, "width": width, "mean": mean}

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return eight relative changes for each joint."""
        del arm
        if "field" in setting:
            return (Parameter("field", 1.0),)
        return tuple(
            Parameter(f"joint_{joint}_{term}", typical, joint=joint, family=term[-1])
            for joint in range(1, 7)
            for term, typical in zip(TERMS, _TYPICAL, strict=True)
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its torque times the change of its compliance."""
        if "field" in setting:
            excess = setting["field"].compliance(samples.q, samples.point) - setting["constant"]
            return Basis(joint=(samples.load_torque() * excess)[:, :, None])
        turn = samples.load_torque() * samples.arm.reference.c_joint
        joint = np.zeros((len(samples), 6, 6 * len(TERMS)))
        for i in range(6):
            terms = _terms(samples, i, setting["centre"], setting["width"]) - setting["mean"][i]
            start = i * len(TERMS)
            joint[:, i, start : start + len(TERMS)] = turn[:, i, None] * terms
        return Basis(joint=joint)

    def write(self, state: State, arm: Arm) -> dict[str, Any]:
        """Return the relative changes, one row a joint, and the reference they are relative to."""
        if "field" in state.setting:
            return dict(state.setting["table"])
        table = np.nan_to_num(state.theta).reshape(6, len(TERMS))
        return {
            "kind": "terms",
            "terms": list(TERMS),
            "relative_compliance": table.tolist(),
            "reference_deg_per_Nm": np.degrees(arm.reference.c_joint).tolist(),
            "centre_mm": (np.asarray(state.setting["centre"]) / MM).tolist(),
            "width_mm": state.setting["width"] / MM,
            "term_mean": np.asarray(state.setting["mean"]).tolist(),
        }

    def read(self, model: ModelFile, arm: Arm) -> State:
        """Return the state; changes relative to another reference are scaled.

        A field (per cell or in joint space, as ``identify`` writes it) holds the whole stiffness;
        here it counts as the change against the constant of ``joint_compliance``.
        """
        if is_field_table(model.effects[self.name]):
            return State(np.ones(1), self._field_setting(model))
        keys = (
            *("relative_compliance", "reference_deg_per_Nm", "centre_mm", "width_mm"),
            "term_mean",
        )
        model.require_known(self.name, [*keys, "terms", "kind"])
        change = model.values(self.name, keys[0], (6, len(TERMS)))
        reference = model.values(self.name, keys[1], (6,))
        centre = model.values(self.name, keys[2], (3,))
        width = model.values(self.name, keys[3])
        mean = model.values(self.name, keys[4], (6, len(TERMS)), optional=True)
        setting = {
            "centre": centre,
            "width": float(np.asarray(width)),
            "mean": np.zeros((6, len(TERMS))) if mean is None else mean,
        }
        scale = np.asarray(reference) / arm.reference.c_joint
        theta = np.asarray(change) * scale[:, None]
        return State(theta.ravel(), setting)

    def is_fixed(self, setting: Setting) -> bool:
        """Return whether the setting is a whole field, of which no number is left to fit."""
        return "field" in setting

    def stiffness(self, model: ModelFile, locate: Locate | None) -> StiffnessField | None:
        """Return the field of a table that holds the whole stiffness."""
        if not is_field_table(model.effects[self.name]):
            return None
        return whole_field(model, self.name, locate)

    def stiffness_table(self, field: StiffnessField, c_mean: FloatArray) -> Table | None:
        """Return the table of a field over the workspace."""
        del c_mean
        return field_table(field)

    def _field_setting(self, model: ModelFile) -> Setting:
        """Return field, constant part (6,) [rad/(N*m)] that another effect has, and the table."""
        constant = np.zeros(6)
        for name in self.refines:
            if name in model.effects:
                constant = np.nan_to_num(constant_of(model, name), nan=0.0)
        # a joint that the field does not know keeps the constant, so nothing comes on top of it
        known = np.where(constant > 0.0, 1.0 / np.where(constant > 0.0, constant, 1.0), np.inf)
        field = whole_field(model, self.name).with_fallback(known)
        return {"field": field, "constant": constant, "table": model.effects[self.name]}


def _terms(samples: Samples, joint: int, centre: FloatArray, width: float) -> FloatArray:
    """Return (n, 8) the terms of one joint (0..5)."""
    q = samples.q[:, joint]
    place = (samples.point - centre) / width
    harmonic = (np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q))
    return np.column_stack([*harmonic, place, np.ones(len(q))])
