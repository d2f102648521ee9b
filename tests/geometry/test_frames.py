import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

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
