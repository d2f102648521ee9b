"""Forward kinematics and Jacobian against pinocchio, published facts and finite differences."""

import numpy as np
import pinocchio
import pytest

from postproc.cell.robotfile import load_robot
from postproc.geometry.frames import abc_from_rotation, rotation_angle
from postproc.kinematics import build
from postproc.units import DEG, MM
from tests.kinematics.urdf_text import rpy_of

CANNON = np.array([0.0, -90.0, 90.0, 0.0, 0.0, 0.0]) * DEG


def pinocchio_arm(geometry):
    """The arm as a pinocchio model, from the machine-data chain: h, A, B, TX3P3, flange."""
    a1, a2, c1, c2, c3, c4 = (
        geometry.a1,
        geometry.a2,
        geometry.c1,
        geometry.c2,
        geometry.c3,
        geometry.c4,
    )
    shifts = [(0, 0, c1), (a1, 0, 0), (c2, 0, 0), (c3, 0, -a2), (0, 0, 0), (0, 0, 0)]
    axes = [(0, 0, -1), (0, 1, 0), (0, 1, 0), (-1, 0, 0), (0, 1, 0), (-1, 0, 0)]
    model = pinocchio.Model()
    parent = 0
    for i, (shift, axis) in enumerate(zip(shifts, axes, strict=True), start=1):
        place = pinocchio.SE3(np.eye(3), np.array(shift, dtype=float))
        moving = pinocchio.JointModelRevoluteUnaligned(np.array(axis, dtype=float))
        parent = model.addJoint(parent, moving, place, f"A{i}")
    R = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    end = pinocchio.SE3(R, np.array([c4, 0.0, 0.0]))
    model.addFrame(pinocchio.Frame("flange", parent, 0, end, pinocchio.FrameType.OP_FRAME))
    return model, model.getFrameId("flange")


def test_pose_and_jacobian_equal_pinocchio(robot):
    model, frame = pinocchio_arm(robot.geometry)
    data = model.createData()
    kinematics = build(robot)
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (300, 6))
    T, J = kinematics.fk(q), kinematics.jacobian(q)
    for i, angles in enumerate(q):
        pinocchio.computeJointJacobians(model, data, angles)
        pinocchio.updateFramePlacements(model, data)
        wanted = pinocchio.getFrameJacobian(model, data, frame, pinocchio.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(T[i], data.oMf[frame].homogeneous, atol=1e-12)
        np.testing.assert_allclose(J[i], wanted, atol=1e-12)


@pytest.mark.parametrize(
    ("name", "x_mm", "z_mm"),
    [("kuka_kr500_r2830", 1815.0, 2290.0), ("kuka_kr210_r2700_2", 1765.0, 1910.0)],
)
def test_cannon_pose_as_published(name, x_mm, z_mm):
    T = build(load_robot(name)).fk(CANNON)
    np.testing.assert_allclose(T[:3, 3] / MM, [x_mm, 0.0, z_mm], atol=1e-9)
    np.testing.assert_allclose(abc_from_rotation(T[:3, :3]) / DEG, [0.0, 90.0, 0.0], atol=1e-9)


def test_stretched_pose_as_published(kr500):
    np.testing.assert_allclose(kr500.fk(np.zeros(6))[:3, 3] / MM, [3115.0, 0.0, 990.0], atol=1e-9)


def test_positive_axes_turn_as_kuka_says(kr500):
    """A1 clockwise from above, A2 and A3 downwards, A5 tilts the flange down."""
    flange = kr500.fk(CANNON)[:3, 3]
    step = 10.0 * DEG * np.eye(6)
    moved = kr500.fk(CANNON + step)
    assert moved[0, 1, 3] < -0.1
    assert moved[1, 2, 3] < flange[2] - 0.1
    assert moved[2, 2, 3] < flange[2] - 0.1
    assert moved[4, 2, 3] < flange[2] - 0.01


def test_jacobian_is_the_derivative(robot):
    kinematics = build(robot)
    rng = np.random.default_rng(2)
    q, tcp, h = rng.uniform(-2.0, 2.0, (40, 6)), np.array([0.1, -0.05, 0.4]), 1e-6
    J = kinematics.jacobian(q, tcp)
    for joint in range(6):
        step = h * np.eye(6)[joint]
        ahead, behind = kinematics.fk(q + step), kinematics.fk(q - step)
        point = [T[:, :3, :3] @ tcp + T[:, :3, 3] for T in (ahead, behind)]
        np.testing.assert_allclose(J[:, :3, joint], (point[0] - point[1]) / (2 * h), atol=1e-8)
        D = ahead[:, :3, :3] @ np.swapaxes(behind[:, :3, :3], 1, 2)
        turn = 0.5 * np.stack(
            [D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]]
        )
        np.testing.assert_allclose(J[:, 3:, joint].T, turn / (2 * h), atol=1e-8)


def test_rates_along_a_direction_are_the_derivative(robot):
    kinematics = build(robot)
    rng = np.random.default_rng(3)
    q, tcp, h = rng.uniform(-2.0, 2.0, (2100, 6)), np.array([0.1, -0.05, 0.4]), 1e-6
    direction = rng.normal(size=(len(q), 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rates = kinematics.rates(q, tcp, direction)
    for joint in range(6):
        step = h * np.eye(6)[joint]
        ahead, behind = kinematics.fk(q + step), kinematics.fk(q - step)
        moved = (ahead - behind)[:, :3, :3] @ tcp + (ahead - behind)[:, :3, 3]
        along = np.einsum("ni,ni->n", moved, direction) / (2 * h)
        np.testing.assert_allclose(rates[:, joint], along, atol=1e-8)


def test_link_frames_are_parallel_to_robroot_at_zero_and_lie_on_the_axes(robot):
    kinematics = build(robot)
    g = robot.geometry
    at_zero = kinematics.link_frames(np.zeros(6))
    np.testing.assert_array_equal(at_zero[:, :3, :3], np.tile(np.eye(3), (7, 1, 1)))
    wrist = [g.a1 + g.c2 + g.c3, 0.0, g.c1 - g.a2]
    np.testing.assert_allclose(at_zero[1, :3, 3], 0.0, atol=1e-15)
    np.testing.assert_allclose(at_zero[2, :3, 3], [g.a1, 0.0, g.c1], atol=1e-12)
    np.testing.assert_allclose(at_zero[3, :3, 3], [g.a1 + g.c2, 0.0, g.c1], atol=1e-12)
    np.testing.assert_allclose(at_zero[5:, :3, 3], [wrist, wrist], atol=1e-12)


def test_link_frames_move_with_their_joints_only(kr500):
    q = np.random.default_rng(3).uniform(-2.0, 2.0, 6)
    before = kr500.link_frames(q)
    for joint in range(6):
        after = kr500.link_frames(q + 0.3 * np.eye(6)[joint])
        moved = np.abs(after - before).max(axis=(1, 2)) > 1e-6
        assert moved.tolist() == [link > joint for link in range(7)]
    np.testing.assert_allclose(before[6, :3, :3] @ before[6, :3, :3].T, np.eye(3), atol=1e-12)


def test_any_leading_shape_gives_the_same_numbers(kr500):
    q = np.random.default_rng(4).uniform(-2.0, 2.0, (3, 5, 6))
    np.testing.assert_array_equal(kr500.fk(q)[1, 2], kr500.fk(q[1, 2]))
    np.testing.assert_array_equal(kr500.jacobian(q)[2, 4], kr500.jacobian(q[2, 4]))
    np.testing.assert_array_equal(kr500.link_frames(q)[0, 0], kr500.link_frames(q[0, 0]))
    assert kr500.fk(np.zeros((0, 6))).shape == (0, 4, 4)


def test_rpy_helper_is_the_inverse_of_its_definition():
    rng = np.random.default_rng(5)
    for abc in rng.uniform(-1.5, 1.5, (50, 3)):
        roll, pitch, yaw = abc
        R = (
            pinocchio.utils.rotate("z", yaw)
            @ pinocchio.utils.rotate("y", pitch)
            @ pinocchio.utils.rotate("x", roll)
        )
        back = pinocchio.rpy.rpyToMatrix(np.array(rpy_of(R)))
        assert rotation_angle(R, back) < 1e-9
