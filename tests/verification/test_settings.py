"""What is in force at motions, and what verify does not know: refused, or accepted by name."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.verification.verify import verify
from tests.samples import AT_PART, HEAD, START, at, cell_in, modules


@pytest.fixture(scope="module")
def cell(tmp_path_factory):
    return cell_in(tmp_path_factory.mktemp("cell"), **AT_PART)


def kinds(cell, *lines, head=HEAD):
    report = verify(modules(*head, *lines), "T", cell, collisions=False)
    return {violation.code for violation in report.violations}


TILTED = at(50, 0, 0).replace("B 0.0", "B 15.0")
ARC = "CIRC {X 10.0,Y 10.0,Z 0.0,A 0.0,B 0.0,C 175.0},{X 20.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 175.0}"
UNJUDGED = [
    "$OV_PRO=100",
    "$SOFTN_END[1]=170.0",
    "$SOFTP_END[6]=350.0",
    "BAS(#EX_BASE,2)",
    "$VEL_MA.CP=9.0",
    "$ROBROOT={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
    "$ASYNC_AXIS=1",
    "$WORKSPACE[1].MODE=#OFF",
    "$CP_VEL_TYPE=#VAR_ALL",
    "MOVE_SOMEWHERE()",
    "$VEL.CP=SPEED_OF_THE_DAY",
    "$ORI_TYPE=#WHATEVER",
    "BAS(#VEL_CP,MY_SPEED)",
]


@pytest.mark.parametrize("line", UNJUDGED)
def test_what_is_not_judged_is_refused_and_can_be_accepted(cell, line):
    lines = (START, line, at(0, 0, 0))
    assert "unjudged" in kinds(cell, *lines)
    name = line.split("=")[0] if line[0] == "$" else line.replace(",", ")").split(")")[0] + ")"
    trusted = replace(cell, accept=(name.replace("()", "").split("[")[0],))
    assert "unjudged" not in kinds(trusted, *lines)


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["$LOAD.M=0"], "load"),
        (["$LOAD={M 3.0,CM {X 0,Y 0,Z 0,A 0,B 0,C 0},J {X 0,Y 0,Z 0}}"], "load"),
        (["$IPO_MODE=#TCP"], "frame"),
        (["$ORI_TYPE=#JOINT"], "orientation"),
        (["$CIRC_TYPE=#PATH", at(0, 0, 0), ARC], "orientation"),
        (["$APO.CORI=180.0", at(0, 0, 0, "C_DIS")], "setup"),
        (["$ADVANCE=6"], "unjudged"),
        (["$ADVANCE=-1"], "unjudged"),
        (["$ADVANCE=2.5"], "unjudged"),
        (["$VEL.ORI1=2000"], "unjudged"),
        (["$APO.CPTP=150"], "unjudged"),
        (["$APO.CVEL=-5"], "unjudged"),
        (["$ACC_AXIS[2]=130"], "unjudged"),
        (["$VEL.CP=2.5"], "speed"),
        (["WAIT SEC 1000000000"], "wait"),
        (["INTERRUPT OFF 3"], "setup"),
        (["INTERRUPT DECL 7 WHEN $IN[1]==TRUE DO AWAY()"], "unjudged"),
        (["IF $IN[1] THEN", "LIN_REL {Z -20}", "ENDIF"], "condition"),
        (["LOOP", "WAIT SEC 0.1", "ENDLOOP"], "endless"),
        (["WHILE TRUE", "WAIT SEC 0.1", "ENDWHILE"], "endless"),
        (["GO:", "GOTO GO"], "endless"),
        (["TRIGGER WHEN DISTANCE=0 DELAY=0 DO $VEL.CP=0.5"], "unjudged"),
        (["$ADVANCE=0"], "setup"),
        (["$APO.CDIS=0", at(0, 0, 0, "C_DIS")], "setup"),
        (["$ACC.CP=0.01"], "speed"),
        (["BAS(#ACC_CP,10)"], "speed"),
        (["BAS(#ACC_PTP,10)"], "speed"),
        (["$VEL.ORI1=20"], "speed"),
        (["$VEL.ORI2=300"], "speed"),
        ([at(0, 0, 0), "$APO.CVEL=10"], "setup"),
        (["$VEL_EXTAX[1]=20"], "unjudged"),
        (["$ACC.ORI1=20"], "unjudged"),
        (["$GEAR_JERK[2]=20"], "unjudged"),
        (["$NO_SUCH_VARIABLE=1"], "unjudged"),
        (["$TOOL.Z=$TOOL.Z+1"], "frame"),
        (["$BASE.Z=$BASE.Z+1"], "frame"),
        ([at(0, 0, 0).replace("}", ",E1 300}")], "external"),
        (["REPEAT", at(0, 0, 0), at(5, 0, 0), "UNTIL FALSE"], "endless"),
        (["AGAIN:", at(0, 0, 0), at(5, 0, 0), "GOTO AGAIN"], "endless"),
        (["FOR i=1 TO 100000000", "$OUT[1]=TRUE", "ENDFOR"], "unjudged"),
    ],
)
def test_what_is_in_force_is_judged(cell, lines, expected):
    assert kinds(cell, START, *lines, at(10, 0, 0), at(20, 0, 0)) >= {expected}


def test_joint_motions_have_one_speed_and_that_of_the_cell(cell):
    assert kinds(cell, START, START) == set()
    assert kinds(cell, "$VEL_AXIS[1]=1", START, START) == {"speed"}
    assert kinds(cell, "BAS(#VEL_PTP,80)", START, START) == {"speed"}
    assert kinds(cell, "$ACC_AXIS[2]=1", START, START) == {"speed"}


@pytest.mark.parametrize(
    ("lost", "lines", "expected"),
    [
        ("INTERRUPT ON 3", (START,), {"setup"}),
        ("INTERRUPT DECL", (START,), {"setup"}),
        ("INITMOV", (START,), {"setup"}),
        ("#TOOL", (START, at(0, 0, 0)), {"setup"}),
        ("#BASE,1", (START, at(0, 0, 0)), {"setup", "frame"}),
        ("$VEL.CP", (START, at(0, 0, 0)), {"setup"}),
        ("$APO.CDIS", (START, at(0, 0, 0), at(0, 20, 0, "C_DIS"), at(0, 40, 0)), {"setup"}),
        ("$CIRC_TYPE", (START, at(0, 0, 0), ARC), {"setup"}),
    ],
)
def test_what_the_head_must_set_is_asked_for(cell, lost, lines, expected):
    assert kinds(cell, *lines) == set()
    head = [line for line in HEAD if lost not in line]
    assert len(head) == len(HEAD) - 1
    assert kinds(cell, *lines, head=head) >= expected


def test_conditions_about_waits_and_outputs_are_warnings(cell):
    lines = ("IF $IN[1] THEN", "$OUT[3]=TRUE", "WAIT SEC 0.1", "ENDIF")
    assert kinds(cell, START, *lines, at(0, 0, 0)) == set()
    trusted = replace(cell, accept=("$IN[1]",))
    motion = ("IF $IN[1] THEN", at(5, 0, 0), "ENDIF")
    assert kinds(trusted, START, *motion, at(0, 0, 0)) == set()


def test_constant_orientation_keeps_that_of_the_start(cell):
    """The controller does not heed the orientation of the target, and goes on from there."""
    lines = (
        *HEAD,
        START,
        at(0, 0, 0),
        "$ORI_TYPE=#CONSTANT",
        TILTED,
        "$ORI_TYPE=#VAR",
        at(90, 0, 0),
    )
    report = verify(modules(*lines), "T", cell, collisions=False)
    axis = report.run.paths.end_axis
    assert np.allclose(axis[1], axis[2])
    assert report.run.paths.curves.angle[3] < 1e-9
    upright = verify(modules(*HEAD, START, at(0, 0, 0), TILTED), "T", cell, collisions=False)
    assert not np.allclose(upright.run.paths.end_axis[2], axis[1], atol=1e-3)
