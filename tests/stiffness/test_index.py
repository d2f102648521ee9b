"""Indices against the paper's own chain of equations and against displacements."""

import numpy as np
import pytest

from postproc.geometry.frames import rotation_about
from postproc.stiffness import cartesian, index

from .conftest import K_PAPER, TCP

C = 1.0 / K_PAPER


def paper_index(K, direction):
    """Return k along a direction by Eqs. (16) to (23), eigenvectors and all."""
    values, vectors = np.linalg.eigh(K.T @ K)  # lambda = squared stiffness
    e = vectors.T @ direction
    t = 1.0 / np.sqrt(np.sum(e**2 / values**2))
    lambda_d = np.linalg.norm(t * e)
    return np.sqrt(lambda_d)


@pytest.fixture(scope="module")
def jacobians(arm, postures):
    return arm.jacobian(postures(40, seed=1), TCP)


def directions(count, seed=0):
    n = np.random.default_rng(seed).normal(size=(count, 3))
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def test_ellipsoid_is_that_of_the_paper(jacobians):
    n = directions(len(jacobians))
    K = np.linalg.inv(cartesian.compliance_rotation_held(jacobians, C))
    ours = index.ellipsoid(jacobians, C, n)
    np.testing.assert_allclose(ours, [paper_index(k, d) for k, d in zip(K, n, strict=True)], 1e-6)


def test_ellipsoid_of_a_principal_axis_is_its_stiffness():
    # one prismatic-like joint per axis: stiffness along it is 1/(c l^2)
    J = np.zeros((6, 6))
    J[0, 0], J[1, 1], J[2, 2] = 2.0, 1.0, 0.5
    J[3:, 3:] = np.eye(3)
    c = np.full(6, 1e-6)
    expected = [1.0 / (1e-6 * size**2) for size in (2.0, 1.0, 0.5)]
    for i, value in enumerate(expected):
        assert index.directional(J, c, np.eye(3)[i]) == pytest.approx(value)
        assert index.ellipsoid(J, c, np.eye(3)[i]) == pytest.approx(value)


def test_directional_is_force_per_displacement_along_it(jacobians):
    n = directions(len(jacobians), 2)
    wrench = np.hstack([1000.0 * n, np.zeros((len(n), 3))])
    moved = np.sum((cartesian.regressor(jacobians, wrench) @ C)[:, :3] * n, axis=1)
    np.testing.assert_allclose(index.directional(jacobians, C, n), 1000.0 / moved, rtol=1e-10)


def test_held_and_free_stand_apart_as_the_review_of_the_paper_found(jacobians):
    held = np.linalg.inv(cartesian.compliance_rotation_held(jacobians, C))
    free = np.linalg.inv(cartesian.translational_compliance(jacobians, C))
    ratio = np.median([np.diag(h) / np.diag(f) for h, f in zip(held, free, strict=True)], axis=0)
    assert 7.0 < ratio[0] < 11.0
    assert 1.4 < ratio[1] < 4.2


def test_radial_is_the_weakest_direction_across_the_axis(jacobians):
    axis = directions(len(jacobians), 3)
    u = np.cross(axis, directions(len(jacobians), 4))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    turns = np.linspace(0.0, np.pi, 721)
    each = [
        index.directional(
            jacobians, C, (rotation_about(axis, np.full(len(axis), a)) @ u[..., None])[..., 0]
        )
        for a in turns
    ]
    np.testing.assert_allclose(index.radial(jacobians, C, axis), np.min(each, axis=0), rtol=1e-4)


def test_kv_is_the_papers_mixture():
    assert index.ellipsoid_normal(3.0, 4.0, 0.0) == pytest.approx(4.0)
    assert index.ellipsoid_normal(3.0, 4.0, np.pi / 2) == pytest.approx(3.0)
    assert index.ellipsoid_normal(3.0, 4.0, np.radians(30)) == pytest.approx(
        np.sqrt((4.0 * np.cos(np.radians(30))) ** 2 + (3.0 * np.sin(np.radians(30))) ** 2)
    )


def test_a_rigid_arm_is_infinitely_stiff():
    assert np.isinf(index.directional(np.ones((6, 6)), np.zeros(6), np.eye(3)[0]))
