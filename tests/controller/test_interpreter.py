"""The interpreter against what the text says, worked out by hand."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from postproc.cell.robotfile import load_robot
from postproc.controller import World, run
from postproc.controller.trace import Blend, EventWord, MotionType
from postproc.kinematics import build
from postproc.krl.text.parse import load_modules, parse_files
from postproc.krl.text.program import Axes, Pose
from tests.samples import modules

FIXTURES = Path(__file__).parents[1] / "krl" / "data"
KINEMATICS = build(load_robot("kuka_kr210_r2700_2"))
ZERO = Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
WORLD = World(
    tools={1: Pose(100.0, 0.0, 300.0, 0.0, 0.0, 0.0), 2: Pose(0.0, 0.0, 150.0, 0.0, 0.0, 0.0)},
    bases={1: Pose(1500.0, 0.0, 800.0, 0.0, 0.0, 0.0), 4: ZERO, 5: ZERO},
    points={"XHOME": Axes(0.0, -90.0, 90.0, 0.0, 30.0, 0.0)},
)
FULL = "{{X {0},Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}}"


def trace(*lines, data=(), world=WORLD, **others):
    return run(modules(*lines, data=data, **others), "T", KINEMATICS, world)


def xs(result):
    return [round(float(x) * 1e3, 6) for x in result.target[:, 0]]


def kinds(result):
    return [finding.code for finding in result.findings]


def test_columns_of_motions():
    result = trace(
        "PTP {A1 10.0,A2 -80.0,A3 90.0,A4 0.0,A5 30.0,A6 -20.0,E1 5.5} C_PTP",
        "LIN {X 1.0,Y 2.0,Z 3.0,A 10.0,B 20.0,C 30.0,S 6,T 'B10010'} C_DIS",
        "CIRC {X 4.0,Y 5.0,Z 6.0},{X 7.0,Y 8.0,Z 9.0,A 0.0,B 0.0,C 0.0},CA 45.0",
        "LIN {X 1.0} C_VEL",
    )
    assert list(result.motion_type) == [
        MotionType.PTP,
        MotionType.LIN,
        MotionType.CIRC,
        MotionType.LIN,
    ]
    assert list(result.blend) == [Blend.AXES, Blend.DISTANCE, Blend.EXACT, Blend.OTHER]
    assert list(result.line) == [2, 3, 4, 5]
    assert np.allclose(np.degrees(result.target[0]), [10, -80, 90, 0, 30, -20])
    assert np.allclose(result.target[1, :3], [1e-3, 2e-3, 3e-3])
    assert np.allclose(np.degrees(result.target[1, 3:]), [10, 20, 30])
    assert (result.status[1], result.turn[1]) == (6, 18)
    assert result.external[0, 0] == 5.5
    assert math.isnan(result.external[1, 0])
    assert np.allclose(result.auxiliary[2][:3], [4e-3, 5e-3, 6e-3])
    assert result.angle[2] == pytest.approx(math.radians(45.0))


def test_settings_follow_bas_and_assignments():
    result = trace(
        "BAS(#INITMOV,0)",
        "BAS(#TOOL,2)",
        "BAS(#BASE,1)",
        "BAS(#VEL_PTP,40)",
        "BAS(#VEL_CP,2.5)",
        "LIN " + FULL.format(1),
        "$VEL.CP=0.0125",
        "$APO={CDIS 0.75,CPTP 30.0}",
        "$VEL_AXIS[3]=15",
        "$ORI_TYPE=#JOINT",
        "$ADVANCE=0",
        "LIN " + FULL.format(2) + " C_DIS",
    )
    first, second = (result.settings[row] for row in result.setting)
    assert (first.tool_number, first.base_number) == (2, 1)
    assert first.speed == 2.0  # BAS clamps at the default
    assert first.ptp == (0.4,) * 6
    assert first.orientation_speed == pytest.approx(math.radians(200.0))
    assert second.speed == 0.0125
    assert second.cdis == pytest.approx(0.75e-3)
    assert dict(second.system)["$APO.CPTP"] == 30.0
    assert second.ptp == (0.4, 0.4, 0.15, 0.4, 0.4, 0.4)
    assert second.system["$ORI_TYPE"] == "JOINT"
    assert result.blend[1] == Blend.EXACT  # nothing is blended without advance run
    assert np.allclose(result.tools[second.tool][:3, 3], [0, 0, 0.15])
    assert np.allclose(result.bases[second.base][:3, 3], [1.5, 0, 0.8])


def test_init_takes_tool_1_and_the_world():
    T_world_robroot = np.eye(4)
    T_world_robroot[:3, 3] = (0.0, 0.0, 0.5)
    world = World(WORLD.tools, WORLD.bases, {}, T_world_robroot)
    result = trace(
        "BAS(#INITMOV,0)",
        "LIN " + FULL.format(1),
        "BAS(#BASE,1)",
        "LIN " + FULL.format(1),
        world=world,
    )
    first, second = (result.settings[row] for row in result.setting)
    assert (first.tool_number, first.base_number) == (1, 0)
    assert np.allclose(result.bases[first.base][:3, 3], [0, 0, -0.5])
    assert np.allclose(result.bases[second.base][:3, 3], [1.5, 0, 0.3])


def test_unknown_frames_are_findings():
    assert kinds(trace("BAS(#TOOL,7)")) == ["frame"]
    assert kinds(trace("BAS(#BASE,nWhich)")) == ["frame"]
    assert kinds(trace("$BASE=BASE_DATA[9]")) == ["frame"]


def test_frames_are_multiplied():
    result = trace(
        "$BASE=BASE_DATA[1]:{Z 10.0,A 90.0}:{X 5.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        "LIN gfPart:{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        data=["DECL FRAME gfPart={X 0.0,Y 0.0,Z 0.0,A 0.0,B 90.0,C 0.0}"],
    )
    settings = result.settings[result.setting[0]]
    assert np.allclose(result.bases[settings.base][:3, 3], [1.5, 0.005, 0.81])
    assert np.allclose(result.target[0, :3], [0, 0, -1e-3], atol=1e-12)


def test_frame_data_written_by_the_program_count():
    result = trace(
        "BASE_DATA[3]={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        "BASE_DATA[3].Z=BASE_DATA[3].X+2",
        "BAS(#BASE,3)",
        "LIN " + FULL.format(0),
    )
    settings = result.settings[result.setting[0]]
    assert np.allclose(result.bases[settings.base][:3, 3], [0.010, 0, 0.012])


def test_partial_targets_keep_the_rest():
    result = trace(
        "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 30.0,A6 0.0}",
        "PTP {A5 40.0}",
        "LIN {X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0}",
        "LIN {Z 9.0}",
    )
    assert np.allclose(np.degrees(result.target[1]), [0, -90, 90, 0, 40, 0])
    assert np.allclose(result.target[3, :3], [1e-3, 2e-3, 9e-3])
    assert np.allclose(np.degrees(result.target[3, 3:]), [4, 5, 6])


def test_relative_motions():
    result = trace(
        "LIN {X 10.0,Y 0.0,Z 0.0,A 0.0,B 90.0,C 0.0}",
        "LIN_REL {Z 5.0}",
        "LIN_REL {Z 5.0} #TOOL",
        "PTP {A1 10.0,A2 -90.0,A3 90.0,A4 0.0,A5 30.0,A6 0.0}",
        "PTP_REL {A1 5.0,A6 -2.0}",
    )
    assert np.allclose(result.target[1, :3], [10e-3, 0, 5e-3])
    assert np.allclose(result.target[2, :3], [15e-3, 0, 5e-3])  # tool Z is base X at B 90
    assert np.allclose(np.degrees(result.target[4]), [15, -90, 90, 0, 30, -2])


def test_a_path_begins_where_the_joints_are():
    result = trace(
        "$TOOL=$NULLFRAME",
        "$BASE=$WORLD",
        "PTP {A1 0.0,A2 -90.0,A3 90.0,A4 0.0,A5 0.0,A6 0.0}",
        "LIN_REL {X 0.0,Y 0.0,Z -100.0}",
    )
    # cannon pose of this robot: flange at X 1765, Z 1910, B 90
    assert np.allclose(result.target[1, :3], [1.765, 0, 1.810], atol=1e-9)
    assert np.degrees(result.target[1, 4]) == pytest.approx(90.0)


def test_positions_can_be_read():
    result = trace(
        "LIN {X 10.0,Y 0.0,Z 5.0,A 0.0,B 0.0,C 0.0}",
        "r=$POS_ACT.X+1",
        "LIN {X r}",
        data=["DECL REAL r=0.0"],
    )
    assert xs(result) == [10.0, 11.0]


LOOPS = [
    (["FOR i=1 TO 3", "LIN {X i}", "ENDFOR"], [1, 2, 3]),
    (["FOR i=6 TO 1 STEP -2", "LIN {X i}", "ENDFOR"], [6, 4, 2]),
    (["FOR i=3 TO 1", "LIN {X i}", "ENDFOR"], []),
    (["i=0", "WHILE i<3", "i=i+1", "LIN {X i}", "ENDWHILE"], [1, 2, 3]),
    (["i=0", "REPEAT", "i=i+1", "LIN {X i}", "UNTIL i>=2"], [1, 2]),
    (["i=0", "LOOP", "i=i+1", "IF i>2 THEN", "EXIT", "ENDIF", "LIN {X i}", "ENDLOOP"], [1, 2]),
    (["IF 2>1 THEN", "LIN {X 1}", "ELSE", "LIN {X 2}", "ENDIF"], [1]),
    (["IF NOT (2>1) THEN", "LIN {X 1}", "ELSE", "LIN {X 2}", "ENDIF"], [2]),
    (["IF FALSE THEN", "LIN {X 1}", "ENDIF", "LIN {X 3}"], [3]),
    (
        [
            "i=2",
            "SWITCH i",
            "CASE 1",
            "LIN {X 1}",
            "CASE 2,3",
            "LIN {X 2}",
            "DEFAULT",
            "LIN {X 9}",
            "ENDSWITCH",
        ],
        [2],
    ),
    (["i=7", "SWITCH i", "CASE 1", "LIN {X 1}", "DEFAULT", "LIN {X 9}", "ENDSWITCH"], [9]),
    (["i=0", "again:", "i=i+1", "LIN {X i}", "IF i<3 THEN", "GOTO again", "ENDIF"], [1, 2, 3]),
    (["LIN {X 1}", "RETURN", "LIN {X 2}"], [1]),
    (["FOR i=1 TO 2", "FOR k=1 TO 2", "LIN {X i*10+k}", "ENDFOR", "ENDFOR"], [11, 12, 21, 22]),
]


@pytest.mark.parametrize(("lines", "expected"), LOOPS, ids=range(len(LOOPS)))
def test_program_control(lines, expected):
    first = "LIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}"
    result = trace("DECL INT i,k", first, *lines)
    assert xs(result)[1:] == expected
    assert not result.findings


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (["IF $IN[3] THEN", "LIN {X 1}", "ELSE", "LIN {X 2}", "ENDIF"], [2]),
        (["LOOP", "LIN {X 1}", "ENDLOOP"], [1]),
        (["WHILE TRUE", "LIN {X 1}", "ENDWHILE"], [1]),
        (["WHILE $IN[1]", "LIN {X 1}", "ENDWHILE"], []),
        (["REPEAT", "LIN {X 1}", "UNTIL $IN[1]"], [1]),
        (["LOOP", "LIN {X 1}", "IF $IN[1] THEN", "EXIT", "ENDIF", "ENDLOOP"], [1]),
        (["FOR i=1 TO nCount", "LIN {X 1}", "ENDFOR"], [1]),
    ],
)
def test_what_only_the_controller_knows_is_refused_where_it_decides_about_motions(lines, expected):
    first = "LIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}"
    result = trace("DECL INT i", first, *lines)
    assert xs(result)[1:] == expected
    assert {f.code for f in result.findings} <= {"condition", "endless"}
    assert any(f.severity == "error" for f in result.findings)


def test_known_values_decide_with_unknown_ones():
    result = trace(
        "IF $IN[1] AND FALSE THEN", "HALT", "ENDIF", "IF $IN[1] OR TRUE THEN", "HALT", "ENDIF"
    )
    assert [event.word for event in result.events] == [EventWord.HALT]
    assert not result.findings


@pytest.mark.parametrize(
    ("lines", "kind"),
    [
        (["i=0", "WHILE i<1", "i=0", "ENDWHILE"], "endless"),
        (["T()"], "endless"),
        (["ENDIF"], "structure"),
        (["IF TRUE THEN"], "structure"),
        (["GOTO nowhere"], "structure"),
        (["EXIT"], "structure"),
        (["LIN XNOWHERE"], "target"),
        (["LIN {A1 1.0,A2 2.0,A3 3.0,A4 4.0,A5 5.0,A6 6.0}"], "target"),
        (["CIRC XNOWHERE,{X 1.0,Y 2.0,Z 3.0,A 0.0,B 0.0,C 0.0}"], "target"),
        (["LIN {X 1.0}"], "target"),
    ],
)
def test_programs_that_do_not_run(lines, kind, monkeypatch):
    import postproc.controller.interpreter as interpreter

    monkeypatch.setattr(interpreter, "MAX_REPEATED_LINES", 1000)
    result = trace("DECL INT i", *lines)
    assert kind in kinds(result)


def test_calls_parameters_and_functions():
    result = trace(
        "DECL REAL a",
        "LIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        "a=2.0",
        "SUB(a,3.0)",
        "LIN {X a}",
        "LIN {X TWICE(a)+ABS(-1)}",
        "OTHER(5)",
        "HELPER()",
        SUB="DEF SUB(x:OUT,y:IN)\nDECL REAL x,y\nx=x*y\ny=99\nLIN {X x}\nEND\n",
        OTHER=(
            "DEF OTHER(n:IN)\nDECL INT n\nLOCAL(n+1)\nEND\n"
            "DEF LOCAL(n:IN)\nDECL INT n\nLIN {X n}\nEND\n"
            "GLOBAL DEF HELPER( )\nLIN {X 77}\nEND\n"
            "GLOBAL DEFFCT REAL TWICE(x:IN)\nDECL REAL x\nRETURN 2.0*x\nENDFCT\n"
        ),
    )
    assert xs(result) == [0, 6, 6, 13, 6, 77]
    assert [result.files[row] for row in result.file] == [
        "T.src", "SUB.src", "T.src", "T.src", "OTHER.src", "OTHER.src"
    ]  # fmt: skip


def test_integer_arithmetic_is_krl():
    result = trace(
        "LIN {X 0.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        "LIN {X 7/2}",
        "LIN {X 7/2.0}",
        "LIN {X SQRT(16)+ATAN2(1,1)+COS(60)*2}",
        "LIN {X 'B101'+'H0F'}",
        "LIN {X (6 B_AND 3)+(4 B_OR 1)}",
    )
    assert xs(result)[1:] == [3, 3.5, 50, 20, 7]


def test_arrays_and_structures():
    result = trace(
        "LIN gP[2]",
        "gP[2].X=gP[1].X+1",
        "LIN gP[2]",
        "gP[3]=gP[1]:{X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        "LIN gP[3]",
        data=[
            "DECL POS gP[3]",
            "gP[1]={X 10.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
            "gP[2]={X 20.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}",
        ],
    )
    assert xs(result) == [20, 11, 11]


def test_events_between_motions():
    result = trace(
        "PP_SPINDLE_ON(3000)",
        "LIN " + FULL.format(1),
        "WAIT SEC 0.25*2",
        "$OUT[7]=TRUE",
        "WAIT FOR $IN[3]",
        "TRIGGER WHEN DISTANCE=0 DELAY=0 DO PP_BLOW(2,#ON) PRIO=-1",
        "LIN " + FULL.format(2),
        "PULSE($OUT[2],TRUE,0.5)",
        "HALT",
        world=replace(WORLD, hooks=frozenset({"PP_SPINDLE_ON", "PP_BLOW"})),
    )
    got = [(e.motion, e.word, e.name) for e in result.events]
    assert got == [
        (0, EventWord.HOOK, "PP_SPINDLE_ON"),
        (1, EventWord.DWELL, "WAIT SEC"),
        (1, EventWord.OUTPUT, "$OUT[7]"),
        (1, EventWord.WAIT_FOR, "$IN[3]"),
        (1, EventWord.HOOK, "PP_BLOW"),
        (2, EventWord.OUTPUT, "PULSE"),
        (2, EventWord.HALT, "HALT"),
    ]
    assert result.events[0].value == 3000
    assert result.events[1].value == 0.5
    assert result.events[4].arguments == (2, "#ON")


def test_forms_up_to_8_5():
    tools = {1: ZERO, 3: Pose(0.0, 0.0, 200.0, 0.0, 0.0, 0.0)}
    world = World(tools=tools, bases={5: ZERO}, points=WORLD.points)
    result = run(load_modules([FIXTURES / "forms85"]), "STACKER", KINEMATICS, world)
    # FHOME and its motion data are in $config.dat
    errors = {f.code for f in result.findings if f.severity == "error"}
    assert errors == {"frame", "unjudged"}
    assert len(result) == 5
    last = result.settings[result.setting[4]]
    assert (last.tool_number, last.base_number) == (3, 5)
    lin = result.settings[result.setting[2]]
    assert lin.speed == 0.5
    assert list(result.blend) == [Blend.EXACT, Blend.AXES, Blend.EXACT, Blend.EXACT, Blend.EXACT]
    assert (result.status[1], result.turn[1]) == (2, 0b100010)
    assert result.target[1, 0] == pytest.approx(1.20433215)


def test_forms_of_8_6_and_spline_blocks():
    timed = replace(WORLD, accept=frozenset({"TIME_BLOCK"}))
    files = load_modules([FIXTURES / "forms86"])
    assert kinds(run(files, "TRIMMER", KINEMATICS, WORLD)) == ["unjudged"]
    result = run(files, "TRIMMER", KINEMATICS, timed)
    assert not result.findings
    assert list(result.motion_type) == [0, 1, 1, 3, 3, 1, 2, 0]
    first = result.settings[result.setting[0]]
    assert (first.tool_number, first.base_number, first.ptp) == (2, 4, (0.2,) * 6)
    assert result.settings[result.setting[1]].speed == 0.3
    assert list(result.blend) == [0, 2, 0, 1, 1, 1, 0, 0]
    inside = result.settings[result.setting[4]]
    assert (inside.speed, inside.tool_number) == (0.05, 2)
    assert list(result.block) == [-1, -1, -1, 1, 1, 1, 1, -1]
    # the WITH of the block ends with the block
    assert result.settings[result.setting[7]].speed != 0.05


def test_a_milling_job():
    files = load_modules([FIXTURES / "milling"])
    trusted = replace(WORLD, accept=frozenset({"SPINDLE_RUN", "SPINDLE_STOP", "INTERRUPT"}))
    result = run(files, "POCKETS", KINEMATICS, trusted)
    assert {f.code for f in run(files, "POCKETS", KINEMATICS, WORLD).findings} == {"unjudged"}
    assert not [f for f in result.findings if f.severity == "error"]
    holes = [e for e in result.events if e.word is EventWord.DWELL and e.value == 0.25]
    assert len(holes) == 3
    assert [e.name for e in result.events if e.word is EventWord.HOOK] == [
        "SPINDLE_RUN", "SPINDLE_STOP"
    ]  # fmt: skip
    depth = result.target[result.motion_type == MotionType.LIN][2]
    assert depth[2] == pytest.approx(-5e-3 + 7.5e-3)  # tool Z points down: -7.5 along it is up


def test_names_are_found_whatever_their_case():
    files = {
        "t.src": b"DEF T( )\nlin xp1\nSub()\nEND\nDEF SUB( )\nLIN Xp1\nEND\n",
        "T.DAT": b"DEFDAT t\nDECL E6POS xP1={X 1.0,Y 0.0,Z 0.0,A 0.0,B 0.0,C 0.0}\nENDDAT\n",
    }
    result = run(parse_files(files), "t", KINEMATICS, WORLD)
    assert xs(result) == [1.0, 1.0]


class TestWhatMayHaveChanged:
    """What something unknown may have written is not known, and no old value stands in for it."""

    UNSURE = ("INT N", "N=5")

    @pytest.mark.parametrize(
        "lines",
        [
            ["IF $IN[1] THEN", "N=7", "ENDIF"],
            ["IF $IN[1] THEN", "N=7", "ELSE", "N=6", "ENDIF"],
            ["SWITCH $IN[1]", "CASE TRUE", "N=7", "DEFAULT", "N=6", "ENDSWITCH"],
            ["WHILE $IN[1]", "N=N+1", "ENDWHILE"],
            ["REPEAT", "N=N+1", "UNTIL $IN[1]"],
            ['CREAD(1,2,3,4,5,"%d",N)'],
            ['SREAD("12","%d",N)'],
        ],
    )
    def test_a_motion_to_it_has_no_target(self, lines):
        result = trace(*self.UNSURE, *lines, "LIN {X 1.0,Y N}")
        assert "target" in kinds(result)

    def test_what_is_known_again_has_one(self):
        lines = ["IF $IN[1] THEN", "N=7", "ENDIF", "N=8"]
        result = trace(*self.UNSURE, *lines, "LIN " + FULL.format("N"))
        assert "target" not in kinds(result)
        assert xs(result)[-1] == 8.0


@pytest.mark.parametrize(
    ("line", "kind"),
    [
        ("ASYPTP {E1 0}", "unjudged"),
        ("ANIN ON FACTOR=1.0*$ANIN[1]+0.0", "unjudged"),
        ('CWRITE($CMD,1,2,"RUN/R1/OTHER()")', "unjudged"),
        ("TIME_BLOCK START", "unjudged"),
        ("BRAKE", "structure"),
        ("RESUME", "structure"),
        ("BASE_DATA[1].Z=10.0", "unjudged"),
        ("TOOL_DATA[2]=TOOL_DATA[1]", "unjudged"),
        ("TOOL_DATA[2].Z=1.0*$ANIN[1]", "unjudged"),
        ("SET_CD_PARAMS(3)", "unjudged"),
        ("SET_CD_PARAMS(0)", None),
        ("$COLLMON_TOL_PRO[1]=500", "unjudged"),
        ("$COLLMON_TOL_PRO[1]=USE_CM_PRO_VALUES(0)", None),
        ("ANOUT ON OUT1=1.0", None),
        ("CHANNEL(:A,B,C)", None),
        ("BASE_DATA[1]={X 1500.0,Y 0.0,Z 800.0,A 0.0,B 0.0,C 0.0}", None),
    ],
)
def test_instructions_that_are_not_followed(line, kind):
    assert kinds(trace(line)) == ([kind] if kind else [])


def test_an_interrupt_acts_at_any_moment():
    lines = ["INTERRUPT DECL 9 WHEN $IN[1]==TRUE DO BACK()", "INTERRUPT ON 9"]
    quiet = trace(*lines, BACK="DEF BACK( )\n$OUT[1]=TRUE\nEND\n")
    leaving = trace(*lines, BACK="DEF BACK( )\nBRAKE\nRESUME\nEND\n")
    assert kinds(quiet) == kinds(leaving) == ["unjudged"]
