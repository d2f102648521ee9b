"""What lies inside a mesh, against solid angles, trimesh and closed forms."""

import numpy as np
import pytest
import trimesh

from postproc.collision.inside import MOST_PROBES, InsideTest, parts_of, probes_of
from postproc.collision.mesh import Mesh, box, cylinder, joined, loft, ring
from tests.collision.conftest import at, wavy_sheet
from tests.collision.oracle import winding_number


def torus(n=40, m=20, big=0.5, small=0.15):
    u, v = np.meshgrid(np.arange(n) * 2 * np.pi / n, np.arange(m) * 2 * np.pi / m, indexing="ij")
    ring_ = big + small * np.cos(v)
    vertices = np.stack([ring_ * np.cos(u), ring_ * np.sin(u), small * np.sin(v)], -1)
    index = np.arange(n * m).reshape(n, m)
    a, b = index, np.roll(index, -1, 0)
    c, d = np.roll(b, -1, 1), np.roll(index, -1, 1)
    faces = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Mesh(vertices.reshape(-1, 3), faces)


def inside(mesh, points):
    return InsideTest(mesh, parts_of(mesh)).contains(points)


def in_the_bounds(mesh, count, seed):
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    return np.random.default_rng(seed).uniform(low - 0.02, high + 0.02, (count, 3))


SOLIDS = {
    "torus": torus(),
    "sheet": wavy_sheet(),
    "cone": loft([ring(0.5, 24), ring(0.05, 24)], [0.0, 1.0]),
    "two": joined([box(np.ones(3)), box(np.ones(3)).moved(at(0.5, 0.3, 0.2))]),
}


@pytest.mark.parametrize("name", SOLIDS)
def test_agrees_with_solid_angles(name):
    mesh = SOLIDS[name]
    points = in_the_bounds(mesh, 1500, seed=1)
    expected = np.rint(winding_number(mesh, points)) != 0
    assert np.array_equal(inside(mesh, points), expected)
    assert 0.003 < expected.mean() < 0.95
    inward = Mesh(mesh.vertices, mesh.faces[:, ::-1])
    assert np.array_equal(inside(inward, points), expected)


@pytest.mark.parametrize("name", ["torus", "sheet", "cone"])
def test_agrees_with_trimesh(name):
    mesh = SOLIDS[name]
    points = in_the_bounds(mesh, 1500, seed=2)
    other = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
    assert np.array_equal(inside(mesh, points), other.contains(points))


def test_faces_that_disagree_about_outside_are_counted():
    solid = box(np.ones(3))
    faces = solid.faces.copy()
    faces[::3] = faces[::3, ::-1]
    mesh = Mesh(solid.vertices, faces)
    parts = parts_of(mesh)
    assert parts.closed.tolist() == [True]
    assert parts.oriented.tolist() == [False]
    points = np.random.default_rng(3).uniform(-0.8, 0.8, (500, 3))
    assert np.array_equal(inside(mesh, points), (np.abs(points) < 0.5).all(axis=1))


def test_rays_through_edges_and_corners_count_once():
    # a fan of triangles whose edges and corners lie exactly below the points
    from postproc.collision import inside as module

    solid = box(np.ones(3))
    upright = Mesh(solid.vertices @ module._TURN.T, solid.faces)
    grid = np.linspace(-0.4, 0.4, 9)
    x, y = np.meshgrid(grid, grid)
    points = np.stack([x.ravel(), y.ravel(), np.zeros(x.size)], 1) @ module._TURN.T
    assert inside(upright, points).all()
    assert not inside(upright, points + module._TURN[:, 2]).any()


def test_an_open_sheet_has_no_inside_and_says_so():
    solid = box(np.ones(3))
    opened = Mesh(solid.vertices, solid.faces[:-1])
    parts = parts_of(opened)
    assert not parts.closed.any()
    assert not InsideTest(opened, parts).has_inside
    assert not inside(opened, np.zeros((3, 3))).any()


def test_parts_and_their_probes():
    pieces = [cylinder(0.1, 0.2).moved(at(x=float(i))) for i in range(5)]
    mesh = joined(pieces)
    parts = parts_of(mesh)
    assert len(parts.closed) == 5
    assert np.array_equal(np.bincount(parts.label), [len(p.faces) for p in pieces])
    assert np.array_equal(np.rint(probes_of(mesh, parts)[:, 0]), np.arange(5))
    crowd = joined([box(np.full(3, 0.1 + 0.001 * i)).moved(at(x=float(i))) for i in range(80)])
    probes = probes_of(crowd, parts_of(crowd))
    assert len(probes) == MOST_PROBES
    assert np.rint(probes[:, 0]).min() == 80 - MOST_PROBES
