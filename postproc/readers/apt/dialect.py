"""What may differ between dialects of APT/CL data.

Source of each rule: measured on files of the systems named, and NX's own description of the CIRCLE
record ("assuming a clockwise direction").
"""

from __future__ import annotations

import re
from dataclasses import field
from enum import Enum, auto

from postproc.records import dataclass


class ArcSense(Enum):
    """Which way a CIRCLE record turns about its written vector."""

    COUNTERCLOCKWISE = auto()
    CLOCKWISE = auto()
    WORD = auto()
    """As the record's last word says."""
    OPEN = auto()
    """As the neighbours show; systems differ, and nothing says which one wrote the file."""


class EighthField(Enum):
    """What field 8 of a CIRCLE record of 11 numbers is."""

    TOLERANCE = auto()
    SWEEP = auto()
    """The sweep in degrees."""
    EITHER = auto()
    """A sweep where it is too large for a tolerance."""


class AxisRule(Enum):
    """Tool axis of a GOTO that gives only a point."""

    KEEP = auto()
    """The last one given; (0, 0, 1) if none was."""
    SETUP = auto()
    """The third column of the current CSYS, whatever stood in the GOTO before."""


class DepthRule(Enum):
    """Sign of a drill cycle's depth against the tool axis."""

    BELOW = auto()
    """Positive = below the GOTO point."""
    SIGNED = auto()
    """Along the tool axis from the GOTO point: negative = into the part."""


class CycleGrammar(Enum):
    """How the parameters of a drill cycle are written."""

    WORDS = auto()
    """Minor words, each before its number."""
    CATIA = auto()
    """As WORDS, or numbers alone, whose meaning a table of the postprocessor gives."""
    HSM = auto()
    """As WORDS, or depth, unit, feed, clearance; minor words between."""
    SURFCAM = auto()
    """As WORDS, or depth, feed, unit, clearance."""
    UNKNOWN = auto()
    """As WORDS, or numbers in whatever order."""
    CAMWORKS = auto()
    """G98 or G99, then numbers in a fixed order."""


class Clear(Enum):
    """What the number of CLEAR in a drill cycle counts from."""

    ABOVE = auto()
    """The top of the hole."""
    ABSOLUTE = auto()
    """The origin, along the tool axis."""
    FROM_BOTTOM = auto()


@dataclass(frozen=True, slots=True)
class CycleRule:
    """What the levels of a drill cycle mean.

    ``goto_bottom``: the GOTO is the bottom of the hole, not its top. ``clear``: what CLEAR (and
    RETURN) count from. ``rapto_below``: RAPTO counts down from the clearance level, not up from the
    hole. ``safe``: without RTRCTO and RETURN the tool goes back to the clearance level.
    ``deep_breaks``: DEEP breaks chips and THRU retracts fully. ``proven``: the meaning is that of
    real files, not of posts and manuals alone.
    """

    goto_bottom: bool = False
    clear: Clear = Clear.ABOVE
    rapto_below: bool = False
    safe: bool = False
    deep_breaks: bool = False
    proven: bool = False


@dataclass(frozen=True, slots=True)
class Dialect:
    """What one system's files mean where systems differ.

    ``marks``: what the head of its files holds, with a weight. ``implied_units``: unit of length
    where no record tells. ``ends``: words one of which must end a complete file. ``origin_moves``:
    ORIGIN places the points. ``setup_plane``: points stand in a setup plane that TLAXIS and ROTABL
    tilt. ``feed_cancels_rapid``: a FEDRAT between RAPID and GOTO. ``blank_separates``: a blank may
    stand for a comma. ``axis_reset``: words at which the tool axis falls back to (0, 0, 1);
    ``off_is_upright``: so does MULTAX/OFF, which begins an operation along z (Autodesk's public
    post writes it so); else it keeps the last axis. ``turned_vectors``: a MOVARC turns
    counterclockwise about its vector, half a turn too.
    """

    name: str
    marks: tuple[tuple[re.Pattern[bytes], float], ...]
    arc_sense: ArcSense = ArcSense.COUNTERCLOCKWISE
    eighth_field: EighthField = EighthField.TOLERANCE
    axis_rule: AxisRule = AxisRule.KEEP
    off_is_upright: bool = False
    depth_rule: DepthRule = DepthRule.BELOW
    cycle_grammar: CycleGrammar = CycleGrammar.WORDS
    cycle_rule: CycleRule = CycleRule()
    implied_units: str | None = None
    ends: frozenset[str] = field(default_factory=lambda: frozenset({"FINI", "END"}))
    origin_moves: bool = False
    setup_plane: bool = False
    feed_cancels_rapid: bool = False
    blank_separates: bool = False
    axis_reset: frozenset[str] = frozenset()
    turned_vectors: bool = False
