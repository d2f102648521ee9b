"""A rapid never begins in material: what the text does behind a cut, and what ``verify`` says."""

import re

import numpy as np
import pytest

from tests.cells import STIFFNESS
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


@pytest.mark.parametrize("rest", [HOLE, BEHIND], ids=["hole", "behind"])
def test_a_joint_motion_behind_a_cut_begins_above_it(tmp_path, rest):
    job = converted(tmp_path, HEAD + CUT + rest + "FINI\n")
    first, second = behind_cut(job)[:2]
    assert (first.word, first.speed, second.word) == ("LIN", RAPID, "PTP")
    assert np.allclose(first.point, [60.0, 0.0, 45.0], atol=1e-3)


@pytest.mark.parametrize("cell", [CELL, HOME], ids=["here", "home"])
def test_a_file_that_ends_in_a_cut_is_left_along_the_axis(tmp_path, cell):
    """As high as the file itself came from."""
    job = converted(tmp_path, HEAD + CUT + "FINI\n", cell=cell)
    first, *rest = behind_cut(job)
    assert (first.word, first.speed) == ("LIN", 1.0)  # in rapid, as every way out of a cut
    assert np.allclose(first.point, [60.0, 0.0, 80.0], atol=1e-3)
    assert ("PTP" in [step.word for step in rest]) is (cell is HOME)


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
    bad.write_text(without(program(job), r"LIN \{X 60\.0000,Y 0\.0000,Z (?:45|80)\.0000"))
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


THREE_PASSES = """\
UNITS/MM
MULTAX/ON
SPINDL/RPM,3000,CLW
RAPID
GOTO/513.4464,363.1038,42.8256,0.172320,-0.244809,0.954135
FEDRAT/800,MMPM
GOTO/510.0000,368.0000,23.7429,0.172320,-0.244809,0.954135
GOTO/512.0000,368.0000,23.3327,0.179604,-0.244485,0.952874
GOTO/514.0000,368.0000,22.9053,0.186666,-0.244158,0.951600
GOTO/516.0000,368.0000,22.4611,0.193500,-0.243829,0.950318
GOTO/518.0000,368.0000,22.0005,0.200100,-0.243500,0.949035
RAPID
GOTO/522.0020,363.1300,40.9812,0.200100,-0.243500,0.949035
RAPID
GOTO/529.4256,363.1527,39.1599,0.221279,-0.242366,0.944613
FEDRAT/800,MMPM
GOTO/525.0000,368.0000,20.2676,0.221279,-0.242366,0.944613
GOTO/527.0000,368.0000,19.7402,0.226763,-0.242052,0.943392
GOTO/529.0000,368.0000,19.1995,0.231987,-0.241746,0.942200
GOTO/531.0000,368.0000,18.6461,0.236948,-0.241449,0.941041
GOTO/533.0000,368.0000,18.0806,0.241644,-0.241161,0.939920
RAPID
GOTO/537.8329,363.1768,36.8790,0.241644,-0.241161,0.939920
RAPID
GOTO/545.1189,363.1950,34.7427,0.255944,-0.240248,0.936362
FEDRAT/800,MMPM
GOTO/540.0000,368.0000,16.0155,0.255944,-0.240248,0.936362
GOTO/542.0000,368.0000,15.4036,0.259412,-0.240019,0.935466
GOTO/544.0000,368.0000,14.7832,0.262601,-0.239804,0.934631
GOTO/546.0000,368.0000,14.1551,0.265511,-0.239606,0.933859
GOTO/548.0000,368.0000,13.5198,0.268141,-0.239425,0.933154
RAPID
GOTO/553.3628,363.2115,32.1829,0.268141,-0.239425,0.933154
FINI
"""


def test_a_cut_ends_where_the_tool_can_leave_it_as_the_file_does(tmp_path):
    """At the end of a pass the stiffest spins have A5 at its limit: no way straight out."""
    cell = CELL.replace("[150, 0, 300]", "[150, 0, 362]").replace(
        "[1700, 0, 700]", "[1800, -150, 800]"
    )
    cell = cell.replace("step_deg = 60\nrefine = false\n", "")
    cell = cell.replace("rapid_percent = 50\n", "home_deg = [0, -90, 90, 0, 45, 0]\n")
    job = converted(tmp_path, THREE_PASSES, cell=cell + STIFFNESS)
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
