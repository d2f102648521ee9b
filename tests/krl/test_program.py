"""The program types: lookups and what counts as equal."""

import pytest

from postproc.krl.text.program import (
    Aggregate,
    Assign,
    Axes,
    Comment,
    DataList,
    Declaration,
    Enum,
    KrlModule,
    Move,
    MoveWord,
    Pose,
    Routine,
    Variable,
)


def test_the_source_line_does_not_count():
    assert Assign("$VEL.CP", 0.1, line=3) == Assign("$VEL.CP", 0.1, line=4)
    assert Assign("$VEL.CP", 0.1, comment="a") != Assign("$VEL.CP", 0.1, comment="b")


def test_completeness():
    assert Pose(1.0, 2.0, 3.0, 4.0, 5.0, 6.0).is_complete
    assert not Pose(x_mm=1.0).is_complete
    assert Axes(*([0.0] * 6)).is_complete
    assert not Axes(a1_deg=1.0).is_complete


@pytest.mark.parametrize(
    ("word", "spline", "axis", "circular", "relative"),
    [
        (MoveWord.PTP, False, True, False, False),
        (MoveWord.LIN_REL, False, False, False, True),
        (MoveWord.SCIRC, True, False, True, False),
        (MoveWord.SPTP, True, True, False, False),
        (MoveWord.SPL, True, False, False, False),
    ],
)
def test_kinds_of_motion(word, spline, axis, circular, relative):
    found = (word.is_spline, word.is_axis_motion, word.is_circular, word.is_relative)
    assert found == (spline, axis, circular, relative)


def test_lookups_ignore_the_case():
    module = KrlModule("A", (Routine("A", ()), Routine("Helper", ())))
    assert module.main.name == "A"
    assert module.routine("HELPER") is module.routines[1]
    assert module.routine("other") is None
    fdat = Aggregate((("TOOL_NO", 1), ("IPO_FRAME", Enum("BASE"))))
    assert fdat.get("tool_no") == 1
    assert fdat.get("BASE_NO") is None


def test_values_of_a_data_list():
    pose = Pose(1.0, 2.0, 3.0, 0.0, 0.0, 0.0)
    data = DataList(
        "A",
        (
            Comment(" points"),
            Declaration("E6POS", (Variable("XP1", None, pose),), line=4),
            Declaration("INT", (Variable("N"),), line=5),
            Assign("TOOL_DATA[3]", pose, line=6),
        ),
    )
    assert list(data.values()) == [("XP1", pose, 4), ("TOOL_DATA[3]", pose, 6)]


def test_moves_can_be_compared_and_hashed():
    one = Move(MoveWord.LIN, Pose(x_mm=1.0), blend=("C_DIS",))
    assert {one, Move(MoveWord.LIN, Pose(x_mm=1.0), blend=("C_DIS",), line=9)} == {one}
