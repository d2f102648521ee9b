"""Ways round obstacles: every move of them is free, and trees are not grown for nothing."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import MeshPlacement
from postproc.geometry.frames import transform
from postproc.planning.checks.feasible import Checker
from postproc.planning.job import problem_of
from postproc.planning.route import connect, tree
from postproc.planning.route.connect import Ends, detours, free_way
from postproc.planning.route.tree import ROUNDS, folded_ways, rrt_connect
from postproc.planning.states import Chosen
from postproc.planning.states.settings import (
    settle,
)
from postproc.timing import joint_move_time


def solid(name, size, x, y, z):
    return MeshPlacement(name, transform(np.eye(3), [x, y, z]), size=np.array(size))


@pytest.fixture
def checker_of(make_cell, make_path):
    """Return a function that gives the checks of two tags in a cell with obstacles."""
    from postproc.collision.scene import Scene

    def make(*obstacles):
        cell = make_cell(obstacles=obstacles)
        rod = solid("rod", [0.05, 0.05, 0.4], 0.0, 0.0, 0.2)
        cell = replace(cell, tools=(replace(cell.tool, meshes=(rod,)),))
        path = make_path([[1.9, 0.0, 0.9], [1.9, 0.1, 0.9]], [-1.0, 0.0, 0.0])
        cell, settings = settle(cell)
        problem = problem_of(path, cell, settings)
        return Checker(problem, Scene.build(cell, problem.kinematics))

    return make


STANDING = np.zeros(0)
PLATE = ("plate", [1.0, 0.02, 3.0], 1.8, 0.0, 1.5)
POST = ("post", [0.1, 0.1, 1.6], 2.15, 0.0, 2.2)
UPRIGHT = Chosen(
    np.zeros((2, 3)), np.zeros(2, int), np.zeros((2, 6)), np.ones(2, bool), np.zeros(2, bool)
)
"""Tags that no way backs off from."""


def swings(count):
    """Connections past a post, to and fro, each a little higher than the one before."""
    side = np.where(np.arange(count) % 2 == 0, 1.0, -1.0)
    q = np.deg2rad(np.tile([0.0, -90.0, 90.0, 0.0, 20.0, 0.0], (count, 1)))
    q[:, 1] += 0.01 * np.arange(count)
    start, end = q.copy(), q.copy()
    start[:, 0], end[:, 0] = 0.5 * side, -0.5 * side
    tag = np.zeros(count, dtype=np.int64)
    # too low to back off anywhere: the tool stands at the tag only in name
    none = np.zeros(count)
    beside = np.full(count, np.nan)
    return Ends(tag, tag + 1, beside, beside, start, end, np.zeros((count, 0)), none)


def legs(ends, ways, samples=60):
    """Return configurations along all moves of the ways."""
    share = np.linspace(0.0, 1.0, samples)[:, None, None]
    nodes = [np.vstack([ends.q_from[r], way, ends.q_to[r]]) for r, way in ways.items()]
    start = np.concatenate([n[:-1] for n in nodes])
    end = np.concatenate([n[1:] for n in nodes])
    return (start + share * (end - start)).reshape(-1, 6)


def test_a_way_found_once_serves_the_connections_beside_it(checker_of, monkeypatch):
    checker = checker_of(solid(*POST))
    ends = swings(24)
    assert not checker.joint_moves(ends.q_from, ends.q_to, STANDING).good.any()
    assert checker.free_poses(np.vstack([ends.q_from, ends.q_to]), STANDING).all()
    grown = []

    def counted(*args):
        grown.append(args)
        return rrt_connect(*args)

    monkeypatch.setattr(connect, "rrt_connect", counted)
    ways = connect._by_trees(checker, ends, np.arange(24), connect.GIVE_UP)
    assert sorted(ways) == list(range(24))
    assert all(len(way) for way in ways.values())
    assert checker.free_poses(legs(ends, ways), STANDING).all()
    assert len(grown) <= 6
    grown.clear()
    again = connect._by_trees(checker, ends, np.arange(24), connect.GIVE_UP)
    assert all(np.array_equal(again[row], way) for row, way in ways.items())
    later = ends.rows(np.arange(4, 20))
    later.q_from[:, 3] += 0.01
    moved = connect._by_trees(checker, later, np.arange(16), connect.GIVE_UP)
    assert sorted(moved) == list(range(16))
    assert checker.free_poses(legs(later, moved), STANDING).all()
    assert not grown
    first = connect._by_trees(checker_of(solid(*POST)), ends, np.arange(24), connect.GIVE_UP)
    assert all(np.array_equal(first[row], way) for row, way in ways.items())
    assert grown


def test_ways_lent_are_not_much_longer(checker_of):
    checker = checker_of(solid(*POST))
    ends = swings(24)
    lent = connect._by_trees(checker, ends, np.arange(24), connect.GIVE_UP)
    for row in range(0, 24, 5):
        own = rrt_connect(checker, ends.q_from[row], ends.q_to[row], STANDING)
        lengths = [
            np.linalg.norm(
                np.diff(np.vstack([ends.q_from[row], way, ends.q_to[row]]), axis=0), axis=1
            ).sum()
            for way in (own, lent[row])
        ]
        assert lengths[1] < 2.0 * lengths[0]


def test_the_arm_folds_past_what_stands_before_it(checker_of, monkeypatch):
    """Connections past a high beam are led back from it, without a tree, and are free all along."""
    checker = checker_of(solid("beam", [0.1, 0.1, 3.0], 2.2, 0.0, 1.5))
    ends = swings(12)
    assert not checker.joint_moves(ends.q_from, ends.q_to, STANDING).good.any()
    monkeypatch.setattr(connect, "rrt_connect", lambda *args: pytest.fail("a tree is grown"))
    ways = {row: way.q for row, way in detours(checker, UPRIGHT, ends).items()}
    assert sorted(ways) == list(range(12))
    assert checker.free_poses(legs(ends, ways, 400), STANDING).all()
    alone = free_way(checker, ends.q_from[3], ends.q_to[3], STANDING)
    assert np.array_equal(alone, ways[3])


def test_folds_stay_within_limits_and_turn_round_overhead(checker_of):
    problem = checker_of().problem
    q_min, q_max = np.asarray(problem.kinematics.q_min), np.asarray(problem.kinematics.q_max)
    start = np.deg2rad([[0.0, -120.0, 140.0, 0.0, 20.0, 0.0], [0.0, -60.0, 60.0, 0.0, 20.0, 0.0]])
    goal = start + np.deg2rad([30.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    ways = folded_ways(problem, start, goal)
    assert (ways >= q_min).all()
    assert (ways <= q_max).all()
    assert (ways[:, 1, :, 1] <= start[1, 1]).all()
    assert (ways[:, 1, :, 2] >= start[1, 2]).all()
    overhead = np.deg2rad([[0.0, -125.0, 0.0, 0.0, 20.0, 0.0]])
    assert problem.kinematics.branches.reach(overhead)[0] < 0.0
    assert (folded_ways(problem, overhead, overhead)[..., 1] >= overhead[0, 1]).all()


def seconds(checker, ends, ways):
    """Return the time of each way by moves from rest to rest."""
    robot = checker.problem.cell.robot
    nodes = [np.vstack([ends.q_from[r], way, ends.q_to[r]]) for r, way in ways.items()]
    limits = robot.qd_max * checker.problem.cell.motion.rapid, robot.qdd_max
    return np.array([joint_move_time(n[:-1], n[1:], *limits).sum() for n in nodes])


@pytest.mark.parametrize(
    ("block", "share"),
    [(("beam", [0.1, 0.1, 3.0], 2.2, 0.0, 1.5), 0.97), (PLATE, 0.9)],
    ids=["folded", "by_trees"],
)
def test_ways_round_are_drawn_in_to_what_saves_time(checker_of, block, share):
    """The arm neither folds up before it turns, nor swings out farther than it must."""
    checker = checker_of(solid(*block))
    ends = swings(6)
    ways = connect._folded(checker, ends, np.arange(6))
    rest = np.setdiff1d(np.arange(6), list(ways))
    ways |= connect._by_trees(checker, ends, rest, connect.GIVE_UP)
    drawn = {row: way.q for row, way in sorted(detours(checker, UPRIGHT, ends).items())}
    first = {row: ways[row] for row in drawn}
    assert list(drawn) == list(range(6))
    assert checker.free_poses(legs(ends, drawn, 400), STANDING).all()
    before, after = (seconds(checker, ends, each) for each in (first, drawn))
    assert (after <= before).all()
    assert after.sum() < share * before.sum()


def proofs_of(checker, monkeypatch):
    """Return a list that fills with the ends (m, 12) of the motions that are proven."""
    proven = []
    prove = Checker.joint_moves

    def noted(self, q_from, q_to, external):
        proven.append(np.hstack([q_from, q_to]))
        return prove(self, q_from, q_to, external)

    monkeypatch.setattr(Checker, "joint_moves", noted)
    return proven


def test_no_move_of_a_tree_is_proven_twice(checker_of, monkeypatch):
    """Round a thin plate, which poses do not see: much of what the trees try is refuted."""
    checker = checker_of(solid(*PLATE))
    ends = swings(1)
    proven = proofs_of(checker, monkeypatch)
    assert rrt_connect(checker, ends.q_from[0], ends.q_to[0], STANDING) is not None
    moves = np.concatenate(proven)
    assert len(moves) > 20
    assert len(np.unique(moves, axis=0)) == len(moves)


def test_a_tree_grows_once_between_the_same_ends(checker_of, monkeypatch):
    checker = checker_of(solid(*PLATE))
    ends = swings(2)
    grown = []
    grow = tree._Tree.grow

    def counted(self, *args):
        grown.append(1)
        return grow(self, *args)

    monkeypatch.setattr(tree._Tree, "grow", counted)
    asked = checker, ends.q_from[0], ends.q_to[0], STANDING
    way = rrt_connect(*asked)
    took = len(grown)
    assert way is not None
    assert took > 1
    assert np.array_equal(rrt_connect(*asked), way)
    assert rrt_connect(*asked, took - 1) is None  # as if it had grown no more often
    assert len(grown) == took
    assert rrt_connect(checker, ends.q_to[1], ends.q_from[1], STANDING, 1) is None
    assert rrt_connect(checker, ends.q_to[1], ends.q_from[1], STANDING, 1) is None
    assert len(grown) == took + 1
    assert rrt_connect(checker, ends.q_to[1], ends.q_from[1], STANDING) is not None


def test_hopeless_connections_cost_little_after_the_first(checker_of, monkeypatch):
    checker = checker_of(solid(*POST))
    asked = []
    monkeypatch.setattr(connect, "rrt_connect", lambda *args: asked.append(args[4]))
    assert connect._by_trees(checker, swings(9), np.arange(9), connect.GIVE_UP) == {}
    assert asked == [ROUNDS] * 5 + [connect._FEW] * 4
    asked.clear()
    assert connect._by_trees(checker, swings(60), np.arange(60), connect.GIVE_UP) == {}
    assert len(asked) == connect.GIVE_UP


def test_no_tree_grows_from_an_end_that_is_not_free(checker_of, monkeypatch):
    """What stands in something has no way out; looking at both ends tells it at once."""
    checker = checker_of(solid(*POST))
    ends = swings(1)
    inside = 0.5 * (ends.q_from[0] + ends.q_to[0])
    assert not checker.free_poses(inside[None], STANDING).any()
    monkeypatch.setattr(tree, "_Tree", lambda *args: pytest.fail("a tree is grown"))
    assert rrt_connect(checker, inside, ends.q_to[0], STANDING) is None
    assert rrt_connect(checker, ends.q_from[0], inside, STANDING) is None


def test_a_free_way_needs_no_points(checker_of):
    checker = checker_of()
    ends = swings(1)
    assert free_way(checker, ends.q_from[0], ends.q_to[0], STANDING).shape == (0, 6)
