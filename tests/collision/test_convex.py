"""Convex solids: which meshes are one; bounds and common points against coal, winding numbers."""

import numpy as np
import pytest
from scipy.optimize import linprog
from scipy.spatial import ConvexHull
from scipy.spatial.transform import Rotation

from postproc.collision.convex_pairs import ConvexPairs
from postproc.collision.cull import Near
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


BEAM, PIN = box(np.array([0.1, 0.12, 1.5])), cylinder(0.12, 0.5)
CONE = loft([ring(0.3, 12), ring(0.05, 12)], [0.0, 0.4])
WEDGE = Mesh(
    np.array([[0.0, 0, 0], [0.5, 0, 0], [0, 0.4, 0], [0, 0, 0.3]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]]),
)
CUT = hull_of(0.25 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])[:-1])
"""A cube without one of its corners."""
L_SHAPE = joined([box(np.array([1.0, 0.2, 0.2])), box(np.array([0.2, 1.0, 0.2])).moved(at(y=0.5))])


def turned(mesh, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=3)
    R = rotation_about(axis / np.linalg.norm(axis), rng.uniform(0.3, 3.0))
    return Mesh(mesh.vertices @ R.T + rng.normal(size=3), mesh.faces)


@pytest.mark.parametrize(
    "mesh",
    [BEAM, PIN, CONE, WEDGE, CUT],
    ids=["beam", "pin", "cone", "wedge", "cut"],
)
def test_convex_meshes_are_known_wherever_they_stand(mesh):
    for placed in (mesh, *(turned(mesh, seed) for seed in range(5))):
        shape = Shape.of(placed)
        assert shape.solid is not None
        assert shape.solid.is_box == (mesh is BEAM)
        inside_out = Mesh(shape.mesh.vertices, shape.mesh.faces[:, ::-1].copy())
        assert Shape.of(inside_out).solid is not None


def test_what_is_not_one_convex_solid_is_left_to_the_exact_test():
    dented = BEAM.vertices.copy()
    dented[0] *= 0.5
    for mesh in (
        L_SHAPE,
        wavy_sheet(),
        Mesh(dented, BEAM.faces),
        Mesh(PIN.vertices, PIN.faces[1:]),
        joined([BEAM, BEAM.moved(at(x=2.0))]),
    ):
        assert Shape.of(mesh).solid is None


def random_poses(count, spread, seed):
    rng = np.random.default_rng(seed)
    axis = rng.normal(size=(count, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    R = rotation_about(axis, rng.uniform(-np.pi, np.pi, count))
    R[::9] = np.eye(3)
    return R, rng.normal(0.0, spread, (count, 3))


@pytest.mark.parametrize(
    ("one", "two"),
    [(PIN, BEAM), (PIN, PIN), (CONE, WEDGE), (BEAM, BEAM), (WEDGE, BEAM), (CUT, BEAM)],
    ids=["pin-beam", "pin-pin", "cone-wedge", "beam-beam", "wedge-beam", "cut-beam"],
)
def test_bounds_hold_and_common_points_are_true(one, two):
    two = turned(two, 2)
    shapes = [Shape.of(one), Shape.of(two)]
    pairs = ConvexPairs(shapes, np.array([0]), np.array([1]))
    R, p = random_poses(600, 0.35, seed=3)
    p += shapes[0].centre - np.einsum("kij,j->ki", R, shapes[1].centre)
    bound, meets = pairs.judge(np.zeros(600, dtype=np.int64), R, p, np.full(600, np.inf))
    a, b, T_two = CoalMesh(one), CoalMesh(two), np.tile(np.eye(4), (600, 1, 1))
    T_two[:, :3, :3], T_two[:, :3, 3] = R, p
    exact = np.array([max(coal_distance(a, np.eye(4), b, T), 0.0) for T in T_two])
    crosses = np.array([coal_collide(a, np.eye(4), b, T) for T in T_two])
    corner = np.einsum("kij,j->ki", R, two.vertices[0]) + p
    back = np.einsum("kji,kj->ki", R, one.vertices[0] - p)
    nested = (np.abs(winding_number(one, corner)) > 0.5) | (np.abs(winding_number(two, back)) > 0.5)
    assert (bound <= np.where(crosses, 0.0, exact) + 1e-7).all()
    assert not (meets & ~(crosses | nested)).any()
    assert not (meets & (bound > 0.0)).any()
    assert crosses.sum() > 100
    assert (~crosses).sum() > 100
    assert meets[crosses].mean() > 0.4
    assert (bound > 0.0)[exact > 0.005].mean() > 0.8
    if all(shape.solid.is_box for shape in shapes):
        assert meets[crosses].mean() > 0.99
        assert (bound > 0.0)[exact > 1e-6].all()


def touching(one, two, R, way):
    """How far [m] out along a way the second solid still has a point in common with the first."""
    a, b = ConvexHull(one.vertices).equations, ConvexHull(two.vertices).equations
    turned = b[:, :3] @ R.T
    shift = np.concatenate([np.zeros(len(a)), -turned @ way])
    planes = np.column_stack([np.vstack([a[:, :3], turned]), shift])
    limits = -np.concatenate([a[:, 3], b[:, 3]])
    return linprog([0, 0, 0, -1], planes, limits, bounds=[(None, None)] * 4).x[3]


@pytest.mark.parametrize("angle", [0.0, 1e-9, 3e-7, 2e-6, 1e-3])
def test_boxes_with_almost_parallel_edges_meet_only_where_they_do(angle):
    """Long beams whose edges nearly line up, a few micrometres apart or into each other."""
    shapes = [Shape.of(BEAM), Shape.of(BEAM)]
    pairs = ConvexPairs(shapes, np.array([0]), np.array([1]))
    rng = np.random.default_rng(8)
    axis = rng.normal(size=(400, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    quarters = np.array([[0, 0, 0], [np.pi / 2, 0, 0], [0, np.pi / 2, 0], [0, 0, np.pi / 4]])
    turn = Rotation.from_rotvec(angle * axis) * Rotation.from_rotvec(quarters[np.arange(400) % 4])
    R = turn.as_matrix()
    way = rng.normal(size=(400, 3))
    way /= np.linalg.norm(way, axis=1, keepdims=True)
    touch = np.array([touching(BEAM, BEAM, *each) for each in zip(R, way, strict=True)])
    off = rng.uniform(-2e-5, 2e-5, 400)
    p = (touch + off)[:, None] * way
    every = np.zeros(400, dtype=np.int64)
    bound, meets = pairs.judge(every, R, p, np.full(400, np.inf))
    sure = np.abs(off) > 5e-7  # the linear programs hold their planes to 1e-7
    assert not meets[sure & (off > 0.0)].any()
    assert (bound <= np.maximum(off, 0.0) + 5e-7).all()
    assert (bound > 0.0)[sure & (off > 0.0)].mean() > 0.3


def test_entries_beyond_their_limits_go_and_others_are_untouched():
    shapes = [Shape.of(mesh) for mesh in (BEAM, PIN, L_SHAPE)]
    pairs = ConvexPairs(shapes, np.array([0, 0]), np.array([1, 2]))
    near = Near(np.array([0, 0, 0, 1]), np.arange(4), np.array([0.0, 0.0, 0.0, 0.4]))
    p = np.array([[0.6, 0, 0], [0.3, 0, 0], [0.02, 0, 0], [3.0, 0, 0]])
    R, limit = np.tile(np.eye(3), (4, 1, 1)), np.array([0.4, 0.4, 0.4, 0.5])
    left, _, at_p, of, meets = pairs.culled(near, R, p, limit)
    assert left.row.tolist() == [1, 2, 3]
    assert meets.tolist() == [False, True, False]
    assert left.bound == pytest.approx([0.3 - 0.12 - 0.05, 0.0, 0.4], abs=2e-3)
    assert np.array_equal(at_p, p[1:])
    assert np.array_equal(of, limit[1:])
