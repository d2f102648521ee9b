"""The spring that balances axis 2 pulls harder or softer than it should."""

from __future__ import annotations

import numpy as np

from postproc.gap.dataset import Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register


@register
class Counterbalance(Effect):
    """A torque on axis 2 that changes once per turn of axis 2.

    A spring between two points at fixed radii gives a torque k (s - s0) times its lever, which
    is once per turn to a few percent.
    """

    name = "counterbalance"
    title = "the counterbalance of axis 2 pulls wrongly"
    source = "spring of length sqrt(a^2 + L^2 + 2 a L cos(q2 - phi)), first harmonic"
    action = "check gas pressure and bearings of the counterbalance"
    conditions = ("q2",)
    layout = (("cosine_deg", 1), ("sine_deg", 1))

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return the amplitudes of cos(q2) and sin(q2) [rad of joint 2]."""
        del arm, setting
        return (
            Parameter("cosine", 2e-4, joint=2),
            Parameter("sine", 2e-4, joint=2),
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn joint 2."""
        del setting
        joint = np.zeros((len(samples), 6, 2))
        joint[:, 1, 0] = np.cos(samples.q[:, 1])
        joint[:, 1, 1] = np.sin(samples.q[:, 1])
        return Basis(joint=joint)
