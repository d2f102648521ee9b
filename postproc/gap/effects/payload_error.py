"""Mass or centre of gravity at the tool is not what the model has."""

from __future__ import annotations

import numpy as np

from postproc.frames import apply
from postproc.gap.dataset import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register
from postproc.units import STANDARD_GRAVITY


@register
class PayloadError(Effect):
    """A weight at the flange that the model does not have, through the joint stiffness.

    Four numbers: extra mass, and its first moment in the flange (extra mass times centre of
    gravity, or a shift of the known mass). The stiffness is the cell's; where it is off, so is
    the mass, by the same factor.
    """

    name = "payload_error"
    title = "mass or centre of gravity at the tool is not what the model has"
    source = "J K^-1 times the torque of a weight in the flange"
    action = "weigh the tool, or let the controller determine the load data"
    conditions = ("orientation", "pose")
    equilibrium = True
    layout = (("mass_kg", 1), ("moment_kgm", 3))

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return mass [kg] and first moments [kg*m]; usual sizes follow the arm's stiffness."""
        del setting
        origins, _, _ = arm.link_constants()
        reach = float(np.linalg.norm(origins[2] + origins[3] + origins[4]))
        mass = 3e-4 / (STANDARD_GRAVITY * reach * float(arm.reference.c_joint[1])) / 3.0
        return (
            Parameter("mass", mass),
            *(Parameter(f"moment_{axis}", 0.3 * mass) for axis in "xyz"),
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by the torque of one kilogram, and of one kilogram metre."""
        del setting
        reference = samples.arm.reference
        origins, _, R_6_flange = samples.arm.link_constants()
        flange = origins[6] - R_6_flange @ samples.arm.p_flange_point
        at_flange = apply(samples.frames[:, 6], flange)
        here = samples.weight_torque(at_flange, 6, reference.gravity)
        R_flange = samples.frames[:, 6, :3, :3] @ R_6_flange
        joint = np.zeros((len(samples), 6, 4))
        joint[:, :, 0] = here * reference.c_joint
        for k in range(3):
            there = samples.weight_torque(at_flange + R_flange[:, :, k], 6, reference.gravity)
            joint[:, :, 1 + k] = (there - here) * reference.c_joint
        return Basis(joint=joint)
