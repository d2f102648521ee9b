"""Legitimate values of ``[motion]`` off the beaten track: programs, not refusals."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.geometry import angle_between
from postproc.jobs.convert import ConvertRequest, convert
from postproc.model import MotionKind
from postproc.units import DEG, MM
from tests.cells import FEED, STIFFNESS, cell_text
from tests.jobs.emitted import converted as converted_text
from tools.bench.contours import SOLIDS, contour


def converted(toolpath, *tables):
    text = cell_text(STIFFNESS, *tables, origin=(1900, 0, 700))
    cell = parse_cell(text.encode(), "cell.toml")
    job = convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
    return job


def program(job):
    return "".join(data.decode() for name, data in sorted(job.files.items()) if ".src" in name)


@pytest.mark.parametrize("percent", [1, 5, 50])
def test_a_cut_goes_on_in_the_next_file_however_slow_the_axes(percent):
    job = converted(
        contour("convex", 60, 1.0),
        f"{FEED}rapid_percent = {percent}\n",
        "[krl]\nmax_points_per_file = 20\n",
    )
    text = program(job)
    assert "re-entry" in text
    told = {int(word) for word in re.findall(r"\$VEL_AXIS\[1\]=(\d+)", text)}
    assert max(told, default=percent) <= max(percent, 10)


def led(path, up):
    """Return a contour entered and left along the tool axis, by rapids so far up [mm]."""
    n = len(path)
    path = path.rows(np.append(np.append(0, np.arange(n)), n - 1))
    kind, points = np.array(path.kind), path.points.copy()
    kind[1], kind[[0, -1]] = MotionKind.LINEAR, MotionKind.RAPID
    points[[0, -1]] += up * MM * path.axes[[0, -1]]
    feed = np.where(kind == MotionKind.RAPID, np.nan, 0.01)
    return replace(path, kind=kind, points=points, feed=feed)


def test_a_cut_in_a_solid_part_goes_on_in_the_next_file():
    """The joint motion at the head of a file stays in the material, and touches it."""
    part = """\
meshes = [{ name = "part", box = { size_mm = [200, 200, 20] }, xyz_mm = [0, 0, -9] }]
"""
    rest = f"{FEED}[krl]\nmax_points_per_file = 20\n"
    cell = parse_cell(cell_text(part, rest, tool=SOLIDS, origin=(1900, 0, 700)).encode(), "c.toml")
    path = led(contour("convex", 60, 1.0, lean=0.0), 30.0)
    job = convert(ConvertRequest("contour", "cell"), toolpath=path, cell=cell)
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
    assert "re-entry" in program(job)


@pytest.mark.parametrize("up", [30.0, 60.0])
def test_a_leaning_tool_backs_off_as_far_as_it_must(up):
    """However far the CAM file itself goes back along its own axis."""
    path = led(contour("convex", 30, 1.0), up)
    job = converted(path, FEED, '[optimize]\npreset = "stiffest"\nlead_deg = [-15, 15]\n')
    last = np.flatnonzero(job.plan.tag == len(path) - 2)[0]
    axis = job.plan.T_base_tcp[last, :3, 0]
    assert angle_between(-path.axes[-2], axis) > 2.0 * DEG


def test_points_that_lie_close_are_passed_without_a_stop():
    slow, dense = contour("wavy", 150, 1.0), contour("wavy", 6000, 0.025)
    fed = [replace(path, feed=0.0 * path.feed + 0.01) for path in (slow, dense)]
    wide, close = (converted(path) for path in fed)
    cuts = close.plan.blend[close.plan.role == close.plan.role[len(close.plan) // 2]]
    assert (cuts[:-1] > 0.0).mean() > 0.99
    assert close.plan.cycle_time == pytest.approx(wide.plan.cycle_time, rel=0.02)
    assert program(close).count("C_DIS") > 5900


def test_home_may_stand_in_the_margin_of_a_limit():
    home = [0, -129, 90, 0, 45, 0]
    job = converted(contour("s", 30, 1.0), f"{FEED}home_deg = {home}\n")
    assert "A2 -129" in program(job)


LIGHT_ARM_ON_A_RAIL = """
schema = "postproc.cell/1"
[robot]
model = "kuka_kr6_r900_2"
[tool]
frame = { xyz_mm = [0, 0, 120], abc_deg = [0, 0, 0] }
axis = "+z"
[workpiece]
frame = { xyz_mm = [1094, 0, 400], abc_deg = [-90, 0, 90] }
[[external_axes]]
name = "E1"
kind = "rail"
axis = "+y"
range_mm = [-2000, 2000]
speed_mm_s = 800
[motion]
home_deg = [0, -90, 90, 0, 45, 0]
"""


def test_a_narrow_window_between_two_places_of_the_grid_is_found(tmp_path):
    """The arm reaches the hole with the rail between 1265 and 1485 mm alone."""
    hole = "id,x,y,z,i,j,k,depth,feed\nH00,-1375,0,0,0,0,1,10,150\n"
    job = converted_text(tmp_path, hole, "hole.csv", LIGHT_ARM_ON_A_RAIL)
    assert job.good
    stands = job.plan.external[job.plan.tag == 0, 0]
    assert ((stands > 1.26) & (stands < 1.49)).all()
