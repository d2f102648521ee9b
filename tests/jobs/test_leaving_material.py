"""A rapid never begins in material: what the text does behind a cut, and what ``verify`` says."""

import re

import numpy as np
import pytest

from tests.jobs.emitted import CELL, RAPID, converted, program, steps

HEAD = "UNITS/MM\nRAPID\nGOTO/0,0,80,0,0,1\nFEDRAT/600,MMPM\nGOTO/0,0,-5\n"
CUT = "GOTO/60,0,-5\n"
HOLE = "CYCLE/DRILL,FEDTO,9,MMPM,60,RAPTO,3,RTRCTO,20\nGOTO/20,90,0\nCYCLE/OFF\n"
HOME = CELL.replace("[motion]\n", "[motion]\nhome_deg = [0, -90, 90, 0, 30, 0]\n")
BEHIND = "RAPID\nGOTO/-3400,0,500\n"
"""Behind the robot: no straight way leads there."""


def behind_cut(job, end=(60.0, 0.0, -5.0)):
    """Return the steps behind the cut that ends at ``end``."""
    found = steps(job)
    last = max(
        i for i, step in enumerate(found) if step.point is not None and np.allclose(step.point, end)
    )
    return found[last + 1 :]


@pytest.mark.parametrize(
    ("cell", "rest"), [(CELL, HOLE), (HOME, ""), (CELL, BEHIND)], ids=["hole", "home", "behind"]
)
def test_a_joint_motion_behind_a_cut_begins_above_it(tmp_path, cell, rest):
    job = converted(tmp_path, HEAD + CUT + rest + "FINI\n", cell=cell)
    first, second = behind_cut(job)[:2]
    assert (first.word, first.speed, second.word) == ("LIN", RAPID, "PTP")
    assert np.allclose(first.point, [60.0, 0.0, 45.0], atol=1e-3)


def test_it_backs_off_along_its_own_axis(tmp_path):
    tilted = "GOTO/60,0,-5,0.6,0,0.8\n"
    job = converted(tmp_path, HEAD + tilted + HOLE.replace("90,0", "90,0,0,0,1") + "FINI\n")
    first = behind_cut(job)[0]
    assert np.allclose(first.point, [60.0 + 0.6 * 50.0, 0.0, -5.0 + 0.8 * 50.0], atol=2e-3)


def test_how_far_is_for_the_cell_to_say(tmp_path):
    cell = CELL.replace("[motion]\n", "[motion]\napproach_mm = 12\n")
    job = converted(tmp_path, HEAD + CUT + HOLE + "FINI\n", cell=cell)
    assert np.allclose(behind_cut(job)[0].point, [60.0, 0.0, 7.0], atol=1e-3)


@pytest.mark.parametrize("again", ["", "RAPID\nGOTO/60,0,-5\n"])
def test_a_repeated_end_is_still_in_material(tmp_path, again):
    job = converted(tmp_path, HEAD + CUT + again + HOLE + "FINI\n")
    assert np.allclose(behind_cut(job)[0].point, [60.0, 0.0, 45.0], atol=1e-3)


def test_a_straight_rapid_of_the_file_is_run_as_it_stands(tmp_path):
    job = converted(tmp_path, HEAD + CUT + "RAPID\nGOTO/90,30,60\nFINI\n")
    first = behind_cut(job)[0]
    assert (first.word, first.speed) == ("LIN", RAPID)
    assert np.allclose(first.point, [90.0, 30.0, 60.0], atol=1e-3)


def test_a_cut_that_has_backed_off_itself_is_left_at_once(tmp_path):
    job = converted(tmp_path, HEAD + CUT + "GOTO/60,0,70\n" + HOLE + "FINI\n")
    assert behind_cut(job, (60.0, 0.0, 70.0))[0].word == "PTP"


def without(text, pattern):
    """Return a program without the one motion that ``pattern`` names."""
    shorter, count = re.subn(rf"(?m)^{pattern}[^\n]*\n", "", text)
    assert count == 1
    return shorter


@pytest.mark.parametrize(
    ("cell", "rest"), [(CELL, HOLE), (HOME, ""), (CELL, BEHIND)], ids=["hole", "home", "behind"]
)
def test_verify_names_a_rapid_from_within_material(tmp_path, run, cell, rest):
    job = converted(tmp_path, HEAD + CUT + rest + "FINI\n", cell=cell)
    words = ("--cell", tmp_path / "cell.toml", "--against", tmp_path / "part.apt", "--json")
    good, bad = tmp_path / "good.src", tmp_path / "bad.src"
    good.write_text(program(job))
    bad.write_text(without(program(job), r"LIN \{X 60\.0000,Y 0\.0000,Z 45\.0000"))
    assert run("verify", good, *words)[0] == 0
    code, output = run("verify", bad, *words)[:2]
    assert code == 1
    assert [item["kind"] for item in output["violations"]] == ["retract"]


def test_verify_asks_for_the_whole_height(tmp_path, run):
    job = converted(tmp_path, HEAD + CUT + HOLE + "FINI\n")
    low = tmp_path / "low.src"
    low.write_text(
        program(job).replace(
            "LIN {X 60.0000,Y 0.0000,Z 45.0000", "LIN {X 60.0000,Y 0.0000,Z 25.0000"
        )
    )
    words = ("--cell", tmp_path / "cell.toml", "--against", tmp_path / "part.apt", "--json")
    kinds = [item["kind"] for item in run("verify", low, *words)[1]["violations"]]
    assert kinds == ["retract"]
