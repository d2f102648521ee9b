"""The spring that balances axis 2 pulls harder or softer than it should."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register


@register
class Counterbalance(Effect):
    """A torque on axis 2 that changes once per turn of axis 2.

    A spring between two points at fixed radii gives a torque k (s - s0) times its lever: once per
    turn, with a smaller part twice per turn. A part twice per turn that is not smaller is no
    spring.
    """

    name = "counterbalance"
    title = "the counterbalance of axis 2 pulls wrongly"
    source = "spring of length sqrt(a^2 + L^2 + 2 a L cos(q2 - phi)), first two harmonics"
    action = "check gas pressure and bearings of the counterbalance"
    conditions = ("q2",)
    layout = (("cosine_deg", 1), ("sine_deg", 1), ("cosine_2_deg", 1), ("sine_2_deg", 1))
    parameter_list = (
        Parameter("cosine", 2e-4, joint=2),
        Parameter("sine", 2e-4, joint=2),
        Parameter("cosine_2", 3e-5, joint=2, family="twice"),
        Parameter("sine_2", 3e-5, joint=2, family="twice"),
    )
    """The amplitudes of cos and sin of q2, then of 2 q2 [rad of joint 2]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn joint 2."""
        del setting
        q = samples.q[:, 1]
        joint = np.zeros((len(samples), 6, 4))
        joint[:, 1] = np.column_stack([np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)])
        return Basis(joint=joint)

    def objection(self, theta: FloatArray, deviation: FloatArray, arm: Arm) -> str:
        """Refuse a part twice per turn that is surely as large as the part once per turn."""
        once, twice = np.linalg.norm(theta[:2]), np.linalg.norm(theta[2:])
        doubt = np.hypot(np.linalg.norm(deviation[2:]), 0.6 * np.linalg.norm(deviation[:2]))
        surely = twice - 2.0 * doubt > 0.6 * once
        return "twice per turn more than once per turn" if surely else ""
