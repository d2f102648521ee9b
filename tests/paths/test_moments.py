"""Speeds and directions of a run, and what lateness does to the part, against brute force."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.compensation.real_arm import real_point
from postproc.gap.robot_model import RobotModel
from postproc.kinematics import build
from postproc.krl.text.parse import parse_files
from postproc.model.modelfile import load_model
from postproc.paths.moments import directions, moments_of
from postproc.paths.motion import joint_paths
from postproc.paths.world import run_in_cell
from tests.cells import cell_text

SPEED = 0.05


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(cell_text(origin=(0, 0, 0)))
    return load_cell(path)


def poses(cell, count=4):
    """Return T_base_tcp along y, 60 mm apart."""
    T = build(cell.robot).fk(np.radians([0.0, -60, 100, 10, 40, 0])) @ cell.tool.T_flange_tcp
    line = np.tile(T, (count, 1, 1))
    line[:, 1, 3] += 0.06 * np.arange(count)
    return line


def program(cell, blended=True):
    from postproc.geometry.frames import kuka_from_transform

    lines = [
        "DEF ways()", "BAS(#INITMOV,0)", "BAS(#TOOL,1)", "BAS(#BASE,1)", "$VEL.CP=0.05",
        "$APO.CDIS=0.2", "PTP {A1 0,A2 -60,A3 100,A4 10,A5 40,A6 0}",
    ]  # fmt: skip
    for T in poses(cell)[1:]:
        xyz, abc = kuka_from_transform(T)
        values = (*xyz, *abc)
        text = ",".join(f"{n} {v:.6f}" for n, v in zip("XYZABC", values, strict=True))
        lines.append(f"LIN {{{text}}}" + (" C_DIS" if blended else ""))
    lines[-1] = lines[-1].replace(" C_DIS", "")
    return "\r\n".join([*lines, "END", ""]).encode()


def moments(cell, blended=True):
    kinematics = build(cell.robot)
    modules = parse_files({"ways.src": program(cell, blended)})
    trace = run_in_cell(modules, "ways", cell, kinematics)
    return moments_of(joint_paths(trace, cell, kinematics), cell)


def test_joint_speeds_are_those_of_the_programmed_path_speed(cell):
    ends, samples = moments(cell)
    kinematics = build(cell.robot)
    velocity = np.einsum(
        "nij,nj->ni", kinematics.jacobian(ends.q, cell.tool.T_flange_tcp[:3, 3]), ends.qd
    )
    wanted = np.zeros((4, 6))
    wanted[1:3, 1] = SPEED  # a stop at the beginning and at the end
    np.testing.assert_allclose(velocity, wanted, atol=3e-3 * SPEED)
    assert len(samples) == 12


def test_a_point_where_the_robot_stops_has_no_speed(cell):
    ends, _ = moments(cell, blended=False)
    assert np.abs(ends.qd).max() < 1e-9


def test_a_joint_keeps_its_side_until_it_really_turns_back():
    q = np.zeros((7, 6))
    q[:, 0] = np.radians([0.0, 1.0, 2.0, 1.9999, 1.9995, 1.0, 1.5])
    q[:, 1] = np.radians([5.0, 5.0, 5.0, 5.0, 5.0, 4.0, 4.0])
    side = directions(q)
    np.testing.assert_allclose(side[:, 0], [0, 1, 1, 0.8, 0, -1, 1], atol=1e-9)
    assert side[:, 1].tolist() == [0, 0, 0, 0, 0, -1, -1]
    assert directions(np.zeros((0, 6))).shape == (0, 6)


def test_a_gear_carries_its_joint_along_once_it_has_crossed_its_gap():
    """The output of a gear by its own rule: it rests while the drive is inside the gap."""
    rng = np.random.default_rng(4)
    q = np.cumsum(rng.normal(0.0, 4e-4, (500, 6)), axis=0)
    half = rng.uniform(1e-4, 6e-4, 6)
    out = np.empty_like(q)
    out[0] = q[0]
    for i in range(1, len(q)):
        out[i] = np.clip(out[i - 1], q[i] - half, q[i] + half)
    np.testing.assert_allclose(q - half * directions(q, 2.0 * half), out, atol=1e-12)


def lagging(tmp_path, cell, lags):
    path = tmp_path / "lag.toml"
    path.write_text(f'schema = "postproc.model/1"\n[effects.servo_lag]\nlag_s = {list(lags)}\n')
    return RobotModel.of(build(cell.robot), cell, load_model(path))


def along(cell, t):
    """Return joints (n, 6) of the straight way at times t (n,) [s], 50 mm/s, endless."""
    kinematics = build(cell.robot)
    T = np.tile(poses(cell)[0], (len(t), 1, 1))
    T[:, 1, 3] += SPEED * t
    slots, _ = kinematics.ik(T @ np.linalg.inv(cell.tool.T_flange_tcp))
    start = np.radians([0.0, -60, 100, 10, 40, 0])
    return kinematics.nearest(slots[:, int(kinematics.slot(start))], start)


@pytest.mark.parametrize("lags", [(0.02,) * 6, (0.03, 0.02, 0.01, 0.004, 0.012, 0.006)])
def test_lateness_counts_across_the_way_only(tmp_path, cell, lags):
    """Brute force: every joint at its own earlier moment; the distance from the line counts."""
    t = np.linspace(0.5, 1.5, 9)
    q = along(cell, t)
    qd = (along(cell, t + 1e-4) - along(cell, t - 1e-4)) / 2e-4
    model = lagging(tmp_path, cell, lags)
    wrench = np.zeros((len(q), 6))
    found = real_point(model, q, wrench, {"qd": qd}) - model.nominal(q)
    late = np.stack([along(cell, t - lag)[:, i] for i, lag in enumerate(lags)], axis=1)
    true = model.nominal(late) - model.nominal(q)
    true[:, 1] = 0.0  # along the way it is only later
    np.testing.assert_allclose(found, true, atol=2e-6)
    if len(set(lags)) == 1:
        assert np.abs(found).max() < 1e-6
    else:
        assert np.abs(found).max() > 1e-5


def test_loads_of_operations_turn_with_the_tool(cell):
    from postproc.compensation.real_arm import loads

    kinematics = build(cell.robot)
    q = np.radians([[0.0, -60, 100, 10, 40, 0], [20.0, -50, 90, 0, 60, 30]])
    process = np.array([[100.0, 0, 0, 0, 1, 0], [0.0, -40, 0, 0, 0, 2]])
    light = replace(cell, tools=(replace(cell.tool, mass=float("nan")),))
    wrench = loads(q, light, kinematics, np.array([True, True]), process=process)
    R = (kinematics.fk(q) @ cell.tool.T_flange_tcp)[:, :3, :3]
    for i in range(2):
        np.testing.assert_allclose(wrench[i, :3], R[i] @ process[i, :3])
        np.testing.assert_allclose(wrench[i, 3:], R[i] @ process[i, 3:])
