"""Every major word of APT and CL data, and what becomes of those that nothing carries out.

Sources: words of real files of NX, SolidWorks CAM, Creo, CATIA and CAMWorks; the public posts of
Fusion 360, HSMWorks, MfgSuite, CAMplete and MANUSnc; PostWorks 15.1; ISO 4343.
"""

from __future__ import annotations

from enum import StrEnum

from postproc.model import EventKind, WordClass
from postproc.readers.apt.state import AptState
from postproc.readers.apt.statement import Statement
from postproc.readers.text import shortened
from postproc.records import dataclass

_NEAR_LENGTH = 4
_SLASHED = ("GOTO", "CIRCLE", "FEDRAT", "CYCLE", "LOADTL", "SPINDL")
"""Words that are nothing without their numbers: without a slash they are a slip of the pen."""

GEOMETRY, COORDINATES = WordClass.GEOMETRY, WordClass.COORDINATES
TOOL, PROCESS, COMMENT = WordClass.TOOL, WordClass.PROCESS, WordClass.COMMENT


class Action(StrEnum):
    """What becomes of a word."""

    EXECUTE = "execute"
    """It has a meaning for the path; forms of it that cannot be kept are refused."""
    HOOK = "hook"
    """The program calls a routine of the integrator."""
    REFUSE = "refuse"
    """No program, unless the user knows it to be harmless in this file."""
    NOTE = "note"
    """Harmless for the motion: listed."""
    KEEP = "keep"
    """Header, end and text."""


@dataclass(frozen=True, slots=True)
class WordRule:
    """``reason``: why a word cannot be kept, or why it need not."""

    word_class: WordClass
    action: Action
    reason: str = ""


_EXECUTED = {
    GEOMETRY: "GOTO RAPID CIRCLE ARC MOVARC ARCSLP NURBS KNOT CNTRL GODLTA MULTAX TLAXIS FROM TLON "
    "INDIRV INDIRP PSIS GOHOME RETRCT CLEARP CLRSRF",
    COORDINATES: "UNITS UNIT MSYS CSYS MCSYS MCS MCS2 ZERO ORIGIN TRANS MODE ROTABL",
    TOOL: "CUTTER TLDATA CUTCOM",
    PROCESS: "FEDRAT CYCLE CYCLE81 CYCLE82 CYCLE83 MCALL DELAY",
}
_HOOKED = {TOOL: "LOAD LOADTL TOOLNO TOOL TURRET UNLOAD", PROCESS: "SPINDL COOLNT STOP OPSTOP"}
_KEPT = (
    "PARTNO PPRINT TPRINT INSERT OPNAME OPERATION BEGIN START MACHIN REWIND SETUP OPFEATSTART "
    "OPFEATEND FINI END END-OF-PATH"
)

_NOTED = {
    # names the surface of an arc that its own numbers give; tolerances of the target control
    GEOMETRY: "AUTOPS LINTOL INTOL OUTTOL TOLER MCHTOL PPTOL SMOOTH SLOWDN ALIGN",
    # the next tool, lengths of the cutter and its holder
    TOOL: "SELECT SELCTL NEXTTL CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH",
    # stock and table, output of the control
    PROCESS: "MATERL TABLE TCP APPLY BOX SEQNO LEADER CLPRNT NOPOST RESERV CUT",
    # display and bookkeeping of the CAM system
    COMMENT: "PAINT TRNTYP MOVE_ATTRIB PLABEL CSI_TOOL_PATH CSI_PATH_TOLERANCE",
}
HARMLESS = "has no meaning for a robot's path"

_REFUSED = {
    (GEOMETRY, "computes motions; expected the result, CL data"): (
        "MACRO CALL LOOPST JUMPTO IF GO GOFWD GOLFT GORGT GOBACK GOUP GODOWN POCKET SCURV SURF "
        "TLLFT TLRGT OFFSET MATRIX"
    ),
    (GEOMETRY, "a position of the machine's axes, not of the tool tip"): "POSITN",
    (GEOMETRY, "a drop along the tool axis to a level that the file does not give"): "PLUNGE",
    (GEOMETRY, "the motions after it are not to be run"): "DNTCUT",
    (GEOMETRY, "turning, which a robot with a spindle cannot do"): (
        "THREAD TURN ROUGH BARFED CATCHR TLSTCK"
    ),
    (COORDINATES, "an instruction to the APT processor; executed twice or never, both are wrong"): (
        "TRACUT COPY INDEX"
    ),
    (COORDINATES, "coordinates that something else places"): "REFSYS",
    (COORDINATES, "turns a table or a head that the robot does not have"): (
        "ROTATE ROTHED HEAD PIVOTZ"
    ),
    (COORDINATES, "changes which point of the tool the coordinates are of"): "SWITCH",
    (PROCESS, "selects a channel of a machine with several"): "CHANNEL",
    (PROCESS, "a code of the target control, for which there is no hook"): "AUXFUN PREFUN",
    (PROCESS, "lines that an operator may skip"): "OPSKIP",
    (PROCESS, "clamps or unclamps, for which there is no hook"): "CLAMP",
    (PROCESS, "splits motions near limits of a machine tool"): "SAFETY",
}
NOT_DONE = "is not carried out"


def unhandled(state: AptState, statement: Statement) -> None:
    """Take a statement that no handler knows; motion without its slash is an error."""
    word = statement.word
    if not word or word[0] in "+-.0123456789":
        raise state.error("APT003", "numbers without a word; is a $ missing on the line before?")
    rule = WORDS.get(word)
    if rule is None:
        _unknown(state, statement)
    elif rule.action is Action.NOTE:
        state.note(word, rule.word_class, rule.reason)
    elif rule.action is not Action.KEEP:
        refuse(state, statement, rule.word_class, rule.reason)


def refuse(
    state: AptState, statement: Statement, word_class: WordClass, reason: str, minor: str = ""
) -> None:
    """Refuse a word, or the form of it that a minor word makes, and keep its text."""
    word = shortened(f"{statement.word}/{minor}" if minor else statement.word)
    state.refuse(word, word_class, reason)
    keep_unknown(state, statement)


def keep_unknown(state: AptState, statement: Statement) -> None:
    """Count a word that is not carried out, and keep its text as an event."""
    shown = shortened(statement.word)
    state.unknown[shown] = state.unknown.get(shown, 0) + 1
    state.add_event(EventKind.UNKNOWN, 0.0, statement.text)


def _unknown(state: AptState, statement: Statement) -> None:
    """Refuse a word that is in no table."""
    first = statement.word.split(" ")[0].split(",")[0]
    ends = state.dialect.ends
    slip = first in _SLASHED or any(_is_near(first, end) for end in ends)
    near = next((known for known in (*sorted(ends), *WORDS) if _is_near(first, known)), None)
    if slip:
        raise state.error("APT005", f"{statement.word[:30]!r} is not a word; is it {near}?")
    reason = "is in no table of words" + (f"; is it {near}?" if near else "")
    state.refuse(shortened(first), WordClass.UNKNOWN, reason)
    keep_unknown(state, statement)


def _is_near(word: str, known: str) -> bool:
    """Return whether ``word`` is ``known`` with one letter changed, missing, doubled or swapped."""
    if len(known) < _NEAR_LENGTH or abs(len(word) - len(known)) > 1:
        return False
    same = 0
    while same < min(len(word), len(known)) and word[same] == known[same]:
        same += 1
    rest, other = word[same:], known[same:]
    if len(word) == len(known):
        return rest[1:] == other[1:] or (rest[:2] == other[1::-1] and rest[2:] == other[2:])
    return rest[1:] == other if len(word) > len(known) else rest == other[1:]


def _rules() -> dict[str, WordRule]:
    rules = {word: WordRule(COMMENT, Action.KEEP) for word in _KEPT.split()}
    rules["TOOL PATH"] = WordRule(COMMENT, Action.KEEP)
    for action, table, reason in (
        (Action.EXECUTE, _EXECUTED, NOT_DONE),
        (Action.HOOK, _HOOKED, NOT_DONE),
        (Action.NOTE, _NOTED, HARMLESS),
    ):
        for word_class, words in table.items():
            rules |= {word: WordRule(word_class, action, reason) for word in words.split()}
    for (word_class, reason), words in _REFUSED.items():
        rules |= {word: WordRule(word_class, Action.REFUSE, reason) for word in words.split()}
    return rules


WORDS = _rules()
"""All words; one that stands in no table may change anything, and is refused."""
