"""Steps on whose way the tool leans too far are out of the graph before they are looked at."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import Workpiece
from postproc.ladder import NONE
from postproc.model.toolpath import Arcs, MotionKind
from postproc.planning.checks import Reason
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import judge
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states import rounded_spin, settle
from postproc.units import DEG
from tools.bench.contours import brute_cost, searched_cost

UP = np.array([0.0, 0.0, 1.0])
RAPID, LINEAR, ARC = MotionKind.RAPID, MotionKind.LINEAR, MotionKind.ARC
AHEAD = Workpiece(1, np.array([[1, 0, 0, 1.8], [0, 1, 0, 0.1], [0, 0, 1, 0.8], [0, 0, 0, 1.0]]))
SIDE = {"side_tilt_deg": [-30.0, 30.0], "tilt_step_deg": 10.0}
BOTH = {"lead_deg": [-5.0, 15.0], "side_tilt_deg": [-10.0, 10.0], "tilt_step_deg": 10.0}


def spiral(count, radius=0.02, turn=17.0, growth=0.002):
    angle, reach = np.arange(count) * turn * DEG, radius + growth * np.arange(count)
    return np.stack([reach * np.cos(angle), reach * np.sin(angle), 0.0 * angle], axis=1)


def searched(make_cell, path, options, *, step=20.0, spins=(-60.0, 60.0)):
    optimize = {"step": step * DEG, "range": (spins[0] * DEG, spins[1] * DEG)}
    cell = make_cell(options=options, optimize=optimize, bases=(AHEAD,))
    checker = checker_of(path, *settle(cell))
    return PoseSearch.of(checker, np.arange(len(path)))


def with_an_arc(make_path):
    """Return a line, a quarter of a circle, a line, and a quarter that rises."""
    points = [[0, 0, 0], [0.04, 0, 0], [0.07, 0.03, 0], [0.07, 0.07, 0], [0.04, 0.1, 0.01]]
    kind = [RAPID, LINEAR, ARC, LINEAR, ARC]
    path = make_path(points, UP, kind)
    centre = np.array([[0.04, 0.03, 0.0], [0.04, 0.07, 0.0]])
    normal, radius = np.array([UP, UP]), np.full(2, 0.03)
    arcs = Arcs(centre, normal, radius, np.full(2, 90.0 * DEG))
    return replace(path, arcs=arcs, arc=np.array([-1, -1, 0, -1, 1]))


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("spins", [(-60.0, 60.0), (-180.0, 180.0)])
@pytest.mark.parametrize("options", [SIDE, BOTH])
@pytest.mark.parametrize("bent", ["corner", "arc", "leaning"])
def test_what_is_barred_is_what_the_check_refuses(make_cell, make_path, options, spins, bent):
    """Random steps, each judged along its way as it is: not one more or fewer leans too far."""
    path = with_an_arc(make_path)
    if bent != "arc":
        axes = UP if bent == "corner" else np.stack([UP, UP, [0, 0.1, 1], [0.2, 0, 1]])
        axes = axes / np.linalg.norm(axes, axis=-1, keepdims=True)
        path = make_path(spiral(4, 0.1), axes, [RAPID, LINEAR, LINEAR, LINEAR])
    search = searched(make_cell, path, options, spins=spins)
    rng, joins, states = np.random.default_rng(1), search.ladder.joins, search.states
    joins.turn[:] = np.pi
    between = Interpolation.of(search.checker.problem)
    barred = looked = 0
    for rung in range(1, len(path)):
        before, low, high = states.offsets[rung - 1 : rung + 2].tolist()
        a, b = rng.integers(before, low, 4000), rng.integers(low, high, 4000)
        keep = np.abs(states.q[a] - states.q[b]).max(axis=1) < 2.0
        keep &= states.branch[a] == states.branch[b]
        steps = np.unique(np.stack([a, b], axis=1)[keep], axis=0)
        judged = judge(search.checker, between, search.spans(*steps.T))
        known = np.isin(judged.reason, [Reason.NONE, Reason.SINGULAR])
        assert joins.told[rung]
        out = np.array([joins.barred(rung, *np.split(pair, 2))[0, 0] for pair in steps])
        assert np.array_equal(out[known], (judged.reason == Reason.SINGULAR)[known])
        barred, looked = barred + int(out.sum()), looked + int(known.sum())
    assert looked > 100
    assert barred > 30


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("options", [SIDE, BOTH])
@pytest.mark.parametrize("turn", [0.0, 8.0, 17.0, 40.0])
def test_equals_brute_force_over_all_judged_steps(make_cell, make_path, options, turn):
    path = make_path(spiral(4, turn=turn, growth=0.01), UP, [RAPID, LINEAR, LINEAR, LINEAR])
    search = searched(make_cell, path, options, step=30.0)
    want = brute_cost(search.checker)
    assert np.isfinite(want)
    assert searched_cost(search) == pytest.approx(want, abs=1e-6)


@pytest.mark.usefixtures("no_scene")
def test_no_step_that_leans_too_far_is_looked_at(make_cell, make_path):
    """A spiral, where most pairs of allowed side tilts are out: thousands of steps were refuted."""
    path = make_path(spiral(20), UP, [RAPID] + [LINEAR] * 19)
    search = searched(make_cell, path, SIDE)
    found = search.found
    assert (found.path != NONE).all()
    assert not search.broken.any()
    assert (search.states.attitude_of(found.path)[:, 2] != 0.0).any()
    assert found.forbidden <= 20


@pytest.mark.usefixtures("no_scene")
def test_pinned_tags_and_tags_between_key_tags_are_left_to_the_check(make_cell, make_path):
    """There the turn of the spin is none of the grid, or the tilt changes on the way."""
    path = make_path(spiral(8), UP, [RAPID] + [LINEAR] * 7)
    pins = {path.tag_name(3): float(rounded_spin(7.0 * DEG))}
    cell = make_cell(options=SIDE, optimize={"step": 20.0 * DEG, "pins": pins}, bases=(AHEAD,))
    checker = checker_of(path, *settle(cell))
    search = PoseSearch.of(checker, np.array([0, 1, 2, 3, 4, 6, 7]))
    assert search.ladder.joins.told.tolist() == [False, True, True, False, False, False, True]
    found = search.found
    assert (found.path != NONE).all()
    assert not search.broken.any()


@pytest.mark.usefixtures("no_scene")
def test_a_tilted_cut_out_of_reach_is_refused_tag_by_tag(make_cell, make_path):
    """Neighbours without any pose: nothing leads from one to the next, and that is no fault."""
    x = np.arange(40) * 0.05
    points = np.stack([x, 0.0 * x, 0.0 * x], axis=1)
    path = make_path(points, UP, [RAPID] + [LINEAR] * 39)
    cell = make_cell(options={"lead_deg": [-3.0, 3.0]}, bases=(AHEAD,))
    result = plan(path, cell)
    failing = result.failing_tags
    assert len(failing) > 3
    assert (np.diff(failing) == 1).all()
    assert {finding.code for finding in result.errors} <= {"PLN101", "PLN102"}
