"""The remedy that is named does help, and a smaller one of its kind does not."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.cell import Workpiece
from postproc.model.toolpath import Cycle, MotionKind
from postproc.planning.checks import explain
from postproc.planning.planner import plan
from postproc.units import DEG, MM

FRONT = np.array([-1.0, 0.0, 0.0])


def hole(make_path, x, axis=FRONT):
    cycles = (Cycle("drill", 0.0, 0.0, 0.0, feed=0.002),)
    return make_path([[x, 0.0, 1.0]], axis, MotionKind.HOLE, cycle=np.zeros(1, int), cycles=cycles)


@pytest.mark.usefixtures("no_scene")
def test_shift_of_the_workpiece(make_cell, make_path):
    cell, toolpath = make_cell(), hole(make_path, 3.6)
    finding = plan(toolpath, cell).errors[0]
    assert finding.code == "PLN101"
    size, axis = re.search(r"workpiece ([+-]\d+) mm along ([xyz])", finding.hint).groups()
    T = np.eye(4)
    T["xyz".index(axis), 3] = float(size) * MM
    assert not plan(toolpath, replace(cell, bases=(Workpiece(1, T),))).errors
    T["xyz".index(axis), 3] *= 0.5
    assert plan(toolpath, replace(cell, bases=(Workpiece(1, T),))).errors


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
        near = f"at tag {name} near by: remedy of {tag}"
        assert hints[tag + 1 : tag + explain.ALIKE] == [near] * (explain.ALIKE - 1)
    assert all(f"at {explain.HELPED} tags before" in hint for hint in hints[-30:])
