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


@pytest.fixture(scope="module")
def trimmed():
    """The verdict on the program with a line put in, below its tools and routines."""
    cell = load_cell(TRIM / "cell.toml")
    asked = read(TRIM / "trim.cls")
    files = {path.name: path.read_bytes() for path in sorted((TRIM / "expected").iterdir())}

    def of(line):
        text = files["trim.src"].decode("ascii")
        before, found, behind = text.partition(IN_THE_CUT)
        changed = f"{before}{line}\r\n{found}{behind}".encode("ascii")
        modules = parse_files({**files, "trim.src": changed})
        return verify(modules, "trim", cell, asked, collisions=False)

    return of


def test_what_does_harm_is_a_violation(trimmed):
    found = {line: {finding.code for finding in trimmed(line).violations} for line in HARMFUL}
    assert {line: codes for line, codes in found.items() if HARMFUL[line] not in codes} == {}


def test_a_program_without_a_motion_is_judged(trimmed):
    report = trimmed("LOOP")
    assert {"structure", "missed"} <= {finding.code for finding in report.violations}
