"""Cycle times where somebody has said what accelerations and jerks the axes take."""

from __future__ import annotations

from dataclasses import replace

import pytest

from postproc.cell import parse_cell
from postproc.jobs.convert import ConvertRequest, convert
from postproc.krl.text.parse import parse_files
from postproc.verification.verify import verify
from tests.cells import STIFFNESS, cell_text
from tools.bench.contours import contour

FAST = 0.5
"""Feed [m/s] at which the axes are busy on a contour of 150 mm."""


@pytest.fixture(scope="module")
def toolpath():
    path = contour("wavy", 150, 1.0)
    return replace(path, feed=0.0 * path.feed + FAST)


def cell_of(robot=""):
    text = cell_text(STIFFNESS, origin=(1900, 0, 700))
    return parse_cell(text.replace("[tool]", f"{robot}\n[tool]", 1).encode(), "cell.toml")


def times(toolpath, robot):
    """Return the estimate of the plan and that of the text [s], and the files."""
    cell = cell_of(robot)
    job = convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)
    modules = parse_files(job.files)
    ran = verify(modules, modules[0].name, cell, toolpath)
    assert ran.ok
    return job.plan.cycle_time, ran.cycle_time, job.files


def test_stated_accelerations_take_time_and_change_no_program(toolpath):
    plain, plain_of_text, files = times(toolpath, "")
    for acceleration, least in ((1e5, 0.999), (60.0, 1.1), (10.0, 2.0)):
        own, of_text, same = times(toolpath, f"accel_deg_s2 = {[acceleration] * 6}")
        assert own >= least * plain
        assert of_text == pytest.approx(own, rel=0.07)  # sampled more coarsely
        assert same == files
    assert plain_of_text == pytest.approx(plain, rel=0.03)


def test_a_lower_jerk_takes_time_on_every_way_from_stop_to_stop(toolpath):
    stated = f"accel_deg_s2 = {[60.0] * 6}"
    soft, _, _ = times(toolpath, f"{stated}\njerk_deg_s3 = {[60.0] * 6}")
    hard, _, _ = times(toolpath, f"{stated}\njerk_deg_s3 = {[6000.0] * 6}")
    assert soft > hard + 0.9  # a second to build the acceleration up, not a hundredth
