"""A long job is searched lap by lap: every hole has a pose, and little is lost by it."""

import numpy as np

from postproc.model import MotionKind
from postproc.planning import plan
from postproc.planning.checks import feasible
from postproc.planning.search import laps

ROWS = [
    (x, y, 0.6)
    for k, y in enumerate(np.arange(-0.5, 0.5, 0.1))
    for x in np.linspace(1.5, 1.9, 6)[:: 1 - 2 * (k % 2)]
]


def test_laps_choose_as_the_whole_search_but_for_the_last_percent(
    make_cell, make_path, monkeypatch
):
    path, cell = make_path(ROWS, [0.1, 0.2, 1.0], MotionKind.RAPID), make_cell()
    whole = plan(path, cell)
    monkeypatch.setattr(feasible, "AT_ONCE", 7)
    assert plan(path, cell).q.tobytes() == whole.q.tobytes()
    monkeypatch.setattr(laps, "AHEAD", 5)
    for lap in (12, 25, 53):
        monkeypatch.setattr(laps, "LAP", lap)
        found = plan(path, cell)
        assert not found.errors
        assert len(found) == len(whole)
        assert np.nanmean(found.stiffness) > 0.98 * np.nanmean(whole.stiffness)
        assert (found.stiffness_best == whole.stiffness_best).all()
        assert found.cycle_time < 1.1 * whole.cycle_time
