"""Nearest places and normals, against closed forms and trimesh."""

import numpy as np
import pytest
import trimesh
from scipy.optimize import nnls

from postproc.cell.cell import MeshPlacement
from postproc.collision.mesh import Mesh, box, joined, loft, ring
from postproc.collision.scene import Scene
from postproc.collision.surface import Surface, nearest_in_triangle, nearest_outside
from postproc.errors import CellError, DataError
from postproc.geometry.frames import apply, transform_from_kuka
from tests.collision.conftest import at, box_at, cell_of, wavy_sheet, write_stl


def test_nearest_in_triangle_agrees_with_least_squares():
    rng = np.random.default_rng(0)
    corners = rng.normal(size=(300, 3, 3))
    points = rng.normal(0.0, 1.5, size=(300, 3))
    weight = nearest_in_triangle(points, corners)
    assert (weight >= 0.0).all()
    assert np.allclose(weight.sum(axis=1), 1.0)
    place = np.einsum("nc,nci->ni", weight, corners)
    heavy = 1e4
    for point, triangle, found in zip(points, corners, place, strict=True):
        A = np.vstack([triangle.T, heavy * np.ones(3)])
        best = nnls(A, np.append(point, heavy))[0]
        exact = np.linalg.norm(best / best.sum() @ triangle - point)
        assert np.linalg.norm(found - point) == pytest.approx(exact, abs=1e-6)


def test_distances_agree_with_trimesh():
    mesh = wavy_sheet()
    points = np.random.default_rng(1).uniform([-0.7, -0.5, -0.2], [0.7, 0.5, 0.2], (400, 3))
    found = Surface(mesh).nearest(points)
    other = trimesh.Trimesh(np.array(mesh.vertices), np.array(mesh.faces), process=False)
    _, distance, _ = trimesh.proximity.closest_point(other, points)
    assert np.allclose(found.distance, distance, atol=1e-12)
    assert np.allclose(np.linalg.norm(found.point - points, axis=1), distance, atol=1e-12)
    assert np.allclose(np.linalg.norm(found.normal, axis=1), 1.0)


def test_a_tessellated_skin_answers_as_the_smooth_one():
    n = 48
    shell = loft([ring(1.0, n), ring(1.0, n)], [-1.0, 1.0])
    angle = np.linspace(0.0, 2.0 * np.pi, 400)
    radial = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1)
    normal = Surface(shell).nearest(1.02 * radial + [0.0, 0.0, 0.3]).normal
    error = np.arccos(np.clip((normal * radial).sum(axis=1), -1, 1))
    facet = np.pi / n
    assert error.max() < 0.05 * facet
    top = Surface(shell).nearest(np.array([[0.3, 0.2, 1.1], [-0.5, 0.1, -1.4]]))
    assert np.allclose(top.normal, [[0, 0, 1], [0, 0, -1]])
    assert np.allclose(top.distance, [0.1, 0.4])


def test_sharp_edges_stay_sharp_and_inward_meshes_are_turned():
    solid = box(np.array([1.0, 2.0, 3.0]))
    points = np.array([[0.6, 0.99, 1.49], [0.1, -1.1, 0.2], [0.2, 0.3, 1.4]])
    expected = [[1, 0, 0], [0, -1, 0], [0, 0, 1]]
    inward = Mesh(solid.vertices, solid.faces[:, ::-1])
    for mesh in (solid, inward, joined([inward, solid.moved(at(x=5.0))])):
        assert np.allclose(Surface(mesh).nearest(points).normal, expected)


def test_points_are_asked_in_cam_coordinates(tmp_path, arm_of):
    frame = transform_from_kuka([1500, 200, 900], [30, -20, 75])
    placement = transform_from_kuka([10, 20, 30], [0, 0, 90])
    path = write_stl(tmp_path / "panel.stl", wavy_sheet())
    cell = cell_of(
        workpiece=[MeshPlacement("workpiece", placement, path)],
        T_robroot_base=frame,
        T_world_robroot=transform_from_kuka([0, 0, 500], [90, 0, 0]),
    )
    scene = Scene.build(cell, arm_of(cell))
    local = np.array([[0.1, 0.1, 0.3], [-0.2, 0.25, 0.4]])
    up = Surface(wavy_sheet()).nearest(local)
    found = scene.nearest_surface(apply(placement, local))
    assert np.allclose(found.distance, up.distance, atol=1e-6)
    assert np.allclose(found.normal @ placement[:3, :3], up.normal, atol=1e-5)
    assert np.array_equal(scene.surface_normals(apply(placement, local)), found.normal)
    assert scene.surface_normals(np.zeros((0, 3))).shape == (0, 3)
    with pytest.raises(DataError, match="point 2 lies") as caught:
        scene.surface_normals(found.point + np.array([[0.0], [0.3]]), farthest=0.01)
    assert caught.value.code == "COL008"


def test_no_workpiece_is_an_error(arm_of):
    cell = cell_of(obstacles=[box_at("post", [0.1, 0.1, 1.0], at(2.0))])
    with pytest.raises(CellError) as caught:
        Scene.build(cell, arm_of(cell)).surface_normals(np.zeros((1, 3)))
    assert caught.value.code == "COL007"


def test_between_two_posts_is_far_from_both():
    post = box((0.02, 0.02, 0.02))
    posts = [post, post.moved(at(0.4, 0.2, 0.0))]
    middle = np.column_stack([np.linspace(0.1, 0.3, 5), np.full(5, 0.1), np.zeros(5)])
    for parts in (posts, [joined(posts)]):  # of one mesh the points are in its box
        assert nearest_outside(middle, parts, 0.02) == pytest.approx(0.09 * np.sqrt(2.0))
    assert nearest_outside(np.zeros((1, 3)), posts, 0.02) == 0.0
