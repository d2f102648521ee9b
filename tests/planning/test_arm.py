"""Shoulder and elbow: changed between tags where a way leads through, else only where they must."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from postproc.kinematics import build
from postproc.model.toolpath import MotionKind
from postproc.planning.checks.feasible import Checker
from postproc.planning.planner import plan, problem_of
from postproc.planning.search import strategy
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states.settings import PlanOptions, settle
from postproc.units import DEG
from tools.bench import workload
from tools.bench.paths import bare_path


def scattered(make_cell, make_path, seed, home=None):
    """Three tags where the arm stands at random: which arms reach them with few spins differs."""
    rng = np.random.default_rng(seed)
    wishes = {
        "step": 20.0 * DEG,
        "range": (-40.0 * DEG, 40.0 * DEG),
        "objective": {"axial": 1.0, "travel": 1e-3},
    }
    cell = make_cell(optimize=wishes, motion={} if home is None else {"home_deg": home})
    low, high = np.asarray(cell.robot.q_min) + 0.1, np.asarray(cell.robot.q_max) - 0.1
    q = rng.uniform(low, high, (3, 6))
    T = build(cell.robot).fk(q) @ cell.tool.T_flange_tcp
    toolpath = make_path(T[:, :3, 3], -T[:, :3, 0], MotionKind.JOINT)
    cell, settings = settle(cell, PlanOptions())
    problem = problem_of(toolpath, cell, settings)
    return Checker(problem, None)


def fewest(checker, start):
    """The fewest changes of shoulder and elbow from tag to tag, by trying all sequences."""
    search = PoseSearch.of(checker, np.arange(len(checker.problem)))
    arms = [set() for _ in range(len(checker.problem))]
    usable = np.flatnonzero(np.isfinite(search.states.cost))
    rungs = search.states.tag_of(usable).tolist()
    for rung, branch in zip(rungs, search.states.branch[usable].tolist(), strict=True):
        arms[rung].add((branch & 1, branch >> 1 & 1))
    if not all(arms):
        return None
    ends = () if start is None else (start,)
    return min(
        sum((a[0] != b[0]) + (a[1] != b[1]) for a, b in itertools.pairwise((*ends, *arms, *ends)))
        for arms in itertools.product(*arms)
    )


def changed(chosen, start):
    arms = [(branch & 1, branch >> 1 & 1) for branch in chosen.branch.tolist()]
    arms = arms if start is None else [start, *arms, start]
    return sum((a[0] != b[0]) + (a[1] != b[1]) for a, b in itertools.pairwise(arms))


@pytest.mark.parametrize("home", [None, [0.0, -90.0, 90.0, 0.0, 30.0, 0.0]])
def test_without_ways_the_arm_is_changed_as_seldom_as_can_be(
    make_cell, make_path, monkeypatch, home
):
    start = None if home is None else (0, 1)
    saved, forced = 0, 0
    for seed in range(60):
        checker = scattered(make_cell, make_path, seed, home)
        least = fewest(checker, start)
        if least is None:
            continue
        free = strategy.choose(checker, lambda *_: None)[0]
        monkeypatch.setattr(strategy, "has_ways", lambda *_: False)
        steady = strategy.choose(checker, lambda *_: None)[0]
        monkeypatch.undo()
        assert free.good.all()
        assert steady.good.all()
        assert changed(steady, start) == least
        saved += changed(free, start) - least
        forced += least
    assert saved >= 5
    assert forced >= 2


@pytest.mark.corpus
@pytest.mark.slow
@pytest.mark.skipif(
    not (workload.WORKLOADS / "scene").is_dir(),
    reason="the shared workloads are not beside the checkout",
)
def test_another_elbow_behind_beams_is_no_reason_to_refuse(tmp_path):
    from postproc.cell.file import load_cell
    from tools.bench.holes import cell_file

    # the stiffest elbow of these holes is one that no way leads to past the beams
    points, normals = workload.holes(10_000)
    rows = slice(8535, 8600)
    path = bare_path("row", points[rows], normals[rows], feed=0.01, kind=MotionKind.HOLE)
    result = plan(path, load_cell(cell_file(tmp_path / "cell.toml", hard=True)))
    assert not result.errors
    assert len(np.unique(result.branch[result.tag >= 0] & 2)) == 1
