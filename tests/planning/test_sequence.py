"""The effect of a free order on a plan."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import Cycle, Event, EventKind, MotionKind
from postproc.planning.planner import plan


@pytest.mark.usefixtures("no_scene")
def test_free_order_saves_time_and_keeps_events_and_lines(make_cell, make_path):
    rng = np.random.default_rng(1)
    n = 40
    points = np.stack([np.full(n, 1.9), rng.uniform(-0.6, 0.6, n), rng.uniform(0.7, 1.3, n)], 1)
    toolpath = make_path(
        points,
        [-1.0, 0.0, 0.0],
        MotionKind.HOLE,
        cycle=np.zeros(n, int),
        cycles=(Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),),
        events=(Event(20, EventKind.STOP),),
        extra={"diameter": list(range(n))},
    )
    given = plan(toolpath, make_cell())
    free = plan(toolpath, make_cell(options={"free_order": True}))
    rapid = [result.duration[result.kind == MoveKind.PTP].sum() for result in (given, free)]
    assert rapid[1] < 0.75 * rapid[0]
    assert sorted(free.toolpath.line.tolist()) == toolpath.line.tolist()
    assert set(free.toolpath.line[:20].tolist()) == set(toolpath.line[:20].tolist())
    assert (np.array(free.toolpath.extra["diameter"]) == free.toolpath.line - 10).all()
    plunge = free.role == MoveRole.PLUNGE
    assert plunge.sum() == n
    tip = free.T_base_tcp[plunge, :3, 3] - free.toolpath.points[free.tag[plunge]]
    assert np.allclose(tip, [0.006, 0.0, 0.0], atol=1e-12)
