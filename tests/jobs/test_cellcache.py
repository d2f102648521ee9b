"""Cells are shared until one of their files changes."""

import os

import pytest

from postproc.cell.cache import shared_cell
from postproc.collision.scene import Scene
from postproc.errors import CellError
from postproc.kinematics import build
from tests.cells import cell_text

CELL = cell_text('[[obstacles]]\nname = "post"\nfile = "post.stl"\n')
TETRAHEDRON = ((0, 0, 0), (100, 0, 0), (0, 100, 0), (0, 0, 100))
FACES = ((0, 2, 1), (0, 1, 3), (0, 3, 2), (1, 2, 3))


def write_mesh(path, scale=1.0):
    lines = ["solid post"]
    for face in FACES:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += ["vertex " + " ".join(f"{scale * v:g}" for v in TETRAHEDRON[i]) for i in face]
        lines += ["endloop", "endfacet"]
    path.write_text("\n".join([*lines, "endsolid post", ""]))


@pytest.fixture
def cell_path(tmp_path):
    write_mesh(tmp_path / "post.stl")
    (tmp_path / "cell.toml").write_text(CELL)
    return tmp_path / "cell.toml"


def test_the_same_files_give_the_same_cell_and_scene(cell_path):
    cell = shared_cell(str(cell_path))
    assert shared_cell(str(cell_path)) is cell
    kinematics = build(cell.robot)
    assert Scene.shared(cell, kinematics) is Scene.shared(cell, kinematics)


def test_a_changed_mesh_gives_another_cell_and_scene(cell_path):
    cell = shared_cell(str(cell_path))
    scene = Scene.shared(cell, build(cell.robot))
    write_mesh(cell_path.with_name("post.stl"), 2.0)
    changed = shared_cell(str(cell_path))
    assert changed is not cell
    after = Scene.shared(changed, build(changed.robot))
    assert after.bodies[-1].mesh.vertices.max() == 2.0 * scene.bodies[-1].mesh.vertices.max()


def test_a_changed_cell_file_is_read_again(cell_path):
    shared_cell(str(cell_path))
    cell_path.write_text(CELL.replace('"post"', '"pole"'))
    os.utime(cell_path)
    assert shared_cell(str(cell_path)).obstacles[0].name == "pole"
    cell_path.write_text("robot = [")
    with pytest.raises(CellError):
        shared_cell(str(cell_path))
