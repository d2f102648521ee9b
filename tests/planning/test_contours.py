"""Cuts between key tags against brute force that knows none, and dense contours at real size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.planning.planner import checker_of, plan
from postproc.planning.search.between import Interpolation, cubic, slopes
from postproc.planning.search.cuts import Spans, judge
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states import PlanOptions, settle
from postproc.units import DEG
from tools.bench.contours import brute_breaks, compare_random, contour, milling_cell


def test_no_random_contour_is_refused_falsely():
    """Places anywhere in reach, with and without a fixture; see ``tools.bench contours random``."""
    verdicts = compare_random(range(1, 7))
    assert verdicts["false"] == []
    assert len(verdicts["run"]) >= 3


@pytest.mark.parametrize("spacing", [0.3, 1.0])
def test_a_dense_closed_contour_runs_through(spacing):
    toolpath, cell = contour("convex", 400, spacing), milling_cell(fixture=False)
    result = plan(toolpath, cell)
    assert not result.errors
    assert len(set(result.branch[result.tag >= 0].tolist())) == 1
    cuts = result.kind[1:] > 0
    assert np.abs(np.diff(result.q, axis=0))[cuts].max() < 5.0 * DEG
    axis = result.T_base_tcp[:, :3, :3] @ cell.tool.axis
    served = np.flatnonzero((result.tag >= 0) & (result.kind > 0))
    served = served[np.unique(result.tag[served], return_index=True)[1]]  # not the way off the part
    assert np.abs(axis + toolpath.axes[result.tag])[served].max() < 1e-9
    tips = result.T_base_tcp[served, :3, 3]
    assert np.abs(tips - toolpath.points[result.tag[served]]).max() < 1e-12


def test_what_cannot_be_run_is_refused_where_the_brute_force_breaks_off():
    """With A5 held to few degrees no spin leads all around; the search says so by proof."""
    toolpath, cell = contour("convex", 90, 3.0, 40.0), milling_cell(fixture=False)
    high = np.array(cell.robot.q_max)
    high[4] = 75.0 * DEG
    low = np.array(cell.robot.q_min)
    low[4] = -75.0 * DEG
    cell = replace(cell, robot=replace(cell.robot, q_min=low, q_max=high))
    breaks = brute_breaks(toolpath, cell)
    errors = plan(toolpath, cell).errors
    assert bool(breaks) == bool(errors)
    assert all(error.code != "PLN106" for error in errors)


@pytest.mark.parametrize("seed", range(6))
def test_equals_brute_force_over_all_judged_steps(seed):
    """Every step of every state, judged along its whole inside, by plain dynamic programming."""
    rng = np.random.default_rng(seed)
    toolpath = contour(("convex", "wavy", "s")[seed % 3], 90, 3.0, float(rng.uniform(0.0, 35.0)))
    toolpath = toolpath.rows(np.arange(4) * int(rng.integers(4, 7)))
    cell = milling_cell(fixture=seed % 2 == 0)
    wishes = replace(cell.optimize, step=20.0 * DEG, range=(-60.0 * DEG, 60.0 * DEG))
    cell, settings = settle(replace(cell, optimize=wishes), PlanOptions())
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.arange(4))
    found = search.run()
    eager = PoseSearch.of(checker, np.arange(4))
    states, ladder = eager.states, eager.ladder
    every = np.arange(len(states.q))
    good = eager.check_states(every)
    value = np.where(good[: states.offsets[1]], ladder.cost[: states.offsets[1]], np.inf)
    for i in range(1, 4):
        before = np.arange(states.offsets[i - 1], states.offsets[i])
        now = np.arange(states.offsets[i], states.offsets[i + 1])
        a, b = (pair.ravel() for pair in np.meshgrid(before, now))
        may = (states.branch[a] == states.branch[b]) & good[a] & good[b]
        may[may] = _can_be_run(checker, eager, a[may], b[may], i)
        step = ladder.weight[i] * ((states.q[b].astype(float) - states.q[a]) ** 2).sum(axis=1)
        total = value[a - before[0]] + np.where(may, step, np.inf)
        value = total.reshape(len(now), len(before)).min(axis=1) + ladder.cost[now]
    if np.isfinite(value.min()):
        assert search.ladder.total(found.path) == pytest.approx(value.min(), rel=1e-6, abs=1e-6)
    else:
        assert search.ladder.broken[1:].any() or (found.path < 0).any()


def _can_be_run(checker, search, a, b, i):
    states, m = search.states, len(a)
    spans = Spans(
        np.full(m, i - 1),
        np.full(m, i),
        states.attitude_of(a),
        states.attitude_of(b),
        states.q[a].astype(float),
        states.q[b].astype(float),
        states.branch[b].astype(np.int64),
    )
    return judge(checker, Interpolation.of(checker.problem), spans).good(m)


def test_the_monotone_cubic_meets_its_knots_and_never_overshoots():
    x = np.array([0.0, 1.0, 1.5, 4.0, 5.0])
    y = np.array([0.0, 1.0, 1.2, 1.2, 3.0])
    slope = slopes(x, y)
    share = np.linspace(0.0, 1.0, 21)
    for k in range(4):
        ends = tuple(np.full(21, v) for v in (y[k], y[k + 1], slope[k], slope[k + 1]))
        values = cubic(share, np.full(21, x[k + 1] - x[k]), ends)
        assert np.allclose(values[[0, -1]], y[[k, k + 1]])
        assert (np.diff(values) >= -1e-12).all()
    line = slopes(x, 2.0 * x)
    assert np.allclose(line, 2.0)
