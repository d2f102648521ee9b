"""Holes whose stiffest postures are walled in, or stand at the edge of reach, can be run."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.model.toolpath import MotionKind
from postproc.planning.planner import plan
from postproc.units import DEG
from tools.bench import workload
from tools.bench.holes import cell_file
from tools.bench.paths import bare_path


def in_workload(test):
    """Run a test that needs the shared workloads, where they are."""
    there = (workload.WORKLOADS / "scene").is_dir()
    test = pytest.mark.skipif(not there, reason="the shared workloads are not here")(test)
    return pytest.mark.corpus(pytest.mark.slow(test))


def holes_of(tmp_path, size, rows, *, hard, bound=None):
    """The plan of some holes of a workload, and the joints at the holes."""
    points, normals = workload.holes(size)
    path = bare_path("row", points[rows], normals[rows], feed=0.01, kind=MotionKind.HOLE)
    cell = load_cell(cell_file(tmp_path / "cell.toml", hard=hard))
    cell = replace(cell, optimize=replace(cell.optimize, loss_bound=bound))
    result = plan(path, cell)
    at = [int(np.flatnonzero(result.tag == tag)[0]) for tag in range(len(path))]
    return result, result.q[at]


@in_workload
@pytest.mark.parametrize("rows", [slice(812, 834), slice(800, 900), slice(140, 200)])
def test_a_bound_of_loss_is_no_reason_to_go_where_no_way_leads(tmp_path, rows):
    """The stiffest postures behind the beams are walled in: the bound is broken, and that told."""
    result, _ = holes_of(tmp_path, 1000, rows, hard=True, bound=0.05)
    assert not result.errors
    assert "PLN305" in [finding.code for finding in result.findings]


@in_workload
def test_edges_of_reach_are_gone_to_without_a_turn_of_the_wrist_more(tmp_path):
    _, q = holes_of(tmp_path, 1000, slice(140, 200), hard=False, bound=0.05)
    assert np.abs(np.diff(q[:, [3, 5]], axis=0)).max() < 225.0 * DEG


@in_workload
def test_another_elbow_behind_beams_is_no_reason_to_refuse(tmp_path):
    # the stiffest elbow of these holes is one that no way leads to past the beams
    result, _ = holes_of(tmp_path, 10_000, slice(8535, 8600), hard=True)
    assert not result.errors
    assert len(np.unique(result.branch[result.tag >= 0] & 2)) == 1
