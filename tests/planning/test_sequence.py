"""Sequencing against enumeration, and its effect on a plan."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from postproc.model.plan import MoveKind, MoveRole
from postproc.model.toolpath import Cycle, Event, EventKind, MotionKind
from postproc.planning.planner import plan
from postproc.planning.search.sequence import shortest


def length(points, order):
    return np.abs(np.diff(points[list(order)], axis=0)).max(axis=1).sum()


@pytest.mark.parametrize("seed", range(20))
def test_near_the_best_of_all_orders(seed):
    rng = np.random.default_rng(seed)
    points = rng.uniform(size=(8, 3))
    order = shortest(points)
    assert sorted(order.tolist()) == list(range(8))
    assert order[0] == 0
    best = min(length(points, (0, *rest)) for rest in itertools.permutations(range(1, 8)))
    assert length(points, order) <= 1.15 * best


def test_two_opt_never_makes_it_worse():
    rng = np.random.default_rng(3)
    points = rng.uniform(size=(300, 6))
    left, order = set(range(1, 300)), [0]
    while left:
        order.append(min(left, key=lambda i: (np.abs(points[i] - points[order[-1]]).max(), i)))
        left.remove(order[-1])
    assert length(points, shortest(points)) < 0.98 * length(points, order)


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
