"""What may touch the workpiece, and how deep."""

import numpy as np
import pytest

from postproc.collision.scene import Scene
from tests.collision.conftest import at, box_at, cell_of, motions_along

CANNON = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
# The flange stands at (1.815, 0, 2.29) and looks along +x; its x axis points down.
TIP = np.array([1.815, 0.0, 2.29]) + np.array([0.4, 0.0, -0.1])


def drilling_cell(depth, contact_depth=np.inf, clearance=0.0):
    """A drill below the flange at z = 0.4, pointing down; a slab whose top it enters by a depth."""
    drill = box_at("drill", [0.2, 0.01, 0.01], at(0.0, 0.0, 0.4), cutting=True)
    holder = box_at("holder", [0.08, 0.08, 0.3], at(-0.14, 0.0, 0.27))
    top = 2.29 - 0.1 + depth
    slab = box_at("slab", [0.1, 0.5, 0.2], at(TIP[0], 0.0, top - 0.1))
    return cell_of([drill, holder], [slab], clearance=clearance, contact_depth=contact_depth)


def scene_of(cell, arm_of):
    return Scene.build(cell, arm_of(cell))


def test_only_the_cutting_part_and_only_in_contact(arm_of):
    scene = scene_of(drilling_cell(0.03), arm_of)
    hits = scene.check(np.stack([CANNON, CANNON]), contact=[False, True])
    assert hits.hit.tolist() == [True, False]
    assert hits.name(0) == "tool drill and workpiece slab"
    assert scene.check(CANNON[None]).hit[0]
    too_deep = scene_of(drilling_cell(0.205), arm_of)
    hits = too_deep.check(CANNON[None], contact=True)
    assert hits.name(0) == "tool holder and workpiece slab"


def test_cutting_parts_never_touch_obstacles(arm_of):
    cell = drilling_cell(0.03)
    cell = cell_of(cell.tool.meshes, (), cell.workpiece.meshes)
    assert scene_of(cell, arm_of).check(CANNON[None], contact=True).hit[0]


@pytest.mark.parametrize(
    ("depth", "hit"), [(-0.01, False), (0.01, False), (0.02, False), (0.0201, True), (0.09, True)]
)
def test_depth_is_counted_along_the_tool_axis(depth, hit, arm_of):
    scene = scene_of(drilling_cell(depth, contact_depth=0.02), arm_of)
    hits = scene.check(CANNON[None], contact=True)
    assert hits.hit[0] == hit
    assert scene.check(CANNON[None]).hit[0] == (depth > 0.0)
    if hit:
        assert hits.name(0) == "tool drill and workpiece slab"


def test_clearance_leaves_out_what_may_touch(arm_of):
    scene = scene_of(drilling_cell(-0.004), arm_of)
    free, touching = scene.clearance(np.stack([CANNON, CANNON]), contact=[False, True])
    assert free == pytest.approx(0.204, abs=1e-9)  # how near the drill is, the CAM file asks for
    # the drill is 0.2 long, the holder begins where it ends
    assert touching == pytest.approx(0.204, abs=1e-9)
    inside = scene_of(drilling_cell(0.03), arm_of)
    assert inside.clearance(CANNON[None])[0] == 0.0
    assert inside.clearance(CANNON[None], contact=True)[0] == pytest.approx(0.17, abs=1e-9)


def test_clearance_margin_does_not_hinder_the_cut(arm_of):
    scene = scene_of(drilling_cell(-0.004, clearance=0.01), arm_of)
    assert not scene.check(CANNON[None]).hit[0]
    assert not scene.check(CANNON[None], contact=True).hit[0]
    inside = scene_of(drilling_cell(0.004, clearance=0.01), arm_of)
    assert inside.check(CANNON[None]).hit[0]
    assert not inside.check(CANNON[None], contact=True).hit[0]
    # the holder keeps it, in contact or not
    near = scene_of(drilling_cell(0.195, clearance=0.01), arm_of)
    assert near.check(CANNON[None], contact=True).hit[0]


def test_contact_on_a_motion_belongs_to_the_motion(arm_of):
    cell = drilling_cell(0.03)
    scene = scene_of(cell, arm_of)
    away = CANNON.copy()
    away[1] -= 0.02  # lifts the arm
    path = np.stack([away, CANNON, away])
    assert motions_along(scene, path, contact=[True, False]).hit.tolist() == [False, True]
    assert motions_along(scene, path, contact=True).hit.tolist() == [False, False]
    assert motions_along(scene, path).hit.tolist() == [True, True]
