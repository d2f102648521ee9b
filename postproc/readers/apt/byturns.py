"""What a drill cycle says in turns of the spindle."""

from __future__ import annotations

from dataclasses import replace
from math import isnan, nan

from postproc.model import Cycle, CycleKind
from postproc.records import dataclass

LEFT = {CycleKind.TAP: CycleKind.TAP_LEFT, CycleKind.RIGID_TAP: CycleKind.RIGID_TAP_LEFT}
"""Taps whose hand the spindle decides, and what they are where it turns counterclockwise."""


@dataclass(frozen=True, slots=True)
class ByTurns:
    """What a cycle says in turns of the spindle, whose speed its holes tell; NaN: nothing.

    ``feed``, ``pitch`` [m a turn]; ``dwell`` [turns]; ``has_hand``: a tap of the spindle's hand.
    """

    feed: float = nan
    pitch: float = nan
    dwell: float = nan
    has_hand: bool = False

    def __bool__(self) -> bool:
        """Return whether the spindle matters at all."""
        return self.has_hand or not (isnan(self.feed) and isnan(self.pitch) and isnan(self.dwell))

    def at(self, cycle: Cycle, turns: float) -> Cycle:
        """Return the cycle at a spindle speed [turns/s], negative counterclockwise."""
        feed = cycle.feed
        lead = self.pitch if isnan(self.feed) else self.feed
        if isnan(feed) and not isnan(lead):
            feed = lead * abs(turns)
        return replace(
            cycle,
            kind=LEFT[cycle.kind] if self.has_hand and turns < 0.0 else cycle.kind,
            feed=feed,
            dwell=cycle.dwell if isnan(self.dwell) else self.dwell / abs(turns),
        )
