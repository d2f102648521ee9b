"""The calibrated arm as URDF, read by pinocchio: where the tool point is, to a micrometre."""

from __future__ import annotations

import numpy as np
import pinocchio as pin

from postproc.cell import Cell, load_cell
from postproc.gap import RobotModel, State, calibrated_urdf, effect_of
from postproc.kinematics import build
from postproc.model import ModelFile, load_model
from tools.blind.robots import COBOT, KR210, RobotClass, cell_text, urdf

GEOMETRY = """schema = "postproc.model/1"
[effects.joint_offset]
offset_deg = [0.1, -0.15, 0.57, -0.49, 0.3, 0.2]
[effects.base_frame]
xyz_mm = [1.0, -2.0, 0.5]
rotation_deg = [0.05, 0.02, -0.1]
[effects.tool_frame]
xyz_mm = [0.4, 0.3, -0.8]
"""
MORE = """[effects.gear_coupling]
axis_4_to_5 = 1e-3
axis_4_to_6 = 2e-3
axis_5_to_6 = -1e-3
[effects.backlash]
half_gap_deg = [0, 0.01, 0, 0, 0, 0]
"""


def cell_of(robot: RobotClass, folder) -> Cell:
    (folder / "cell.toml").write_text(cell_text(robot, None), encoding="utf-8")
    (folder / "robot.urdf").write_text(urdf(robot), encoding="utf-8")
    return load_cell(folder / "cell.toml")


def model_of(cell: Cell, folder, text: str) -> ModelFile:
    path = folder / "model.toml"
    path.write_text(text, encoding="utf-8")
    model = load_model(path)
    arm = RobotModel.of(build(cell.robot), cell, None).arm
    links = effect_of("link_geometry")
    theta = np.random.default_rng(3).normal(0, 1, len(links.parameters(arm, {})))
    sizes = np.array([p.typical for p in links.parameters(arm, {})])
    tables = dict(model.effects) | {"link_geometry": links.write(State(5 * theta * sizes), arm)}
    return ModelFile(tables, text=None)


def points_by_pinocchio(path, q: np.ndarray) -> np.ndarray:
    model = pin.buildModelFromUrdf(str(path))
    data, tip = model.createData(), model.getFrameId("tool_point")
    found = []
    for row in q:
        pin.framesForwardKinematics(model, data, row)
        found.append(data.oMf[tip].translation.copy())
    return np.array(found)


def test_pinocchio_puts_the_tool_where_the_model_does(tmp_path) -> None:
    off = {}
    for robot in (KR210, COBOT):
        cell = cell_of(robot, tmp_path)
        kinematics = build(cell.robot)
        q = np.random.default_rng(1).uniform(cell.robot.q_min, cell.robot.q_max, (60, 6))
        nominal = RobotModel.of(kinematics, cell).tool_point(q)
        for more in ("", MORE):
            model = model_of(cell, tmp_path, GEOMETRY + more)
            text = calibrated_urdf(kinematics, cell, model)
            path = tmp_path / "calibrated.urdf"
            path.write_bytes(text)
            assert calibrated_urdf(kinematics, cell, model) == text
            kept = {n: t for n, t in model.effects.items() if n not in MORE}
            expected = RobotModel.of(kinematics, cell, ModelFile(kept)).tool_point(q)
            assert np.linalg.norm(expected - nominal, axis=1).min() > 1e-4
            found = points_by_pinocchio(path, q)
            off[robot.name, more[:12]] = np.linalg.norm(found - expected, axis=1).max()
            comment = text.decode().split("-->")[0]
            assert ("gear_coupling" in comment) == bool(more)
            assert ("backlash" in comment) == bool(more)
    assert max(off.values()) < 1e-8, off


def test_a_model_without_geometry_is_the_nominal_arm(tmp_path) -> None:
    cell = cell_of(KR210, tmp_path)
    path = tmp_path / "calibrated.urdf"
    path.write_bytes(calibrated_urdf(build(cell.robot), cell, ModelFile()))
    q = np.random.default_rng(2).uniform(-1, 1, (20, 6))
    nominal = RobotModel.of(build(cell.robot), cell).tool_point(q)
    np.testing.assert_allclose(points_by_pinocchio(path, q), nominal, atol=1e-10)
    assert "nothing beyond the nominal arm" in path.read_text(encoding="utf-8")
