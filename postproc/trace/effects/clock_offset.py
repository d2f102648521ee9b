"""The tracker's clock is not the controller's: a fault of the measurement, not of the arm."""

from __future__ import annotations

import math

from postproc.trace.effect import TOOL, WHOLE, register
from postproc.trace.effects.controller_delay import ControllerDelay


@register
class ClockOffset(ControllerDelay):
    """The measured tool point, stamped so much later than it was there."""

    name = "clock_offset"
    title = "the clock of the tracker is late against that of the controller"
    action = "trigger the tracker by an output of the controller"
    stages = (TOOL, WHOLE)
    rivals = ("controller_delay", "servo_lag")
    keys = ("offset_ms",)
    usual = 1.0
    """A second: nobody sets two clocks closer by hand."""
    most = math.inf
