"""The joints go on giving under a load for minutes, and come back as slowly."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import FADES, Arm, Samples
from postproc.gap.effect import Basis, Effect, Parameter, Setting, diagonal, register


@register
class LoadCreep(Effect):
    """A spring with a damper in each joint: it follows the torque with a delay.

    Three delays of fixed length together stand for any between them. What a joint gives at once is
    another effect, ``joint_compliance``. A load counts from the reading before the one that it was
    logged at.
    """

    name = "load_creep"
    title = "the joints go on giving under a load for minutes"
    source = "dq = C s, T ds/dt = torque - s (Kelvin and Voigt), T of 300, 900 and 2700 s"
    action = "wait equally long under load before each reading; see to the grease of the gears"
    needs = ("past",)
    conditions = ("load", "time")
    is_rare = True
    layout = tuple((f"after_{fade:.0f}_s_deg_per_Nm", 6) for fade in FADES)

    def parameters(self, arm: Arm, setting: Setting) -> tuple[Parameter, ...]:
        """Return what each joint gives with each delay [rad/(N*m)], never negative."""
        del setting
        usual = 2.0 * arm.reference.c_joint
        return tuple(
            Parameter(f"joint_{i + 1}_after_{fade:.0f}_s", float(usual[i]), 0.0, joint=i + 1)
            for fade in FADES
            for i in range(6)
        )

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by what its torque has left of earlier loads."""
        del setting
        past = samples.column("past").reshape(len(samples), len(FADES), 6)
        joint = [diagonal(past[:, k]) for k in range(len(FADES))]
        return Basis(joint=np.concatenate(joint, axis=2))
