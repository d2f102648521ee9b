"""Mass or centre of gravity at the tool is not what the model has."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Arm, Samples, first_moment_torque
from postproc.gap.effect import (
    Basis,
    Effect,
    Parameter,
    Setting,
    diagonal,
    per_joint,
    register,
)
from postproc.units import STANDARD_GRAVITY

_TOLD, _ASSUMED = 0.15, 0.4
"""Scatter of the joints' stiffness against each other, where a source gives it and where not."""


@register
class PayloadError(Effect):
    """A weight at the flange that the model does not have, through the joint stiffness.

    Extra mass, and its first moment in the flange (extra mass times centre of gravity, or a shift
    of the known mass). The stiffness is the cell's; where all of it is off, so is the mass, by
    the same factor. Where it is off from joint to joint, six more numbers say how much more or
    less mass each joint seems to feel; they are small against the mass.
    """

    name = "payload_error"
    title = "mass or centre of gravity at the tool is not what the model has"
    source = "J K^-1 times the torque of a weight in the flange"
    action = "weigh the tool, or let the controller determine the load data"
    conditions = ("orientation", "pose")
    has_tool_weight = True
    equilibrium = True
    layout = (("mass_kg", 1), ("moment_kgm", 3), ("joint_feels_kg", 6))

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return mass [kg], first moments [kg*m], what joints feel of more mass [kg].

        Usual sizes follow the arm's stiffness.
        """
        del setting
        mass = 3e-4 / (STANDARD_GRAVITY * arm.reach * float(arm.reference.c_joint[1])) / 3.0
        return (
            Parameter("mass", mass),
            *(Parameter(f"moment_{axis}", 0.3 * mass) for axis in "xyz"),
            *per_joint(mass * (_ASSUMED if "joint stiffness" in arm.reference.assumed else _TOLD)),
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn the joints by the torque of a kilogram, of a kilogram metre; then one by one."""
        del setting
        reference = samples.arm.reference
        at_flange = samples.flange()
        _, _, R_6_flange = samples.arm.link_constants()
        R_flange = samples.frames[:, 6, :3, :3] @ R_6_flange
        here = samples.weight_torque(at_flange, 6) * reference.c_joint
        joint = np.zeros((len(samples), 6, 10))
        joint[:, :, 0] = here
        aside = first_moment_torque(samples, R_flange, 6)
        joint[:, :, 1:4] = aside * reference.c_joint[:, None]
        joint[:, :, 4:] = diagonal(here)
        return Basis(joint=joint)
