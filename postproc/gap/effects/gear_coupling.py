"""One wrist joint turns another, because their gears run through each other."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, register

PAIRS = ((4, 5), (4, 6), (5, 6))
"""(driving, driven) joints."""


@register
class GearCoupling(Effect):
    """A wrong coupling ratio in the controller: dq5 = c q4, dq6 = c q4 + c q5."""

    name = "gear_coupling"
    title = "one wrist joint turns another"
    source = "hollow-shaft wrist: the motors of axes 5 and 6 sit before axis 4"
    action = "check the coupling factors of the wrist in the machine data"
    conditions = ("q4", "q5")
    layout = tuple((f"axis_{a}_to_{b}", 1) for a, b in PAIRS)
    parameter_list = tuple(Parameter(f"axis_{a}_to_{b}", 3e-4, joint=b) for a, b in PAIRS)
    """Three ratios [rad/rad]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn the driven joint by the angle of the driving one."""
        del setting
        joint = np.zeros((len(samples), 6, 3))
        for column, (driving, driven) in enumerate(PAIRS):
            joint[:, driven - 1, column] = samples.q[:, driving - 1]
        return Basis(joint=joint)
