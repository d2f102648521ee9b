"""The give of a joint is not proportional to its load (an alternative, never named)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Kind, Parameter, Setting, register


@register
class NonlinearStiffness(Effect):
    """Even and cubic parts of a joint's give under load: hardening, softening, lost motion."""

    name = "nonlinear_stiffness"
    title = "behaves like a stiffness that depends on the load (hardening)"
    source = "dq = tau / K (1 + a |tau| + b tau^2)"
    action = "measure at three load levels, up and down, at the same poses"
    kind = Kind.ALTERNATIVE
    needs = ("wrench",)
    conditions = ("load",)
    refines = ("joint_compliance",)
    parameter_list = tuple(
        Parameter(f"joint_{i}_{way}", 0.2, joint=i)
        for way in ("root", "even", "cubic")
        for i in range(1, 7)
    )
    """For each joint three relative changes of its give."""

    def prepare(self, samples: Samples) -> Setting:
        """Return the usual torque of each joint [N*m]."""
        return {"torque": np.sqrt(np.mean(samples.load_torque() ** 2, axis=0)) + 1e-9}

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by powers of its torque."""
        torque = samples.load_torque()
        size = np.abs(torque) / setting["torque"]
        turn = torque * samples.arm.reference.c_joint
        joint = np.zeros((len(samples), 6, 18))
        for i in range(6):
            joint[:, i, i] = turn[:, i] / np.sqrt(size[:, i] + 0.05)
            joint[:, i, 6 + i] = turn[:, i] * size[:, i]
            joint[:, i, 12 + i] = turn[:, i] * size[:, i] ** 2
        return Basis(joint=joint)
