"""The joints run behind their command while they move."""

from __future__ import annotations

from postproc.gap.data import Samples
from postproc.gap.effect import Basis, Effect, Setting, diagonal, per_joint, register


@register
class ServoLag(Effect):
    """Each joint is a constant time behind its command."""

    name = "servo_lag"
    title = "the joints run behind their command while moving"
    source = "q_actual = q_command - T qd"
    action = "measure at standstill, lower the feed, or tune the drives"
    needs = ("qd",)
    conditions = ("speed",)
    layout = (("lag_s", 6),)
    parameter_list = per_joint(2e-3)
    """Six times [s]."""

    def basis(self, samples: Samples, setting: Setting) -> Basis:
        """Turn each joint back by its speed times one second."""
        del setting
        return Basis(joint=diagonal(-samples.column("qd")))
