"""Program text: one spelling, ASCII and CR LF, nothing that outside text can break out of.

Expected lines follow what controllers write themselves (forms, INI fold, literals); the reader is a
program of its own, so reading and printing again is a test of both.
"""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.errors import KrlError
from postproc.krl.text.parse import parse_files
from postproc.krl.text.program import (
    Aggregate,
    Assign,
    Axes,
    Blank,
    Call,
    Comment,
    Continue,
    Control,
    DataList,
    Declaration,
    Enum,
    Expr,
    External,
    FoldBegin,
    FoldEnd,
    Halt,
    Interrupt,
    KrlModule,
    Move,
    MoveWord,
    Parameter,
    Pose,
    Raw,
    Routine,
    SplineBegin,
    SplineEnd,
    Text,
    Trigger,
    Variable,
    WaitFor,
    WaitSec,
)
from postproc.krl.text.render import render, render_statement

POSE = Pose(1.0, -2.5, 1234.56789, 90.0, -1e-9, 179.999999)
AXES = Axes(0.0, -90.0, 90.0, 0.0, -0.000001, 0.0)


@pytest.mark.parametrize(
    ("statement", "text"),
    [
        (
            Move(MoveWord.LIN, POSE, blend=("C_DIS",)),
            "LIN {X 1.0000,Y -2.5000,Z 1234.5679,A 90.00000,B 0.00000,C 180.00000} C_DIS",
        ),
        (
            Move(MoveWord.PTP, AXES, blend=("C_PTP", "C_DIS")),
            "PTP {A1 0.00000,A2 -90.00000,A3 90.00000,A4 0.00000,A5 0.00000,A6 0.00000} "
            "C_PTP C_DIS",
        ),
        (
            Move(MoveWord.CIRC, Expr("XP2"), Expr("XP1"), angle_deg=360.0),
            "CIRC XP1,XP2,CA 360.00000",
        ),
        (Move(MoveWord.LIN_REL, Pose(z_mm=10.0), frame="TOOL"), "LIN_REL {Z 10.0000} #TOOL"),
        (
            Move(MoveWord.SLIN, Expr("XP1"), settings=(Assign("$VEL.CP", 0.1),), blend=("C_SPL",)),
            "SLIN XP1 WITH $VEL.CP=0.100000 C_SPL",
        ),
        (
            Move(MoveWord.PTP, Pose(*[0.0] * 6, status=2, turn=35, external=(1.5, 0.0))),
            "PTP {X 0.0000,Y 0.0000,Z 0.0000,A 0.00000,B 0.00000,C 0.00000,S 2,T 35,"
            "E1 1.50000,E2 0.00000}",
        ),
        (Move(MoveWord.LIN, Pose(*[0.0] * 6, type_name="E6POS")), None),
        (SplineBegin(settings=(Assign("$VEL.CP", 0.5),)), "SPLINE WITH $VEL.CP=0.500000"),
        (SplineEnd(blend=("C_SPL",)), "ENDSPLINE C_SPL"),
        (Assign("$VEL.CP", 0.00166667), "$VEL.CP=0.00166667"),
        (Assign("$APO.CDIS", 1.0), "$APO.CDIS=1.0000"),
        (Assign("$BWDSTART", False), "$BWDSTART=FALSE"),
        (Assign("PDAT_ACT", Expr("PPDAT1")), "PDAT_ACT=PPDAT1"),
        (Call("BAS", (Enum("TOOL"), 1)), "BAS(#TOOL,1)"),
        (Call("BAS", (Enum("CP_PARAMS"), 0.05)), "BAS(#CP_PARAMS,0.050000)"),
        (Call("UP", (None, 2)), "UP(,2)"),
        (Call("PP_STOP"), "PP_STOP()"),
        (WaitSec(0.5), "WAIT SEC 0.5000"),
        (WaitFor("$IN[5]"), "WAIT FOR $IN[5]"),
        (Halt(), "HALT"),
        (Continue(), "CONTINUE"),
        (
            Trigger("DISTANCE", 0, 0, Call("PP_COOLANT_ON", (1,)), priority=-1),
            "TRIGGER WHEN DISTANCE=0 DELAY=0 DO PP_COOLANT_ON(1) PRIO=-1",
        ),
        (
            Trigger("PATH", -35.0, 20, Assign("$OUT[3]", True)),
            "TRIGGER WHEN PATH=-35.0000 DELAY=20 DO $OUT[3]=TRUE",
        ),
        (
            Interrupt("DECL", 3, "$STOPMESS==TRUE", Call("IR_STOPM"), is_global=True),
            "GLOBAL INTERRUPT DECL 3 WHEN $STOPMESS==TRUE DO IR_STOPM()",
        ),
        (Interrupt("ON", 3), "INTERRUPT ON 3"),
        (Control("IF", "$IN[1] THEN"), "IF $IN[1] THEN"),
        (Control("LABEL", "AGAIN"), "AGAIN:"),
        (
            Declaration("FDAT", (Variable("FP1", None, Aggregate((("POINT2[]", Text(" ")),))),)),
            'DECL FDAT FP1={POINT2[] " "}',
        ),
        (
            Declaration("REAL", (Variable("A", "3"), Variable("B")), is_global=True),
            "DECL GLOBAL REAL A[3],B",
        ),
        (Declaration("INT", (Variable("I"),), has_decl=False), "INT I"),
        (External("BAS(BAS_COMMAND :IN,REAL :IN)"), "EXT BAS(BAS_COMMAND :IN,REAL :IN)"),
        (FoldBegin("INI;%{PE}"), ";FOLD INI;%{PE}"),
        (FoldEnd("(INI)"), ";ENDFOLD (INI)"),
        (FoldEnd(), ";ENDFOLD"),
        (Comment(" hello"), "; hello"),
        (Blank(), ""),
        (Raw("ANOUT ON SIG=0.5*$VEL_ACT"), "ANOUT ON SIG=0.5*$VEL_ACT"),
        (
            Assign("LOAD_DATA[1]", Aggregate((("M", 12.5), ("CM", Pose(x_mm=1.0))))),
            "LOAD_DATA[1]={M 12.5000,CM {X 1.0000}}",
        ),
        (Halt(comment=" CAM line 7"), "HALT ; CAM line 7"),
    ],
)
def test_statements(statement, text):
    if text is None:
        text = "LIN {E6POS: X 0.0000,Y 0.0000,Z 0.0000,A 0.00000,B 0.00000,C 0.00000}"
    assert render_statement(statement) == text


def module(*statements, data=None):
    return KrlModule("A", (Routine("A", statements),), data, ("ACCESS RVP", "REL 1"))


def test_a_whole_module():
    data = DataList("A", (Declaration("INT", (Variable("N", None, 3),)),), True, ("ACCESS RVP",))
    helper = Routine("UP", (Halt(),), (Parameter("X", "IN"), Parameter("Y", "OUT")), is_global=True)
    function = Routine("F", (Control("RETURN", "1"),), result_type="INT")
    src, dat = render(KrlModule("A", (Routine("A", ()), helper, function), data, ("ACCESS RVP",)))
    assert src == (
        b"&ACCESS RVP\r\nDEF A( )\r\nEND\r\nGLOBAL DEF UP(X:IN,Y:OUT)\r\nHALT\r\nEND\r\n"
        b"DEFFCT INT F( )\r\nRETURN 1\r\nENDFCT\r\n"
    )
    assert dat == b"&ACCESS RVP\r\nDEFDAT A PUBLIC\r\nDECL INT N=3\r\nENDDAT\r\n"


def test_blocks_are_indented():
    src, dat = render(
        module(
            Control("IF", "TRUE THEN"),
            SplineBegin(),
            Move(MoveWord.SPL, Expr("XP1")),
            SplineEnd(),
            Control("ELSE"),
            Halt(),
            Control("ENDIF"),
        )
    )
    lines = src.decode().split("\r\n")[3:-2]
    assert lines == [
        "IF TRUE THEN",
        "  SPLINE",
        "    SPL XP1",
        "  ENDSPLINE",
        "ELSE",
        "  HALT",
        "ENDIF",
    ]
    assert dat == b""


@pytest.mark.parametrize(
    "text", ["a\nHALT", "a\rHALT", "tab\there", "nul\x00", "ä", "a\u2028HALT", "a\x85b"]
)
@pytest.mark.parametrize("place", ["comment", "fold", "raw", "trailing", "text"])
def test_text_that_breaks_its_line_is_refused(text, place):
    statement = {
        "comment": Comment(text),
        "fold": FoldBegin(text),
        "raw": Raw(text),
        "trailing": Halt(comment=text),
        "text": Assign("T[]", Text(text)),
    }[place]
    with pytest.raises(KrlError) as caught:
        render(module(statement))
    assert caught.value.code == "KRL911"
    assert caught.value.source.line == 4


@pytest.mark.parametrize(
    "statement",
    [
        Comment("FOLD x"),
        Comment("  endfold"),
        Raw("X=1 ; HALT"),
        Assign("X;Y", 1),
        Assign("X", Expr("1;HALT")),
        WaitFor("TRUE;"),
        Call("UP;HALT"),
        Assign("T[]", Text('say "x"')),
    ],
)
def test_text_that_changes_its_meaning_is_refused(statement):
    with pytest.raises(KrlError) as caught:
        render(module(statement))
    assert caught.value.code == "KRL912"


@pytest.mark.parametrize("wrong", [float("nan"), float("inf"), 1e12])
@pytest.mark.parametrize(
    "make",
    [
        lambda v: Move(MoveWord.LIN, Pose(v, 0.0, 0.0, 0.0, 0.0, 0.0)),
        lambda v: Move(MoveWord.LIN, Pose(c_deg=v)),
        lambda v: Move(MoveWord.PTP, Axes(v, *[0.0] * 5)),
        lambda v: Move(MoveWord.PTP, Axes(*[0.0] * 6, external=(v,))),
        lambda v: Assign("$VEL.CP", v),
        lambda v: Assign("$APO.CDIS", v),
        WaitSec,
        lambda v: Call("BAS", (Enum("VEL_PTP"), v)),
    ],
)
def test_numbers_that_are_none_are_refused(make, wrong):
    with pytest.raises(KrlError) as caught:
        render(module(make(wrong)))
    assert caught.value.code == "KRL901"


# ---------------------------------------------------------------- reading back what was printed

number = st.floats(-1e6, 1e6)
angle = st.floats(-720, 720)
fraction = st.floats(1e-4, 1e3)
external = st.lists(number, max_size=6).map(tuple)
poses = st.builds(
    Pose,
    *[number] * 3,
    *[angle] * 3,
    st.none() | st.integers(0, 31),
    st.none() | st.integers(0, 4095),
    external,
)
some_pose = st.builds(Pose, number, st.none() | number, z_mm=st.none() | number)
axes = st.builds(Axes, *[angle] * 6, external)
names = st.from_regex(r"[A-WYZ][A-Z0-9_]{2,10}", fullmatch=True).map(lambda n: "Q" + n)
targets = st.one_of(poses, axes, names.map(Expr))
comments = st.one_of(st.just(""), st.from_regex(r" [a-zA-Z0-9 ,.:()'-]{0,30}[a-z]", fullmatch=True))
settings = st.lists(st.builds(Assign, st.just("$VEL.CP"), st.floats(1e-4, 3.0)), max_size=1).map(
    tuple
)
classic = st.builds(
    Move,
    st.sampled_from([MoveWord.PTP, MoveWord.LIN]),
    targets,
    blend=st.sampled_from([(), ("C_DIS",), ("C_PTP",), ("C_PTP", "C_DIS")]),
    comment=comments,
)
circles = st.builds(
    Move,
    st.sampled_from([MoveWord.CIRC, MoveWord.SCIRC]),
    poses,
    st.one_of(poses, names.map(Expr)),
    st.none() | angle,
    comment=comments,
)
splines = st.builds(
    Move,
    st.sampled_from([MoveWord.SLIN, MoveWord.SPTP, MoveWord.SPL]),
    targets,
    settings=settings,
    blend=st.sampled_from([(), ("C_SPL",)]),
    comment=comments,
)
relative = st.builds(
    Move, st.just(MoveWord.LIN_REL), some_pose, frame=st.sampled_from(["", "BASE", "TOOL"])
)
others = st.one_of(
    st.builds(Assign, st.just("$VEL.CP"), st.floats(1e-4, 3.0), comment=comments),
    st.builds(Assign, names, st.one_of(number, st.integers(-999, 999), st.booleans())),
    st.builds(Call, names, st.lists(st.one_of(st.integers(0, 9), fraction), max_size=3).map(tuple)),
    st.builds(WaitSec, st.floats(0, 100)),
    st.builds(Comment, comments.filter(bool)),
    st.builds(FoldBegin, st.just("A b;%{PE}")),
    st.builds(FoldEnd, st.just("(A b)")),
    st.builds(Halt),
    st.builds(Blank),
    st.builds(
        Trigger,
        st.just("DISTANCE"),
        st.sampled_from([0, 1]),
        st.integers(-100, 100),
        st.builds(Call, names),
        st.just(-1),
    ),
)
programs = st.lists(st.one_of(classic, circles, splines, relative, others), max_size=15)


@given(programs, st.lists(poses, max_size=4))
def test_reading_and_printing_again_is_the_identity(statements, points):
    data = DataList(
        "A",
        tuple(
            Declaration("E6POS", (Variable(f"XP{i}", None, pose),)) for i, pose in enumerate(points)
        ),
        attributes=("ACCESS RVP",),
    )
    first = render(module(*statements, data=data))
    read = parse_files({"A.src": first[0], "A.dat": first[1]})
    assert len(read) == 1
    assert not read[0].problems
    assert render(read[0]) == first
