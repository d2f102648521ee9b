"""Cuts between key tags against brute force that knows none, and dense contours at real size."""

from __future__ import annotations

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from postproc.model import MoveRole
from postproc.planning.external.positions import cubic, slopes
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.keytags import dense_key_tags
from postproc.planning.search.pose_search import PoseSearch, grown
from postproc.planning.states import settle
from postproc.units import DEG
from tools.bench.contours import (
    brute_breaks,
    compare_eager,
    compare_exact,
    compare_random,
    contour,
    milling_cell,
    random_case,
)


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


def test_equals_brute_force_over_all_judged_steps():
    """A slice of ``tools.bench contours exact``: plain dynamic programming over every step."""
    assert compare_exact(range(6))["other"] == []


def test_lazily_checked_is_eagerly_checked():
    """A slice of ``tools.bench contours eager``: all collisions known before the search."""
    assert compare_eager(range(40, 43))["other"] == []


def test_repaired_values_are_those_of_a_search_from_scratch():
    toolpath, cell = contour("wavy", 1500, 1.0), milling_cell(fixture=True)
    cell, settings = settle(cell)
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.flatnonzero(dense_key_tags(checker.problem)))
    assert search.found
    for tag in (200, 633, 634, 1120):
        search = grown(search, np.array([tag]), np.array([search.checker.problem.fine]))
        assert search.found
    search.ladder.settle()
    fresh, runs = copy(search.ladder), search.joins
    fresh.__post_init__()
    fresh.joins = replace(runs)
    fresh.solve()
    assert np.isinf(fresh.value).sum() > len(fresh.value) / 10
    assert search.ladder.value == pytest.approx(fresh.value, abs=1e-8)
    assert (search.ladder.broken == fresh.broken).all()


def test_cuts_found_good_before_another_into_the_same_state_are_run():
    toolpath, cell = contour("convex", 300, 1.0), milling_cell(fixture=False)
    cell, settings = settle(cell)
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.flatnonzero(dense_key_tags(checker.problem)))
    known = search.chosen
    rolled = replace(search.known, passed=np.roll(search.known.passed, 1))
    again = replace(search, known=rolled).chosen
    assert known.good.all()
    assert again.good.all()
    assert np.array_equal(known.q, again.q)


def test_key_tags_of_cuts_stand_on_round_spins_and_the_tags_between_do_not():
    toolpath, cell = contour("convex", 1200, 1.5), milling_cell(fixture=False)
    result = plan(toolpath, cell)
    assert not result.errors
    checker = checker_of(toolpath, *settle(cell))
    is_key = dense_key_tags(checker.problem)[result.tag]
    off = np.abs(result.spin / DEG - np.round(result.spin / DEG)) > 1e-6
    assert not off[is_key].any()
    assert off[~is_key].mean() > 0.3


@pytest.mark.parametrize("seed", [23, 54, 740])
def test_a_cut_ends_where_the_tool_can_back_off(seed):
    """The stiffest pose at its end leaves no way out along the tool axis; another one does."""
    toolpath, cell = random_case(seed)
    result = plan(toolpath, cell)
    assert not result.errors
    last = np.flatnonzero(result.role == MoveRole.CUT)[-1]
    up = result.T_base_tcp[last + 1, :3, 3] - result.T_base_tcp[last, :3, 3]
    assert up @ toolpath.axes[-1] == pytest.approx(cell.motion.approach, abs=1e-9)


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
