"""Hooks whose lines are in the files, and calls of different kinds in the wrong order.

Programs of the fixtures, changed in one place each: what does harm is noticed, the rest is not.
"""

import shutil
from pathlib import Path

import pytest

from postproc.api import load_cell, verify
from postproc.readers import read

FIXTURES = Path(__file__).parents[2] / "fixtures"
HEAD = "GLOBAL DEF PP_COOLANT_ON(MODE :IN)\nDECL INT MODE\n"


@pytest.fixture(scope="module")
def judged(tmp_path_factory):
    """The verdict on a fixture, its program and its CAM file changed and more files beside it."""

    def of(case, cam, program, changed=(), asked=(), **others):
        folder = tmp_path_factory.mktemp(case) / "out"
        shutil.copytree(FIXTURES / case / "expected", folder)
        src = folder / f"{program}.src"
        for path, pairs in ((src, changed), (folder / cam, asked)):
            text = (path if path == src else FIXTURES / case / cam).read_bytes().decode()
            ends = "\r\n" if "\r\n" in text else "\n"
            text = text.replace("\r\n", "\n")
            for old, new in pairs:
                assert old in text
                text = text.replace(old, new, 1)
            path.write_bytes(text.replace("\n", ends).encode())
        for name, text in others.items():
            (folder / f"{name}.src").write_bytes(text.replace("\n", "\r\n").encode())
        cell = load_cell(FIXTURES / case / "cell.toml")
        return verify(src, cell, against=read(str(folder / cam)), collisions=False)

    return of


@pytest.fixture(scope="module")
def trimmed(judged):
    return lambda *a, **k: judged("trim_5axis", "trim.cls", "trim", *a, **k)


@pytest.fixture(scope="module")
def plate(judged):
    return lambda *a, **k: judged("tool_changes", "plate.apt", "PLATE_7", *a, **k)


def codes(report):
    return {finding.code for finding in report.violations}


HARMFUL = {
    "$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}": "frame",
    "$TOOL={X 0,Y 0,Z 0,A 0,B 0,C 0}": "frame",
    "BAS(#BASE,0)": "frame",
    "LIN_REL {X 5}": "target",
    "PTP {A1 50}": "target",
    "BASE_DATA[4].Z=10.0": "unjudged",
    "$OV_PRO=30": "unjudged",
    "$ACC.CP=0": "unjudged",
    "INTERRUPT OFF 3": "setup",
    "INTERRUPT DECL 21 WHEN $IN[3] DO OTHER()": "unjudged",
    "MOVE_SOMEWHERE()": "unjudged",
    "IF $IN[3] THEN\nLIN_REL {X 5}\nENDIF": "condition",
    "PP_SPINDLE_OFF()": "spindle",
    "PP_TOOL_CHANGE(2)": "event",
}
HARMLESS = (
    "$OUT[17]=TRUE\nPULSE($OUT[3],TRUE,0.5)",
    "WAIT SEC 2.5\nWAIT FOR $IN[4]",
    "$TIMER[3]=-5000\n$TIMER_STOP[3]=FALSE\nREPEAT\nUNTIL $IN[5] OR ($TIMER[3]>0)\nHALT",
    "SWITCH MODE\nCASE 1\n$OUT[1]=TRUE\nDEFAULT\n$OUT[2]=TRUE\nENDSWITCH\nRETURN",
    "HELP(MODE)\nEND\nDEF HELP(N :IN)\nDECL INT N\n$OUT[N]=TRUE",
    "",
)
PLACES = ("in the program", "in a file of its name", "in a file of hooks")


def with_body(trimmed, place, body):
    text = f"{HEAD}{body}\nEND\n"
    if place == PLACES[0]:
        return trimmed([("\nEND\n", f"\nEND\n{text}")])
    if place == PLACES[1]:
        return trimmed(PP_COOLANT_ON=text)
    return trimmed(MY_HOOKS=f"DEF MY_HOOKS( )\nEND\n{text}")


@pytest.mark.parametrize("body", HARMFUL)
def test_what_a_hook_does_to_the_motion_counts(trimmed, body):
    assert HARMFUL[body] in codes(with_body(trimmed, PLACES[0], body))


@pytest.mark.parametrize("place", PLACES)
def test_a_hook_is_read_wherever_it_lies(trimmed, place):
    assert "frame" in codes(with_body(trimmed, place, "$BASE={X 0,Y 0,Z 0,A 0,B 0,C 0}"))


@pytest.mark.parametrize("body", HARMLESS)
def test_a_hook_may_switch_and_wait(trimmed, body):
    report = with_body(trimmed, PLACES[2], body)
    assert codes(report) == set()
    assert [w.message for w in report.warnings] == [w.message for w in trimmed().warnings]


def test_a_hook_that_moves_between_two_points(plate):
    body = "DEF PP_STOP( )\nLIN_REL {Y -20,Z -40}\nEND\n"
    assert codes(plate(PP_STOP=body)) >= {"path"}


def test_a_hook_in_two_files_is_none(trimmed):
    assert "structure" in codes(trimmed(ONE=f"{HEAD}END\n", TWO=f"{HEAD}END\n"))


def test_a_triggered_hook_is_read(trimmed):
    cut = "LIN {X 100.0000"
    calls = "TRIGGER WHEN DISTANCE=0 DELAY=0 DO PP_COOLANT_ON(4)\n"
    triggered = [(cut, calls + cut)]
    assert codes(trimmed(triggered)) == {"event"}
    assert codes(trimmed(triggered, PP_COOLANT_ON=f"{HEAD}$OUT[4]=TRUE\nEND\n")) == {"event"}
    assert "unjudged" in codes(trimmed(triggered, PP_COOLANT_ON=f"{HEAD}$OV_PRO=30\nEND\n"))


def test_an_interrupt_of_the_program_is_not_judged(trimmed):
    interrupt = "INTERRUPT DECL 21 WHEN $IN[3] DO PP_COOLANT_ON(4)\n"
    declared = [("BAS(#INITMOV", interrupt + "BAS(#INITMOV")]
    assert codes(trimmed(declared)) == {"unjudged"}


def test_a_bas_of_the_program_is_not_that_of_the_controller(trimmed):
    own = "\nEND\nDEF BAS(WHAT :IN,VALUE :IN)\nEND\n"
    assert "unjudged" in codes(trimmed([("\nEND\n", own)]))


COOLANT_OFF, SPINDLE_OFF = "PP_COOLANT_OFF() ; CAM line 18: OFF\n", "MILL_STOP() ; CAM line 19\n"
OPTIONAL, ON = (
    "PP_OPTIONAL_STOP() ; CAM line 20\n",
    "MILL_START(9000) ; CAM line 22: 9000,RPM,CLW\n",
)
MIST = "PP_COOLANT_ON(2) ; CAM line 23: MIST\n"
STOP, LAST_OFF = "PP_STOP() ; CAM line 31\n", "MILL_STOP() ; CAM line 33\n"
CHANGE, FIRST_ON = (
    "MAG_CHANGE(1) ; CAM line 4: LOADTL/1\n",
    "MILL_START(18000) ; CAM line 5: 18000,RPM,CLW\n",
)
FRAMES = "BAS(#TOOL,1)\nBAS(#BASE,3)\n"
AIR, LAST_COOLANT = "PP_COOLANT_ON(4) ; CAM line 6: AIR\n", "PP_COOLANT_OFF() ; CAM line 32: OFF\n"
BOTH = "DELAY/1.0\nSPINDL/OFF\nDELAY/3.0\n"
WRONG = {
    "tool change while the spindle turns": [
        (CHANGE + FRAMES + FIRST_ON, FIRST_ON + CHANGE + FRAMES)
    ],
    "tool change under coolant": [
        (CHANGE + FRAMES + FIRST_ON + AIR, AIR + CHANGE + FRAMES + FIRST_ON)
    ],
    "optional stop while the spindle turns": [(SPINDLE_OFF + OPTIONAL, OPTIONAL + SPINDLE_OFF)],
    "optional stop under coolant": [
        (COOLANT_OFF + SPINDLE_OFF + OPTIONAL, SPINDLE_OFF + OPTIONAL + COOLANT_OFF)
    ],
    "spindle on before the optional stop": [(OPTIONAL + ON, ON + OPTIONAL)],
    "spindle off before the stop": [
        (STOP + LAST_COOLANT + LAST_OFF, LAST_OFF + STOP + LAST_COOLANT)
    ],
    "coolant off behind coolant on": [
        (
            COOLANT_OFF + SPINDLE_OFF + OPTIONAL + ON + MIST,
            SPINDLE_OFF + OPTIONAL + ON + MIST + COOLANT_OFF,
        )
    ],
}
RIGHT = {
    "coolant on before the spindle": [(ON + MIST, MIST + ON)],
    "spindle off before coolant": [(COOLANT_OFF + SPINDLE_OFF, SPINDLE_OFF + COOLANT_OFF)],
    "last spindle off before coolant": [(LAST_COOLANT + LAST_OFF, LAST_OFF + LAST_COOLANT)],
    "spindle off once more at the optional stop": [(OPTIONAL, "MILL_STOP()\n" + OPTIONAL)],
    "spindle on once more": [(ON, ON + "MILL_START(9000)\n")],
}


@pytest.mark.parametrize("name", WRONG)
def test_calls_of_different_kinds_in_the_wrong_order(plate, name):
    assert "event" in codes(plate(WRONG[name]))


@pytest.mark.parametrize("name", RIGHT)
def test_an_order_that_makes_no_difference(plate, name):
    assert codes(plate(RIGHT[name])) == set()


@pytest.mark.parametrize(
    ("asked", "program", "expected"),
    [
        ("SPINDL/OFF\nDELAY/3.0\n", SPINDLE_OFF + "WAIT SEC 3.0\n", set()),
        ("SPINDL/OFF\nDELAY/3.0\n", "WAIT SEC 3.0\n" + SPINDLE_OFF, {"dwell"}),
        ("DELAY/3.0\nSPINDL/OFF\n", "WAIT SEC 3.0\n" + SPINDLE_OFF, set()),
        (BOTH, "WAIT SEC 1.0\n" + SPINDLE_OFF + "WAIT SEC 3.0\n", set()),
        (BOTH, "WAIT SEC 3.0\n" + SPINDLE_OFF + "WAIT SEC 1.0\n", {"dwell"}),
    ],
)  # fmt: skip
def test_a_dwell_waits_for_what_is_switched(plate, asked, program, expected):
    found = plate([(SPINDLE_OFF, program)], [("SPINDL/OFF\n", asked)])
    assert codes(found) == expected


@pytest.mark.parametrize(
    ("declared", "lines", "expected"),
    [
        ("DECL INT I", "I=0.012\n$VEL.CP=I\n", "speed"),
        ("DECL INT I", "I=0.5\nI=I-1\n", None),
        ("DECL INT I", "I=TRUE\n", "type"),
        ("DECL INT I", "I=#CDIS\n", "type"),
        ("DECL INT I", "I=3E9\n", "type"),
        ("DECL BOOL B", "B=1\n", "type"),
        ("DECL BOOL B", "B=2>1\n", None),
        ("DECL CHAR C", 'C="A"\n', None),
        ("DECL CHAR C", "C=TRUE\n", "type"),
        ("DECL REAL R", "R=TRUE\n", "type"),
        ("DECL REAL R", "R=48\n$VEL.CP=R/4000\n", None),
        ("DECL APO_MODE_T M", "M=#CDIS\n", None),
        ("DECL APO_MODE_T M", "M=1\n", "type"),
        ("DECL INT P", "P={X 60,Y 0,Z -1,A 0,B 0,C 180}\n", "type"),
        ("DECL E6AXIS P", "P={X 60,Y 0,Z -1,A 0,B 0,C 180}\n", "type"),
        ("DECL E6POS P", "P={A1 0,A2 -90,A3 90,A4 0,A5 0,A6 0}\n", "type"),
        ("DECL E6POS P", "P={X 1,Y 1,Z 1,A 0,B 0,C 0}\nP.X=TRUE\n", "type"),
        ("STRUC PAR INT N, REAL V\nDECL PAR P", "P={N 1,V 0.0}\nP.N=0.012\n$VEL.CP=P.N\n", "speed"),
        ("STRUC PAR INT N, REAL V\nDECL PAR P", "P={N 0.012,V 1}\n$VEL.CP=P.N\n", "speed"),
        ("STRUC PAR INT N, REAL V\nDECL PAR P", "P={N 1,V 0.012}\n$VEL.CP=P.V\n", None),
        ("STRUC PAR INT N, REAL V\nDECL PAR P", "P={N 1,V 0.012}\nP.V=TRUE\n", "type"),
        ("DECL FRAME P", "P={X 60,Y 0,Z -1,A 0,B 0,C 180}\n", None),
    ],
)
def test_variables_hold_what_they_are_declared_as(plate, declared, lines, expected):
    speed = "$VEL.CP=0.012000\n"
    lines = lines if "$VEL.CP" in lines else speed + lines
    found = codes(plate([("DEF PLATE_7( )\n", f"DEF PLATE_7( )\n{declared}\n"), (speed, lines)]))
    assert expected in found if expected else found == set()
