"""Torques of an arm of points of mass, by virtual work: friction, weight and limits come back."""

import numpy as np

from postproc.cell import load_cell
from postproc.jobs.diagnose_trace import diagnose_trace
from tools.blind.robots import COBOT, KR500, cell_text, urdf
from tools.blind.traces.robot import torques

STEP = 0.016
VISCOUS = np.array([12.0, 15.0, 8.0, 3.0, 2.0, 1.5])
COULOMB = np.array([9.0, 14.0, 7.0, 2.5, 2.0, 1.2])
MASS, AT = 0.8, np.array([0.02, -0.03, 0.1])
LIMIT = 45.0
HEAVY = 60.0


def recorded(folder, robot, mass=0.0, most=np.inf, still=False):
    """The table of torques of a log: joints swing, each at its own pace; A3 gives ``most``."""
    rng = np.random.default_rng(7)
    time = np.arange(0.0, 8.0, STEP)
    pace = np.array([0.31, 0.47, 0.59, 0.73, 0.89, 1.03])
    q = robot.start_deg + 9.0 * np.sin(2.0 * np.pi * pace * time[:, None])
    if still:
        q = robot.start_deg + 0.0 * q
    arm, q_rad = robot.arm, np.deg2rad(q)
    load = (robot.tool_mass * robot.tool_com + mass * AT) / (robot.tool_mass + mass)
    tau = torques(arm, load, robot.tool_mass + mass, q_rad, STEP)
    rate = np.gradient(q_rad, STEP, axis=0)
    size = HEAVY if robot is KR500 else 1.0
    tau += size * (VISCOUS * rate + COULOMB * np.sign(rate))
    tau += rng.normal(0.0, 0.05, tau.shape)
    tau[:, 2] = np.clip(tau[:, 2], -most, most)
    names = ["time_s", *(f"q{k}_{kind}_deg" for kind in ("cmd", "act") for k in range(1, 7))]
    rows = np.column_stack([time, q, q + rng.normal(0.0, 1e-4, q.shape), tau])
    header = ",".join([*names, *(f"tau{k}_Nm" for k in range(1, 7))])
    np.savetxt(folder / "log.csv", rows[2:-2], "%.6f", ",", header=header, comments="")
    # points of mass: no inertia about their own centres
    (folder / "robot.urdf").write_text(urdf(robot).replace('"0.1"', '"1e-9"'))
    (folder / "cell.toml").write_text(cell_text(robot, None))
    return diagnose_trace(folder / "log.csv", load_cell(folder / "cell.toml")).document["torque"]


def off(told, key, true):
    """By which share numbers of joints are off, of those that are told."""
    rows = [(row[key], true[row["joint"] - 1]) for row in told["joints"] if row[key] is not None]
    return np.array([abs(value / real - 1.0) for value, real in rows])


def test_friction_and_an_unknown_weight_come_back(tmp_path):
    told = recorded(tmp_path, COBOT, MASS)
    for key, true in (("viscous_Nms_per_rad", VISCOUS), ("coulomb_Nm", COULOMB)):
        shares = off(told, key, true)
        assert len(shares) == 6
        assert shares.max() < 0.08
    assert [row["saturated_rows"] for row in told["joints"]] == [0] * 6
    weight = list(told["payload"].values())
    np.testing.assert_allclose(weight, [MASS, *(MASS * AT)], rtol=0.05, atol=0.004)


def test_no_weight_is_told_where_there_is_none_and_a_limit_is(tmp_path):
    told = recorded(tmp_path, COBOT, 0.0, LIMIT)
    assert told["payload"] is None
    rows = [row["saturated_rows"] for row in told["joints"]]
    assert rows[2] > 20
    assert sum(rows) == rows[2]


def test_without_inertias_only_friction_is_told(tmp_path):
    told = recorded(tmp_path, KR500)
    assert told["not_observable"] == ["payload", "inertia of the links"]
    shares = off(told, "coulomb_Nm", HEAVY * COULOMB)
    assert len(shares) >= 4
    assert shares.max() < 0.2


def test_an_arm_that_stands_tells_nothing(tmp_path):
    assert recorded(tmp_path, COBOT, still=True)["joints"] == []
