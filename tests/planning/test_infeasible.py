"""Motions that no pose can run are refused at once, and no others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.model.toolpath import Arcs, MotionKind
from postproc.planning.checks import Reason
from postproc.planning.job import checker_of
from postproc.planning.planner import plan
from postproc.planning.search.between import Interpolation
from postproc.planning.states import settle
from tests.cells import FEED, cell_text
from tests.jobs.emitted import converted

UP = np.array([0.0, 0.0, 1.0])


def infeasible(cell, path):
    problem = checker_of(path, *settle(cell)).problem
    return Interpolation.of(problem).infeasible.tolist()


def round_about(make_path, radius, side):
    """Return two points beside each other, and the arc from one to the other."""
    points = np.array([[1.7, 0.0, 0.8], [1.7, 0.0, 0.8], [1.7, 0.05, 0.8]])
    path = make_path(points, UP, [MotionKind.RAPID, MotionKind.LINEAR, MotionKind.ARC])
    half = 0.5 * np.linalg.norm(points[2] - points[1])
    centre = 0.5 * (points[1] + points[2]) + side * np.sqrt(radius**2 - half**2) * np.eye(3)[0]
    sweep = 2.0 * np.arcsin(half / radius)
    sweep = sweep if side < 0 else 2.0 * np.pi - sweep
    arcs = Arcs(centre[None], UP[None], np.array([radius]), np.array([sweep]))
    return replace(path, arcs=arcs, arc=np.array([-1, -1, 0]))


@pytest.mark.usefixtures("no_scene")
@pytest.mark.parametrize("radius", [10.0, 1e3, 1e6])
def test_an_arc_far_out_of_reach_is_refused_at_once(make_cell, make_path, radius):
    cell = make_cell()
    for side, reason in ((-1, Reason.NONE), (1, Reason.UNREACHABLE)):
        path = round_about(make_path, radius, side)
        assert infeasible(cell, path)[2] == reason
        codes = [finding.code for finding in plan(path, cell).errors]
        assert codes == ([] if reason is Reason.NONE else ["PLN101"])


@pytest.mark.usefixtures("no_scene")
def test_a_tool_axis_that_turns_over_in_one_motion(make_cell, make_path):
    turned = make_path(
        [[1.7, y, 0.8] for y in (0.0, 0.01, 0.02, 0.03)],
        np.array([UP, UP, -UP, UP]),
        [MotionKind.RAPID, MotionKind.LINEAR, MotionKind.LINEAR, MotionKind.LINEAR],
    )
    assert infeasible(make_cell(), turned) == [0, 0, Reason.SINGULAR, Reason.SINGULAR]
    assert {error.code for error in plan(turned, make_cell()).errors} == {"PLN103"}


@pytest.mark.usefixtures("no_scene")
def test_long_lines_within_reach_are_not(make_cell, make_path):
    points = [[1.6 + 0.2 * (k % 2), -0.6 + 1.2 * (k % 2), 0.8] for k in range(20)]
    kind = [MotionKind.RAPID] + [MotionKind.LINEAR] * 19
    assert not any(infeasible(make_cell(), make_path(points, UP, kind)))


EDGE = """\
PARTNO/P
UNITS/MM
SPINDL/3000,RPM,CLW
RAPID
GOTO/81.2074,2323.3484,-23.7305,0,0,1
FEDRAT/3000,MMPM
GOTO/81.2074,2323.3484,-53.7305,0,0,1
CIRCLE/-62.4604,2396.0262,-53.7305,0,0,1,161.0047
GOTO/-211.8425,2456.0888,-53.7305,0,0,1
SPINDL/OFF
FINI
"""


def test_an_arc_at_the_edge_of_reach_is_not(tmp_path):
    """Half way round a few spins reach it, between those of a grid of 10 degrees."""
    job = converted(tmp_path, EDGE, "edge.apt", cell_text(FEED, origin=(1900, 300, 500)))
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
