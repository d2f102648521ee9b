"""What becomes of every word of APT data: executed, a hook, refused, noted or kept."""

import pytest

from postproc.model import WordClass
from postproc.readers.apt.refused import WORDS, Action

HEAD = "UNITS/MM\nSPINDL/1000,RPM,CLW\nFEDRAT/100,MMPM\nGOTO/1,2,3\n"
DOCUMENTED = {
    WordClass.GEOMETRY: (
        "GOTO RAPID CIRCLE ARC MOVARC ARCSLP FROM GOHOME POSITN GODLTA RETRCT CLEARP CLRSRF PLUNGE "
        "MULTAX TLAXIS NURBS LINTOL INTOL OUTTOL TOLER MCHTOL PPTOL SMOOTH SLOWDN ALIGN THREAD "
        "TURN ROUGH BARFED CATCHR TLSTCK PSIS INDIRV INDIRP TLON"
    ),
    WordClass.COORDINATES: (
        "MCSYS MCS MCS2 ZERO MSYS CSYS ORIGIN TRANS TRACUT COPY INDEX MODE ROTABL ROTHED ROTATE "
        "HEAD PIVOTZ UNITS UNIT"
    ),
    WordClass.TOOL: (
        "LOADTL LOAD TOOL TURRET TLDATA TOOLNO CUTTER SELCTL SELECT NEXTTL UNLOAD CUTCOM "
        "CSI_SET_FLUTE_LENGTH CSI_SET_EXTENSION_LENGTH"
    ),
    WordClass.PROCESS: (
        "SPINDL COOLNT DELAY FEDRAT STOP OPSTOP OPSKIP AUXFUN PREFUN CLAMP TCP TABLE MATERL SAFETY "
        "CYCLE"
    ),
    WordClass.COMMENT: (
        "PARTNO PPRINT TPRINT OPNAME OPERATION BEGIN START MACHIN REWIND INSERT PAINT TRNTYP SETUP "
        "FINI END END-OF-PATH OPFEATSTART OPFEATEND MOVE_ATTRIB"
    ),
}
"""The words of the vendors' documents and of real files by what they can change."""
REFUSED = (
    "POSITN PLUNGE PIVOTZ THREAD TURN ROUGH BARFED CATCHR TLSTCK TRACUT COPY INDEX ROTABL ROTHED "
    "ROTATE HEAD OPSKIP AUXFUN PREFUN CLAMP SAFETY MACRO CALL GOFWD DNTCUT SWITCH"
)
"""Those that no robot can keep, whatever stands behind the slash."""
NOTED = (
    "LINTOL INTOL OUTTOL TOLER MCHTOL PPTOL SMOOTH SLOWDN ALIGN SELCTL SELECT NEXTTL TCP TABLE "
    "MATERL"
)


@pytest.mark.parametrize("word_class", DOCUMENTED)
def test_every_documented_word_has_its_class(word_class):
    for word in DOCUMENTED[word_class].split():
        assert WORDS[word].word_class == word_class, word


def test_header_and_text_pass():
    for word in ["TOOL PATH", *DOCUMENTED[WordClass.COMMENT].split()]:
        assert WORDS[word].action in (Action.KEEP, Action.NOTE), word


@pytest.mark.parametrize("word", REFUSED.split())
def test_a_word_that_no_robot_keeps_is_refused(read_text, word):
    toolpath = read_text(f"{HEAD}{word}/1\nGOTO/4,5,6\n{word}/2\nFINI\n")
    (use,) = (use for use in toolpath.word_uses if use.refused)
    assert (use.word, use.lines) == (word, (5, 7))
    assert use.word_class == WORDS[word].word_class
    assert use.reason
    assert len(toolpath) == 2, "the rest of the path is read all the same"
    assert toolpath.unknown_words == {word: 2}


@pytest.mark.parametrize("word", NOTED.split())
def test_a_harmless_word_is_a_note(read_text, word):
    (use,) = read_text(f"{HEAD}{word}/1\nFINI\n").word_uses
    assert (use.word, use.refused, use.lines) == (word, False, (5,))


@pytest.mark.parametrize("word", ["MYWORD", "GOT0", "CIRCEL", "X-Y_Z"])
def test_a_word_in_no_table_is_refused(read_text, word):
    (use,) = read_text(f"{HEAD}{word}/1,2,3\nFINI\n").word_uses
    assert (use.word, use.word_class, use.refused) == (word, "unknown", True)
    near = {"GOT0": "GOTO", "CIRCEL": "CIRCLE"}.get(word)
    assert (f"is it {near}?" in use.reason) == (near is not None)


FORMS = [
    # statement, word as accepted, class, refused
    ("MODE/MILL", "MODE/MILL", "process", False),
    ("MODE/INCR,ON", "MODE/INCR", "coordinates", True),
    ("MODE/TURN", "MODE/TURN", "process", True),
    ("MODE/TOOL,0,0,1", "MODE/TOOL", "coordinates", True),
    ("TRANS/0,0,10", "TRANS", "coordinates", True),
    ("LOAD/WIRE,1", "LOAD/WIRE", "tool", True),
    ("TOOLNO/ADJUST,3", "TOOLNO/ADJUST", "tool", False),
    ("CUTCOM/LEFT", "CUTCOM", "tool", True),
    ("CUTCOM/ON,RIGHT,5.", "CUTCOM", "tool", True),
    ("CUTCOM/ON,LENGTH,3", "CUTCOM/LENGTH", "tool", True),
    ("CUTCOM/ADJUST,2", "CUTCOM/ADJUST", "coordinates", True),
    ("INSERT/; G1", "INSERT", "process", False),
]


@pytest.mark.parametrize(("statement", "word", "word_class", "refused"), FORMS)
def test_forms_of_a_word(read_text, statement, word, word_class, refused):
    (use,) = read_text(f"{HEAD}{statement}\nGOTO/4,5,6\nFINI\n").word_uses
    assert (use.word, use.word_class, use.refused) == (word, word_class, refused)


@pytest.mark.parametrize(
    "statement", ["TRANS/0,0,0", "CUTCOM/OFF", "MULTAX/ON", "INSERT/D 6 DRILL"]
)
def test_forms_that_change_nothing(read_text, statement):
    assert read_text(f"{HEAD}{statement}\nGOTO/4,5,6\nFINI\n").word_uses == ()


def test_insert_is_code_if_it_begins_as_a_block(read_text):
    """A letter that commands, then a digit, perhaps behind a block number; all else is text."""
    heads = ("", "N10 ", "n5", "N 10  ", "/", "'", "/N7 ")
    code = [f"{head}{letter}{blank}68.2 X0"
            for head in heads for letter in "GMTSF#gmtsf" for blank in ("", " ")]  # fmt: skip
    text = [f"{head}{word} 40." for head in ("", "N10 ", "[", "(")
            for word in ("Stock Size X40. Y267.", "GROOVE 3", "TSLOT8", "SPOT 90", "FACE MILL",
                         "6G8 REAMER", "[HOLDER=G2-5ERP]", "90DEG", "X0", "#A1")]  # fmt: skip
    for statement in ("INSERT/{}", "INSERT {}", "insert / {}"):
        for words, expected in ((code, ["INSERT"]), (text, [])):
            for word in words:
                toolpath = read_text(f"{HEAD}{statement.format(word)}\nGOTO/4,5,6\nFINI\n")
                assert [use.word for use in toolpath.word_uses if use.refused] == expected, word
    (use,) = read_text(f"{HEAD}INSERT/G68.2\nGOTO/4,5,6\nFINI\n", accept_words="INSERT").word_uses
    assert not use.refused


def test_what_says_that_the_points_are_the_tool_centre(read_text):
    """NX says it for each path, Creo for the file; other comments say nothing."""
    path = "TOOL PATH/{},TOOL,MILL\nMSYS/0,0,0,1,0,0,0,1,0\n{}FEDRAT/MMPM,9\nCUTCOM/LEFT\n"
    body = "GOTO/1,2,3\nCUTCOM/OFF\nEND-OF-PATH\n"
    nx = (
        path.format("A", "$$ centerline data\n")
        + body
        + path.format("B", "$$ contact data\n")
        + body
    )
    uses = read_text(nx, "a.cls").word_uses
    assert [(use.word, use.refused, use.lines) for use in uses] == [
        ("CUTCOM", False, (5,)), ("CUTCOM", True, (13,)),
    ]  # fmt: skip
    for kind, refused in (("OUTPUT_ON_CENTER", False), ("OUTPUT_ON_PROFILE", True)):
        creo = (
            "$$*          Pro/CLfile  Version 8.0 - 8.0.3.0\n"
            f"$$-> CUTCOM_GEOMETRY_TYPE / {kind}\n{HEAD}CUTCOM / LEFT\nGOTO / 4, 5, 6\nFINI\n"
        )
        (use,) = read_text(creo, "a.ncl.1").word_uses
        assert use.refused is refused


@pytest.mark.parametrize(
    ("given", "left"),
    [
        ((), ["MODE/INCR", "CUTCOM", "MYWORD"]),
        ("cutcom", ["MODE/INCR", "MYWORD"]),
        ("MODE, MyWord", ["CUTCOM"]),
        (("MODE/INCR", "CUTCOM", "MYWORD"), []),
        ("MODE/TOOL,CUT,MYWORD/1", ["MODE/INCR", "CUTCOM", "MYWORD"]),
    ],
)
def test_accepted_words_become_notes(read_text, given, left):
    text = f"{HEAD}MODE/INCR,ON\nCUTCOM/LEFT\nMYWORD/1\nGOTO/4,5,6\nFINI\n"
    uses = read_text(text, accept_words=given).word_uses
    assert [use.word for use in uses if use.refused] == left
    assert len(uses) == 3


def test_unknown_activities_of_delmia_are_refused(read_text):
    motion = (
        "<Activity ActivityType='DNBRobotMotionActivity' Operation='O' id='1'><MotionAttributes>"
        "<MotionType>Linear</MotionType></MotionAttributes><Target><CartesianTarget>"
        "<Position Units='m' X='1' Y='0' Z='0'/><Orientation Units='deg' Yaw='0' Pitch='0' "
        "Roll='0'/></CartesianTarget></Target></Activity>"
    )
    clamp = "\n<Activity ActivityType='DNBGrabActivity' id='7'/>"
    text = f"<OLPData><Resource id='r'><ActivityList Task='A'>{motion}{clamp}{clamp}"
    toolpath = read_text(text + "</ActivityList></Resource></OLPData>", "a.xml")
    (use,) = toolpath.word_uses
    assert (use.word, use.lines, use.refused) == ("DNBGrabActivity", (2, 3), True)
    assert toolpath.unknown_words == {"DNBGrabActivity": 2}
