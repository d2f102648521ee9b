"""The encoder of a joint counts too much or too little for each turn."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Setting, diagonal, per_joint, register


@register
class EncoderScale(Effect):
    """A joint turns by a little more or less than commanded, in proportion to its angle.

    A gear ratio or an encoder resolution that is entered wrongly. Over a part of a turn a wave of
    two or more periods, a spring or the sag looks alike.
    """

    name = "encoder_scale"
    title = "a joint turns further or less far than commanded, in proportion to its angle"
    source = "dq = s q, s per joint"
    action = "check the gear ratio of the named axis in the machine data"
    conditions = ("joint angle",)
    is_rare = True
    layout = (("relative", 6),)
    parameter_list = per_joint(2e-4)
    """Six ratios [rad/rad]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint by its own angle."""
        del setting
        return Basis(joint=diagonal(samples.q))
