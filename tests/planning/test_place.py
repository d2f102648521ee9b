"""Spin references, grids, and the transported frame of the smoothing: closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.errors import PlanError
from postproc.geometry.frames import angle_between, rotation_angle, rotation_x, rotation_z
from postproc.planning.search.between import Interpolation, carried_twist
from postproc.planning.states.place import (
    finer_spins,
    frames_across,
    place,
    spin_values,
    transported,
)
from postproc.planning.states.settings import Settings
from postproc.units import DEG


@pytest.mark.parametrize("axis", [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, 0, 1), (0, 0, -1)])
def test_frames_lay_the_tool_axis(axis):
    rng = np.random.default_rng(1)
    d = rng.normal(size=(50, 3))
    d /= np.linalg.norm(d, axis=1, keepdims=True)
    u = np.cross(d, rng.normal(size=(50, 3)))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    R = frames_across(d, u, np.array(axis, dtype=float))
    assert np.allclose(R @ np.array(axis), d, atol=1e-14)
    assert np.allclose(np.linalg.det(R), 1.0)
    assert np.allclose(R @ np.swapaxes(R, 1, 2), np.eye(3), atol=1e-14)


@pytest.mark.parametrize(
    ("step", "low", "high", "want"),
    [
        (90, -180, 180, [-180, -90, 0, 90]),
        (90, 0, 360, [-180, -90, 0, 90]),
        (10, -20, 20, [-20, -10, 0, 10, 20]),
        (10, -15, 25, [-10, 0, 10, 20]),
        (360, -180, 180, [0]),
        (10, 0, 0, [0]),
        (10, 12, 14, [13]),
        (50, -180, 180, [-150, -100, -50, 0, 50, 100, 150]),
    ],
)
def test_spin_grid(step, low, high, want):
    assert np.allclose(spin_values(step * DEG, low * DEG, high * DEG) / DEG, want)


@pytest.mark.parametrize("step", [10, 7, 6.95, 50, 0.7])
@pytest.mark.parametrize("fine", [1, 2, 4])
def test_the_finer_grid_holds_the_grid(step, fine):
    grid = spin_values(step * DEG, -np.pi, np.pi)
    finer = finer_spins(step * DEG, -np.pi, np.pi, fine)
    assert np.allclose(finer[::fine], grid)
    assert np.allclose(np.diff(finer), step * DEG / fine)
    assert len(finer) == fine * len(grid)


@pytest.mark.parametrize(
    ("step", "tilts", "fine"), [(10, 1, 4), (10, 25, 4), (5, 25, 2), (1, 1, 2), (0.5, 1, 1)]
)
def test_the_finest_grid_fits_on_a_rung(step, tilts, fine):
    settings = Settings(None, spin_values(step * DEG, -np.pi, np.pi))
    assert settings.fine(tilts) == fine
    assert Settings(None, np.zeros(1)).fine(tilts) == 1


def test_transport_carries_the_solid_angle():
    """Around a cone of half angle 45 degrees: 360 (1 - cos 45) = 105.44 degrees of holonomy."""
    t = np.linspace(0.0, 2.0 * np.pi, 2001)
    cone = 45.0 * DEG
    d = np.stack(
        [np.sin(cone) * np.cos(t), np.sin(cone) * np.sin(t), np.full_like(t, np.cos(cone))], axis=1
    )
    u = transported(d, np.array([0.0, 1.0, 0.0]))
    turned = angle_between(u[0], u[-1]) / DEG
    assert turned == pytest.approx(360.0 * (1.0 - np.cos(cone)), abs=0.01)
    assert np.abs(np.einsum("ij,ij->i", u, d)).max() < 1e-12


def test_opposite_axes_are_refused():
    with pytest.raises(PlanError, match="180 degrees between tags 0 and 1"):
        transported(np.array([[0, 0, 1.0], [0, 0, -1.0]]), np.array([1.0, 0, 0]))


def test_full_turn_changes_nothing(make_cell, make_path):
    placement = place(make_path([[1.5, 0, 1], [1.5, 0.2, 1]], [-1, 0.1, 0.2]), make_cell())
    tags, spin = np.arange(2), np.array([0.3, -1.0])
    assert np.allclose(
        placement.tcp(tags, spin), placement.tcp(tags, spin + 2.0 * np.pi), atol=1e-14
    )


def test_axes_all_around_use_transport(make_cell, make_path):
    rng = np.random.default_rng(0)
    axes = np.concatenate([np.eye(3), rng.normal(size=(20, 3))])
    placement = place(make_path(rng.normal(size=(23, 3)), axes), make_cell())
    assert placement.reference == "parallel transport"
    toolpath = make_path(rng.normal(size=(23, 3)), axes)
    assert np.allclose(placement.axis_base(np.arange(23)), -toolpath.axes, atol=1e-12)


def interpolated(placement, spin):
    """Spins of all tags at equal distances, from the first to the last of those given."""
    n = len(placement)
    none = np.zeros(n, dtype=bool)
    way, nowhere = np.arange(float(n)), np.zeros(n, dtype=int)
    between = Interpolation(way, carried_twist(placement), none, none, nowhere)
    first, last = np.array([0]), np.array([n - 1])
    rows = between.rows(first, last)
    ends = tuple(np.array([[spin[tag], 0.0, 0.0]]) for tag in (0, -1))
    return np.append(spin[0], between.attitudes(rows, (first, last), ends)[:, 0])


def test_wrap_goes_the_short_way(make_cell, make_path):
    """Optima +170 and -170 are 20 degrees apart, not 340."""
    placement = place(make_path(np.linspace([0, 0, 0], [1, 0, 0], 5), [0, 0, 1]), make_cell())
    spin = np.array([170.0, 0, 0, 0, -170.0]) * DEG
    full = interpolated(placement, spin)
    steps = np.mod(np.diff(full) / DEG + 180.0, 360.0) - 180.0
    assert np.allclose(steps, 5.0)


def test_row_through_the_vertical_has_even_steps(make_cell, make_path):
    """A drilling row whose axis swings 60..120 degrees about y: roll angles jump, the twist not.

    Tool axis in the x-z plane: the twist-free motion is a plain turn about y, 5 degrees a step.
    """
    tilt = np.arange(60.0, 121.0, 5.0) * DEG
    axes = np.stack([-np.cos(tilt), 1e-5 * np.sin(7.0 * tilt), np.sin(tilt)], axis=1)
    points = np.linspace([0, 0, 0], [0.6, 0, 0], len(tilt))
    placement = place(make_path(points, axes), make_cell())
    tags = np.arange(len(tilt))
    spin = interpolated(placement, np.zeros(len(tilt)))
    R = placement.rotation(tags, spin)
    steps = rotation_angle(R[:-1], R[1:]) / DEG
    assert np.abs(steps - 5.0).max() < 1e-3
    assert spin[-1] == 0.0


def test_axis_at_its_own_reference(make_cell, make_path):
    """Spin 0 lays the first cross axis of the tool along the part axis named as reference."""
    axes = rotation_z(np.linspace(0, 0.3, 6)) @ rotation_x(0.2) @ np.array([0.0, 0.0, 1.0])
    placement = place(make_path(np.zeros((6, 3)), axes), make_cell())
    cross = placement.R_base_tcp @ np.array([0.0, 1.0, 0.0])
    fixed = np.eye(3)["xyz".index(placement.reference[-1])]
    assert (cross @ fixed > 0.9).all()
