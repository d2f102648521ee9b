"""Levels of a drill cycle: where feed begins, where the tool ends, and whether that can be meant.

And what it says in turns of the spindle.

One vendor alone has four meanings of the number that stands for the clearance and three levels of
the GOTO, so a reading is shown and checked, not trusted.
"""

from __future__ import annotations

from dataclasses import replace
from math import isnan, nan

from postproc.model import Cycle, CycleKind
from postproc.readers.apt.dialect import Clear, CycleRule
from postproc.records import dataclass
from postproc.units import MM, MM_PER_MIN

READINGS = "--dialect NAME of the seat, or --cycle-words with the order of the numbers"
"""Options that settle a reading."""
_HIGH = 100.0 * MM
"""A feed that begins higher above the hole [m] is asked back."""
_SLOW = 10.0 * MM_PER_MIN
"""A slower drilling feed [m/s] is asked back."""
_ROUNDING = 1e-2 * MM
NAN = float("nan")


@dataclass(frozen=True, slots=True)
class Heights:
    """What a cycle says about its levels [m]; NaN where it says nothing.

    ``clearance``: above the point; ``clear``, ``rapto``, ``retract``, ``back``: the numbers of
    CLEAR, RAPTO, RTRCTO and RETURN, in the meaning of the seat's ``rule``.
    """

    rule: CycleRule
    depth: float
    clearance: float = NAN
    clear: float = NAN
    rapto: float = NAN
    retract: float = NAN
    back: float = NAN

    @property
    def needs_level(self) -> bool:
        """Whether the levels depend on where the hole lies."""
        absolute = self.rule.clear is Clear.ABSOLUTE
        return isnan(self.clearance) and (
            self.rule.goto_bottom or (absolute and not (isnan(self.clear) and isnan(self.back)))
        )

    def above(self, top: float) -> tuple[float, float]:
        """Return where feed begins and the tool ends, above the top (along the tool axis) [m]."""
        plane = self.clear
        back = self.back
        if self.rule.clear is Clear.ABSOLUTE:
            plane, back = plane - top, back - top
        elif self.rule.clear is Clear.FROM_BOTTOM:
            plane -= self.depth
        rapto = plane - self.rapto if self.rule.rapto_below else self.rapto
        feed = _first(self.clearance, rapto, self.retract if self.rule.safe else NAN, plane)
        ends = _first(self.retract, back, plane if self.rule.safe else NAN, feed)
        return feed, ends


def _first(*values: float) -> float:
    """Return the first value that is known, NaN if none is."""
    return next((value for value in values if not isnan(value)), NAN)


def doubts(cycle: Cycle, feed: float, ends: float) -> list[str]:
    """Return what can hardly be meant; feed begins and the tool ends so far above the top [m]."""
    found = []
    if feed < -_ROUNDING:
        found.append(f"the feed begins {-feed / MM:g} mm below the surface")
    if ends < -_ROUNDING:
        found.append(f"the tool ends {-ends / MM:g} mm below the surface")
    if feed > _HIGH:
        found.append(f"the feed begins {feed / MM:g} mm above the hole")
    if cycle.feed < _SLOW:
        found.append(f"the feed is {cycle.feed / MM_PER_MIN:g} mm/min")
    return found


def reading(cycle: Cycle, feed: float, ends: float, top: float = NAN) -> str:
    """Return how a cycle was read, in words; with the levels of its first hole where known [m]."""
    speed = "the feed in force" if isnan(cycle.feed) else f"{cycle.feed / MM_PER_MIN:g} mm/min"
    text = (
        f"read as a {cycle.kind} cycle {cycle.depth / MM:g} mm deep at {speed}, feed from "
        f"{feed / MM:g} mm above the hole, back to {ends / MM:g} mm"
    )
    if isnan(top):
        return text
    levels = (top + feed, top, top - cycle.depth, top + ends)
    approach, surface, bottom, back = (f"{level / MM:g}" for level in levels)
    return (
        f"{text}; first hole, heights along the tool axis: approach {approach}, surface "
        f"{surface}, bottom {bottom}, retract {back} mm"
    )


def with_levels(cycle: Cycle, feed: float, ends: float) -> Cycle:
    """Return a cycle with its levels [m], none of them below the hole."""
    return replace(cycle, clearance=max(feed, 0.0), retract=max(ends, 0.0))


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
