"""Expressions and literals."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.krl.text.expression import (
    Binary,
    FunctionCall,
    Reference,
    Unary,
    names_in,
    parse_expression,
    unparse,
)
from postproc.krl.text.lexer import KrlSyntaxError
from postproc.krl.text.literals import components, quick_literal
from postproc.krl.text.program import Aggregate, Axes, Enum, Expr, Pose, Text


def test_literals():
    assert parse_expression("12") == 12
    assert isinstance(parse_expression("12"), int)
    assert parse_expression("-1.5E-03") == -0.0015
    assert parse_expression("'B101'") == 5
    assert parse_expression("'H1F'") == 31
    assert parse_expression("true") is True
    assert parse_expression("#Base") == Enum("Base")
    assert parse_expression('"a b"') == Text("a b")


def test_minus_zero_is_kept():
    assert math.copysign(1.0, parse_expression("-0.0")) < 0.0
    pose = parse_expression("{X -0.0,Y 1}")
    assert math.copysign(1.0, pose.x_mm) < 0.0


def test_pose_literals():
    pose = parse_expression("{E6POS: T 'B010010', S 2, Z 3.0 ,Y 2,X 1.0,A 4,B 5,C 6,E1 7,E2 8}")
    assert pose == Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 2, 18, (7.0, 8.0), "E6POS")
    assert parse_expression("{Z 10}") == Pose(z_mm=10.0)
    assert parse_expression("{A1 1,A2 2,A3 3,A4 4,A5 5,A6 6}") == Axes(1.0, 2.0, 3.0, 4.0, 5.0, 6.0)


@pytest.mark.parametrize(
    "text",
    [
        "{X 1,X 2}",
        "{X 1,A1 2}",
        "{X 1,Q 2}",
        "{X 1,E2 2}",
        "{S 2.5,X 1}",
        "{T 99999999999,X 1}",
        "{E6AXIS: X 1}",
        "{FRAME: A1 1}",
        "{E1 1}",
    ],
)
def test_what_is_neither_pose_nor_axes_stays_an_aggregate(text):
    assert isinstance(parse_expression(text), Aggregate)


def test_other_structures():
    load = parse_expression("{M 85.5,CM {X 1,Y 2,Z 3,A 0,B 0,C 0},J {X 1,Y 1,Z 1}}")
    assert load.get("m") == 85.5
    assert load.get("CM") == Pose(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    fdat = parse_expression('{TOOL_NO 1,BASE_NO 2,IPO_FRAME #BASE,POINT2[] " ",TQ_STATE FALSE}')
    assert fdat.get("POINT2[]") == Text(" ")
    assert fdat.get("TQ_STATE") is False


def test_structures_to_be_computed():
    from postproc.krl.text.expression import ExpressionParser

    value = ExpressionParser("{X a+1, Y 2.0}").value()
    assert value == Aggregate((("X", Expr("(A + 1)")), ("Y", 2.0)))


def test_precedence():
    assert unparse(parse_expression("1+2*3:4")) == "(1 + (2 * (3 : 4)))"
    assert (
        unparse(parse_expression("a==1 AND b<>2 OR NOT c")) == "(((A == 1) AND (B <> 2)) OR NOT C)"
    )
    assert unparse(parse_expression("a-b-c")) == "((A - B) - C)"
    assert isinstance(parse_expression("-a"), Unary)
    assert isinstance(parse_expression("a:b"), Binary)


def test_references_and_calls():
    node = parse_expression("gfRow[n+1,2].X")
    assert node == Reference("GFROW", ((Binary("+", Reference("N"), 1), 2), "X"))
    call = parse_expression("SVEL_CP(2.0, , LCPDAT1)")
    assert call == FunctionCall("SVEL_CP", (2.0, None, Reference("LCPDAT1")))
    assert parse_expression("f( )") == FunctionCall("f", ())


def test_names():
    found = set(names_in(parse_expression("f(a[i],{X b}):$BASE")))
    assert found == {
        ("F", True),
        ("A", False),
        ("I", False),
        ("B", False),
        ("$BASE", False),
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{X 1,5,Y 2}", "decimal comma"),
        ("{X 1 Y 2}", "expected ','"),
        ("{X }", "expected a value"),
        ("{X 1", "expected ','"),
        ("(1+2", r"expected '\)'"),
        ("a +", "expected a value"),
        ("a b", "does not belong here"),
        ("1e999", "too large"),
        ("9" * 40, "too large"),
        ("'B102'", "no binary"),
        ("a[1", "expected ']'"),
        ("a.[1]", "component"),
        ("", "expected a value"),
        ("(" * 100 + "1" + ")" * 100, "brackets"),
        ("{X " * 100 + "1" + "}" * 100, "brackets"),
        ("-" * 100 + "1", "brackets"),
    ],
)
def test_faults(text, message):
    with pytest.raises(KrlSyntaxError, match=message):
        parse_expression(text)


@pytest.mark.parametrize(
    "text",
    ["{X nan}", "{X inf}", "{X 1_0}", "{X 1e999}", "{X 1,5}", "{X}", "{}", "{X 1 2}", "{X ٣}"],
)
def test_the_fast_reader_leaves_doubts_to_the_full_one(text):
    assert quick_literal(text) is None


numbers = st.floats(-1e6, 1e6, allow_nan=False).map(lambda v: float(f"{v:.9g}"))


@given(st.lists(numbers, min_size=6, max_size=6), st.integers(0, 31), st.integers(0, 63))
def test_fast_and_full_reader_agree(values, status, turn):
    names = ("X", "Y", "Z", "A", "B", "C")
    body = ",".join(f"{n} {v!r}" for n, v in zip(names, values, strict=True))
    text = f"{{{body},S {status},T 'B{turn:b}',E1 0.0}}"
    quick = quick_literal(text)
    assert quick == parse_expression(text)
    assert [v for _, v in components(quick)][:6] == values
