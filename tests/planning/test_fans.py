"""Steps that are refused by a look half way are those that cannot be run."""

import numpy as np

from postproc.planning.planner import checker_of
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import judge, probed
from postproc.planning.search.fans import fan
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.states import PlanOptions, settle
from tools.bench.contours import contour, milling_cell


def steps_of(count, spacing, steps):
    toolpath = contour("convex", count, spacing)
    cell, settings = settle(milling_cell(fixture=True, origin=(2150, 550, 750)), PlanOptions())
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.arange(count))
    rng, states = np.random.default_rng(3), search.states
    before = rng.integers(0, states.offsets[-2], 40 * steps)
    rung = states.tag_of(before)
    size = np.diff(states.offsets)[rung + 1]
    after = states.offsets[rung + 1] + (rng.uniform(size=len(before)) * size).astype(np.int64)
    same = states.branch[before] == states.branch[after]
    same &= np.abs(states.q[before] - states.q[after]).max(axis=1) < 1.0
    return checker, search.spans(before[same][:steps], after[same][:steps])


def test_what_is_met_half_way_cannot_be_run():
    checker, spans = steps_of(8, 150.0, 300)
    met = probed(checker, spans)
    good = judge(checker, Interpolation.of(checker.problem), spans).good(len(spans))
    assert not (met & good).any()
    assert met.sum() > 30
    assert good.sum() > 30
    assert (met[~good].mean()) > 0.5  # a look half way is worth it


def test_short_steps_are_left_to_the_sweep():
    checker, spans = steps_of(8, 20.0, 50)
    assert not probed(checker, spans).any()


def test_steps_are_looked_at_once_and_what_the_joints_refute_cannot_be_run():
    """A fan that comes back with the same steps, all known to fail, gets the search nowhere."""
    toolpath = contour("convex", 8, 60.0)
    cell, settings = settle(milling_cell(fixture=True, origin=(2150, 550, 750)), PlanOptions())
    checker = checker_of(toolpath, cell, settings)
    search = PoseSearch.of(checker, np.arange(8))
    rung = 4
    states = np.arange(*search.states.offsets[[rung - 1, rung]])
    now = np.arange(*search.states.offsets[[rung, rung + 1]])
    told: set[tuple[int, int]] = set()
    refuted: set[tuple[int, int]] = set()
    for n in range(12):
        more, known = fan(search, [(int(states[n]), int(now[n]))])
        assert told.isdisjoint(more)
        assert told.isdisjoint(known)
        told |= {*more, *known}
        refuted |= set(known)
    ends = np.array(sorted(refuted))
    spans = search.spans(ends[:, 0], ends[:, 1])
    assert len(ends) > 100
    assert not judge(checker, Interpolation.of(checker.problem), spans).good(len(spans)).any()
