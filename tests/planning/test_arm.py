"""Shoulder and elbow: changed between tags where a way leads through, else only where they must."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.kinematics import build
from postproc.model.toolpath import MotionKind
from postproc.planning import repairs
from postproc.planning.checks.feasible import Checker
from postproc.planning.job import problem_of
from postproc.planning.planner import plan
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states.settings import (
    settle,
)
from postproc.units import DEG
from tests.planning.stages import solve
from tools.bench import workload
from tools.bench.holes import cell_file
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
    cell, settings = settle(cell)
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


def solved(checker):
    return solve(checker).choice.chosen


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
        free = solved(checker)
        monkeypatch.setattr(repairs, "has_ways", lambda *_: False)
        steady = solved(checker)
        monkeypatch.undo()
        assert free.good.all()
        assert steady.good.all()
        assert changed(steady, start) == least
        saved += changed(free, start) - least
        forced += least
    assert saved >= 5
    assert forced >= 2


def in_workload(test):
    """Run a test that needs the shared workloads, where they are."""
    there = (workload.WORKLOADS / "scene").is_dir()
    test = pytest.mark.skipif(not there, reason="the shared workloads are not here")(test)
    return pytest.mark.corpus(pytest.mark.slow(test))


def holes_of(tmp_path, size, rows, *, hard, bound=None):
    """The plan of some holes of a workload, and the joints at the holes."""
    points, normals = workload.holes(size)
    path = bare_path("row", points[rows], normals[rows], feed=0.01, kind=MotionKind.HOLE)
    cell = load_cell(cell_file(tmp_path / "cell.toml", hard=hard))
    cell = replace(cell, optimize=replace(cell.optimize, loss_bound=bound))
    result = plan(path, cell)
    at = [int(np.flatnonzero(result.tag == tag)[0]) for tag in range(len(path))]
    return result, result.q[at]


@in_workload
@pytest.mark.parametrize("rows", [slice(812, 834), slice(800, 900), slice(140, 200)])
def test_a_bound_of_loss_is_no_reason_to_go_where_no_way_leads(tmp_path, rows):
    """The stiffest postures behind the beams are walled in: the bound is broken, and that told."""
    result, _ = holes_of(tmp_path, 1000, rows, hard=True, bound=0.05)
    assert not result.errors
    assert "PLN305" in [finding.code for finding in result.findings]


@in_workload
def test_edges_of_reach_are_gone_to_without_a_turn_of_the_wrist_more(tmp_path):
    _, q = holes_of(tmp_path, 1000, slice(140, 200), hard=False, bound=0.05)
    assert np.abs(np.diff(q[:, [3, 5]], axis=0)).max() < 225.0 * DEG


@in_workload
def test_another_elbow_behind_beams_is_no_reason_to_refuse(tmp_path):
    # the stiffest elbow of these holes is one that no way leads to past the beams
    result, _ = holes_of(tmp_path, 10_000, slice(8535, 8600), hard=True)
    assert not result.errors
    assert len(np.unique(result.branch[result.tag >= 0] & 2)) == 1
