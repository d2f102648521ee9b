"""Distances of solids against coal's trees of all their triangles and winding numbers."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial import ConvexHull

from postproc.collision.distance import Distances
from postproc.collision.inside import parts_of
from postproc.collision.mesh import Mesh, box, cylinder, joined, loft, ring
from postproc.collision.shape import Shape
from postproc.geometry.frames import rotation_about
from tests.collision.conftest import at, wavy_sheet
from tests.collision.oracle import CoalMesh, coal_collide, coal_distance, winding_number


def hull_of(points):
    hull = ConvexHull(points)
    corners, inside = points[hull.simplices], points.mean(axis=0)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", normals, corners[:, 0] - inside) < 0.0
    faces = np.where(inwards[:, None], hull.simplices[:, ::-1], hull.simplices)
    return Mesh(points, faces.astype(np.int32))


def ball(count, radius):
    points = np.random.default_rng(4).normal(size=(count, 3))
    return hull_of(radius * points / np.linalg.norm(points, axis=1, keepdims=True))


def flat_sheet(count):
    """A plane of many triangles: a hull of its points is flat."""
    x, y = np.meshgrid(*[np.linspace(-0.5, 0.5, count)] * 2, indexing="ij")
    index = np.arange(count * count).reshape(count, count)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    return Mesh(np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3), faces.astype(np.int32))


def tube():
    """A closed pipe with a wall of 20 mm: what is in its bore is free."""
    outer, inner = ring(0.3, 48), ring(0.28, 48)
    n = len(outer)
    walls = [np.column_stack([s, np.full(n, z)]) for s in (outer, inner) for z in (-0.4, 0.4)]
    i, j = np.arange(n), np.roll(np.arange(n), -1)
    quads = [(0, 1), (3, 2), (2, 0), (1, 3)]
    faces = [
        face
        for low, high in quads
        for face in (
            np.stack([low * n + i, low * n + j, high * n + j], 1),
            np.stack([low * n + i, high * n + j, high * n + i], 1),
        )
    ]
    return Mesh(np.vstack(walls), np.vstack(faces).astype(np.int32))


def boxed(mesh):
    """A thick box around a mesh with a cavity for it."""
    size = 2.4 * np.abs(mesh.vertices).max()
    inner = box(np.full(3, size))
    return joined([box(np.full(3, 1.2 * size)), Mesh(inner.vertices, inner.faces[:, ::-1].copy())])


SOLIDS = {
    "beam": box(np.array([0.1, 0.12, 1.5])),
    "pin": cylinder(0.12, 0.5),
    "cone": loft([ring(0.3, 12), ring(0.05, 12)], [0.0, 0.4]),
    "inside out": Mesh((pin := cylinder(0.1, 0.3)).vertices, pin.faces[:, ::-1].copy()),
    "arm": joined([cylinder(0.1, 0.6), box(np.array([0.2, 0.5, 0.2])).moved(at(z=0.3))]),
    "panel": wavy_sheet(30),
    "ball": ball(900, 0.3),
    "sheet": flat_sheet(40),
    "tube": tube(),
    "open": Mesh(wavy_sheet(30).vertices, wavy_sheet(30).faces[1:]),
    "room": boxed(ball(20, 0.4)),
}
CONVEX = {"beam", "pin", "cone", "inside out", "arm"}


def random_poses(count, spread, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    R = rotation_about(axis, rng.uniform(-np.pi, np.pi, count))
    R[::9] = np.eye(3)
    return R, rng.normal(0.0, spread, (count, 3))


@cache
def coal_of(name):
    return CoalMesh(SOLIDS[name])


def true_distances(names, R, p):
    """Distances (n,) [m] by all triangles, 0 where a vertex of one is in the other."""
    one, two = (SOLIDS[name] for name in names)
    T = np.tile(np.eye(4), (len(p), 1, 1))
    T[:, :3, :3], T[:, :3, 3] = R, p
    a, b = map(coal_of, names)
    exact = np.array(
        [0.0 if coal_collide(a, HERE, b, t) else coal_distance(a, HERE, b, t) for t in T]
    )
    for outer, inner, turn, shift in (
        (one, two, R, p),
        (two, one, np.swapaxes(R, 1, 2), -np.einsum("kji,kj->ki", R, p)),
    ):
        if len(parts_of(outer).closed) and parts_of(outer).closed.all():
            for first in np.unique(parts_of(inner).label, return_index=True)[1]:
                point = np.einsum("kij,j->ki", turn, inner.vertices[inner.faces[first, 0]]) + shift
                exact[np.abs(winding_number(outer, point)) > 0.5] = 0.0
    return exact


HERE = np.eye(4)


def test_solids_are_split_into_convex_pieces_and_patches():
    meshes = list(SOLIDS.values())
    distances = Distances([Shape.of(mesh) for mesh in meshes])
    for name, solid in zip(SOLIDS, distances._solids, strict=True):
        assert solid.is_convex.all() == (name in CONVEX), name
        assert sorted(solid.faces.tolist()) == list(range(len(SOLIDS[name].faces))), name


@pytest.mark.slow
def test_distances_are_those_of_all_triangles_and_bounds_hold():
    """What is exact, what is a bound, what is far enough: all pairs of solids, random poses."""
    names, count = list(SOLIDS), 3
    meshes = list(SOLIDS.values())
    distances = Distances([Shape.of(mesh) for mesh in meshes])
    rng = np.random.default_rng(3)
    wrong, met = [], 0
    for a, b in zip(*np.triu_indices(len(names)), strict=True):
        a, b = (a, b) if rng.integers(0, 2) else (b, a)
        R, p = random_poses(count, 0.45, seed=17 * a + 1000 * b)
        true = true_distances((names[a], names[b]), R, p)
        pair = np.full(count, a), np.full(count, b)
        low = rng.uniform(0.0, 0.05, count)
        enough = low + rng.uniform(0.0, 0.2, count) * rng.integers(0, 2, count)
        whole = np.full(count, np.inf)
        plain = distances.distance(*pair, R, p, whole, whole)
        bound = distances.distance(*pair, R, p, enough, low)
        near = distances.distance(*pair, R, p, low, low, stop=low)
        met += int((true == 0.0).sum())
        known = true <= low
        for text, good in (
            ("distance", np.abs(plain - true) <= 1e-7),
            ("exact up to low", ~known | (np.abs(bound - true) <= 1e-7)),
            ("bound", known | (bound <= true + 1e-7) | (true > enough)),
            ("bound beyond low", known | (bound > low - 1e-7)),
            ("far enough", (true <= enough) | (bound > low)),
            ("near enough", (near <= low) == known),
        ):
            wrong += [f"{names[a]} {names[b]} {text} {true[k]}" for k in np.flatnonzero(~good)]
    assert not wrong, wrong[:20]
    assert met > 50


def test_of_a_group_the_first_that_is_near_ends_the_search():
    meshes = [SOLIDS["beam"], SOLIDS["pin"]]
    distances = Distances([Shape.of(mesh) for mesh in meshes])
    p = np.array([[3.0, 0, 0], [0.1, 0, 0], [0, 0, 0], [0.1, 0, 0], [3.0, 0, 0]])
    zero, R = np.zeros(5), np.tile(np.eye(3), (5, 1, 1))
    pair = np.zeros(5, dtype=np.int64), np.ones(5, dtype=np.int64)
    group = np.array([0, 0, 0, 1, 1])
    found = distances.distance(*pair, R, p, zero, zero, zero, group)
    assert np.flatnonzero(found <= 0.0).tolist() == [1, 3]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 3e-7, 2e-6, 1e-3])
def test_solids_that_overlap_deeply_or_lie_flush_have_no_distance(angle):
    """Aligned axes and faces are where a search for the distance between convex solids ends ill."""
    meshes = [SOLIDS["cone"], SOLIDS["pin"], SOLIDS["beam"], box(np.full(3, 0.3))]
    distances = Distances([Shape.of(mesh) for mesh in meshes])
    rng = np.random.default_rng(8)
    first, second = rng.integers(0, 4, (2, 3000))
    quarter = rotation_about(np.array([0.0, 1.0, 0.0]), np.pi / 2 * rng.integers(0, 4, 3000))
    R = rotation_about(np.array([0.0, 0.0, 1.0]), np.full(3000, angle)) @ quarter
    p = rng.uniform(0.0, 0.04, (3000, 3)) * rng.integers(0, 2, (3000, 3))
    p[:, 2] += np.where((first == 0) & (second != 0), 0.1, 0.0)
    far = np.full(3000, 1.0)
    overlap = (first != 0) & (second != 0)
    assert (distances.distance(first, second, R, p, far, far)[overlap] == 0.0).all()
