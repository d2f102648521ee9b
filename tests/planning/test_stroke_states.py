"""States that cannot run their stroke are no states."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.model import MotionKind
from postproc.planning import settle
from postproc.planning.checks import Checker, Reason
from postproc.planning.job import problem_of
from postproc.planning.states import sample
from postproc.units import DEG

APPROACH = 0.25


@pytest.fixture
def problems(make_cell, make_path):
    """Return the problems of points at the edge of reach, to touch without and with a stroke."""
    rng = np.random.default_rng(4)
    points = np.column_stack(
        [rng.uniform(1.6, 2.5, 30), rng.uniform(-0.6, 0.6, 30), rng.uniform(0.6, 2.2, 30)]
    )
    toolpath = make_path(points, [1.0, 0.0, 0.0], MotionKind.HOLE)
    made = []
    for approach in (0.0, APPROACH):
        cell = make_cell(optimize={"step": 20.0 * DEG}, options={"turns": True})
        cell = replace(cell, motion=replace(cell.motion, approach=approach))
        cell, settings = settle(cell)
        made.append(problem_of(toolpath, cell, settings))
    return made


def keys(states, rows):
    """Return what tells states apart."""
    return {
        (
            int(tag),
            int(states.column[row]),
            int(states.branch[row]),
            *states.q[row].round(4).tolist(),
        )
        for tag, row in zip(states.tag_of(rows), rows, strict=True)
    }


def test_the_states_are_those_whose_stroke_can_be_run(problems):
    tags = np.arange(30)
    free, bound = (sample(problem, tags, problem.settings.spins) for problem in problems)
    rows = np.arange(len(free.q))
    verdict = Checker(problems[1], None).states(
        tags[free.tag_of(rows)],
        free.q.astype(np.float64),
        free.attitude_of(rows),
        free.branch.astype(np.int64),
    )
    met = set(verdict.reason.tolist())
    assert met >= {Reason.NONE, Reason.UNREACHABLE, Reason.JOINT_LIMIT}
    inner = keys(free, rows[verdict.good])
    assert inner <= keys(bound, np.arange(len(bound.q)))
    rest = keys(bound, np.arange(len(bound.q))) - inner
    assert len(rest) < 0.05 * len(bound.q), "few strokes fail between their ends alone"
    lost = free.refused.sum(axis=1) - bound.refused.sum(axis=1)
    count = [len(np.unique(states.config)) for states in (free, bound)]
    assert -lost.sum() == count[0] - count[1] > 0
