"""The remedy that is named does help, and a smaller one of its kind does not."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.cell.file import parse_cell
from postproc.model.toolpath import Cycle, MotionKind
from postproc.planning.checks import explain
from postproc.planning.planner import plan
from postproc.units import DEG
from tests.cells import STIFFNESS, cell_text
from tools.bench.contours import SOLIDS

FRONT = np.array([-1.0, 0.0, 0.0])


def hole(make_path, x, axis=FRONT):
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    return make_path([[x, 0.0, 1.0]], axis, MotionKind.HOLE, cycle=np.zeros(1, int), cycles=cycles)


@pytest.mark.usefixtures("no_scene")
def test_more_spin(make_cell, make_path):
    toolpath = hole(make_path, 2.4)
    wide = plan(toolpath, make_cell())
    assert not wide.errors
    away = wide.spin[0] + np.pi
    narrow = make_cell(optimize={"range": (away - 1.0 * DEG, away + 1.0 * DEG)})
    finding = plan(toolpath, narrow).errors
    if finding:
        assert "widen range_deg" in finding[0].hint


@pytest.mark.usefixtures("no_scene")
def test_remedies_of_many_failing_tags_are_looked_for_a_few_times_only(
    make_cell, make_path, monkeypatch
):
    n = explain.ALIKE * explain.HELPED + 30
    points = np.column_stack([np.full(n, 3.6), np.linspace(-0.1, 0.1, n), np.full(n, 1.0)])
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    toolpath = make_path(points, FRONT, MotionKind.HOLE, cycle=np.zeros(n, int), cycles=cycles)
    asked = []

    def counted(checker, tag, reason):
        asked.append(tag)
        return f"remedy of {tag}"

    monkeypatch.setattr(explain, "remedy", counted)
    findings = plan(toolpath, make_cell()).errors
    assert len(findings) == n
    assert asked == list(range(0, explain.ALIKE * explain.HELPED, explain.ALIKE))
    hints = [finding.hint for finding in findings]
    for tag in asked:
        name = toolpath.tag_name(tag)
        assert hints[tag] == f"remedy of {tag}"
        near = f"at tag {name} nearby: remedy of {tag}"
        assert hints[tag + 1 : tag + explain.ALIKE] == [near] * (explain.ALIKE - 1)
    assert all(f"at {explain.HELPED} earlier tags" in hint for hint in hints[-30:])


def under_beam(height, approach):
    """A cell in which a beam stands above the end of a cut of 300 mm, so high [mm] over it."""
    beam = (
        '[[obstacles]]\nname = "beam"\nbox = { size_mm = [60, 60, 60] }\n'
        f"xyz_mm = [1900, 300, {700 + height}]\n"
    )
    motion = f"[motion]\nhome_deg = [0, -90, 90, 0, 45, 0]\napproach_mm = {approach}\n"
    text = cell_text(beam, STIFFNESS, motion, tool=SOLIDS, origin=(1900, 0, 700))
    return parse_cell(text.encode(), "beam.toml")


@pytest.mark.slow
@pytest.mark.parametrize("height", [280, 300])
def test_the_end_of_a_cut_that_the_tool_cannot_come_away_from(make_path, height):
    """The head, 227 mm high, stands free at every spin; it hits the beam when it backs off."""
    n = 16
    points = np.column_stack([np.zeros(n), np.linspace(0.0, 0.3, n), np.zeros(n)])
    kind = np.full(n, MotionKind.LINEAR)
    kind[0] = MotionKind.RAPID
    toolpath = make_path(points, [0.0, 0.0, 1.0], kind, feed=np.full(n, 0.02))
    finding = plan(toolpath, under_beam(height, 50)).errors[0]
    assert (finding.code, finding.tag_index) == ("PLN104", n - 1)
    assert "cannot leave the cut" in finding.hint
    assert "lower [motion] approach_mm" in finding.hint
    assert not plan(toolpath, under_beam(height, 10)).errors


@pytest.mark.slow
def test_a_spin_that_is_named_serves_the_whole_stroke(make_path):
    """Beside a beam over the hole the tool stands free, but not where its stroke begins."""
    cycles = (Cycle("drill", 0.0, 0.0, 0.05, feed=0.002),)
    toolpath = make_path(
        [[0.0, 0.3, 0.0]], [0.0, 0.0, 1.0], MotionKind.HOLE, cycle=np.zeros(1, int), cycles=cycles
    )
    finding = plan(toolpath, under_beam(290, 50)).errors[0]
    assert finding.code == "PLN104"
    assert "not all along its stroke" in finding.hint


@pytest.mark.usefixtures("no_scene")
def test_why_the_tool_cannot_leave_a_cut_is_told(make_cell, make_path):
    """Higher and higher under the end of reach: at first the way out fails, not the cut."""
    cell = make_cell(motion={"home_deg": [0, -90, 90, 0, 45, 0]})
    for z in np.arange(2.6, 4.0, 0.02):
        points = [[1.5, y, z] for y in (0.0, 0.01, 0.02)]
        found = plan(make_path(points, [0.0, 0.0, 1.0]), cell)
        if found.errors:
            break
    way_in, error = found.errors
    assert "the tool cannot come down along its axis" in way_in.message
    assert "the tool cannot back off along its axis" in error.message
    assert error.code in {"PLN101", "PLN102", "PLN103"}  # there is nothing to collide with
    height = int(error.hint.rsplit("approach_mm to ", 1)[1])
    assert 0 < height < 50
    lower = make_cell(motion={"home_deg": [0, -90, 90, 0, 45, 0], "approach_mm": height})
    assert not plan(make_path(points, [0.0, 0.0, 1.0]), lower).errors
