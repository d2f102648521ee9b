"""Programs with points left out: accepted within the tolerance of the cell, and caught beyond."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from postproc.cell import MotionStyle, parse_cell
from postproc.jobs.convert import ConvertRequest, convert, document
from postproc.krl.text.parse import parse_files
from postproc.model import Event, EventKind, MotionKind
from postproc.units import DEG, MM
from postproc.verification.verify import verify
from tests.cells import STIFFNESS, cell_text
from tools.bench.contours import contour

CHORD, AXIS, LEAN = 0.05, 0.1, 3.0
"""[mm], [deg], [deg]"""
_FROM = 10
"""The first tag behind the first line, which begins at no line's end."""
LINE = re.compile(rb"^ *S?LIN \{X (\S+),Y (\S+),Z (\S+),A (\S+),B (\S+),C ([^,}]+).*\r\n", re.M)


def cell_of(chord=CHORD, axis=AXIS, *, asked=True, style=MotionStyle.DENSE, part=1000):
    """Return the cell of the contours, with points left out if that is ``asked`` for."""
    thin = f"thin = {{ chord_mm = {chord}, axis_deg = {axis} }}\n" if asked else ""
    text = cell_text("[motion]\n", thin, STIFFNESS, origin=(1900, 0, 700))
    cell = parse_cell(text.encode(), "contour.toml")
    return replace(cell, krl=replace(cell.krl, motion=style, max_points_per_file=part))


def made(toolpath, cell):
    return convert(ConvertRequest("contour", "cell"), toolpath=toolpath, cell=cell)


def judged(files, cell, toolpath):
    return verify(parse_files(files), next(iter(files)).removesuffix(".src"), cell, toolpath)


def driven(files):
    """Return the points [mm] and orientations of all lines of a program, read from its text."""
    found = [line for name in sorted(files) for line in LINE.findall(files[name])]
    values = np.array(found, dtype=float)
    return values[:, :3], Rotation.from_euler("ZYX", values[:, 3:], degrees=True)


def farthest(files, toolpath):
    """Return by how much [mm, deg] the lines of a text pass the CAM points; any line counts."""
    points, turns = driven(files)
    start, way = points[:-1], np.diff(points, axis=0)
    square = np.maximum((way**2).sum(axis=1), 1e-18)
    chord, axis = [], []
    for point, holder in zip(toolpath.points[_FROM:] / MM, toolpath.axes[_FROM:], strict=True):
        share = np.clip(((point - start) * way).sum(axis=1) / square, 0.0, 1.0)
        apart = np.linalg.norm(start + share[:, None] * way - point, axis=1)
        near = int(apart.argmin())
        led = Slerp([0.0, 1.0], turns[[near, near + 1]])(share[near]).apply([1.0, 0.0, 0.0])
        chord.append(apart[near])
        axis.append(np.degrees(np.arccos(np.clip(-led @ holder, -1.0, 1.0))))
    return max(chord), max(axis)


@pytest.fixture(scope="module", params=["convex", "wavy", "s"])
def thinned(request):
    toolpath, cell = contour(request.param, 240, 1.0, LEAN), cell_of()
    job = made(toolpath, cell)
    assert job.good, [str(finding) for finding in job.findings]
    return toolpath, cell, job


def test_the_text_passes_every_cam_point_within_the_tolerance(thinned):
    toolpath, cell, job = thinned
    report = judged(job.files, cell, toolpath)
    assert report.ok
    assert report.matched == report.tags == len(toolpath)
    lines = len(driven(job.files)[0]) - 1  # the last one leads the tool out
    assert report.passed == len(toolpath) - 1 - lines > 0.3 * len(toolpath)
    chord, axis = farthest(job.files, toolpath)
    assert chord <= CHORD + 2e-4
    assert axis <= AXIS + 1e-4
    assert chord - 2e-4 <= report.position_error / MM <= CHORD
    assert axis - 1e-4 <= report.axis_error / DEG <= AXIS
    said = document(job)["left_out"]
    assert said["points"] == report.passed
    assert said["chord_mm"] == pytest.approx(chord, abs=2e-4)  # approximation comes on top
    assert said["axis_deg"] >= axis - 1e-4  # of the whole orientation, not of the axis alone


def test_a_tighter_cell_refuses_what_a_wider_one_left_out(thinned):
    toolpath, _, job = thinned
    for tight in (cell_of(chord=0.003, axis=0.02), cell_of(asked=False)):
        report = judged(job.files, tight, toolpath)
        assert {item.code for item in report.violations} & {"position", "axis"}


@pytest.mark.slow
def test_a_line_more_left_out_is_caught_where_it_matters(thinned):
    """Each line taken out of the text in turn: wrong as soon as the sampled way is off by more."""
    toolpath, cell, job = thinned
    (name, text), *others = job.files.items()
    lines = [match.span() for match in LINE.finditer(text)]
    caught = 0
    for low, high in lines[5:-2:7]:
        mutant = {name: text[:low] + text[high:], **dict(others)}
        chord, axis = farthest(mutant, toolpath)
        report = judged(mutant, cell, toolpath)
        if chord > CHORD + 1e-3 or axis > AXIS + 5e-3:
            assert not report.ok
            caught += 1
        elif chord < 0.3 * CHORD and axis < AXIS - 5e-3:  # the rest is for approximated corners
            assert report.ok, report.violations
    assert caught > 3


@pytest.mark.parametrize("spacing", [1.0, 4.0])
def test_a_tilted_tool_is_held_against_the_feed_directions_of_the_whole_file(spacing):
    """Without the points passed the feed turns otherwise, and with it where lead and side lie."""
    toolpath, cell = contour("wavy", 240, spacing, LEAN), cell_of()
    lead, side = (-5.0 * DEG, 10.0 * DEG), (-10.0 * DEG, 3.0 * DEG)
    cell = replace(cell, optimize=replace(cell.optimize, lead=lead, side_tilt=side))
    job = made(toolpath, cell)
    assert job.good, [str(finding) for finding in job.findings]
    report = judged(job.files, cell, toolpath)
    assert report.ok
    assert report.passed > 10


@pytest.mark.parametrize("style", [MotionStyle.SPLINE, MotionStyle.SPLINE_BLOCK])
def test_spline_motions_and_blocks_are_thinned_alike(style):
    toolpath = contour("wavy", 200, 1.0, LEAN)
    cell = cell_of(style=style, part=60)
    job = made(toolpath, cell)
    assert job.good
    assert judged(job.files, cell, toolpath).passed > 60
    assert farthest(job.files, toolpath)[0] <= CHORD + 2e-4


def test_where_something_is_asked_for_the_point_is_written():
    toolpath = contour("s", 300, 1.0, LEAN)
    feed = np.asarray(toolpath.feed).copy()
    feed[100:] = 0.01
    kind = np.asarray(toolpath.kind).copy()
    kind[201] = MotionKind.RAPID
    events = (Event(60, EventKind.COOLANT_ON, 1.0, "", 60), Event(151, EventKind.DWELL, 1.0, "", 1))
    toolpath = replace(toolpath, feed=feed, kind=kind, events=events)
    cell = cell_of()
    job = made(toolpath, cell)
    assert job.good, [str(finding) for finding in job.findings]
    gone = set(np.flatnonzero(job.plan.left_out).tolist())
    assert len(gone) > 100
    assert not gone & {0, 59, 99, 150, 200, 201, 299}
    assert judged(job.files, cell, toolpath).ok


def test_nothing_changes_without_the_key_and_nothing_is_said():
    toolpath, cell = contour("wavy", 120, 1.0, LEAN), cell_of(asked=False)
    job = made(toolpath, cell)
    assert not job.plan.left_out.any()
    assert document(job)["left_out"] is None
    assert "PLN309" not in {finding.code for finding in job.findings}
    assert judged(job.files, cell, toolpath).passed == 0


def test_approximation_leads_past_points_left_out_no_farther_than_they_may_be():
    """Steps of 20 mm, a point every 0.1 mm: lines pass all of them, blends of 1 mm would not."""
    toolpath = contour("s", 401, 0.1, 0.0)
    way = np.linspace(0.0, 40.0, 401) * MM
    flat = np.zeros((401, 3))
    flat[:, 0] = np.minimum(way, 20 * MM)
    flat[:, 1] = np.maximum(way - 20 * MM, 0.0)
    toolpath = replace(toolpath, points=flat, axes=np.tile([0.0, 0.0, 1.0], (401, 1)))
    cell = cell_of(chord=0.02)
    motion = replace(cell.motion, approximation=3.0 * MM, corner_tolerance=1.0 * MM)
    cell = replace(cell, motion=motion)
    job = made(toolpath, cell)
    assert job.good
    assert judged(job.files, cell, toolpath).ok
    name, text = next(iter(job.files.items()))
    told = [float(word) for word in re.findall(rb"\$APO\.CDIS=([\d.]+)", text)]
    at = 0.5 * max(told) * np.sqrt(0.5)  # of a parabola between both ends, at its middle
    assert 0.0 < at <= 0.02
    wider = re.sub(rb"\$APO\.CDIS=[\d.]+", b"$APO.CDIS=1.0", text)
    assert not judged({**job.files, name: wider}, cell, toolpath).ok


def test_a_point_given_twice_within_a_cut_is_passed_like_one_given_once():
    toolpath = contour("s", 300, 1.0, LEAN)
    again = np.sort(np.append(np.arange(300), [100, 200]))
    kind = np.asarray(toolpath.rows(again).kind).copy()
    kind[101] = MotionKind.RAPID  # to where the tool is
    twice = replace(toolpath.rows(again), kind=kind)
    cell = cell_of()
    job = made(twice, cell)
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
    report = judged(job.files, cell, twice)
    assert report.ok
    assert report.passed > 150


@pytest.mark.parametrize("step", [0.001, 0.005, 0.009])
def test_the_first_of_points_that_lie_together_is_written(step):
    """The one behind it may be passed; a motion to the first goes to both, by the tolerance."""
    toolpath = contour("s", 40, 1.0, LEAN)
    rows = np.sort(np.append(np.arange(40), 1))
    points = toolpath.points[rows].copy()
    points[2] += step * MM * (points[3] - points[2]) / np.linalg.norm(points[3] - points[2])
    kind = np.asarray(toolpath.rows(rows).kind).copy()
    kind[1] = MotionKind.RAPID
    close = replace(toolpath.rows(rows), points=points, kind=kind)
    job = made(close, cell_of())
    assert job.good, [str(finding) for finding in job.findings if finding.is_error]
    assert judged(job.files, cell_of(), close).passed > 0
