"""The zero positions of the joints are off (mastering)."""

from __future__ import annotations

import numpy as np

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Setting, diagonal, per_joint, register


@register
class JointOffset(Effect):
    """A constant added to each joint angle."""

    name = "joint_offset"
    title = "joint zero positions (mastering) are off"
    source = "joint 1 is confounded with the base, joint 6 with the tool"
    action = "master the named axes again, or enter the offsets in the controller"
    conditions = ("pose",)
    geometric = True
    is_common = True
    layout = (("offset_deg", 6),)
    parameter_list = per_joint(3e-4)
    """Six offsets [rad]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by one radian per unit."""
        del setting
        return Basis(joint=diagonal(np.ones((len(samples), 6))))
