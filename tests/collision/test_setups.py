"""Solids of several setups: those that overlap the setup in work are not in the cell."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import MeshPlacement, Workpiece
from postproc.collision.mesh import box, joined
from postproc.collision.scene import Scene
from postproc.collision.setups import absent_bases
from postproc.geometry.frames import rotation_about, transform
from postproc.kinematics import build
from tests.collision.conftest import at, box_at, cell_of, write_stl

BLOCK = box_at("block", [0.3, 0.2, 0.1], np.eye(4))
TURN = transform(rotation_about(np.array([0.0, 0.0, 1.0]), np.array(0.4)), np.zeros(3))


def of_bases(*bases):
    """Return a cell of workpieces: pairs of a frame and solids."""
    made = (Workpiece(i + 1, T, tuple(solids)) for i, (T, solids) in enumerate(bases))
    return replace(cell_of(), bases=tuple(made))


def numbers(cell, index=0):
    """Return the numbers of the bases that are there while one is in work."""
    absent = absent_bases(cell.with_tool(0, index))
    return [base.number for k, base in enumerate(cell.bases) if k not in absent]


@pytest.mark.parametrize(
    ("T", "expected"),
    [
        (at(), [1]),
        (at(0.2997), [1]),
        (at(0.0, 0.0, 0.08) @ TURN, [1]),
        (at(0.3), [1, 2]),  # they touch
        (at(0.29995), [1, 2]),
        (at(0.31) @ TURN, [1]),
        (at(0.34) @ TURN, [1, 2]),
        (at(0.0, 0.0, 5.0), [1, 2]),
    ],
)
def test_overlap_decides(T, expected):
    cell = of_bases((np.eye(4), [BLOCK]), (T, [BLOCK]))
    assert numbers(cell) == expected
    assert numbers(cell, 1) == ([1, 2] if len(expected) == 2 else [2])


def test_a_solid_inside_another_overlaps():
    small = box_at("pin", [0.01, 0.01, 0.01], np.eye(4))
    cell = of_bases((np.eye(4), [BLOCK]), (np.eye(4), [small]))
    assert (numbers(cell), numbers(cell, 1)) == ([1], [2])


@pytest.mark.parametrize("inward", [False, True])
def test_a_part_in_the_notch_of_another_touches_it(tmp_path, inward):
    """An angle of two legs, and a block that fits between them, faces on faces."""
    legs = [box(np.array([0.3, 0.2, 0.1])), box(np.array([0.1, 0.2, 0.3])).moved(at(-0.2, 0, 0.1))]
    mesh = joined(legs)
    if inward:
        mesh = replace(mesh, faces=mesh.faces[:, ::-1])
    angle = MeshPlacement("angle", np.eye(4), write_stl(tmp_path / "angle.stl", mesh))
    for height, expected in ((0.1, [1, 2]), (0.095, [1])):
        cell = of_bases((np.eye(4), [angle]), (at(0.0, 0.0, height), [BLOCK]))
        assert numbers(cell) == expected


def test_only_what_overlaps_the_one_in_work_goes():
    """Setups 1 and 2 are at one place, 3 stands beside them, 4 has no solids."""
    cell = of_bases((np.eye(4), [BLOCK]), (at(0.1), [BLOCK]), (at(1.0), [BLOCK]), (np.eye(4), []))
    assert [numbers(cell, k) for k in range(4)] == [
        [1, 3, 4],
        [2, 3, 4],
        [1, 2, 3, 4],
        [1, 2, 3, 4],
    ]


def test_the_scene_says_what_is_not_there():
    cell = of_bases((np.eye(4), [BLOCK]), (at(0.1), [BLOCK]), (at(1.0), [BLOCK]))
    scene = Scene.build(cell.with_tool(0, 1), build(cell.robot))
    assert [body.name for body in scene.bodies if body.kind == "workpiece"] == [
        "workpiece block (2)",
        "workpiece block (3)",
    ]
    (note,) = [finding for finding in scene.findings if finding.code == "COL106"]
    assert "base 1 overlap those of base 2" in note.message
