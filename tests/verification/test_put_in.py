"""Lines put into the middle of a cut of a good program: all that the CAM file does not ask for.

The trimming job cuts in one pass: spindle, coolant, tool and supervision are as the CAM file says
from its first point to its last, and nothing waits there.
"""

from pathlib import Path

import pytest

from postproc.cell import load_cell
from postproc.krl import parse_files
from postproc.readers import read
from postproc.verification import verify

TRIM = Path(__file__).parents[2] / "fixtures" / "trim_5axis"
IN_THE_CUT = "LIN {X 100.0000"

HARMFUL = {
    "PP_SPINDLE_ON(1200)": "event",
    "PP_SPINDLE_OFF()": "event",
    "PP_COOLANT_OFF()": "event",
    "PP_COOLANT_ON(1)": "event",
    "PP_TOOL_CHANGE(4)": "event",
    "PP_TOOL_CHANGE(3)": "event",
    "HALT": "dwell",
    "WAIT SEC 0.5": "dwell",
    "WAIT FOR $IN[1]": "dwell",
    "INTERRUPT OFF": "setup",
    "INTERRUPT DISABLE": "setup",
    "INTERRUPT OFF 3": "setup",
    "INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO PP_STOP()": "setup",
    "INTERRUPT DECL 3 WHEN $IN[5] DO IR_STOPM()": "setup",
    "PP_STOP()": "event",
    "PP_SPINDLE_ON(12000)": "event",
    "PP_COOLANT_ON(4)": "event",
    "PP_COOLANT_OFF()\r\nPP_COOLANT_ON(4)": "event",
    "PP_SPINDLE_OFF()\r\nPP_SPINDLE_ON(12000)": "event",
    "$OUT[17]=FALSE": "event",
    "WAIT SEC 0.0": "dwell",
    "CONTINUE": "event",
    "CIRC {X 80,Y -5,Z -5},{X 60,Y -5,Z -5,A 104.81,B 90,C 0},CA 360": "circle",
    "$ACC.CP=0": "unjudged",
    "$VEL.ORI1=0": "unjudged",
    "$APO.CDIS=-5": "unjudged",
    "BAS(#ACC_CP,0)": "unjudged",
    "DIGIN ON X=$DIGIN1": "unjudged",
    "BRAKE": "structure",
    "RESUME": "structure",
    "PP_SPINDLE_ORIENT(90)": "unjudged",
    "ASYPTP {E1 0}": "unjudged",
    "TIME_BLOCK START": "unjudged",
    "CONST_VEL START=1": "unjudged",
    'CWRITE($CMD,1,2,"RUN/R1/OTHER()")': "unjudged",
    "BASE_DATA[4].Z=10.0": "unjudged",
    "TOOL_DATA[3].Z=10.0": "unjudged",
}


IN_THE_HEAD = ("$APO.CVEL=50", "$APO.CPTP=30", "$ADVANCE=1", "$ADVANCE=5", "$ACC.CP=1.0")
NOWHERE = ("LIN_REL {Z 0}", "LIN_REL {X 0,Y 0,Z 0,A 0,B 0,C 0} C_DIS", "PTP_REL {A1 0}")
LONG = "FOR I=1 TO 5000\r\nPTP_REL {A1 1.0}\r\nPTP_REL {A1 -1.0}\r\nENDFOR"


@pytest.fixture(scope="module")
def trimmed():
    """The verdict on the program with a line put in, below its tools and routines."""
    cell = load_cell(TRIM / "cell.toml")
    asked = read(TRIM / "trim.cls")
    files = {path.name: path.read_bytes() for path in sorted((TRIM / "expected").iterdir())}

    def of(line, place=IN_THE_CUT):
        text = files["trim.src"].decode("ascii")
        before, found, behind = text.partition(place)
        changed = f"{before}{line}\r\n{found}{behind}".encode("ascii")
        modules = parse_files({**files, "trim.src": changed})
        return verify(modules, "trim", cell, asked, collisions=False)

    return of


def test_what_does_harm_is_a_violation(trimmed):
    found = {line: {finding.code for finding in trimmed(line).violations} for line in HARMFUL}
    assert {line: codes for line, codes in found.items() if HARMFUL[line] not in codes} == {}


def test_what_no_plan_counts_with_is_a_violation_in_the_head_too(trimmed):
    place = "$VEL.CP="  # the first motion is behind it
    passed = [line for line in IN_THE_HEAD if trimmed(line, place).ok]
    passed += [line for line in NOWHERE if trimmed(line).ok]
    assert not passed
    assert trimmed("$ADVANCE=3\r\n$APO.CPTP=100\r\n$APO.CVEL=100", place).ok


def test_a_counted_loop_is_too_long_and_one_without_a_way_out_endless(trimmed):
    codes = {finding.code for finding in trimmed(LONG, "$VEL.CP=").violations}
    assert "unjudged" in codes
    assert "endless" not in codes
    endless = LONG.replace("FOR I=1 TO 5000", "LOOP").replace("ENDFOR", "ENDLOOP")
    assert "endless" in {finding.code for finding in trimmed(endless, "$VEL.CP=").violations}


def test_a_program_without_a_motion_is_judged(trimmed):
    report = trimmed("LOOP")
    assert {"structure", "missed"} <= {finding.code for finding in report.violations}
