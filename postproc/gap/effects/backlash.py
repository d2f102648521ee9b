"""Lost motion in the gears: the joint rests on the flank that it came from."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Setting, diagonal, per_joint, register


@register
class Backlash(Effect):
    """Half the gap of each gear against the direction of the joint's last motion.

    The arm stays behind: a joint that came from below rests below its commanded angle. The sign
    is left free, some controllers over-compensate.
    """

    name = "backlash"
    title = "backlash: the reading depends on the side a joint came from"
    source = "reversal error, half gap times sign of the last motion"
    action = "approach from one side, or enter the reversal error in the controller"
    needs = ("direction",)
    conditions = ("approach",)
    layout = (("half_gap_deg", 6),)
    parameter_list = per_joint(1.5e-4)
    """Six half gaps [rad], positive in the direction of the last motion."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint towards where its last motion went."""
        del setting
        return Basis(joint=diagonal(samples.column("direction")))
