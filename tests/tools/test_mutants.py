"""Mutants of emitted programs, by rule: all that do harm are noticed by lint or verify.

What nobody notices is executed beside the program and found to do no harm.
"""

import re

import numpy as np
import pytest

from tests.places import FIXTURES
from tools.mutants import MUST_CATCH, Case, cases_of, judge, mutants
from tools.mutants.effect import Effect, Work
from tools.mutants.judge import noticed

STYLES = [
    ("dense", "inline", "8.6", 1000),
    ("spline", "dat", "8.5", 15),
    ("forms", "dat", "8.5", 15),
]
PROGRAMS = sorted(
    listed.parent.name
    for listed in FIXTURES.glob("*/commands.txt")
    if "verify" in listed.read_text("utf-8")
)
"""Holes, pecks, milling, arcs, splines, forms, several tools, external axes, tilt, a model."""
NOTICED = 0.5
"""Share of the mutants that is noticed, at least; the others are executed and do no harm."""


def fixture_of(folder):
    """The golden program of a fixture."""
    (case,) = cases_of(FIXTURES / folder)
    return case


def of(emitted):
    """A program of the demo part as a case."""
    cell, toolpath, files = emitted
    return Case("demo", files, cell, toolpath)


def check(case, number):
    """One mutant of every third rule in each file: what is not noticed does no harm.

    Other programs have the other rules; all of all: ``python -m tools.mutants``.
    """
    result = judge(case, each=1, seed=1, part=(number % 3, 3))
    assert [f"{m.rule}: {m.file}:{m.line}" for m in result.missed] == []
    assert result.caught.total() > NOTICED * result.total
    assert result.total > 15


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES, ids=lambda s: "-".join(map(str, s)))
def test_whatever_does_harm_is_noticed(emitted, style):
    check(of(emitted(*style)), STYLES.index(style))


@pytest.mark.slow
@pytest.mark.parametrize("folder", PROGRAMS)
def test_whatever_does_harm_is_noticed_in_every_golden_program(folder):
    check(fixture_of(folder), PROGRAMS.index(folder))


@pytest.mark.parametrize("rule", MUST_CATCH)
def test_each_of_these_is_noticed_wherever_it_stands(emitted, rule):
    case = of(emitted())
    every = [mutant for mutant in mutants(case.files) if mutant.rule == rule]
    assert len(every) > 20
    for mutant in every[:: len(every) // 3]:
        assert noticed(case, mutant.files, collisions=False), mutant.line


def changed(files, name, pattern, text, number=0):
    """Files with the ``number``-th match of a pattern in one of them changed."""
    content = files[name].decode("ascii")
    match = list(re.finditer(pattern, content))[number]
    content = content[: match.start()] + match.expand(text) + content[match.end() :]
    return {**files, name: content.encode("ascii")}


def test_a_drill_tilted_at_a_peck_is_noticed():
    case = fixture_of("peck_cycles")
    tilted = changed(case.files, "holes_001.src", r"(Z -10\.0000,A [-\d.]+,B )90\.0", r"\g<1>91.0")
    assert noticed(case, tilted, collisions=False) == {"axis"}


def test_the_default_name_of_a_routine_that_the_cell_calls_otherwise_is_not_trusted():
    case = fixture_of("tool_changes")
    other = changed(case.files, "PLATE_7.src", r"\r\nPTP ", "\r\nPP_SPINDLE_OFF()\r\nPTP ")
    assert "unjudged" in noticed(case, other, collisions=False)


def test_joint_motions_at_no_speed_are_refused():
    case = fixture_of("tool_changes")
    other = changed(case.files, "PLATE_7.src", r"BAS\(#VEL_PTP,30\)", "BAS(#VEL_PTP,0)")
    assert "speed" in noticed(case, other, collisions=False)


def test_execution_tells_what_does_the_same_from_what_does_not():
    case = fixture_of("tool_changes")
    program = Effect(case.files, case.cell, 0.02)
    same = Effect(changed(case.files, "PLATE_7.src", r"\$ADVANCE=3\r\n", ""), case.cell, 0.02)
    assert program.is_same(same)
    moved = changed(case.files, "PLATE_7.src", r"LIN \{X 60\.0", "LIN {X 60.5")
    slow = changed(case.files, "PLATE_7.src", r"\$VEL\.CP=0\.6", "$VEL.CP=0.1")
    dry = changed(case.files, "PLATE_7.src", r"PP_COOLANT_ON\(4\)", "PP_COOLANT_ON(2)")
    for harm in (moved, dry):
        effect = Effect(harm, case.cell, 0.02)
        assert not program.is_same(effect)
        assert not program.is_slower_in_the_air(effect)
        assert not program.does_the_same_work(effect)
    effect = Effect(slow, case.cell, 0.02)
    assert not program.is_same(effect)
    assert program.is_slower_in_the_air(effect)
    assert not effect.is_slower_in_the_air(program)


def test_a_cut_may_begin_farther_back_on_its_line_and_nowhere_else():
    axes = np.tile([0.0, 0.0, -1.0], (2, 1))
    tilt = np.zeros(2)
    cut = Work(np.array([[0.0, 0, 0], [0, 0, -0.01]]), axes, 0.01, (), tilt)
    for start, same in (([0, 0, 0.02], True), ([0, 0, -0.005], False), ([0.001, 0, 0.02], False)):
        other = Work(np.array([start, [0, 0, -0.01]]), axes, 0.01, (), tilt)
        assert cut.is_like(other) == same
    assert not cut.is_like(Work(cut.points, axes, 0.02, (), tilt))


def test_a_tool_tilted_in_the_middle_of_an_arc_is_noticed(emitted):
    case = of(emitted())
    arc = r"(CIRC \{[^}]*\},\{[^}]*,A )0\.0+(,[^}]*\} C_DIS)"
    tilted = changed(case.files, "demo.src", arc, r"\g<1>1.00000\g<2>")
    assert noticed(case, tilted, collisions=False) == {"axis"}


def test_a_drill_that_comes_tilted_to_its_hole_is_noticed():
    case = fixture_of("peck_cycles")
    for angle in ("91.0", "135.0"):
        tilted = changed(case.files, "holes_001.dat", r"(XP1=\{.*B )90\.0+", rf"\g<1>{angle}")
        assert noticed(case, tilted, collisions=False) == {"axis"}


def test_a_drill_that_turns_on_its_way_out_is_noticed():
    case = fixture_of("peck_cycles")
    out = r"(LIN \{X 80\.0000,Y 46\.4705,Z 34\.1481,A -90\.0+,B )75\.0"
    tilted = changed(case.files, "holes_002.src", out, r"\g<1>76.0")
    assert noticed(case, tilted, collisions=False) == {"axis"}


def test_a_drill_that_starts_beside_its_hole_is_noticed():
    case = fixture_of("peck_cycles")
    # 0.06 mm of 0.1 beside the axis by which a motion belongs to the hole
    beside = changed(case.files, "holes_001.dat", r"(XP1=\{X )0\.0000", r"\g<1>0.0600")
    assert noticed(case, beside, collisions=False) == {"path"}


@pytest.mark.parametrize("speed", ["", "$VEL.CP=0.00680000", "$VEL.CP=0.00333333"])
def test_the_feed_of_a_cut_behind_a_hole_is_that_of_the_file(speed):
    case = fixture_of("peck_cycles")
    other = changed(case.files, "holes_002.src", r"\$VEL\.CP=0\.00666667", speed)
    assert noticed(case, other, collisions=False) == {"feed"}


def test_a_cut_behind_a_hole_is_no_joint_motion():
    case = fixture_of("peck_cycles")
    other = changed(case.files, "holes_002.src", r"LIN (\{X 80\.0000,Y 40\.0000,Z 60)", r"PTP \1")
    assert "path" in noticed(case, other, collisions=False)


def test_a_call_does_not_part_two_pieces_of_one_cut():
    case = fixture_of("tool_changes")
    first = r"\r\nLIN \{X 0\.0000,Y 0\.0000,Z -1"
    stop = changed(case.files, "PLATE_7.src", first, r"\r\nLIN_REL {Z -20.0}\g<0>")
    assert Effect(case.files, case.cell, 0.02).does_the_same_work(Effect(stop, case.cell, 0.02))


def test_points_of_the_data_list_are_broken_as_well():
    case = fixture_of("olp_task")
    rules = {mutant.rule for mutant in mutants(case.files) if mutant.file.endswith(".dat")}
    assert {"lost: E6POS", "data: X of E6POS +", "data: A1 of E6AXIS *"} <= rules
