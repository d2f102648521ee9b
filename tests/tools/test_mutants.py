"""Mutants of emitted programs, by rule: all that do harm are noticed by lint or verify.

What nobody notices is executed beside the program and found to do no harm.
"""

import re

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.jobs.convert import ConvertRequest, read_toolpath
from tests.places import FIXTURES
from tools.mutants import MUST_CATCH, judge, mutants
from tools.mutants.effect import Effect, Work
from tools.mutants.judge import noticed

STYLES = [
    ("dense", "inline", "8.6", 1000),
    ("spline", "dat", "8.5", 15),
    ("forms", "dat", "8.5", 15),
]
TABLE = [
    # case, program, input, one mutant of a rule in so many, share that is noticed at least
    ("peck_cycles", "holes", "holes.clsf", 47, 0.65),
    ("forms_pocket", "pocket", "pocket.aptsource", 97, 0.7),
    ("tool_changes", "PLATE_7", "plate.apt", 397, 0.7),
    ("turntable", "ring", "ring.csv", 397, 0.6),
    ("spline_points", "bead", "bead.csv", 197, 0.7),
    ("wall_tilt", "wall", "wall.apt", 97, 0.7),
    ("olp_task", "seam", "seam.xml", 97, 0.7),
]
"""Drilling by pecks; arcs and inline forms; several tools; external axes; splines; tilt; a task."""


def fixture_of(case, program, source):
    """Cell, toolpath and files of a golden program, its start first."""
    folder = FIXTURES / case
    cell = load_cell(folder / "cell.toml")
    toolpath = read_toolpath(ConvertRequest(str(folder / source), "cell.toml"), cell)
    every = sorted(f for f in (folder / "expected").iterdir() if f.suffix in (".src", ".dat"))
    every.sort(key=lambda file: file.name != f"{program}.src")
    return cell, toolpath, {file.name: file.read_bytes() for file in every}


@pytest.mark.slow
@pytest.mark.parametrize("style", STYLES, ids=lambda s: "-".join(map(str, s)))
def test_whatever_does_harm_is_noticed(emitted, style):
    cell, toolpath, files = emitted(*style)
    result = judge(files, cell, toolpath, every=61)
    assert [f"{m.rule}: {m.file}:{m.line}" for m in result.missed] == []
    assert result.caught.total() > 0.6 * result.total


@pytest.mark.slow
@pytest.mark.parametrize("row", TABLE, ids=lambda row: row[0])
def test_whatever_does_harm_is_noticed_in_every_kind_of_program(row):
    case, program, source, every, share = row
    cell, toolpath, files = fixture_of(case, program, source)
    result = judge(files, cell, toolpath, every)
    assert [f"{m.rule}: {m.file}:{m.line}" for m in result.missed] == []
    assert result.caught.total() > share * result.total
    assert result.total > 50


@pytest.mark.parametrize("rule", MUST_CATCH)
def test_each_of_these_is_noticed_wherever_it_stands(emitted, rule):
    cell, toolpath, files = emitted()
    every = [mutant for mutant in mutants(files) if mutant.rule == rule]
    assert len(every) > 20
    for mutant in every[:: len(every) // 3]:
        assert noticed(mutant.files, cell, toolpath, collisions=False), mutant.line


def changed(files, name, pattern, text, number=0):
    """Files with the ``number``-th match of a pattern in one of them changed."""
    content = files[name].decode("ascii")
    match = list(re.finditer(pattern, content))[number]
    content = content[: match.start()] + match.expand(text) + content[match.end() :]
    return {**files, name: content.encode("ascii")}


def test_a_drill_tilted_at_a_peck_is_noticed():
    cell, toolpath, files = fixture_of("peck_cycles", "holes", "holes.clsf")
    tilted = changed(files, "holes_001.src", r"(Z -10\.0000,A [-\d.]+,B )90\.0", r"\g<1>91.0")
    assert noticed(tilted, cell, toolpath, collisions=False) == {"axis"}


def test_the_default_name_of_a_routine_that_the_cell_calls_otherwise_is_not_trusted():
    cell, toolpath, files = fixture_of("tool_changes", "PLATE_7", "plate.apt")
    other = changed(files, "PLATE_7.src", r"\r\nPTP ", "\r\nPP_SPINDLE_OFF()\r\nPTP ")
    assert "unjudged" in noticed(other, cell, toolpath, collisions=False)


def test_joint_motions_at_no_speed_are_refused():
    cell, toolpath, files = fixture_of("tool_changes", "PLATE_7", "plate.apt")
    other = changed(files, "PLATE_7.src", r"BAS\(#VEL_PTP,30\)", "BAS(#VEL_PTP,0)")
    assert "speed" in noticed(other, cell, toolpath, collisions=False)


def test_execution_tells_what_does_the_same_from_what_does_not():
    cell, _, files = fixture_of("tool_changes", "PLATE_7", "plate.apt")
    program = Effect(files, cell, 0.02)
    same = Effect(changed(files, "PLATE_7.src", r"\$ADVANCE=3\r\n", ""), cell, 0.02)
    assert program.is_same(same)
    moved = changed(files, "PLATE_7.src", r"LIN \{X 60\.0", "LIN {X 60.5")
    slow = changed(files, "PLATE_7.src", r"\$VEL\.CP=0\.6", "$VEL.CP=0.1")
    dry = changed(files, "PLATE_7.src", r"PP_COOLANT_ON\(4\)", "PP_COOLANT_ON(2)")
    for harm in (moved, dry):
        effect = Effect(harm, cell, 0.02)
        assert not program.is_same(effect)
        assert not program.is_slower_in_the_air(effect)
        assert not program.does_the_same_work(effect)
    effect = Effect(slow, cell, 0.02)
    assert not program.is_same(effect)
    assert program.is_slower_in_the_air(effect)
    assert not effect.is_slower_in_the_air(program)


def test_a_cut_may_begin_farther_back_on_its_line_and_nowhere_else():
    axes = np.tile([0.0, 0.0, -1.0], (2, 1))
    cut = Work(np.array([[0.0, 0, 0], [0, 0, -0.01]]), axes, 0.01, ())
    for start, same in (([0, 0, 0.02], True), ([0, 0, -0.005], False), ([0.001, 0, 0.02], False)):
        other = Work(np.array([start, [0, 0, -0.01]]), axes, 0.01, ())
        assert cut.is_like(other) == same
    assert not cut.is_like(Work(cut.points, axes, 0.02, ()))


def test_a_tool_tilted_in_the_middle_of_an_arc_is_noticed(emitted):
    cell, toolpath, files = emitted()
    arc = r"(CIRC \{[^}]*\},\{[^}]*,A )0\.0+(,[^}]*\} C_DIS)"
    tilted = changed(files, "demo.src", arc, r"\g<1>1.00000\g<2>")
    assert noticed(tilted, cell, toolpath, collisions=False) == {"axis"}
