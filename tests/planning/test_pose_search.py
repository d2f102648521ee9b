"""Searching with collisions found on the way gives the cost of checking every state first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import MeshPlacement, Tool
from postproc.collision.scene import Scene
from postproc.geometry import rotation_from_abc, transform
from postproc.model.toolpath import Cycle, MotionKind
from postproc.planning.checks.feasible import Checker
from postproc.planning.job import problem_of
from postproc.planning.search.failing import _within, also_colliding
from postproc.planning.search.pose_search import PoseSearch, travel
from postproc.planning.states import TRAVEL_UNIT, evaluate
from postproc.planning.states.settings import (
    settle,
)
from postproc.units import DEG
from tests.planning.stages import solve


def crowded(make_cell, make_path, seed):
    """Five holes among random boxes, some of which the arm must reach around."""
    rng = np.random.default_rng(seed)
    n = 5
    points = np.stack([np.full(n, 1.9), np.linspace(-0.4, 0.4, n), rng.uniform(0.8, 1.2, n)], 1)
    cycles = (Cycle("drill", 0.0, 0.002, 0.01, feed=0.002),)
    toolpath = make_path(
        points, [-1.0, 0, 0], MotionKind.HOLE, cycle=np.zeros(n, int), cycles=cycles
    )
    boxes = []
    for i in range(5):
        T = np.eye(4)
        T[:3, 3] = rng.uniform([1.0, -1.0, 0.2], [2.0, 1.0, 2.0])
        boxes.append(MeshPlacement(f"box{i}", T, size=rng.uniform(0.1, 0.4, 3)))
    T = np.eye(4)
    T[:3, 3] = [0.0, 0.0, 0.18]
    head = MeshPlacement("head", T, radius=0.06, length=0.36)
    cell = make_cell(optimize={"step": 20.0 * DEG}, options={"turns": seed % 2 == 0})
    cell = replace(cell, obstacles=tuple(boxes), tools=(replace(cell.tool, meshes=(head,)),))
    cell, settings = settle(cell)
    problem = problem_of(toolpath, cell, settings)
    scene = Scene.build(cell, problem.kinematics)
    return Checker(problem, scene)


@pytest.mark.parametrize("seed", range(50))
def test_lazy_equals_eager(make_cell, make_path, seed):
    checker = crowded(make_cell, make_path, seed)
    tags = np.arange(5)
    lazy = PoseSearch.of(checker, tags)
    found = lazy.found
    eager = PoseSearch.of(checker, tags)
    every = np.arange(len(eager.states.q))
    bad = ~eager.check_states(every)
    eager.ladder.cost[every[bad]] = np.inf
    eager.ladder.solve()
    want = eager.ladder.total(eager.ladder.path())
    assert lazy.ladder.total(found.path) == pytest.approx(want, abs=1e-7)
    assert np.array_equal(lazy.ladder.broken, eager.ladder.broken)
    if bad.any():
        assert found.checked <= len(every)


def test_poses_a_turn_away_from_free_ones_are_judged_as_by_themselves(make_cell, make_path):
    """The last turn copy of each pose first, the others then: strokes and limits are asked."""
    told = 0
    for seed in range(0, 50, 4):
        checker = crowded(make_cell, make_path, seed)
        search = PoseSearch.of(checker, np.arange(5))
        states, every = search.states, np.arange(len(search.states.q))
        at = states.tag_of(every), states.q.astype(np.float64), states.attitude_of(every)
        alone = checker.states(*at, states.branch.astype(np.int64)).good
        first = np.unique(states.config, return_index=True)[1]
        search.check_states(np.append(first[1:], len(every)) - 1)
        assert np.array_equal(search.check_states(every), alone)
        told += len(every) - len(first)
    assert told > 1000


def test_the_way_out_of_a_pose_a_turn_away_is_asked(make_cell, make_path, monkeypatch):
    """Another copy may have been good because its axes could not get there."""
    points = np.array([[1.9, -0.1, 1.0], [1.9, 0.1, 1.0]])
    toolpath = make_path(points, [-1.0, 0, 0], [MotionKind.RAPID, MotionKind.LINEAR])
    cell, settings = settle(make_cell(optimize={"step": 20.0 * DEG}))
    checker, asked = Checker(problem_of(toolpath, cell, settings), None), []
    assert (checker.problem.ways_out > 0.0).tolist() == [False, True]
    search = PoseSearch.of(checker, np.arange(2))
    states, every = search.states, np.arange(len(search.states.q))
    monkeypatch.setattr(Checker, "_way_out", lambda _, verdict, rows, *given: asked.append(rows))
    tags, branch = states.tag_of(every), states.branch.astype(np.int64)
    q, free = states.q.astype(np.float64), np.ones(len(every), dtype=np.bool_)
    checker.states(tags, q, states.attitude_of(every), branch, free)
    assert np.array_equal(np.concatenate(asked), np.flatnonzero(tags == 1))


def test_what_fails_beside_a_pose_collides_and_the_wrist_turned_over_is_among_it(
    make_cell, make_path
):
    turned_over = 0
    for seed in range(0, 50, 5):
        checker = crowded(make_cell, make_path, seed)
        search = PoseSearch.of(checker, np.arange(5))
        states = search.states
        rung = states.tag_of(np.arange(len(states.q)))
        hits = ~checker.poses(rung, states.q.astype(np.float64)).good
        key = np.column_stack([rung, states.column, states.branch])
        for one in np.flatnonzero(hits)[:: max(1, hits.sum() // 4)].tolist():
            search = PoseSearch.of(checker, np.arange(5))
            assert not search.check_states(np.array([one])).any()
            gone = also_colliding(search, np.array([one]))
            assert hits[gone].all()
            over = hits & (key == [*key[one, :2], key[one, 2] ^ 4]).all(axis=1)
            assert np.isin(np.flatnonzero(over), gone).all()
            turned_over += over.any()
    assert turned_over > 5


@pytest.mark.slow
def test_poses_on_round_spins_are_free_and_cost_no_more(make_cell, make_path):
    lower = 0
    for seed in range(0, 50, 7):
        checker = crowded(make_cell, make_path, seed)
        optimize = checker.problem.cell.optimize
        chosen, settings = {}, checker.problem.settings
        settings = replace(settings, weights=replace(settings.weights, prices=()))
        for refine in (False, True):
            cell = replace(checker.problem.cell, optimize=replace(optimize, refine=refine))
            problem = replace(checker.problem, cell=cell, settings=settings)
            here = replace(checker, problem=problem)
            solved = solve(here)
            chosen[refine] = solved.choice.chosen
        good = np.nonzero(chosen[True].good)[0]
        assert np.array_equal(good, np.nonzero(chosen[False].good)[0])
        grid, moved = (chosen[refine].at(good) for refine in (False, True))
        assert checker.states(good, moved.q, moved.attitude, moved.branch).good.all()
        assert np.allclose(moved.spin / DEG, np.round(moved.spin / DEG))
        cost = [objective(checker.problem, good, poses) for poses in (grid, moved)]
        assert cost[1] <= cost[0] + 1e-6
        lower += cost[1] < cost[0] - 1e-3
    assert lower > 2


def objective(problem, tags, poses):
    """Return what a sequence of holes costs, without prices of losses."""
    T = problem.placement.tcp(tags, poses.attitude)
    cost = evaluate(problem, tags, poses.spin, T, poses.q)[0].sum()
    return cost + problem.settings.weights.travel / TRAVEL_UNIT**2 * travel(poses)


@pytest.mark.parametrize("seed", range(20))
def test_what_is_near_on_lines_is_found_once(seed):
    rng = np.random.default_rng(seed)
    n, m, far = rng.integers(1, 30), rng.integers(0, 12), int(rng.integers(0, 8))
    line, at = rng.integers(0, 3, m), rng.integers(0, n, m)
    row, where = _within(line, at, far, int(n))
    found = sorted(zip(line[row].tolist(), where.tolist(), strict=True))
    near = [(on, k) for on, place in zip(line, at, strict=True) for k in range(n)
            if abs(k - place) <= far]  # fmt: skip
    assert found == sorted(set(near))
    assert (np.abs(at[row] - where) <= far).all()


@pytest.mark.parametrize("rows", [(8, 3), (10, 2)])
def test_of_mirror_images_the_one_of_the_smaller_spins_counts(rows, make_cell, make_path):
    """A panel in the plane of the arm is drilled as well by families turned by half a turn."""
    across, up = rows
    y, z = np.meshgrid(np.linspace(-0.45, 0.45, across), np.linspace(1.0, 1.4, up))
    y[1::2] *= -1.0
    points = np.stack([np.full(y.size, 2.072), y.ravel(), z.ravel()], axis=1)
    cycles = (Cycle("drill", 0.0, 0.002, 0.01, feed=0.002),)
    cycle = np.zeros(y.size, dtype=int)
    across_flange = transform(
        rotation_from_abc(np.array([0.0, -90.0, -180.0]) * DEG), [0.36, 0, 0.34]
    )
    head = Tool(1, "angle head", across_flange, np.array([0.0, 0.0, 1.0]))
    toolpath = make_path(points, [-1.0, 0, 0], MotionKind.HOLE, cycle=cycle, cycles=cycles)
    cell, settings = settle(replace(make_cell(), tools=(head,)))
    problem = problem_of(toolpath, cell, settings)
    search = PoseSearch.of(Checker(problem, None), np.arange(y.size))
    spin = search.states.spin_of(search.found.path)
    assert (np.cos(spin) > 0.0).all()
