"""Collisions against coal, pair by pair, on random configurations."""

import pickle

import numpy as np
import pytest

from postproc.collision.bodies import WORLD
from postproc.collision.check import Tally
from postproc.collision.scene import Scene
from postproc.geometry.frames import inverse
from tests.collision.conftest import at, box_at, cell_of, motions_along
from tests.collision.oracle import CoalMesh, coal_collide, coal_distance, winding_number


def poses(bodies, cell, arm, q):
    """Poses (b, 4, 4) of the bodies in robroot."""
    T_robroot_world = inverse(cell.robot.T_world_robroot)
    frames = arm.link_frames(q)
    return [T_robroot_world if b.link == WORLD else frames[b.link] for b in bodies]


def solids_of(scene):
    """The solids that are tested, and of each pair their two indices."""
    bodies = list({id(body): body for pair in scene.pair_bodies for body in pair}.values())
    index = {id(body): i for i, body in enumerate(bodies)}
    return bodies, [(index[id(one)], index[id(two)]) for one, two in scene.pair_bodies]


def oracle_hits(scene, cell, arm, q):
    """Index of the first pair that collides by coal and solid angles, -1 for none."""
    bodies, pairs = solids_of(scene)
    meshes = [CoalMesh(body.mesh) for body in bodies]
    answers = []
    for row in q:
        T = poses(bodies, cell, arm, row)
        hit = -1
        for number, (a, b) in enumerate(pairs):
            if coal_collide(meshes[a], T[a], meshes[b], T[b]) or swallowed(bodies, T, a, b):
                hit = number
                break
        answers.append(hit)
    return np.array(answers)


def swallowed(bodies, T, a, b):
    for outer, inner in ((a, b), (b, a)):
        mesh = bodies[outer].mesh
        point = (inverse(T[outer]) @ T[inner] @ [*bodies[inner].vertices[0], 1.0])[:3]
        low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
        if ((point > low) & (point < high)).all():
            return abs(winding_number(mesh, point[None])[0]) > 0.5
    return False


def test_random_poses_agree_with_coal_to_the_pair(busy_cell, arm_of, random_q):
    arm = arm_of(busy_cell)
    scene = Scene.build(busy_cell, arm)
    q = random_q(400)
    hits = scene.check(q)
    assert np.array_equal(hits.pair, oracle_hits(scene, busy_cell, arm, q))
    assert np.array_equal(hits.hit, hits.pair >= 0)
    assert 0.1 < hits.hit.mean() < 0.9
    assert len(np.unique(hits.pair)) > 8


def test_margin_agrees_with_distances_of_coal(busy_cell, arm_of, random_q):
    margin = 0.03
    cell = cell_of(
        busy_cell.tool.meshes,
        busy_cell.workpiece.meshes,
        busy_cell.obstacles,
        busy_cell.T_robroot_base,
        clearance=margin,
        T_world_robroot=busy_cell.robot.T_world_robroot,
    )
    arm = arm_of(cell)
    bare, scene = Scene.build(busy_cell, arm), Scene.build(cell, arm)
    q = random_q(300, seed=3)
    q = q[~bare.check(q).hit]
    bodies, pairs = solids_of(scene)
    meshes = [CoalMesh(body.mesh) for body in bodies]
    closest = []
    for row in q:
        T = poses(bodies, cell, arm, row)
        distances = [
            coal_distance(meshes[a], T[a], meshes[b], T[b])
            for a, b in pairs
            if bodies[b].link == WORLD or (bodies[b].kind != "link" and bodies[a].link != 5)
        ]
        closest.append(min(distances))
    closest = np.array(closest)
    assert np.array_equal(scene.check(q).hit, closest <= margin)
    assert 0.02 < (closest <= margin).mean() < 0.9
    assert np.allclose(scene.clearance(q), closest, atol=1e-9)
    assert np.allclose(scene.clearance(q, most=0.1), np.minimum(closest, 0.1), atol=1e-9)


def test_clearance_is_zero_exactly_where_something_collides(busy_cell, arm_of, random_q):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    q = random_q(300, seed=5)
    assert np.array_equal(scene.clearance(q) == 0.0, scene.check(q).hit)


def test_answers_do_not_depend_on_the_batch(busy_cell, arm_of, random_q):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    q = random_q(60, seed=7)
    whole = scene.check(q).pair
    single = np.concatenate([scene.check(row[None]).pair for row in q])
    assert np.array_equal(whole, single)
    assert np.array_equal(whole, scene.check(np.tile(q, (20, 1))).pair.reshape(20, -1)[13])
    assert len(scene.check(np.zeros((0, 6))).hit) == 0
    assert len(scene.clearance(np.zeros((0, 6)))) == 0


@pytest.mark.parametrize("contact", [None, True])
def test_a_pair_said_to_be_likely_changes_no_answer(busy_cell, arm_of, random_q, contact):
    """It is looked at first: right, wrong, or one that may touch where contact is allowed."""
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    q = random_q(200, seed=17)
    plain = scene.check(q, contact)
    guess = np.random.default_rng(3).integers(-1, len(scene.pairs), len(q))
    guess[::2] = plain.pair[::2]
    guided = scene.check(q, contact, likely=guess)
    assert np.array_equal(guided.hit, plain.hit)
    told = guided.pair == guess
    assert told[::2].all()
    assert np.array_equal(guided.pair[~told], plain.pair[~told])
    assert np.array_equal(scene.check(q, contact, likely=plain.pair).pair, plain.pair)


def test_a_scene_travels_to_another_process(busy_cell, arm_of, random_q):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    q = random_q(50, seed=9)
    before = scene.check(q).pair
    copy = pickle.loads(pickle.dumps(scene))
    assert np.array_equal(copy.check(q).pair, before)
    assert copy.pairs == scene.pairs


def test_threads_get_objects_of_their_own(busy_cell, arm_of, random_q):
    from concurrent.futures import ThreadPoolExecutor

    scene = Scene.build(busy_cell, arm_of(busy_cell))
    q = random_q(200, seed=11)
    expected = scene.check(q).pair
    with ThreadPoolExecutor(4) as pool:
        answers = list(pool.map(lambda _: scene.check(q).pair, range(8)))
    assert all(np.array_equal(answer, expected) for answer in answers)


def test_most_pairs_never_reach_the_exact_test(busy_cell, arm_of, random_q):
    scene = Scene.build(busy_cell, arm_of(busy_cell))
    tally = Tally()
    scene.check(random_q(500), tally=tally)
    assert tally.pairs == 500 * len(scene.pairs)
    assert 0 < tally.exact < 0.05 * tally.pairs


ROOM = box_at("room", [6.0, 6.0, 6.0], at())
CHIP = box_at("chip", [0.004, 0.004, 0.004], at(1.9, 0.0, 2.15))
CANNON = np.deg2rad([[0.0, -90.0, 90.0, 0.0, 0.0, 0.0]])


@pytest.mark.parametrize(
    ("obstacle", "pair"),
    [(ROOM, ("link 1", "obstacle room")), (CHIP, ("tool head", "obstacle chip"))],
)
def test_a_solid_wholly_inside_another_collides(obstacle, pair, arm_of):
    head = box_at("head", [0.3, 0.2, 0.3], at(0.1, 0.0, 0.15))
    cell = cell_of(tool=[head], obstacles=[obstacle])
    scene = Scene.build(cell, arm_of(cell))
    hits = scene.check(CANNON)
    assert hits.pairs[hits.pair[0]] == pair
    assert hits.name(0) == " and ".join(pair)
    assert scene.clearance(CANNON)[0] == 0.0
    assert motions_along(scene, np.vstack([CANNON, CANNON + 1e-4])).hit[0]
