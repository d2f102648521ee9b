"""Steps that are refused by a look half way are those that cannot be run."""

import numpy as np

from postproc.planning.planner import checker_of
from postproc.planning.search.between import Interpolation
from postproc.planning.search.cuts import judge, probed
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
