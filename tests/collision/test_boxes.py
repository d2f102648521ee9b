"""Bounds from boxes against closest points found by optimisation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import lsq_linear

from postproc.collision.boxes import box_gap, fit_box
from postproc.collision.mesh import Mesh, box, cylinder
from postproc.geometry.frames import rotation_about


def distance(R, p, half_a, half_b):
    """Exact distance of two boxes: bounded least squares over a point in each."""
    A = np.hstack([np.eye(3), -R])
    bounds = np.concatenate([half_a, half_b])
    answer = lsq_linear(A, p, (-bounds, bounds), tol=1e-12)
    return np.sqrt(2.0 * answer.cost)


def random_boxes(count, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    R = rotation_about(axis, rng.uniform(-np.pi, np.pi, count))
    R[::7] = np.eye(3)
    return R, rng.normal(0.0, 1.2, (count, 3)), *rng.uniform(0.02, 0.8, (2, count, 3))


def test_gap_bounds_the_distance_and_sees_every_separation():
    R, p, half_a, half_b = random_boxes(400, seed=0)
    gap = box_gap(np.moveaxis(R, 0, -1), p.T, half_a.T, half_b.T)
    exact = np.array([distance(*args) for args in zip(R, p, half_a, half_b, strict=True)])
    assert (gap <= exact + 1e-7).all()
    assert np.array_equal(gap > 1e-6, exact > 1e-6)
    apart = exact > 0.05
    assert apart.sum() > 100
    assert np.median(gap[apart] / exact[apart]) > 0.9


def test_gap_of_faces_and_corners_is_exact():
    R = np.eye(3)[:, :, None]
    half = np.full((3, 1), 0.5)
    face = box_gap(R, np.array([[2.0], [0.2], [-0.3]]), half, half)
    corner = box_gap(R, np.array([[2.0], [2.0], [2.0]]), half, half)
    assert face[0] == pytest.approx(1.0)
    assert corner[0] == pytest.approx(np.sqrt(3.0))
    assert box_gap(R, np.zeros((3, 1)), half, half)[0] < 0.0


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.01, 2.0), min_size=3, max_size=3), st.integers(0, 1000))
def test_a_turned_box_is_fitted_exactly(size, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    R = rotation_about(axis / np.linalg.norm(axis), rng.uniform(0.0, 3.0))
    solid = box(np.array(size))
    turned = Mesh(solid.vertices @ R.T + rng.normal(size=3), solid.faces)
    _, axes, half = fit_box(turned.vertices, turned.corners)
    assert np.allclose(np.sort(2.0 * half), np.sort(size), atol=1e-9)
    assert np.allclose(axes.T @ axes, np.eye(3), atol=1e-12)


def test_every_point_lies_in_the_box():
    rng = np.random.default_rng(3)
    for points in (rng.normal(size=(50, 3)), rng.normal(size=(1, 3)), cylinder(0.2, 1.0).vertices):
        centre, axes, half = fit_box(points)
        assert (np.abs((points - centre) @ axes) <= half + 1e-12).all()
