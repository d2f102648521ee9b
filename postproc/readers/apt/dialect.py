"""What may differ between dialects of APT/CL data, and the seats whose files are known.

The first five seats are measured on real files. Fusion's arcs and moves are too; its cycles and the
other seats are declared from their posts and manuals.

Source of each rule: measured on files of the systems named, and NX's own description of the CIRCLE
record ("assuming a clockwise direction").
"""

from __future__ import annotations

import re
from dataclasses import field, replace
from enum import Enum, auto

from postproc.errors import UsageError
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
    stand for a comma. ``axis_of_setup``: a GOTO that gives only a point has the third column of the
    current CSYS as its tool axis, not the last axis given. ``signed_depth``: that of a drill
    cycle counts along the tool axis, negative into the part, not below the point.
    ``axis_reset``: words at which the tool axis falls back to (0, 0, 1); ``off_is_upright``: so
    does MULTAX/OFF, which begins an operation along z (Autodesk's public post writes it so);
    else it keeps the last axis. ``turned_vectors``: a MOVARC turns counterclockwise about its
    vector, half a turn too.
    """

    name: str
    marks: tuple[tuple[re.Pattern[bytes], float], ...]
    arc_sense: ArcSense = ArcSense.COUNTERCLOCKWISE
    eighth_field: EighthField = EighthField.TOLERANCE
    axis_of_setup: bool = False
    off_is_upright: bool = False
    signed_depth: bool = False
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
            cycle_rule=CycleRule(proven=True),
            arc_sense=ArcSense.CLOCKWISE,
            signed_depth=True,
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
            cycle_rule=CycleRule(proven=True),
            axis_of_setup=True,
        ),
        Dialect(
            "creo",
            _marks((rb"^\$\$\*[ \t]*PRO/CLFILE", 5.0), (rb"^\$\$->", 3.0)),
            cycle_rule=CycleRule(proven=True),
        ),
        Dialect(
            "catia",
            _marks(
                (rb"^\$\$\*CATIA", 5.0),
                (rb"CATIA", 1.0),
                (rb"^[ \t]*TLON[ \t]*,", 2.0),
                (rb"^[ \t]*(MULTAX|TPRINT|LOADTL)", 0.5),
            ),
            cycle_grammar=CycleGrammar.CATIA,
            origin_moves=True,
            implied_units="mm",
        ),
        Dialect(
            "camworks",
            _marks(
                (rb"^[ \t]*OPFEAT(START|END)" + _SLASH, 4.0),
                (rb"^[ \t]*MOVE_ATTRIB" + _SLASH, 3.0),
                (rb"^[ \t]*ROTABL" + _SLASH, 0.5),
                (rb"(COUNTER)?CLOCKWISE[ \t]*\r?$", 2.0),
                (rb"^[ \t]*CYCLE" + _SLASH + rb"[ \t]*ON[ \t]*\r?$", 0.5),
            ),
            cycle_rule=CycleRule(proven=True),
            arc_sense=ArcSense.WORD,
            cycle_grammar=CycleGrammar.CAMWORKS,
            setup_plane=True,
            blank_separates=True,
        ),
        Dialect(
            "fusion",
            _marks(
                (rb"^[ \t]*PARTNO" + _SLASH + rb"[ \t]*'", 2.0),
                (rb"^[ \t]*PPRINT" + _SLASH + rb"[ \t]*'", 1.0),
                (rb"^[ \t]*MOVARC" + _SLASH + rb"[^'\n]*,[ \t]*ANGLE", 2.0),
                (rb"^[ \t]*MODE" + _SLASH + rb"[ \t]*MILL", 0.5),
                (rb"^[ \t]*MULTAX" + _SLASH + rb"[ \t]*OFF", 0.3),
                (rb"^[ \t]*LOADTL" + _SLASH + rb"[ \t]*\d+, 0, ", 1.0),
            ),
            cycle_grammar=CycleGrammar.HSM,
            off_is_upright=True,
            cycle_rule=CycleRule(
                goto_bottom=True, clear=Clear.ABSOLUTE, rapto_below=True, safe=True
            ),
        ),
        Dialect(
            "hsmworks",
            _marks(
                (rb"^[ \t]*LOADTL" + _SLASH + rb"[ \t]*\d+[ \t]*,[ \t]*IN[ \t]*,", 9.0),
                (rb"^[ \t]*CUTCOM" + _SLASH + rb"[ \t]*ON[ \t]*,[ \t]*(LEFT|RIGHT)", 2.0),
            ),
            cycle_grammar=CycleGrammar.HSM,
            off_is_upright=True,
            cycle_rule=CycleRule(clear=Clear.FROM_BOTTOM, rapto_below=True, safe=True),
        ),
        Dialect(
            "mfgsuite",
            _marks(
                (rb"^[ \t]*MCSYS" + _SLASH, 5.0),
                (rb"^[ \t]*MOVARC" + _SLASH + rb"[ \t]*CENTER", 4.0),
                (rb"^[ \t]*(OPNAME|APPLY|ARCSLP)" + _SLASH, 3.0),
                (rb"^[ \t]*LOAD" + _SLASH + rb"[^\n]*NEXTTL", 3.0),
                (rb"^[ \t]*(MATERL|TCP|CLAMP)" + _SLASH, 1.0),
            ),
            cycle_rule=CycleRule(rapto_below=True, safe=True),
        ),
        Dialect(
            "camplete",
            _marks((rb"^[ \t]*MCS" + _SLASH, 8.0), (rb"^[ \t]*CSI_", 1.0)),
            eighth_field=EighthField.SWEEP,
            arc_sense=ArcSense.CLOCKWISE,
            off_is_upright=True,
            cycle_rule=CycleRule(clear=Clear.ABSOLUTE, safe=True),
        ),
        Dialect(
            "manusnc",
            _marks(
                (rb"^[ \t]*MCS" + _SLASH, 8.0),
                (rb"^[ \t]*MCS2" + _SLASH, 6.0),
                (rb"^[ \t]*START" + _SLASH + rb"[ \t]*'OPERATION", 6.0),
                (rb"^[ \t]*OPERATION" + _SLASH + rb"[ \t]*END", 4.0),
                (rb"^[ \t]*ZERO" + _SLASH, 2.0),
            ),
            eighth_field=EighthField.SWEEP,
            arc_sense=ArcSense.CLOCKWISE,
            off_is_upright=True,
            cycle_rule=CycleRule(clear=Clear.ABSOLUTE, safe=True),
        ),
        Dialect(
            "postworks",
            _marks(
                (rb"CIRCLE" + _SLASH + rb"[ \t]*CANON", 6.0),
                (rb"^[ \t]*(INDIRP|CLRSRF|PLUNGE|RETRCT)\b", 2.0),
                (rb"^[ \t]*LOADTL" + _SLASH + rb"[ \t]*\d+[ \t]*,[ \t]*(LENGTH|OFFSET)", 2.0),
            ),
            cycle_rule=CycleRule(deep_breaks=True),
        ),
        Dialect("surfcam", _marks((rb"SURFCAM", 2.0)), cycle_grammar=CycleGrammar.SURFCAM),
        Dialect(
            "apt",
            (),
            arc_sense=ArcSense.OPEN,
            eighth_field=EighthField.EITHER,
            cycle_grammar=CycleGrammar.UNKNOWN,
        ),
    )
}
"""All dialects by name; ``apt`` is the plain language, used where no mark of a system is found."""
_TURNED_VECTORS = tuple(
    mark
    for mark, _ in _marks(
        (rb"^[ \t]*MODE" + _SLASH + rb"[ \t]*(MILL|TURN)", 1.0),
        (rb"^[ \t]*PARTNO" + _SLASH + rb"[ \t]*'", 1.0),
        (rb"^[ \t]*MOVARC" + _SLASH + rb"([^\n]*,)?[ \t]*-?\d+\.0*[ \t]*,[^\n]*ANGLE", 1.0),
    )
)
"""Marks of Autodesk's post of 2019 and later: it writes whole numbers with their point, those of
2011 without, and turns the vector of a clockwise arc over, which those do not."""


def dialect_of(head: bytes, forced: str | None) -> Dialect:
    """Return the dialect that was asked for, else the one whose marks the head holds."""
    turned = all(mark.search(head) for mark in _TURNED_VECTORS)
    if forced is not None:
        if forced not in DIALECTS:
            known = ", ".join(sorted(DIALECTS))
            raise UsageError("APT090", f"no APT dialect {forced!r}, known are {known}")
        return replace(DIALECTS[forced], turned_vectors=turned)
    best = DIALECTS["apt"]
    best_score = 0.9
    for dialect in DIALECTS.values():
        score = sum(weight for mark, weight in dialect.marks if mark.search(head))
        if score > best_score:
            best, best_score = dialect, score
    return replace(best, turned_vectors=turned)
