"""Statements, modules, files on disk."""

from pathlib import Path

import pytest

from postproc.errors import KrlError, PostprocError
from postproc.krl.text.parse import load_modules, parse_files, parse_module, require_sound
from postproc.krl.text.program import (
    Assign,
    Axes,
    Blank,
    Call,
    Comment,
    Continue,
    Control,
    Declaration,
    Enum,
    Expr,
    External,
    FoldBegin,
    FoldEnd,
    Halt,
    Interrupt,
    Move,
    MoveWord,
    Parameter,
    Pose,
    Raw,
    SplineBegin,
    SplineEnd,
    Text,
    Trigger,
    Variable,
    WaitFor,
    WaitSec,
)
from postproc.krl.text.render import render

FIXTURES = Path(__file__).parent / "data"


def module(*lines, data=None):
    text = "\r\n".join(["DEF M( )", *lines, "END", ""])
    files = {"M.src": text.encode()}
    if data is not None:
        files["M.dat"] = "\r\n".join(["DEFDAT M", *data, "ENDDAT", ""]).encode()
    return parse_files(files)[0]


def one(line):
    found = module(line)
    assert not found.problems, found.problems
    return found.main.statements[0]


P = Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)
POINT = "{X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0}"


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        (f"LIN {POINT} C_DIS", Move(word=MoveWord.LIN, target=P, blend=("C_DIS",))),
        ("  ptp XP1", Move(word=MoveWord.PTP, target=Expr("XP1"))),
        (
            "PTP XP1 C_PTP C_DIS",
            Move(word=MoveWord.PTP, target=Expr("XP1"), blend=("C_PTP", "C_DIS")),
        ),
        (
            "PTP {A1 1,A2 2,A3 3,A4 4,A5 5,A6 6,E1 7}",
            Move(word=MoveWord.PTP, target=Axes(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, (7.0,))),
        ),
        ("LIN_REL {Z -5} #TOOL", Move(word=MoveWord.LIN_REL, target=Pose(z_mm=-5.0), frame="TOOL")),
        (
            "LIN_REL {Z -5} C_DIS #BASE",
            Move(word=MoveWord.LIN_REL, target=Pose(z_mm=-5.0), blend=("C_DIS",), frame="BASE"),
        ),
        (
            f"CIRC {{X 0,Y 0,Z 1}},{POINT},CA -90.5 C_ORI",
            Move(
                word=MoveWord.CIRC,
                auxiliary=Pose(0.0, 0.0, 1.0),
                target=P,
                angle_deg=-90.5,
                blend=("C_ORI",),
            ),
        ),
        (
            "SLIN XP1 WITH $VEL.CP=0.3, $TOOL = STOOL2(FP1) C_SPL",
            Move(
                word=MoveWord.SLIN,
                target=Expr("XP1"),
                settings=(
                    Assign(target="$VEL.CP", value=0.3),
                    Assign(target="$TOOL", value=Expr("STOOL2(FP1)")),
                ),
                blend=("C_SPL",),
            ),
        ),
        (
            "LIN gfA[2]:{X 1} C_DIS",
            Move(word=MoveWord.LIN, target=Expr("gfA[2]:{X 1}"), blend=("C_DIS",)),
        ),
        ("SPLINE WITH $VEL.CP=0.1", SplineBegin(settings=(Assign(target="$VEL.CP", value=0.1),))),
        ("ENDSPLINE C_SPL", SplineEnd(blend=("C_SPL",))),
        ("$vel.cp = 0.5", Assign(target="$VEL.CP", value=0.5)),
        ("BASE_DATA[ n ] = a:b", Assign(target="BASE_DATA[n]", value=Expr("a:b"))),
        ("BAS (#TOOL,1 )", Call(name="BAS", arguments=(Enum("TOOL"), 1))),
        ("SUB( )", Call(name="SUB")),
        ("SUB(1,,TRUE)", Call(name="SUB", arguments=(1, None, True))),
        ("WAIT SEC 0.2", WaitSec(seconds=0.2)),
        ("WAIT FOR $IN[3] AND NOT x", WaitFor(condition="$IN[3] AND NOT x")),
        ("HALT", Halt()),
        ("CONTINUE", Continue()),
        (
            "TRIGGER WHEN DISTANCE=1 DELAY=20 DO SUB(2) PRIO=-1",
            Trigger(
                word="DISTANCE",
                where=1,
                delay_ms=20,
                action=Call(name="SUB", arguments=(2,)),
                priority=-1,
            ),
        ),
        (
            "TRIGGER WHEN PATH=-35.0 ONSTART DELAY=t DO $OUT[2]=TRUE",
            Trigger(
                word="PATH",
                where=-35.0,
                delay_ms=Expr("t"),
                action=Assign(target="$OUT[2]", value=True),
                on_start=True,
            ),
        ),
        (
            "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM ( )",
            Interrupt(
                word="DECL",
                number=3,
                condition="$STOPMESS==TRUE",
                action=Call(name="IR_STOPM"),
                is_global=True,
            ),
        ),
        ("INTERRUPT ON 3", Interrupt(word="ON", number=3)),
        ("INTERRUPT OFF", Interrupt(word="OFF")),
        ("IF (a==1) AND b THEN", Control(word="IF", text="(a==1) AND b THEN")),
        ("FOR i=1 TO n STEP 2", Control(word="FOR", text="i=1 TO n STEP 2")),
        ("ENDIF", Control(word="ENDIF")),
        ("again:", Control(word="LABEL", text="again")),
        ("GOTO again", Control(word="GOTO", text="again")),
        ("RETURN x*2", Control(word="RETURN", text="x*2")),
        (
            "DECL INT i, j[3]",
            Declaration(type_name="INT", variables=(Variable("i"), Variable("j", "3"))),
        ),
        (
            "REAL r",
            Declaration(type_name="REAL", variables=(Variable("r"),), has_decl=False),
        ),
        ("EXT BAS (BAS_COMMAND :IN,REAL :IN )", External(text="BAS (BAS_COMMAND :IN,REAL :IN )")),
        (";FOLD LIN P1;%{PE}", FoldBegin(text="LIN P1;%{PE}")),
        (";ENDFOLD (x)", FoldEnd(text="(x)")),
        ("; a word", Comment(text=" a word")),
        ("", Blank()),
        ("ANOUT ON a=0.5*$VEL_ACT", Raw(text="ANOUT ON a=0.5*$VEL_ACT")),
    ],
)
def test_statements(line, expected):
    assert one(line) == expected


def test_lines_and_comments():
    found = module("", "LIN XP1 ; there", "  $OUT[1]=TRUE")
    assert [s.line for s in found.main.statements] == [2, 3, 4]
    assert found.main.statements[1].comment == " there"


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("INI", "smartPAD"),
        ("PTP HOME Vel=100 % DEFAULT", "does not belong here"),
        ("G01 X100 Y200", "no KRL statement"),
        ("// comment", "no KRL statement"),
        ("LIN {X 1,5,Y 2}", "decimal comma"),
        ("LIN", "expected a value"),
        ("WAIT 3", "SEC or FOR"),
        ("IF a==1", "expected 'THEN'"),
        ("FOR 1 TO 3", "FOR needs"),
        ("TRIGGER WHEN TIME=1 DELAY=0 DO a=1", "DISTANCE or PATH"),
        ("INTERRUPT MAYBE 1", "INTERRUPT needs"),
        ("CIRC XP1", "expected ','"),
        ("TRUE[1]=3", "no KRL statement"),
        ("a = ", "expected a value"),
        ("b = 3 4", "does not belong here"),
        ("MYROUTINE", "needs brackets"),
        ("12 + 3", "no KRL statement"),
        ("HALT 3", "does not belong here"),
        ("GOTO 3", "GOTO needs"),
        ("DECL INT 3", "expected a name"),
    ],
)
def test_lines_that_are_no_krl_are_kept_and_reported(line, message):
    found = module("LIN XP1", line)
    assert len(found.problems) == 1
    assert message in found.problems[0].message
    assert str(found.problems[0]).startswith("M.src:3: error KRL004:")
    assert isinstance(found.main.statements[1], Raw)
    with pytest.raises(KrlError, match=r"M\.src:3: error KRL004"):
        require_sound([found])


def test_routines_of_a_module():
    text = (
        "&ACCESS RVP\n&REL 2\n; before\nDEF M(a:IN,b[]:OUT)\nEND\n\n; between\n"
        "GLOBAL DEFFCT REAL F( )\nRETURN 1.0\nENDFCT\n"
    )
    found = parse_files({"m.src": text.encode()})[0]
    assert found.attributes == ("ACCESS RVP", "REL 2")
    assert found.before == (Comment(text=" before"),)
    main, function = found.routines
    assert main.parameters == (Parameter("a", "IN"), Parameter("b", "OUT", ""))
    assert main.after == (Blank(), Comment(text=" between"))
    assert (function.name, function.result_type, function.is_global) == ("F", "REAL", True)
    assert (function.line, function.end_line) == (8, 10)


def test_data_lists():
    found = module(
        data=[
            "DECL GLOBAL CONST INT N=2",
            "DECL E6POS XP1={X 1.0,Y 2.0,Z 3.0,A 4.0,B 5.0,C 6.0,S 'B010',T 2}",
            "DECL E6POS P[2]",
            "P[1]={X 1.0}",
            'DECL FDAT FP1={TOOL_NO 1,BASE_NO 0,IPO_FRAME #BASE,POINT2[] " "}',
        ]
    )
    values = {name: value for name, value, _ in found.data.values()}
    assert values["N"] == 2
    assert values["XP1"].status == 2
    assert values["FP1"].get("POINT2[]") == Text(" ")
    first = found.data.statements[0]
    assert (first.is_global, first.is_const) == (True, True)
    assert found.data.statements[3] == Assign(target="P[1]", value=Pose(x_mm=1.0))


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (b"id,x,y,z\n1,2,3,4\n", "KRL005"),
        (b"just some words\n", "KRL005"),
        (b"DEF A( )\nLIN XP1\n", "KRL006"),
        (b"DEF A( )\nDEF B( )\nEND\n", "KRL006"),
        (b"DEF A\nEND\n", "KRL004"),
        (b"DEF A(1)\nEND\n", "KRL004"),
        (b"DEF A( )\nENDDAT\n", "KRL004"),
        (b"DEF A( )\nEND\nEND\n", "KRL004"),
        (b"DEF A( )\nEND\nLIN XP1\n", "KRL004"),
        (b"DEF A( )\nEND\n&REL 1\n", "KRL004"),
    ],
)
def test_files_that_cannot_run(text, code):
    with pytest.raises(KrlError) as caught:
        require_sound(parse_files({"A.src": text}))
    assert caught.value.code == code
    assert caught.value.source.path == "A.src"


def test_truncation_anywhere_is_an_error_or_a_shorter_program():
    whole = (FIXTURES / "milling" / "POCKETS.src").read_bytes()
    for cut in range(0, len(whole), 97):
        try:
            require_sound(parse_files({"POCKETS.src": whole[:cut]}))
        except KrlError:
            continue
        code = [line.partition(b";")[0].strip() for line in whole[:cut].splitlines()]
        assert [line for line in code if line][-1] in (b"END", b"ENDFCT")


def test_garbage_never_escapes_as_anything_but_a_krl_error():
    import numpy as np

    rng = np.random.default_rng(5)
    whole = bytearray((FIXTURES / "forms86" / "TRIMMER.src").read_bytes())
    for _ in range(300):
        broken = bytearray(whole)
        for at in rng.integers(0, len(whole), 3):
            broken[at] = int(rng.integers(0, 256))
        try:
            parse_files({"TRIMMER.src": bytes(broken)})
        except KrlError:
            continue


def test_pairs_on_disk(tmp_path):
    for name in ("forms85/STACKER", "milling/POCKETS"):
        found = parse_module(FIXTURES / f"{name}.src")
        assert found.src_path.endswith(".src")
        assert found.dat_path.endswith(".dat")
        assert not found.problems
    assert len(load_modules([FIXTURES])) == 4
    assert load_modules([FIXTURES / "milling" / "POCKETS.dat"])[0].routines
    with pytest.raises(KrlError, match="KRL007"):
        load_modules([tmp_path])
    with pytest.raises(KrlError, match="KRL007"):
        load_modules([tmp_path / "part.cls"])
    with pytest.raises(PostprocError, match="IO001"):
        load_modules([tmp_path / "none.src"])


@pytest.mark.parametrize("name", ["forms85/STACKER", "forms86/TRIMMER", "milling/POCKETS"])
def test_reading_our_rendering_of_real_looking_programs_changes_nothing(name):
    first = parse_module(FIXTURES / f"{name}.src")
    src, dat = render(first)
    again = parse_files({f"{first.name}.src": src, f"{first.name}.dat": dat})[0]
    assert not again.problems
    assert render(again) == (src, dat)
