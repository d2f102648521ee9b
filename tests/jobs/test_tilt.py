"""A cut beside a wall that only a tilted tool can run: from the CAM file to the checked program."""

import re
import shutil

import numpy as np
import pinocchio
import pytest

from postproc.cell.robotfile import load_robot
from postproc.units import DEG
from tests.kinematics.test_forward import pinocchio_arm
from tests.places import FIXTURES

WALL = FIXTURES / "wall_tilt"
TILT = "side_tilt_deg = [0, 12]"


@pytest.fixture
def job(tmp_path):
    """Return a function that writes a cell with keys of [optimize]; the CAM file lies beside."""
    shutil.copy(WALL / "wall.apt", tmp_path)
    text = (WALL / "cell.toml").read_text()
    assert TILT in text

    def make(keys, name="cell.toml"):
        (tmp_path / name).write_text(text.replace(TILT, keys))
        return tmp_path / name

    return make


def kinds(report):
    return {item["kind"] for item in report["violations"]}


def test_without_tilt_every_tag_says_what_would_help(job, run, tmp_path):
    code, answer, _ = run(
        "convert", tmp_path / "wall.apt", "--cell", job(""), "-o", tmp_path / "out", "--json"
    )
    assert code == 1
    assert [failure["tag"] for failure in answer["failures"]] == [1, 2, 3, 4, 5]
    assert {failure["reason"] for failure in answer["failures"]} == {"collision"}
    for failure in answer["failures"]:
        assert "a side tilt of 10 deg would do: widen side_tilt_deg" in failure["hint"]


@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_with_tilt_the_program_is_right(job, run, tmp_path, strategy):
    cell, out = job(TILT), tmp_path / "out"
    cam = tmp_path / "wall.apt"
    how = ("--strategy", strategy)
    code, answer, errors = run("convert", cam, "--cell", cell, "-o", out, *how, "--json")
    assert (code, answer["failures"]) == (0, []), errors
    assert run("lint", out / "wall.src", "--json")[0] == 0
    verify = ("verify", out / "wall.src", "--against", cam, "--json")
    code, report, _ = run(*verify, "--cell", cell)
    assert (code, report["ok"]) == (0, True)
    assert report["max_axis_error_deg"] < 0.001
    lead, side = tilts_of_joints(answer_joints(out / "wall.src", cell))
    assert np.abs(lead).max() < 0.001
    assert side.max() == pytest.approx(report["max_tilt_deg"], abs=0.001)
    assert (side[[0, -1]] < 0.001).all()
    assert (side[1:-1] > 5.0).all()
    code, report, _ = run(*verify, "--cell", job("", "upright.toml"))
    assert code == 1
    assert {"axis", "collision"} & kinds(report) == {"axis"}
    assert report["max_axis_error_deg"] == pytest.approx(side.max(), abs=0.001)
    assert report["max_tilt_deg"] == 0.0
    code, report, _ = run(*verify, "--cell", job("side_tilt_deg = [0, 4]", "narrow.toml"))
    assert report["max_tilt_deg"] == pytest.approx(4.0, abs=1e-6)
    assert report["max_axis_error_deg"] == pytest.approx(side.max() - 4.0, abs=0.001)
    code, report, _ = run(*verify, "--cell", job("lead_deg = [-12, 12]", "lead.toml"))
    assert kinds(report) == {"axis"}


def answer_joints(src, cell):
    """Return the joints (n, 6) [rad] at the end of every motion, run from the text."""
    from postproc.cell.file import load_cell
    from postproc.controller.modules import load_program
    from postproc.kinematics import build
    from postproc.paths import joint_paths, run_in_cell

    cell = load_cell(cell)
    modules, kinematics = load_program(src), build(cell.robot)
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    return joint_paths(trace, cell, kinematics).q


def tilts_of_joints(q):
    """Return lead and side tilt (n,) [deg] by pinocchio; the feed is along x, the CAM axis z."""
    robot = load_robot("kuka_kr500_r2830")
    model, flange = pinocchio_arm(robot.geometry)
    data = model.createData()
    axes = []
    for row in q:
        pinocchio.framesForwardKinematics(model, data, row)
        axes.append(-data.oMf[flange].rotation @ [1.0, 0.0, 0.0])
    axes = np.array(axes)
    return np.arctan2(axes[:, 0], axes[:, 2]) / DEG, np.arcsin(-axes[:, 1]) / DEG


def test_the_text_itself_is_tilted(job, run, tmp_path):
    """A, B, C of the lines by hand: x of Rz(A) Ry(B) Rx(C) is the tool axis."""
    run("convert", tmp_path / "wall.apt", "--cell", job(TILT), "-o", tmp_path / "out", "--json")
    text = (tmp_path / "out" / "wall.src").read_text()
    found = re.findall(r"LIN \{X (\S+),Y (\S+),Z (\S+),A (\S+),B (\S+),C", text)
    numbers = np.array(found, dtype=float)
    cut = np.abs(numbers[:, 2]) < 1e-6
    assert cut.sum() == 5
    a, b = numbers[:, 3] * DEG, numbers[:, 4] * DEG
    axis = -np.stack([np.cos(a) * np.cos(b), np.sin(a) * np.cos(b), -np.sin(b)], axis=1)
    assert np.abs(axis[:, 0]).max() < 1e-5
    assert (axis[cut, 1] < -np.sin(5.0 * DEG)).all()
    assert (axis[cut, 1] > -np.sin(12.001 * DEG)).all()
    assert np.allclose(axis[~cut], [0.0, 0.0, 1.0], atol=1e-5)


def test_keys_are_checked(job, run, tmp_path):
    for keys, words in (
        ("lead_deg = [5, 10]", "0 must lie in the range"),
        ("side_tilt_deg = [10, -10]", "is above"),
        ("lead_deg = [0, 60]", "less than or equal to 45"),
        ("tilt_step_deg = 0", "0.5"),
    ):
        code, _, errors = run("check", job(keys))
        assert code == 2
        assert "CEL004" in errors
        assert words in errors


def test_check_says_what_is_allowed(job, run):
    code, answer, _ = run("check", job(TILT), "--json")
    assert code == 0
    notes = {item["code"]: item["text"] for item in answer["findings"]}
    assert notes["CEL119"].endswith("lead 0 to 0 deg, side tilt 0 to 12 deg")
    fine = job("lead_deg = [-5, 5]").read_text().replace("step_deg = 15", "step_deg = 0.5")
    (cell := job("")).write_text(fine)
    code, answer, _ = run("check", cell, "--json")
    assert code == 1
    assert "PLN207" in {item["code"] for item in answer["findings"]}
