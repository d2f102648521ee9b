"""Motions: the bound holds, nothing that dense sampling finds is missed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from postproc.collision.scene import Scene
from postproc.collision.sweep import Sway
from postproc.kinematics import build
from tests.collision.conftest import at, box_at, cell_of, motions_along

CANNON = np.deg2rad([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def plain():
    """A scene with one solid in the flange, one workpiece."""
    cell = cell_of(
        tool=[box_at("head", [0.3, 0.2, 0.3], at(0.1, 0.05, 0.15))],
        workpiece=[box_at("block", [0.4, 0.4, 0.4], at(1.5, 0.2, 0.3))],
    )
    scene = Scene.build(cell, build(cell.robot))
    return scene, build(cell.robot), cell


angles = st.floats(-3.0, 3.0)
turns = st.floats(0.0, 0.8)


def no_vertex_farther(scene, arm, q, away, bound):
    """Vertices of each pair, seen from the other body, keep within the bound (p,) at all poses."""
    start, frames = arm.link_frames(q), arm.link_frames(away)
    for (a, b), limit in zip(scene.pair_bodies, bound, strict=True):
        low, high = sorted((a, b), key=lambda body: max(body.link, 0))
        base, link = max(low.link, 0), max(high.link, 0)
        points = np.column_stack([high.vertices, np.ones(len(high.vertices))]).T
        before = np.linalg.inv(start[base]) @ start[link] @ points
        after = np.linalg.inv(frames[:, base]) @ frames[:, link] @ points
        moved = np.linalg.norm((after - before)[:, :3], axis=1).max()
        assert moved <= limit + 1e-12


@settings(max_examples=60, deadline=None)
@given(st.lists(angles, min_size=6, max_size=6), st.lists(turns, min_size=6, max_size=6))
def test_no_vertex_moves_farther_than_the_bound(plain, q, turn):
    scene, arm, _ = plain
    q, turn = np.array(q), np.array(turn)
    engine = scene._engine
    bound = engine.sweep.of_pairs(engine.place(q[None]), Sway(turn[None]))[:, 0]
    rng = np.random.default_rng(1)
    away = q + turn * np.sign(rng.uniform(-1, 1, (24, 6))) * rng.choice([1.0, 0.3], (24, 6))
    no_vertex_farther(scene, arm, q, away, bound)


def test_the_bound_is_not_wasteful_for_one_joint(plain):
    scene, arm, _ = plain
    engine = scene._engine
    pair = scene.pairs.index(("tool head", "workpiece block"))
    head = next(body for body in scene.bodies if body.name == "tool head")
    points = np.column_stack([head.vertices, np.ones(len(head.vertices))]).T
    for joint in range(6):
        turn = np.zeros(6)
        turn[joint] = 0.01
        bound = engine.sweep.of_pairs(engine.place(CANNON[None]), Sway(turn[None]))[pair, 0]
        moved = (arm.link_frames(CANNON + turn) - arm.link_frames(CANNON))[6] @ points
        assert 0.75 * bound < np.linalg.norm(moved[:3], axis=0).max() <= bound


@settings(max_examples=60, deadline=None)
@given(
    st.lists(angles, min_size=6, max_size=6),
    st.lists(st.floats(-0.5, 0.5), min_size=6, max_size=6),
    st.sampled_from([0.0, 0.01, 0.2]),
)
def test_no_vertex_leaves_the_bound_of_a_common_way(plain, q, way, beside):
    scene, arm, _ = plain
    q, way = np.array(q), np.array(way)
    engine = scene._engine
    sway = Sway((np.abs(way) + beside)[None], way[None])
    bound = engine.sweep.of_pairs(engine.place(q[None]), sway)[:, 0]
    every = np.arange(len(bound))
    entries = engine.sweep.of_entries(engine.frames(q[None]), every, 0 * every, sway)
    assert np.allclose(entries, bound, rtol=1e-12, atol=1e-15)
    assert (bound <= engine.sweep.of_pairs(engine.place(q[None]), Sway(sway.turn))[:, 0]).all()
    rng = np.random.default_rng(1)
    share = np.append(rng.uniform(-1, 1, 22), [-1.0, 1.0])
    away = q + share[:, None] * way + beside * rng.choice([-1.0, 1.0], (24, 6))
    no_vertex_farther(scene, arm, q, away, bound)


def test_the_bound_of_a_straight_line_in_space_is_hardly_longer_than_the_line(plain):
    scene, arm, _ = plain
    engine = scene._engine
    pair = scene.pairs.index(("tool head", "workpiece block"))
    share = np.array([-1.0, 1.0]) * 0.025
    low, high = line(arm, 1.0)(0.5 + 0.5 * share)
    way = 0.5 * (high - low)
    placed = engine.place(0.5 * (high + low)[None])
    bound = engine.sweep.of_pairs(placed, Sway(np.abs(way)[None], way[None]))[pair, 0]
    loose = engine.sweep.of_pairs(placed, Sway(np.abs(way)[None]))[pair, 0]
    assert 0.025 <= bound < 1.15 * 0.025
    assert loose > 1.3 * bound


def motions(count, seed):
    robot_min, robot_max = (
        np.deg2rad([-60, -110, 30, -90, -80, -90]),
        np.deg2rad([60, -40, 130, 90, 80, 90]),
    )
    rng = np.random.default_rng(seed)
    start = rng.uniform(robot_min, robot_max, (count, 6))
    scale = rng.choice([0.02, 0.1, 0.4], (count, 1))
    return start, start + scale * rng.normal(0.0, 1.0, (count, 6))


def densely(scene, start, end, samples, contact=None):
    share = np.linspace(0.0, 1.0, samples)[:, None, None]
    q = start + share * (end - start)
    return scene.check(q.reshape(-1, 6), contact).hit.reshape(samples, -1)


def test_nothing_that_dense_sampling_finds_is_missed(busy_cell, arm_of):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end = motions(1000, seed=2)
    answer = scene.check_paths(start, end)
    sampled = densely(scene, start, end, 200)
    assert not (sampled.any(axis=0) & ~answer.hit).any()
    where = start + np.nan_to_num(answer.share)[:, None] * (end - start)
    assert scene.check(where[answer.hit]).hit.all()
    assert np.isnan(answer.share[~answer.hit]).all()
    assert (answer.pair[~answer.hit] == -1).all()
    # among them motions whose ends are free
    assert (answer.hit & ~sampled[0] & ~sampled[-1]).sum() > 5
    assert 0.1 < answer.hit.mean() < 0.9


def test_the_named_pair_collides_where_it_is_said_to(busy_cell, arm_of):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end = motions(120, seed=4)
    answer = scene.check_paths(start, end)
    for row in np.flatnonzero(answer.hit):
        q = start[row] + answer.share[row] * (end[row] - start[row])
        first = scene.check(q[None]).pair[0]
        assert first <= answer.pair[row]
        assert answer.name(row) == " and ".join(scene.pairs[answer.pair[row]])


def test_answers_do_not_depend_on_the_batch(busy_cell, arm_of):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end = motions(40, seed=6)
    whole = scene.check_paths(start, end)
    single = [scene.check_paths(a[None], b[None]) for a, b in zip(start, end, strict=True)]
    assert np.array_equal(whole.pair, np.concatenate([one.pair for one in single]))
    assert np.array_equal(whole.share, np.concatenate([one.share for one in single]), True)
    path = motions_along(scene, np.vstack([start[0], end[0], start[1]]))
    assert len(path.hit) == 2
    assert path.pair[0] == whole.pair[0]
    assert not motions_along(scene, start[:1]).any
    assert len(scene.check_paths(start[:0], end[:0]).hit) == 0


def polylines(count, seed, pieces=5):
    """Motions (count * pieces) that follow each other near straight ways, and their numbers."""
    start, end = motions(count, seed)
    rng = np.random.default_rng(seed)
    share = np.linspace(0.0, 1.0, pieces + 1)[:, None]
    size = np.linalg.norm(end - start, axis=1)[:, None, None]
    bent = 0.1 * size * np.sin(np.pi * share) * rng.normal(0.0, 1.0, (count, 1, 6))
    q = start[:, None] + share * (end - start)[:, None] + bent
    return q[:, :-1].reshape(-1, 6), q[:, 1:].reshape(-1, 6), np.repeat(np.arange(count), pieces)


@pytest.mark.parametrize("contact", [False, True])
def test_motions_looked_at_together_give_the_same_answer(busy_cell, arm_of, contact):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end, track = polylines(240, seed=12)
    touch = (track % 2 == 0) if contact else None
    alone = scene.check_paths(start, end, touch)
    together = scene.check_paths(start, end, touch, track=track)
    assert np.array_equal(together.hit, alone.hit)
    assert np.array_equal(together.pair == -1, ~alone.hit)
    sampled = densely(scene, start, end, 40, None if touch is None else np.tile(touch, 40))
    assert not (sampled.any(axis=0) & ~together.hit).any()
    assert 0.1 < alone.hit.mean() < 0.9


@pytest.mark.parametrize("beside", [0.0, 1e-8, 0.9e-5])
def test_ways_back_give_the_same_answer(busy_cell, arm_of, beside):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end, _ = polylines(150, seed=14)
    there = start.reshape(-1, 5, 6), end.reshape(-1, 5, 6)
    off = beside * np.random.default_rng(5).uniform(-1.0, 1.0, there[0].shape)
    back = there[1][:, ::-1] + off, there[0][:, ::-1] + off
    a, b = (
        np.stack([one, other, one], axis=1).reshape(-1, 6)
        for one, other in zip(there, back, strict=True)
    )
    track = np.repeat(np.arange(450), 5)
    touch = (track % 4 == 0) | (track % 7 == 0)  # another one on the way back
    alone = scene.check_paths(a, b, touch)
    together = scene.check_paths(a, b, touch, track=track)
    assert np.array_equal(together.hit, alone.hit)
    assert 0.05 < alone.hit.mean() < 0.9


def test_motions_with_one_number_need_not_join(busy_cell, arm_of):
    """The whole is wide enough for them wherever they are."""
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    start, end = motions(150, seed=13)
    alone = scene.check_paths(start, end)
    together = scene.check_paths(start, end, track=np.arange(150) // 3)
    assert np.array_equal(together.hit, alone.hit)


def test_resolution_must_be_above_zero(plain):
    with pytest.raises(ValueError, match="above zero"):
        plain[0].check_paths(CANNON[None], CANNON[None], resolution=0.0)


def test_a_thin_plate_between_free_ends_is_found(arm_of):
    plate = box_at("plate", [0.3, 0.002, 0.6], at(2.1, 0.0, 2.2))
    cell = cell_of(tool=[box_at("rod", [0.02, 0.02, 0.5], at(0, 0, 0.25))], obstacles=[plate])
    scene = Scene.build(cell, arm_of(cell))
    start, end = CANNON.copy(), CANNON.copy()
    start[0], end[0] = -0.5, 0.55
    assert not scene.check(np.stack([start, end])).hit.any()
    answer = motions_along(scene, np.stack([start, end]))
    assert answer.hit[0]
    assert answer.name(0) == "tool rod and obstacle plate"
    beside = cell_of(
        tool=cell.tool.meshes, obstacles=[box_at("plate", [0.6, 0.002, 0.6], at(2.65, 0.0, 2.2))]
    )
    assert not motions_along(Scene.build(beside, arm_of(beside)), np.stack([start, end])).hit[0]


@pytest.mark.parametrize(("gap", "hit"), [(2e-5, False), (-2e-5, True)])
def test_a_gap_finer_than_the_resolution_is_told_from_contact(gap, hit, arm_of):
    # a rod turns about axis 1 under a ceiling that its upper edge all but touches
    rod = box_at("rod", [0.4, 0.02, 0.02], at(0.0, 0.0, 0.25))
    ceiling = box_at("ceiling", [0.5, 1.0, 0.1], at(2.2, 0.0, 2.29 + 0.2 + 0.05 + gap))
    cell = cell_of(tool=[rod], obstacles=[ceiling])
    scene = Scene.build(cell, arm_of(cell))
    start, end = CANNON.copy(), CANNON.copy()
    start[0], end[0] = -0.05, 0.05
    answer = motions_along(scene, np.stack([start, end]))
    assert answer.hit[0] == hit
    assert answer.name(0) == ("tool rod and obstacle ceiling" if hit else "")


def test_clearance_counts_on_the_way_too(busy_cell, arm_of):
    wide = cell_of(
        busy_cell.tool.meshes,
        busy_cell.workpiece.meshes,
        busy_cell.obstacles,
        busy_cell.T_robroot_base,
        clearance=0.05,
        T_world_robroot=busy_cell.robot.T_world_robroot,
    )
    arm = arm_of(wide)
    scene, bare = Scene.build(wide, arm), Scene.build(busy_cell, arm)
    start, end = motions(80, seed=8)
    answer, without = scene.check_paths(start, end), bare.check_paths(start, end)
    assert not (without.hit & ~answer.hit).any()
    assert (answer.hit & ~without.hit).any()
    sampled = densely(scene, start, end, 120).any(axis=0)
    assert not (sampled & ~answer.hit).any()
    where = start + np.nan_to_num(answer.share)[:, None] * (end - start)
    assert scene.check(where[answer.hit]).hit.all()


BENT = np.deg2rad([0.0, -90.0, 110.0, 0.0, 40.0, 0.0])


def line(arm, half_width):
    """A LIN motion along y through the pose BENT, as a function of the share."""
    T = arm.fk(BENT)
    slot = int(arm.slot(BENT[None])[0])

    def q_at(share):
        poses = np.broadcast_to(T, (len(share), 4, 4)).copy()
        poses[:, 1, 3] = (2.0 * share - 1.0) * half_width
        q, valid = arm.ik(poses)
        assert valid[:, slot].all()
        return arm.nearest(q[:, slot], BENT)

    return q_at
