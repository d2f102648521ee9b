"""The dialects of APT/CL data as small declared differences, and how a file's dialect is found.

Source of each rule: measured on files of the systems named, and NX's own description of the CIRCLE
record ("assuming a clockwise direction").
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum, auto

from postproc.errors import UsageError


class ArcSense(Enum):
    """Which way a CIRCLE record turns about its written vector."""

    COUNTERCLOCKWISE = auto()
    CLOCKWISE = auto()
    WORD = auto()
    """As the record's last word says."""


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
    WORDS_OR_NUMBERS = auto()
    """As WORDS, or numbers alone, whose meaning a table of the postprocessor gives."""
    CAMWORKS = auto()
    """G98 or G99, then numbers in a fixed order."""


@dataclass(frozen=True, slots=True)
class Dialect:
    """What one system's files mean where systems differ.

    ``marks``: what the head of its files holds, with a weight. ``implied_units``: unit of length
    where no record tells. ``ends``: words one of which must end a complete file. ``setup_plane``:
    points stand in a setup plane that TLAXIS and ROTABL tilt. ``feed_cancels_rapid``: a FEDRAT
    between RAPID and GOTO. ``blank_separates``: a blank may stand for a comma. ``axis_reset``:
    words at which the tool axis falls back to (0, 0, 1).
    """

    name: str
    marks: tuple[tuple[re.Pattern[bytes], float], ...]
    arc_sense: ArcSense = ArcSense.COUNTERCLOCKWISE
    axis_rule: AxisRule = AxisRule.KEEP
    depth_rule: DepthRule = DepthRule.BELOW
    cycle_grammar: CycleGrammar = CycleGrammar.WORDS
    implied_units: str | None = None
    ends: frozenset[str] = field(default_factory=lambda: frozenset({"FINI", "END"}))
    setup_plane: bool = False
    feed_cancels_rapid: bool = False
    blank_separates: bool = False
    axis_reset: frozenset[str] = frozenset()


def _marks(*pairs: tuple[bytes, float]) -> tuple[tuple[re.Pattern[bytes], float], ...]:
    flags = re.MULTILINE | re.IGNORECASE
    return tuple((re.compile(pattern, flags), weight) for pattern, weight in pairs)


_SLASH = rb"[ \t]*/"

DIALECTS = {
    dialect.name: dialect
    for dialect in (
        Dialect(
            "nx",
            _marks(
                (rb"^[ \t]*TOOL PATH" + _SLASH, 3.0),
                (rb"^[ \t]*(TLDATA|MSYS)" + _SLASH, 2.0),
                (rb"^[ \t]*(PAINT" + _SLASH + rb"|END-OF-PATH)", 2.0),
            ),
            arc_sense=ArcSense.CLOCKWISE,
            depth_rule=DepthRule.SIGNED,
            implied_units="mm",
            ends=frozenset({"END-OF-PATH", "FINI"}),
            feed_cancels_rapid=True,
            axis_reset=frozenset({"TOOL PATH"}),
        ),
        Dialect(
            "solidworks",
            _marks(
                (rb"^[ \t]*CSI_", 4.0),
                (rb"^[ \t]*TRNTYP" + _SLASH, 2.0),
                (rb"^[ \t]*CSYS" + _SLASH, 1.0),
                (rb"^[ \t]*UNIT" + _SLASH, 0.5),
            ),
            axis_rule=AxisRule.SETUP,
        ),
        Dialect(
            "creo",
            _marks((rb"^\$\$\*[ \t]*PRO/CLFILE", 5.0), (rb"^\$\$->", 3.0)),
        ),
        Dialect(
            "catia",
            _marks(
                (rb"^\$\$\*CATIA", 5.0),
                (rb"CATIA", 1.0),
                (rb"^[ \t]*TLON[ \t]*,", 2.0),
                (rb"^[ \t]*(MULTAX|TPRINT|LOADTL)", 0.5),
            ),
            cycle_grammar=CycleGrammar.WORDS_OR_NUMBERS,
            implied_units="mm",
        ),
        Dialect(
            "camworks",
            _marks(
                (rb"^[ \t]*OPFEAT(START|END)" + _SLASH, 4.0),
                (rb"^[ \t]*MOVE_ATTRIB" + _SLASH, 3.0),
                (rb"^[ \t]*ROTABL" + _SLASH, 0.5),
                (rb"(COUNTER)?CLOCKWISE[ \t]*\r?$", 2.0),
                (rb"^[ \t]*CYCLE" + _SLASH + rb"[ \t]*ON[ \t]*\r?$", 1.0),
            ),
            arc_sense=ArcSense.WORD,
            cycle_grammar=CycleGrammar.CAMWORKS,
            setup_plane=True,
            blank_separates=True,
        ),
        Dialect("apt", (), cycle_grammar=CycleGrammar.WORDS_OR_NUMBERS),
    )
}
"""All dialects by name; ``apt`` is the plain language, used where no mark of a system is found."""


def dialect_of(head: bytes, forced: str | None) -> Dialect:
    """Return the dialect that was asked for, else the one whose marks the head holds.

    Raises:
        UsageError: APT090 if the dialect asked for is unknown.
    """
    if forced is not None:
        if forced not in DIALECTS:
            known = ", ".join(sorted(DIALECTS))
            raise UsageError("APT090", f"no APT dialect {forced!r}, known are {known}")
        return DIALECTS[forced]
    best = DIALECTS["apt"]
    best_score = 0.9
    for dialect in DIALECTS.values():
        score = sum(weight for mark, weight in dialect.marks if mark.search(head))
        if score > best_score:
            best, best_score = dialect, score
    return best
