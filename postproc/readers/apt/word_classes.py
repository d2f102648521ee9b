"""Every major word of APT and CL data: what it can change, and what becomes of it.

Sources: words of real files of NX, SolidWorks CAM, Creo, CATIA and CAMWorks; the public posts of
Fusion 360, HSMWorks, MfgSuite, CAMplete and MANUSnc; PostWorks 15.1; ISO 4343.
"""

from __future__ import annotations

from enum import StrEnum

from postproc.model import WordClass
from postproc.records import dataclass

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
    (GEOMETRY, "computes motions; expected is CL data, its result"): (
        "MACRO CALL LOOPST JUMPTO IF GO GOFWD GOLFT GORGT GOBACK GOUP GODOWN POCKET SCURV SURF "
        "TLLFT TLRGT OFFSET MATRIX"
    ),
    (GEOMETRY, "a position of the machine's axes, not of the tool tip"): "POSITN",
    (GEOMETRY, "a drop along the tool axis to a level that the file does not give"): "PLUNGE",
    (GEOMETRY, "the motions after it are not to be driven"): "DNTCUT",
    (GEOMETRY, "turning, which no robot with a spindle does"): (
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
