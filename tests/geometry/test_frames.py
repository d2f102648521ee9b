import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation, Slerp

from postproc.geometry import frames

angles = st.floats(-np.pi, np.pi, allow_nan=False)
steep = st.one_of(
    st.floats(-np.pi / 2, np.pi / 2),
    st.sampled_from([np.pi / 2, -np.pi / 2, np.pi / 2 - 1e-12, -np.pi / 2 + 1e-7]),
)


@given(angles, steep, angles)
def test_abc_there_and_back_is_the_same_rotation(a, b, c):
    R = frames.rotation_from_abc([a, b, c])
    again = frames.rotation_from_abc(frames.abc_from_rotation(R))
    assert np.abs(again - R).max() < 1e-7
    assert abs(frames.abc_from_rotation(R)[1]) <= np.pi / 2


def test_abc_is_kukas_intrinsic_zyx():
    rng = np.random.default_rng(1)
    abc = rng.uniform(-3, 3, (200, 3))
    want = Rotation.from_euler("ZYX", abc).as_matrix()
    assert np.abs(frames.rotation_from_abc(abc) - want).max() < 1e-14


def test_gimbal_lock_puts_the_whole_angle_into_a():
    abc = frames.abc_from_rotation(frames.rotation_from_abc([0.4, np.pi / 2, 0.1]))
    assert abc == pytest.approx([0.3, np.pi / 2, 0.0])


def test_rotation_about_agrees_with_scipy():
    rng = np.random.default_rng(2)
    axis = rng.normal(size=(100, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    angle = rng.uniform(-np.pi, np.pi, 100)
    want = Rotation.from_rotvec(axis * angle[:, None]).as_matrix()
    assert np.abs(frames.rotation_about(axis, angle) - want).max() < 1e-14
    one = Rotation.from_rotvec(axis[0] * angle[:, None]).as_matrix().reshape(20, 5, 3, 3)
    assert np.abs(frames.rotation_about(axis[0], angle.reshape(20, 5)) - one).max() < 1e-14


def test_inverse_and_apply():
    rng = np.random.default_rng(3)
    T_a_b = frames.transform_from_kuka(
        rng.normal(size=(5, 3)) * 1000, rng.uniform(-180, 180, (5, 3))
    )
    point = rng.normal(size=(5, 3))
    assert frames.inverse(T_a_b) @ T_a_b == pytest.approx(np.broadcast_to(np.eye(4), (5, 4, 4)))
    back = frames.apply(frames.inverse(T_a_b), frames.apply(T_a_b, point))
    assert back == pytest.approx(point)


def test_kuka_numbers_there_and_back():
    xyz, abc = frames.kuka_from_transform(frames.transform_from_kuka([1, -2, 3.5], [10, 20, -30]))
    assert xyz == pytest.approx([1, -2, 3.5])
    assert abc == pytest.approx([10, 20, -30])


@pytest.mark.parametrize("angle", [0.0, 1e-9, 1e-4, 1.0, np.pi - 1e-9, np.pi])
def test_rotation_angle_is_exact_for_tiny_and_half_turns(angle):
    R = frames.rotation_about([0.6, 0.0, 0.8], angle)
    assert frames.rotation_angle(np.eye(3), R) == pytest.approx(angle, abs=1e-12)
    assert frames.angle_between([1, 0, 0], [np.cos(angle), np.sin(angle), 0]) == pytest.approx(
        angle, abs=1e-15
    )


def test_orthonormalised_is_a_rotation_near_the_rounded_one():
    R = frames.rotation_from_abc([0.3, -0.7, 2.0])
    fixed = frames.orthonormalised(np.round(R, 6))
    assert fixed @ fixed.T == pytest.approx(np.eye(3), abs=1e-14)
    assert np.linalg.det(fixed) == pytest.approx(1.0)
    assert np.abs(fixed - R).max() < 1e-6


def near_half_turns():
    rng = np.random.default_rng(8)
    axes = rng.normal(size=(400, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    edge = [0.0, 1e-12, 1e-7, 1e-5, 3e-5, 1e-4, 1e-3, 0.05, 0.1, 0.3]
    angle = np.pi - np.resize(edge, 400)
    R_a = Rotation.random(400, random_state=9).as_matrix()
    return R_a, R_a @ Rotation.from_rotvec(axes * angle[:, None]).as_matrix()


@pytest.mark.parametrize("size", [0.0, 1e-9, 1e-3, 1.0, 3.0, 3.05, 3.14])
def test_axis_and_angle_lead_from_one_rotation_to_the_other(size):
    rng = np.random.default_rng(7)
    axes = rng.normal(size=(300, 3))
    vector = size * axes / np.linalg.norm(axes, axis=1, keepdims=True)
    R_a = Rotation.random(300, random_state=3).as_matrix()
    R_b = R_a @ Rotation.from_rotvec(vector).as_matrix()
    axis, angle = frames.axis_angle(R_a, R_b)
    assert np.abs(angle - size).max() < 1e-9
    assert np.abs(R_a @ frames.rotation_about(axis, angle) - R_b).max() < 1e-9


def test_axis_and_angle_hold_up_to_a_half_turn():
    R_a, R_b = near_half_turns()
    axis, angle = frames.axis_angle(R_a, R_b)
    assert np.abs(np.linalg.norm(axis, axis=1) - 1.0).max() < 1e-9
    assert np.abs(R_a @ frames.rotation_about(axis, angle) - R_b).max() < 1e-7


def test_slerp_is_that_of_scipy():
    R = Rotation.random(2, random_state=4)
    shares = np.linspace(0.0, 1.0, 11)
    want = Slerp([0.0, 1.0], R)(shares).as_matrix()
    a, b = (np.repeat(R.as_matrix()[i : i + 1], 11, axis=0) for i in (0, 1))
    assert np.abs(frames.slerp(a, b, shares) - want).max() < 1e-12


@pytest.mark.parametrize("noise", [0.0, 1e-15, -1e-15, 1e-12, -1e-12])
def test_a_half_turn_has_one_sign(noise: float) -> None:
    for angles in ([np.pi + noise, 0.3, 0.2], [0.4, 0.3, np.pi + noise]):
        abc = frames.abc_from_rotation(frames.rotation_from_abc(angles))
        assert np.allclose(abc, angles, atol=1e-9)


def test_vectors_turn_evenly_from_one_to_the_other():
    a, b = np.array([1.0, 0.0, 0.0]), np.array([np.cos(2.0), np.sin(2.0), 0.0])
    share = np.linspace(0.0, 1.0, 9)
    wanted = np.stack([np.cos(2.0 * share), np.sin(2.0 * share), 0.0 * share], axis=1)
    assert np.allclose(frames.turned_between(a, b, share), wanted, atol=1e-15)
    assert np.allclose(frames.turned_between(a, a, share), a)
    against = frames.turned_between(a, -a, np.array([0.0, 0.25, 1.0]))
    assert np.allclose(against, [a, a, -a])


def test_a_twist_is_what_is_left_of_a_turn_without_its_tilt():
    rng = np.random.default_rng(8)
    for twist in (-3.1, -1.0, 0.0, 0.4, 3.1):
        axis, other = rng.normal(size=(2, 3))
        axis /= np.linalg.norm(axis)
        across = np.cross(axis, other)
        tilt = frames.rotation_from_vector(2.8 * across / np.linalg.norm(across))
        R = tilt @ frames.rotation_about(axis, twist)
        assert frames.twist_about(R, axis) == pytest.approx(twist, abs=1e-12)
