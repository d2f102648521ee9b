"""A cut that no single arm configuration serves: refused, or left and entered again as told."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell import parse_cell
from postproc.errors import CellError, Severity
from postproc.jobs.convert import ConvertRequest, convert, document
from postproc.krl.text.parse import parse_files
from postproc.model import Event, EventKind, MotionKind, MoveKind, MoveRole
from postproc.readers import read
from postproc.units import DEG, MM
from postproc.verification.verify import verify
from tests.cells import STIFFNESS, cell_text
from tools.bench.paths import bare_path

FEED = 0.02
RADIUS = 1.9
HOME = "home_deg = [0, -90, 90, 0, 45, 0]\n"
LEAVE = f"[motion]\n{HOME}retract_in_cuts = true\n"
PILLAR = """\
[[obstacles]]
name = "pillar"
box = { size_mm = [300, 300, 2400] }
xyz_mm = [1344, -1344, 1200]
"""


def cell_of(*tables):
    return parse_cell(cell_text(STIFFNESS, *tables, origin=(0, 0, 700)).encode(), "cell.toml")


def around(first=100, last=260, step=5, events=()):
    """Return a cut on a circle about A1 from one angle to another [deg], straight down."""
    angle = np.arange(first, last + 1, step) * DEG
    points = RADIUS * np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=1)
    kind = np.full(len(angle), MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    axes = np.tile([0.0, 0.0, 1.0], (len(angle), 1))
    path = bare_path("around", points, axes, feed=FEED, kind=kind)
    return replace(path, events=tuple(events))


def made(toolpath, cell):
    return convert(ConvertRequest("around", "cell"), toolpath=toolpath, cell=cell)


def left(plan):
    """Return the first moves of each place at which a cut is left."""
    return (
        np.flatnonzero((plan.role[1:] == MoveRole.RAPID) & (plan.role[:-1] == MoveRole.CUT))[:-1]
        + 1
    )


def test_without_the_key_the_cut_is_refused_with_the_nearest_change():
    job = made(around(), cell_of(f"[motion]\n{HOME}"))
    assert not job.files
    (found,) = job.plan.errors
    assert found.code == "PLN102"
    assert "retract_in_cuts" in found.hint
    assert "at A1" in found.hint


def test_the_tool_is_lifted_off_goes_round_and_comes_down_where_it_left():
    """A1 ends at 185 degrees: half way round the base it has to go back by a turn."""
    toolpath, cell = around(), cell_of(LEAVE)
    job = made(toolpath, cell)
    assert job.good
    plan = job.plan
    (up,) = left(plan)
    assert plan.kind[up : up + 3].tolist() == [MoveKind.LIN, MoveKind.PTP, MoveKind.LIN]
    assert (plan.blend[up - 1 : up + 2] == 0.0).all()
    before, above, there, down = plan.T_base_tcp[up - 1 : up + 3, :3, 3]
    assert down == pytest.approx(before, abs=1e-9)
    assert above - before == pytest.approx([0.0, 0.0, 50.0 * MM], abs=1e-9)
    assert there == pytest.approx(above, abs=1e-9)
    assert plan.role[up + 2] == MoveRole.CUT
    assert plan.speed[up + 2] == FEED
    assert abs(plan.q[up + 2, 0] - plan.q[up - 1, 0]) > 350.0 * DEG
    steps = np.abs(np.diff(plan.q, axis=0))[plan.role[1:] == MoveRole.CUT]
    assert steps.max() < 15.0 * DEG
    (told,) = (finding for finding in job.findings if finding.code == "PLN310")
    assert told.severity is Severity.WARNING
    assert told.tag_index == plan.tag[up]
    assert told.source.line == toolpath.line[told.tag_index]
    tried = {row["repair"]: row["times"] for row in document(job)["tried"]}
    assert tried["a cut left and entered again"] == 1
    modules = parse_files(job.files)
    assert verify(modules, modules[0].name, cell, toolpath).ok


def test_it_is_left_no_more_often_than_the_limit_of_the_axis_asks():
    """A1 goes as the cut does, from 0: its limit is at 185 degrees, the spin gains some more."""
    job = made(around(0, 1200, 4), cell_of(LEAVE))
    assert job.good
    angles = job.plan.tag[left(job.plan)] * 4.0
    assert (np.abs(angles - [185.0, 545.0, 905.0]) < 30.0).all()


def test_the_way_round_keeps_clear_of_what_stands_there():
    """Back by a turn of A1, stretched out as it cuts, the arm would hit the pillar."""
    toolpath, cell = around(), cell_of(LEAVE, PILLAR)
    job = made(toolpath, cell)
    assert job.good
    (up,) = left(job.plan)
    way = int(np.flatnonzero(job.plan.role[up:] == MoveRole.CUT)[0])
    assert way > 2
    modules = parse_files(job.files)
    assert verify(modules, modules[0].name, cell, toolpath).ok


def test_what_happens_between_two_tags_still_happens_once_before_the_cut_goes_on():
    free = made(around(), cell_of(LEAVE)).plan
    tag = int(free.tag[left(free)[0]])
    events = [Event(tag, EventKind.MESSAGE, text="HERE", line=tag + 1)]
    job = made(around(events=events), cell_of(LEAVE))
    assert job.good
    ((move, event),) = job.plan.events
    assert event.index == tag
    assert job.plan.tag[move] == tag
    assert sum(text.count(b"HERE") for text in job.files.values()) == 1


def test_a_tool_that_may_tilt_comes_down_upright():
    cell = cell_of(LEAVE, "[optimize]\nlead_deg = [0, 15]\nstep_deg = 30\n")
    job = made(around(), cell)
    assert job.good
    (up,) = left(job.plan)
    lean = np.arccos(np.clip(-job.plan.T_base_tcp[up + 1 : up + 3, 2, 0], -1.0, 1.0))
    assert lean == pytest.approx([0.0, 0.0], abs=1e-6)


def test_what_lifting_off_does_not_help_is_refused_as_before():
    """One point lies behind the reach of the arm: there is nothing to go on to."""
    toolpath = around(100, 160)
    points = np.array(toolpath.points)
    points[6] *= 3.0
    toolpath = replace(toolpath, points=points)
    refused = made(toolpath, cell_of(f"[motion]\n{HOME}")).plan.errors
    assert refused
    assert made(toolpath, cell_of(LEAVE)).plan.errors == refused


def test_lifting_off_needs_a_height():
    with pytest.raises(CellError, match="approach_mm"):
        cell_of(f"[motion]\n{HOME}retract_in_cuts = true\napproach_mm = 0\n")


def test_a_change_between_two_cuts_is_told():
    """Two cuts that meet behind the arm: its A1 goes back by a turn between them."""
    both = around(step=4)
    rows = np.concatenate([np.arange(21), np.arange(20, len(both))])
    points, kind = np.array(both.points)[rows], np.asarray(both.kind)[rows]
    points[21, 2] += 0.1
    kind[21] = MotionKind.RAPID
    toolpath = replace(both.rows(rows), points=points, kind=kind)
    job = made(toolpath, cell_of(f"[motion]\n{HOME}"))
    assert job.good
    (told,) = (finding for finding in job.findings if finding.code == "PLN311")
    assert told.severity is Severity.NOTE
    assert told.source.line == toolpath.line[21]
    assert not {"PLN308", "PLN310"} & {finding.code for finding in job.findings}
    assert abs(job.plan.q[left(job.plan)[0] + 1, 0] - job.plan.q[left(job.plan)[0], 0]) > np.pi


def test_a_point_out_of_reach_within_a_cut_is_no_change_between_two():
    cut = around(first=100, last=184, step=2)
    points = np.array(cut.points)
    points[-3] *= 4.0
    job = made(replace(cut, points=points), cell_of())
    codes = {finding.code for finding in job.findings}
    assert "PLN101" in codes
    assert "PLN311" not in codes


WALL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr16_2"
base = { xyz_mm = [0, 0, 1500], abc_deg = [0, 90, 0] }
[tool]
frame = { xyz_mm = [0, 0, 262], abc_deg = [0, 0, 0] }
axis = "+z"
[workpiece]
frame = { xyz_mm = [936.6744, -0.4034, 545.5132], abc_deg = [0, -90, 10] }
[motion]
retract_in_cuts = true
home_deg = [0, -90, 90, 0, 30, 0]
feed_mm_min = 300
"""
RIM = """\
UNITS/MM
RAPID
GOTO/269.530708,263.573246,20.
FEDRAT/288.6,MMPM
GOTO/269.530708,263.573246,-2.4
CIRCLE/154.48744,154.487094,-2.4,0,0,-1.
GOTO/312.970875,158.699323,-2.4
CIRCLE/304.973775,158.486773,-2.4,0,0,-1.
GOTO/304.973665,150.486849,-2.4
GOTO/300.281982,150.486855,-2.4
CIRCLE/154.487389,154.486625,-2.4,0,0,-1.
GOTO/260.408003,54.22254,-2.4
GOTO/263.725551,50.905,-2.4
CIRCLE/258.068684,45.24815,-2.4,0,0,-1.
GOTO/263.573246,39.442989,-2.4
CIRCLE/154.487094,154.486257,-2.4,0,0,-1.
GOTO/158.699323,-3.997178,-2.4
CIRCLE/158.486773,3.999923,-2.4,0,0,-1.
GOTO/150.486849,4.000032,-2.4
GOTO/150.486855,8.691716,-2.4
RAPID
GOTO/150.486855,8.691716,50.
FINI
"""


def test_the_point_at_which_a_cut_was_left_is_met_exactly():
    """Rounded, the corner would be cut before the tool is back on its way."""
    toolpath, cell = around(), cell_of(LEAVE)
    job = made(toolpath, cell)
    assert job.good
    plan = job.plan
    down = [int(np.flatnonzero(plan.role[at:] == MoveRole.CUT)[0]) + at for at in left(plan)]
    assert len(down) == 1
    assert plan.blend[down[0]] == 0.0
    assert plan.blend[down[0] + 1] > 0.0


@pytest.mark.parametrize("height", [10, 25])
def test_where_the_tool_cannot_rise_at_the_last_point_it_is_left_earlier(tmp_path, height):
    """On the wall A1 runs into its limit of 183 degrees, and further into it as the tool rises."""
    source = tmp_path / "rim.apt"
    source.write_text(RIM)
    cell = parse_cell(f"{WALL}approach_mm = {height}\n".encode(), "cell.toml")
    toolpath = read(str(source))
    job = convert(ConvertRequest("rim", "cell"), toolpath=toolpath, cell=cell)
    assert job.good
    (told,) = (finding for finding in job.findings if finding.code == "PLN310")
    assert told.tag_index == 6  # as high as the file comes to the cut from, at least
    modules = parse_files(job.files)
    assert verify(modules, modules[0].name, cell, toolpath).ok


def test_a_broken_cut_is_told_once(tmp_path):
    """That the arm cannot go round from one side to the other either is no second fault."""
    source = tmp_path / "rim.apt"
    source.write_text(RIM)
    text = f"{WALL}approach_mm = 25\n".replace("retract_in_cuts = true\n", "")
    cell = parse_cell(text.encode(), "cell.toml")
    job = convert(ConvertRequest("rim", "cell"), toolpath=read(str(source)), cell=cell)
    assert not job.files
    (error,) = job.plan.errors
    assert error.code == "PLN102"
    assert "serves the cut from tag" in error.message
