"""The tracker's clock is not the controller's: a fault of the measurement, not of the arm."""

from __future__ import annotations

import math

from postproc.arrays import FloatArray
from postproc.trace.effect import TOOL, WHOLE, register
from postproc.trace.effects.controller_delay import ControllerDelay


@register
class ClockOffset(ControllerDelay):
    """The measured tool point, stamped so much later [s] than it was there.

    No share of neighbours beside it: it is told from motors' angles, whose noise a mean of
    neighbours takes off in every record.
    """

    name = "clock_offset"
    title = "the clock of the tracker is late against that of the controller"
    action = "trigger the tracker by an output of the controller"
    stages = (TOOL, WHOLE)
    rivals = ("controller_delay", "servo_lag")
    keys = ("offset_ms",)
    is_kept = False
    has_share = False
    usual = 1.0
    """A second: nobody sets two clocks closer by hand."""
    most = math.inf

    def late(self, theta: FloatArray) -> float:
        """Return the offset."""
        return float(theta[0])
