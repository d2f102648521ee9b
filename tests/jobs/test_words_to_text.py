"""Every row of the words of CAM files: what becomes of it in the text of the program.

A row is a seat, lines put into a small file of that seat, and what must be found: a line of the
program, a refused word, a note, or a comment that keeps the text.
"""

# ruff: noqa: E501 - a row is a line

import re

import pytest

from postproc.process import word_findings
from postproc.readers import ReadOptions, read
from postproc.readers.apt.refused import WORDS, Action
from postproc.readers.apt.words import _HANDLERS
from tests.jobs.emitted import CELL, converted, program

HEAD = "UNITS/MM\nLOADTL/1\nSPINDL/900,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\nFEDRAT/600,MMPM\nGOTO/0,0,0\n"
TAIL = "GOTO/60,0,0\nRAPID\nGOTO/60,0,50\nFINI\n"
NX_HEAD = (
    "TOOL PATH/A,TOOL,T\nMSYS/0,0,0,1,0,0,0,1,0\nSPINDL/RPM,900,CLW\nRAPID\nGOTO/0,0,50,0,0,1\n"
    "FEDRAT/MMPM,600\nGOTO/0,0,0\n"
)
SINKS = "CYCLE/{},FEDTO,9,MMPM,60,RAPTO,3,RTRCTO,20\nGOTO/20,0,0\nCYCLE/OFF"
EXECUTED = [
    # seat, lines, lines of the program that must follow each other
    ("apt", "RAPID\nGOTO/20,0,0\nGOTO/40,0,0", [r"\$VEL\.CP=1\.0", r"LIN \{X 20\.0", r"\$VEL\.CP=0\.01", r"LIN \{X 40"]),
    ("apt", "GODLTA/20,5,0", [r"LIN \{X 20\.0000,Y 5\.0000,Z 0\.0"]),
    ("apt", "GODLTA/0,0,7,0.6,0,0.8", [r"LIN \{X 0\.0000,Y 0\.0000,Z 7\.0"]),
    ("apt", "CLEARP/XYPLAN,30\nRETRCT", [r"\$VEL\.CP=1\.0", r"LIN \{X 0\.0000,Y 0\.0000,Z 30\.0"]),
    ("postworks", "CLRSRF/30\nRETRCT", [r"LIN \{X 0\.0000,Y 0\.0000,Z 30\.0"]),
    ("nx", "TLAXIS/0.6,0,0.8\nGOTO/20,0,0", [r"LIN \{X 20\.0"]),
    ("catia", "MULTAX/ON\nGOTO/20,0,0,0.6,0,0.8\nMULTAX/OFF\nGOTO/30,0,0", [r"LIN \{X 20\.0", r"LIN \{X 30"]),
    ("apt", "TRANS/0,0,0\nGOTO/20,0,0", [r"LIN \{X 20\.0000,Y 0\.0000,Z 0\.0"]),
    ("nx", "MSYS/0,0,9,1,0,0,0,1,0\nGOTO/20,0,0", [r"LIN \{X 20\.0000,Y 0\.0000,Z"]),
    ("solidworks", "CSYS/1,0,0,5,0,1,0,5,0,0,1,5\nGOTO/20,0,0", [r"LIN \{X 20\.0000,Y 0\.0000,Z 0\.0"]),
    ("apt", "FEDRAT/120,MMPM\nGOTO/20,0,0", [r"\$VEL\.CP=0\.002000", r"LIN \{X 20"]),
    ("apt", "FEDRAT/.1,MMPR\nGOTO/20,0,0", [r"\$VEL\.CP=0\.001500", r"LIN \{X 20"]),
    ("apt", "FEDRAT/120,PERMIN\nGOTO/20,0,0", [r"\$VEL\.CP=0\.002000"]),
    ("apt", "DELAY/2.5\nGOTO/20,0,0", [r"WAIT SEC 2\.5", r"LIN \{X 20"]),
    ("apt", "DELAY/DWELL,2.5\nGOTO/20,0,0", [r"WAIT SEC 2\.5"]),
    ("apt", "DELAY/30,REV\nGOTO/20,0,0", [r"WAIT SEC 2\.0"]),
    ("apt", SINKS.format("DRILL"), [r"LIN .*Z 3\.0", r"\$VEL\.CP=0\.001", r"LIN .*Z -9\.0", r"\$VEL\.CP=1\.0", r"LIN .*Z 20\.0"]),
    ("apt", SINKS.format("REAM"), [r"LIN .*Z -9\.0", r"LIN .*Z 3\.0000[^\n]*\} ; CAM", r"\$VEL\.CP=1\.0", r"LIN .*Z 20\.0"]),
    ("apt", SINKS.format("BORE"), [r"LIN .*Z -9\.0", r"PP_SPINDLE_OFF\(\)", r"LIN .*Z 3\.0", r"PP_SPINDLE_ON\(900\)", r"\$VEL\.CP=1\.0"]),
    ("apt", SINKS.format("BORE8"), [r"LIN .*Z -9\.0", r"PP_SPINDLE_OFF\(\)", r"\$VEL\.CP=1\.0", r"LIN .*Z 20\.0", r"PP_SPINDLE_ON\(900\)"]),
    ("apt", SINKS.format("TAP").replace("MMPM,60", "MMPM,900"),
     [r"LIN .*Z -9\.0", r"TAP_BACK\(-900\)", r"LIN .*Z 3\.0", r"PP_SPINDLE_ON\(900\)", r"\$VEL\.CP=1\.0"]),
    ("apt", SINKS.format("FACE").replace("RAPTO", "DWELL,.5,RAPTO"), [r"LIN .*Z -9\.0", r"WAIT SEC 0\.5", r"\$VEL\.CP=1\.0"]),
    ("apt", SINKS.format("DRILL").replace("RAPTO", "DWELL,REV,30,RAPTO"), [r"LIN .*Z -9\.0", r"WAIT SEC 2\.0", r"\$VEL\.CP=1\.0"]),
    ("apt", "CYCLE/CSINK,FEDTO,10,90,MMPM,60,RAPTO,3\nGOTO/20,0,0\nCYCLE/OFF", [r"LIN .*Z -5\.0"]),
    ("postworks", "CYCLE/THRU,FEDTO,9,MMPM,60,RAPTO,3,STEP,4\nGOTO/20,0,0\nCYCLE/OFF",
     [r"Z -4\.0", r"Z 3\.0", r"Z -3\.5", r"Z -8\.0", r"Z 3\.0", r"Z -7\.5", r"Z -9\.0", r"Z 3\.0"]),
    ("postworks", "CYCLE/DEEP,FEDTO,9,MMPM,60,RAPTO,3,STEP,4\nGOTO/20,0,0\nCYCLE/OFF",
     [r"Z -4\.0", r"Z -3\.0", r"Z -3\.5", r"Z -8\.0", r"Z -7\.0", r"Z -7\.5", r"Z -9\.0", r"Z 3\.0"]),
    ("apt", "CYCLE/CYCLE81,20,0,3,-9\nGOTO/20,0,0\nCYCLE/OFF", [r"Z 3\.0", r"Z -9\.0", r"Z 20\.0"]),
]  # fmt: skip
HOOKED = [
    ("SPINDL/1200,RPM,CLW", r"PP_SPINDLE_ON\(1200\)"), ("SPINDL/RPM,1200,CLW", r"PP_SPINDLE_ON\(1200\)"),
    ("SPINDL/ON", r"PP_SPINDLE_ON\(900\)"), ("spindl/1200,rpm,clw", r"PP_SPINDLE_ON\(1200\)"),
    ("COOLNT/ON", r"PP_COOLANT_ON\(1\)"), ("COOLNT/FLOOD", r"PP_COOLANT_ON\(1\)"),
    ("COOLNT/flood", r"PP_COOLANT_ON\(1\)"), ("COOLNT/MIST", r"PP_COOLANT_ON\(2\)"),
    ("COOLNT/THRU", r"PP_COOLANT_ON\(3\)"), ("COOLNT/AIR", r"PP_COOLANT_ON\(4\)"),
    ("COOLNT/TAP", r"PP_COOLANT_ON\(5\)"), ("COOLNT/CUSTOM1", r"PP_COOLANT_ON\(6\)"),
    ("COOLNT/CUSTOM3", r"PP_COOLANT_ON\(8\)"), ("COOLNT/OFF", r"PP_COOLANT_OFF\(\)"),
    ("STOP", r"PP_STOP\(\)"), ("OPSTOP", r"PP_OPTIONAL_STOP\(\)"), ("INSERT/STOP", r"PP_STOP\(\)"),
]  # fmt: skip
KEPT = [
    "PARTNO/ROW",
    "PPRINT/ROW",
    "TPRINT/ROW",
    "INSERT/ROW",
    "INSERT/STOPPER ROW",
    "MACHIN/ROW",
    "OPNAME/'ROW'",
    "REWIND/1",
]
NOTED = [
    "LINTOL/.01", "INTOL/.01", "OUTTOL/.01", "TOLER/.01", "MCHTOL/.01", "PPTOL/.01", "SMOOTH/ON",
    "SLOWDN/ON", "ALIGN/ON", "MATERL/2", "TABLE/1", "TCP/ON", "SELECT/TOOL,3", "SELCTL/3",
    "MODE/MILL", "FROM/0,0,9", "TOOLNO/ADJUST,3",
]  # fmt: skip
REFUSED = {
    "POSITN/XAXIS,5": "POSITN", "PLUNGE/100": "PLUNGE", "PIVOTZ/5": "PIVOTZ", "THREAD/1": "THREAD",
    "TURN/1": "TURN", "ROUGH/1": "ROUGH", "BARFED/1": "BARFED", "CATCHR/1": "CATCHR",
    "TLSTCK/1": "TLSTCK", "RETRCT": "RETRCT", "RETRCT/ON": "RETRCT", "CLEARP/WHAT": "CLEARP",
    "GODLTA/5": "GODLTA", "GOHOME/CHECK": "GOHOME/CHECK", "GOHOME": "GOHOME",
    "SPINDL/0,RPM,CLW": "SPINDL/OFF", "FINI": "FINI", "SPINDL/900,RPM,200": "SPINDL",
    "PPRINT/MORE $": "PPRINT",
    "CYCLE/DRILL,FEDTO,9,FEDTO,5,MMPM,60,RAPTO,3": "CYCLE/FEDTO",
    "CYCLE/DRILL,FEDTO,9,MMPM,60,RAPTO,3,DWELL,-2": "CYCLE/DWELL",
    "CYCLE/DRILL,DEEP,FEDTO,9,MMPM,60,RAPTO,3": "CYCLE/STEP",
    "LOADTL/1,LENGTH,180\nLOADTL/1,LENGTH,250": "LOADTL/LENGTH",
    "RAPID/OFF": "RAPID", "RAPID/ON": "RAPID", "RAPID/300": "RAPID",
    "TRANS/0,0,5": "TRANS", "TRACUT/1": "TRACUT", "COPY/1": "COPY", "INDEX/1": "INDEX",
    "MODE/INCR,ON": "MODE/INCR", "MODE/LATHE": "MODE/LATHE", "MODE/TURN": "MODE/TURN",
    "MODE/TOOL,0,0,1": "MODE/TOOL", "MODE/AXIS": "MODE/AXIS", "ROTABL/90,CLW,CAXIS": "ROTABL",
    "ROTHED/1": "ROTHED", "ROTATE/1": "ROTATE", "HEAD/2": "HEAD", "CUTCOM/LEFT": "CUTCOM",
    "CUTCOM/ON,RIGHT,5.": "CUTCOM", "CUTCOM/ADJUST,2": "CUTCOM/ADJUST",
    "CUTCOM/ON,LENGTH,3": "CUTCOM/LENGTH", "LOAD/WIRE,1": "LOAD/WIRE", "UNLOAD/TOOL": "UNLOAD",
    "SPINDL/ORIENT,90": "SPINDL/ORIENT", "SPINDL/LOCK": "SPINDL/LOCK",
    "SPINDL/OFF": "SPINDL/OFF", "SPINDL/-900,RPM,CCLW": "SPINDL/CCLW",
    "COOLNT/FOAM": "COOLNT/FOAM", "FEDRAT/INVERS,AUTO": "FEDRAT/INVERS", "FEDRAT/9,MMPM,LOCK": "FEDRAT/LOCK",
    "OPSKIP/ON": "OPSKIP", "AUXFUN/8": "AUXFUN", "PREFUN/54": "PREFUN", "CLAMP/TABLE": "CLAMP",
    "SAFETY/1": "SAFETY", "ANYWORD/1": "ANYWORD", "CYCLE/ON": "CYCLE/ON",
    "CYCLE/CIRCUL,DEPTH,5,RADIUS,20,ON": "CYCLE/CIRCUL",
    "CYCLE/BORE7,FEDTO,5,MMPM,60,RAPTO,2": "CYCLE/BORE7",
    "CYCLE/BORE9,FEDTO,5,MMPM,60,RAPTO,2": "CYCLE/BORE9",
    "CYCLE/SHIFT,FEDTO,5,MMPM,60,RAPTO,2": "CYCLE/SHIFT",
    "CYCLE/BORE,FEDTO,5,MMPM,60,RAPTO,2,ORIENT,90": "CYCLE/ORIENT",
    "CYCLE/DRILL,FEDTO,5,MMPM,60,RAPTO,2,REPEAT,3": "CYCLE/REPEAT",
    "CYCLE/DRILL,FEDTO,5,MMPM,60,RAPTO,2,CAM,3": "CYCLE/CAM",
    "CYCLE/REAM,FEDTO,5,MMPM,60,RAPTO,2,STEP,2": "CYCLE/REAM",
}  # fmt: skip
CODED = {
    "CYCLE/RIGID,FEDTO,5,PITCH,1,RAPTO,2": "PRC002", "CYCLE/REVERS,FEDTO,5,PITCH,1,RAPTO,2": "PRC002",
    "CYCLE/TAP,FEDTO,5,PITCH,1,RAPTO,2,DWELL,1": "PRC002", "SPINDL/900,RPM,CCLW": "PRC001",
    "SPINDL/-900,RPM": "PRC001", "FEDRAT/.5,MMPM": "PLN105",
}  # fmt: skip


def part(lines, seat="apt"):
    head, end = (NX_HEAD, "END-OF-PATH\n") if seat == "nx" else (HEAD, "FINI\n")
    return f"{head}{lines}\n{TAIL.replace('FINI' + chr(10), end)}"


def in_order(text, patterns):
    at = text.index("(MOTION STATE)")
    for pattern in patterns:
        found = re.compile(pattern).search(text, at)
        assert found, f"{pattern} behind {text[max(0, at - 60) : at]!r}"
        at = found.end()


@pytest.mark.parametrize(("seat", "lines", "expected"), EXECUTED)
def test_an_executed_word_is_in_the_text(tmp_path, seat, lines, expected):
    text = program(converted(tmp_path, part(lines, seat), dialect=seat)).replace("\r", "")
    in_order(text, expected)


@pytest.mark.parametrize(("line", "call"), HOOKED)
def test_a_hooked_word_is_a_call_between_its_points(tmp_path, line, call):
    text = program(converted(tmp_path, part(f"{line}\nGOTO/20,0,0"), dialect="apt"))
    in_order(text, [r"X 0\.0000,Y 0\.0000,Z 0\.0000", call, r"X 20\.0000"])


def lines_of(job):
    return re.findall(r"^LIN.*?\}", program(job), re.M)


def test_text_and_harmless_words_move_nothing(tmp_path):
    job = converted(tmp_path, part("\n".join([*KEPT, *NOTED])), dialect="apt")
    assert lines_of(job) == lines_of(converted(tmp_path, part(""), dialect="apt"))
    noted = [finding.message for finding in job.findings if finding.code == "WRD003"]
    words = {re.split(r"[/,]", line)[0] for line in NOTED}
    assert [word for word in words if not any(word in text for text in noted)] == []


@pytest.mark.parametrize(("line", "word"), REFUSED.items())
def test_a_refused_word_stops_the_program_by_name(tmp_path, line, word):
    job = converted(tmp_path, part(f"{line}\nGOTO/20,0,0"), dialect="apt")
    errors = [finding for finding in job.findings if finding.code == "WRD001"]
    assert not job.files
    assert [(finding.code, finding.message.split(" ")[0]) for finding in errors] == [
        ("WRD001", word)
    ]
    options = ReadOptions(dialect="apt", accept_words=(word,))
    accepted = word_findings(read(tmp_path / "part.apt", options=options))
    assert word not in {f.message.split(" ")[0] for f in accepted if f.is_error}


@pytest.mark.parametrize(("line", "code"), CODED.items())
def test_what_no_word_can_accept_stops_the_program(tmp_path, line, code):
    job = converted(
        tmp_path, part(f"{line}\nGOTO/20,0,0"), dialect="apt", accept=["CYCLE", "SPINDL"]
    )
    assert not job.files
    assert code in {finding.code for finding in job.findings if finding.is_error}


@pytest.mark.parametrize(
    ("first", "then", "way"),
    [
        ("-900,RPM", "500,RPM", 500), ("-900,RPM", "ON", -900), ("900,CCLW", "500", -500),
        ("-900,RPM", "500,CCLW", -500), ("-900,RPM", "-500", -500),
    ],
)  # fmt: skip
def test_the_sign_of_a_speed_holds_for_that_speed_a_word_holds_on(tmp_path, first, then, way):
    text = f"UNITS/MM\nSPINDL/{first}\nSTOP\nSPINDL/{then}\nRAPID\nGOTO/0,0,50,0,0,1\nFINI\n"
    calls = re.findall(r"PP_SPINDLE_ON\((\S+)\)", program(converted(tmp_path, text)))
    assert calls[1] == str(way)


def test_taps_are_refused_where_the_cell_names_no_routine(tmp_path):
    lines = SINKS.format("TAP").replace("MMPM,60", "MMPM,900")
    bare = CELL[: CELL.index("[krl.hooks]")]
    job = converted(tmp_path, part(lines), dialect="apt", cell=bare)
    assert not job.files
    assert "PRC002" in {finding.code for finding in job.findings if finding.is_error}


def test_every_word_that_is_executed_or_hooked_has_a_handler():
    """Motions are taken out of the file in bulk, before the handlers see the rest."""
    motions = set(
        ["GOTO", "RAPID", "CIRCLE", "ARC", "MOVARC", "ARCSLP", "GODLTA", "TLON", "INDIRV", "INDIRP", "PSIS", "RETRCT", "CLEARP", "CLRSRF"]
    )  # fmt: skip
    acting = {word for word, rule in WORDS.items() if rule.action in (Action.EXECUTE, Action.HOOK)}
    assert acting - motions - set(_HANDLERS) == {"UNLOAD"}, "refused: nothing puts a tool away"
    assert not motions & set(_HANDLERS)
