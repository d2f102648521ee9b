"""The examples of docs/examples/python, each run as its user would."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pinocchio
import pytest

import postproc as pp
from tests.kinematics.test_forward import pinocchio_arm

ROOT = Path(__file__).resolve().parents[2]
CASE = ROOT / "fixtures" / "drilling_panel"
CELL = str(CASE / "cell.toml")


def run(example, *arguments):
    script = ROOT / "docs" / "examples" / "python" / f"{example}.py"
    command = [sys.executable, str(script), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.fixture(scope="module")
def holes(tmp_path_factory):
    lines = (CASE / "panel.csv").read_text(encoding="utf-8").splitlines()[:7]
    path = tmp_path_factory.mktemp("examples") / "row.csv"
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")
    return path


def test_engineer(holes, tmp_path):
    done = run("engineer", holes, CELL, tmp_path)
    assert done.returncode == 0, done.stderr
    assert "N/mm" in done.stdout
    assert {"row.src", "row.dat", "row.html"} <= {path.name for path in tmp_path.iterdir()}


def test_integrator_goes_on_after_a_bad_part(holes, tmp_path):
    (tmp_path / "bad.csv").write_text("no points\n", encoding="utf-8")
    done = run("integrator", CELL, tmp_path / "out", tmp_path / "bad.csv", holes)
    assert done.returncode == 1
    assert "bad.csv:1: error" in done.stdout
    assert "1 of 2 parts became programs" in done.stdout
    assert (tmp_path / "out" / "row.src").exists()


@pytest.mark.slow
def test_ci_check_sees_a_changed_and_an_edited_program(holes, tmp_path):
    job = pp.convert(holes, CELL)
    job.write(tmp_path)
    released = tmp_path / f"{job.name}.src"
    assert run("check_released", holes, CELL, released).returncode == 0
    text = released.read_bytes()
    line = next(row for row in text.split(b"\r\n") if row.startswith(b"LIN "))
    released.write_bytes(text.replace(line, line.replace(b"{X ", b"{X 1"), 1))
    shutil.copy(tmp_path / f"{job.name}.dat", tmp_path / "kept.dat")
    done = run("check_released", holes, CELL, released)
    assert done.returncode == 1
    assert "moved" in done.stdout


def test_metrologist_finds_how_far_the_gear_was_set_wrong(tmp_path):
    """Points by pinocchio with A2 and A3 off by known angles: the model must foretell others."""
    cell = pp.load_cell(CELL)
    model, flange = pinocchio_arm(cell.robot.geometry)
    data = model.createData()
    rng = np.random.default_rng(3)
    error = np.deg2rad([0.0, 0.02, -0.03, 0.0, 0.0, 0.0])

    def campaign(name, rows):
        lines = ["id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm"]
        low, high = [-40, -110, 70, -120, 20, -170], [40, -60, 120, 120, 100, 170]
        q = np.deg2rad(rng.uniform(low, high, (rows, 6)))
        q = np.concatenate([q, q[:10]])  # revisited poses tell the noise
        for number, angles in enumerate(q):
            pinocchio.framesForwardKinematics(model, data, angles + error)
            T = data.oMf[flange].homogeneous @ cell.tool.T_flange_tcp
            point = T[:3, 3] * 1e3 + rng.normal(0.0, 0.01, 3)
            values = [*np.rad2deg(angles), *point]
            lines.append(",".join([str(number), *(f"{value:.6f}" for value in values)]))
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n", encoding="utf-8")
        return path

    measured, other = campaign("measured.csv", 80), campaign("other.csv", 40)
    done = run("metrologist", measured, CELL, tmp_path / "gap", other)
    assert done.returncode == 0, done.stdout + done.stderr
    known = pp.load_model(tmp_path / "gap" / "model.toml")
    before, after = (pp.predict(other, CELL, arm).rms for arm in (None, known))
    assert before > 2e-4
    assert after < 3e-5
