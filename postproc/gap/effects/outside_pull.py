"""Something pulls at the flange that nobody logged (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Arm, Samples
from postproc.gap.effect import (
    SYMMETRIC,
    Basis,
    Effect,
    Kind,
    Parameter,
    Setting,
    centre_and_extent,
    from_centre,
    register,
    symmetric,
)
from postproc.units import STANDARD_GRAVITY


@register
class OutsidePull(Effect):
    """A force on the flange that changes with its place, as of a hose, a cable or a balancer.

    Constant part (three numbers) and a linear spring to a place at rest (six), through the joint
    stiffness of the cell. Without it a pull is explained by link geometry and waves.
    """

    name = "outside_pull"
    title = "behaves like a hose or cable that pulls at the flange"
    source = "J K^-1 times the torque of f0 + S (p_flange - p0)"
    action = "hang the hose package free, or measure again without it"
    kind = Kind.ALTERNATIVE
    conditions = ("position", "pose")

    def prepare(self, samples: Samples) -> Setting:
        """Return the centre [m] and the extent [m] of the flange's places."""
        return centre_and_extent(samples.flange())

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return forces [N]; their usual size follows from the arm's stiffness."""
        del setting
        size = 1e-4 / (arm.reach**2 * float(arm.reference.c_joint[1]))
        size = min(size, 100.0 * STANDARD_GRAVITY)
        names = ("x", "y", "z", *("".join("xyz"[k] for k in pair) for pair in SYMMETRIC))
        return tuple(Parameter(f"pull_{name}", size) for name in names)

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by the torque of one newton, constant or at the usual distance."""
        flange = samples.flange()
        away = from_centre(flange, setting)
        lever = flange[:, None, :] - samples.frames[:, 1:, :3, 3]
        push = np.cross(np.swapaxes(samples.axes, 1, 2), lever)
        push = push * samples.arm.reference.c_joint[:, None]
        return Basis(joint=np.concatenate([push, push @ symmetric(away)], axis=2))
