"""Rails and positioners: the same answers as a cell that stands where they have moved it."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import ExternalAxis
from postproc.collision.scene import Scene
from postproc.geometry.frames import inverse, rotation_about, transform, transform_from_kuka
from postproc.kinematics import build
from tests.collision.conftest import at, box_at, cell_of

RAIL = ExternalAxis("E1", "rail", np.array([0.6, 0.8, 0.0]), np.eye(4), -2.0, 2.0, 1.0)
TILT = ExternalAxis(
    "E2", "positioner", np.array([0.0, 1.0, 0.0]), at(2.0, 0.1, 0.8), -2.0, 2.0, 1.0
)
TABLE = ExternalAxis(
    "E3", "positioner", np.array([0.0, 0.0, 1.0]), at(2.1, 0.0, 0.0), -3.0, 3.0, 1.0
)
STAND = transform_from_kuka([100, -200, 150], [20, 0, 0])


def cell_with(axes):
    cell = cell_of(
        tool=[box_at("head", [0.2, 0.2, 0.4], at(0.0, 0.0, 0.2))],
        workpiece=[box_at("block", [0.9, 0.3, 0.5], at(0.05, 0.1, 0.0))],
        obstacles=[box_at("post", [0.2, 0.2, 2.4], at(1.4, 1.1, 1.2))],
        T_robroot_base=transform_from_kuka([1900, 100, 1000], [0, 0, 30]),
        T_world_robroot=STAND,
    )
    return replace(cell, external_axes=tuple(axes))


BESIDE, RIDING = ("workpiece block", "obstacle post"), ("link 0", "obstacle post")


def named(scene, x):
    """Return the name of the pair that collides at each configuration, None where none does."""
    return [scene.pairs[pair] if pair >= 0 else None for pair in scene.check(x).pair]


def frozen(cell, values):
    """The cell without axes, standing where they stand at these values."""
    world, turned = STAND.copy(), np.eye(4)
    for axis, value in zip(cell.external_axes, values, strict=True):
        if axis.kind == "rail":
            world[:3, 3] += value * axis.axis
        else:
            origin = axis.T_world_axis[:3, 3]
            R = rotation_about(axis.axis, value)
            turned = turned @ transform(R, origin - R @ origin)
    T_robroot_base = inverse(world) @ turned @ STAND @ cell.T_robroot_base
    return replace(
        cell,
        external_axes=(),
        robot=replace(cell.robot, T_world_robroot=world),
        bases=(replace(cell.workpiece, T_robroot_base=T_robroot_base),),
    )


@pytest.mark.parametrize("axes", [[RAIL], [TILT, TABLE], [RAIL, TILT, TABLE]])
def test_equals_a_cell_that_stands_there(axes, random_q):
    cell = cell_with(axes)
    arm = build(cell.robot)
    scene = Scene.build(cell, arm)
    rng = np.random.default_rng(0)
    seen = 0
    for seed in range(4):
        values = rng.uniform(-0.6, 0.6, len(axes))
        q = random_q(150, seed)
        x = np.hstack([q, np.tile(values, (len(q), 1))])
        there = Scene.build(frozen(cell, values), arm)
        # only a part that turns and a base that rides may meet what stands in the room
        more = [BESIDE] * (TABLE in axes) + [RIDING] * (RAIL in axes)
        assert sorted([*there.pairs, *more]) == sorted(scene.pairs)
        hit, hit_there = named(scene, x), named(there, q)
        beside = np.array([one in more for one in hit])
        assert (np.array(hit, object)[~beside] == np.array(hit_there, object)[~beside]).all()
        assert np.allclose(scene.clearance(x)[~beside], there.clearance(q)[~beside], atol=1e-9)
        seen += there.check(q).hit.sum()
    assert seen > 15
    still = Scene.build(frozen(cell, np.zeros(len(axes))), arm)
    assert [one for one in named(scene, q) if one not in more] == [
        other
        for one, other in zip(named(scene, q), named(still, q), strict=True)
        if one not in more
    ]


def test_motions_of_all_axes_miss_nothing():
    cell = cell_with([RAIL, TILT, TABLE])
    scene = Scene.build(cell, build(cell.robot))
    rng = np.random.default_rng(1)
    low = np.deg2rad([-50, -100, 40, -90, -80, -90])
    start = np.hstack([rng.uniform(low, [0.8, -0.7, 2.2, 1.5, 1.4, 1.5], (200, 6)),
                       rng.uniform(-0.5, 0.5, (200, 3))])  # fmt: skip
    step = np.where(rng.random((200, 9)) < 0.5, 0.0, rng.normal(0.0, 0.3, (200, 9)))
    step[:60, :6] = 0.0
    answer = scene.check_paths(start, start + step)
    share = np.linspace(0.0, 1.0, 150)[:, None, None]
    sampled = scene.check((start + share * step).reshape(-1, 9)).hit.reshape(150, -1)
    assert not (sampled.any(axis=0) & ~answer.hit).any()
    where = start + np.nan_to_num(answer.share)[:, None] * step
    assert scene.check(where[answer.hit]).hit.all()
    assert (answer.hit & ~sampled[0] & ~sampled[-1])[:60].sum() + answer.hit[60:].sum() > 10


@pytest.mark.parametrize("top", [0.0, 0.008, 0.02])
def test_the_base_rides_on_its_bed_and_into_a_crate(top):
    """The bed stands in three pieces, as high around the foot as bolts and plates, or higher."""
    along = STAND[:3, 3] + np.multiply.outer([-1.0, 0.0, 1.0, 1.9], RAIL.axis)
    bed = [
        box_at(f"bed {n}", [1.4, 1.4, 0.3], at(*place[:2], place[2] + top - 0.15))
        for n, place in enumerate(along[:3])
    ]
    crate = box_at("crate", [0.2, 0.2, 0.2], at(*along[3, :2], along[3, 2] + 0.2))
    cell = replace(cell_with([RAIL]), obstacles=(*bed, crate))
    scene = Scene.build(cell, build(cell.robot))
    q = np.deg2rad([0.0, -120.0, 120.0, 0.0, 0.0, 0.0])
    x = np.array([[*q, -1.5], [*q, 0.5], [*q, 1.9]])
    hit = named(scene, x)
    assert hit[2] is not None
    assert (hit[:2] == [None, None]) == (top < 0.01)
    if top < 0.01:
        assert hit[2] == ("link 0", "obstacle crate")
        assert scene.clearance(x)[0] > 0.1
        assert scene.check_paths(x[:1], x[1:2]).hit.tolist() == [False]
        assert scene.check_paths(x[:1], x[2:]).hit.tolist() == [True]


def test_wrong_shapes_and_numbers_are_refused():
    cell = cell_with([RAIL])
    scene = Scene.build(cell, build(cell.robot))
    with pytest.raises(ValueError, match="expected"):
        scene.check(np.zeros((2, 8)))
    with pytest.raises(ValueError, match="finite"):
        scene.check(np.full((1, 6), np.nan))
    assert len(scene.check(np.zeros(6)).hit) == 1
