"""The registration against closed forms, made-up truths and what statistics promise."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import DataError
from postproc.geometry.frames import apply, inverse, rotation_from_abc, transform
from postproc.measurement.registration import (
    fit_registration,
    in_robroot,
    rigid_motion,
    unloaded_rows,
)

FRAME = transform(rotation_from_abc(np.array([2.0, 0.3, -0.2])), np.array([3.0, -1.0, 0.4]))
REFLECTOR = np.array([0.15, -0.08, 0.3])
TOOL = np.array([0.1, 0.0, 0.36])
NOISE = 2e-5


def flanges(n, seed=0, spread=0.8):
    """Poses (n, 4, 4) in a box of a metre, turned by up to ``spread`` rad about each axis."""
    rng = np.random.default_rng(seed)
    R = rotation_from_abc(rng.uniform(-spread, spread, (n, 3)))
    return transform(R, np.array([1.5, 0.0, 0.8]) + rng.uniform(-0.5, 0.5, (n, 3)))


def horn(source, target):
    """Return T_target_source by the unit quaternion (Horn 1987, J. Opt. Soc. Am. A 4, 629)."""
    S = (source - source.mean(axis=0)).T @ (target - target.mean(axis=0))
    A = S - S.T
    N = np.zeros((4, 4))
    N[0, 0] = np.trace(S)
    N[0, 1:] = N[1:, 0] = A[1, 2], A[2, 0], A[0, 1]
    N[1:, 1:] = S + S.T - np.trace(S) * np.eye(3)
    w, *v = np.linalg.eigh(N)[1][:, -1]
    K = np.cross(np.eye(3), v)
    R = np.eye(3) + 2.0 * w * K + 2.0 * K @ K
    return transform(R, target.mean(axis=0) - R @ source.mean(axis=0))


def test_rigid_motion_is_that_of_horn():
    rng = np.random.default_rng(1)
    points = rng.normal(size=(20, 3))
    measured = apply(FRAME, points) + rng.normal(size=(20, 3)) * 1e-2
    np.testing.assert_allclose(rigid_motion(points, measured), horn(points, measured), atol=1e-12)


def test_points_in_a_plane_are_not_mirrored():
    points = np.random.default_rng(2).normal(size=(8, 3)) * [1.0, 1.0, 0.0]
    np.testing.assert_allclose(rigid_motion(points, apply(FRAME, points)), FRAME, atol=1e-12)


def test_frame_and_reflector_are_recovered_exactly():
    T = flanges(30)
    found = fit_registration(T, apply(FRAME, apply(T, REFLECTOR)), TOOL)
    np.testing.assert_allclose(found.T_measured_robroot, FRAME, atol=1e-9)
    np.testing.assert_allclose(found.p_flange_point, REFLECTOR, atol=1e-9)
    assert found.rms < 1e-9


def test_one_orientation_leaves_the_reflector_where_it_is_expected():
    T = flanges(30, spread=0.0)
    rng = np.random.default_rng(3)
    measured = apply(FRAME, apply(T, REFLECTOR)) + rng.normal(size=(30, 3)) * NOISE
    found = fit_registration(T, measured, TOOL)
    np.testing.assert_allclose(found.p_flange_point, TOOL, atol=1e-6)
    # what is left is a frame alone, with a closed form of its own up to the robust weights
    expected = horn(apply(T, TOOL), measured)
    np.testing.assert_allclose(found.T_measured_robroot, expected, atol=2.0 * NOISE)


def test_scatter_is_what_least_squares_promise():
    """The squared errors over their covariance have the mean of chi-square with nine freedoms."""
    T = flanges(60, seed=4)
    exact = apply(FRAME, apply(T, REFLECTOR))
    X = np.zeros((60, 3, 9))
    X[:, :, :3] = FRAME[:3, :3]
    for k in range(3):
        X[:, :, 3 + k] = np.cross(np.eye(3)[k], apply(T, REFLECTOR)) @ FRAME[:3, :3].T
    X[:, :, 6:] = FRAME[:3, :3] @ T[:, :3, :3]
    H = np.einsum("nki,nkj->ij", X, X) / NOISE**2
    rng = np.random.default_rng(5)
    runs = 200
    distance = []
    for _ in range(runs):
        found = fit_registration(T, exact + rng.normal(size=exact.shape) * NOISE, TOOL)
        off = inverse(FRAME) @ found.T_measured_robroot
        turn = 0.5 * np.array([off[2, 1] - off[1, 2], off[0, 2] - off[2, 0], off[1, 0] - off[0, 1]])
        x = np.concatenate([off[:3, 3], turn, found.p_flange_point - REFLECTOR])
        distance.append(x @ H @ x)
    # 200 means of chi-square(9) scatter by 0.3; the robust weights cost up to 5 %
    assert 8.1 < np.mean(distance) < 10.4


def test_readings_that_are_wrong_do_not_pull():
    T = flanges(60, seed=6)
    rng = np.random.default_rng(7)
    measured = apply(FRAME, apply(T, REFLECTOR)) + rng.normal(size=(60, 3)) * NOISE
    clean = fit_registration(T, measured, TOOL)
    measured[::12] += [0.0, 0.0, 0.05]
    found = fit_registration(T, measured, TOOL)
    np.testing.assert_allclose(found.p_flange_point, clean.p_flange_point, atol=2.0 * NOISE)
    np.testing.assert_allclose(found.T_measured_robroot, clean.T_measured_robroot, atol=2.0 * NOISE)


def test_the_expected_place_of_the_reflector_does_not_matter():
    T = flanges(40, seed=8)
    rng = np.random.default_rng(9)
    measured = apply(FRAME, apply(T, REFLECTOR)) + rng.normal(size=(40, 3)) * NOISE
    near, far = (fit_registration(T, measured, place) for place in (REFLECTOR, TOOL + 0.4))
    np.testing.assert_allclose(near.p_flange_point, far.p_flange_point, atol=1e-7)


def test_in_robroot_undoes_the_frame():
    T = flanges(20)
    points = apply(T, REFLECTOR)
    found = fit_registration(T, apply(FRAME, points), TOOL)
    np.testing.assert_allclose(in_robroot(found, apply(FRAME, points)), points, atol=1e-9)


@pytest.mark.parametrize(
    "rows", [np.arange(5), np.zeros(40, dtype=int)], ids=["five postures", "one posture"]
)
def test_too_few_postures_are_refused(rows):
    T = flanges(10)[rows]
    with pytest.raises(DataError, match=r"MEA012: [15] distinct posture"):
        fit_registration(T, apply(FRAME, apply(T, REFLECTOR)), TOOL)


def test_points_on_one_line_are_refused():
    T = np.tile(np.eye(4), (20, 1, 1))
    T[:, 0, 3] = np.linspace(0.0, 1.0, 20)
    with pytest.raises(DataError, match="MEA012: all points on one line"):
        fit_registration(T, apply(FRAME, apply(T, REFLECTOR)), TOOL)


def test_unloaded_rows_suffice_where_they_are_enough_postures():
    q = np.random.default_rng(10).uniform(-1.0, 1.0, (30, 6))
    wrench = np.zeros((30, 6))
    assert unloaded_rows(q, None).all()
    assert unloaded_rows(q, wrench).all()
    wrench[12:, 2] = -500.0
    assert unloaded_rows(q, wrench).tolist() == [True] * 12 + [False] * 18
    wrench[11, 4] = 30.0
    assert unloaded_rows(q, wrench).all()
    # twelve readings of one posture say no more than one
    wrench[:, :] = 0.0
    wrench[12:, 2] = -500.0
    q[:12] = q[0]
    assert unloaded_rows(q, wrench).all()
