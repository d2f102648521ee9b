"""The lowest feed that the process takes: the search keeps it, the text is held to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.geometry import rotation_about
from postproc.jobs.convert import ConvertRequest, convert
from postproc.krl.text.parse import parse_files
from postproc.model import MoveRole
from postproc.units import DEG
from postproc.verification.verify import verify
from tools.bench.contours import contour, milling_cell

FEED = 0.08
"""Of the contours [m/s]."""
KEPT = 0.1
"""Share of the feed that the slowed contour keeps anyway."""


def fast(*contour_of):
    toolpath = contour(*contour_of)
    return replace(toolpath, feed=np.full(len(toolpath), FEED))


def cell_of(least):
    cell = milling_cell(fixture=False)
    return replace(cell, process=replace(cell.process, least_feed=least))


def made(toolpath, cell):
    return convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)


def shares(job):
    """Return the feeds of the cuts over the one asked for."""
    return job.plan.speed[job.plan.role == MoveRole.CUT] / FEED


@pytest.fixture(scope="module")
def slowed():
    """A contour that the arm follows too slowly somewhere as it is led without the key."""
    toolpath = fast("wavy", 1000, 1.0)
    job = made(toolpath, cell_of(0.0))
    assert job.good
    assert KEPT < shares(job).min() < 0.6
    return toolpath, job


def test_cuts_that_need_less_are_led_another_way(slowed):
    toolpath, _ = slowed
    job = made(toolpath, cell_of(0.7))
    assert job.good
    assert shares(job).min() >= 0.7
    joints = np.abs(np.diff(job.plan.q, axis=0))[1:]
    seconds = job.plan.duration[2:]
    cuts = job.plan.role[2:] == MoveRole.CUT
    assert (joints[cuts] <= job.cell.robot.qd_max * seconds[cuts, None] * 1.02).all()


def test_a_lowest_feed_that_is_kept_anyway_changes_no_byte(slowed):
    toolpath, job = slowed
    assert made(toolpath, cell_of(KEPT)).files == job.files


def test_what_no_way_keeps_is_refused_and_says_so():
    """The tool axis turns by 30 degrees within a millimetre: 13 ms, and A5 turns 2.1 rad/s."""
    toolpath = fast("convex", 60, 1.0, 5.0)
    axes = np.array(toolpath.axes)
    axes[30:] = axes[30:] @ rotation_about([1.0, 0.0, 0.0], -30.0 * DEG)
    toolpath = replace(toolpath, axes=axes)
    job = made(toolpath, cell_of(0.0))
    assert job.good
    assert shares(job).min() < 0.2
    job = made(toolpath, cell_of(0.9))
    assert not job.files
    found = [finding for finding in job.findings if finding.code == "PLN105"]
    assert 30 in {finding.tag_index for finding in found}
    assert all("least_feed_percent" in finding.hint for finding in found)


def test_verify_holds_a_lowered_feed_against_the_lowest_that_is_taken(slowed):
    toolpath, job = slowed
    modules = parse_files(job.files)
    name = modules[0].name
    assert verify(modules, name, cell_of(KEPT), toolpath).ok
    assert {v.code for v in verify(modules, name, cell_of(0.7), toolpath).violations} == {"feed"}
