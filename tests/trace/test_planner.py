"""Corners and feeds of a planner of its own, against the program that it was given."""

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.controller import load_program
from postproc.kinematics import build
from postproc.trace import of_program
from postproc.trace.planner import feed, rounding
from postproc.trace.program import matched
from postproc.trace.recording import Recording
from postproc.trace.scene import Scene
from tools.blind.robots import KR500, cell_text
from tools.blind.traces.cases import program_text
from tools.blind.traces.robot import Path, fk, ik

START = np.deg2rad(KR500.start_deg)


ZIGZAG = [[0, 0, 0], [80, 0, 0], [80, 60, 0], [20, 90, 10], [-40, 40, 0], [60, -30, 0]]
STAIRS = [[40 * ((k + 1) // 2), 40 * (k // 2), 0] for k in range(7)]


@pytest.mark.parametrize(
    ("steps", "cdis", "form", "factor", "speeds"),
    [
        (ZIGZAG, 0.004, "parabola", 1.0, (0.1, 2.0)),
        (ZIGZAG, 0.008, "arc", 0.8, (0.1, 2.0)),
        (ZIGZAG, 0.0, "arc", 1.0, (0.1, 2.0)),
        # a rounded corner has one speed for a while, and it is not the feed
        (ZIGZAG, 0.01, "parabola", 0.87, (0.2, 1.0)),
        (STAIRS, 0.01, "parabola", 1.0, (0.2, 1.0)),
    ],
)
def test_rounding_and_feed(steps, cdis, form, factor, speeds, tmp_path):
    at = fk(KR500.arm, KR500.tool, START[None])[0][0]
    way = Path(at + 1e-3 * np.array(steps, float), cdis, form, *speeds)
    time, points = way.timed()
    time, points = time[::4], points[::4]
    q = ik(KR500.arm, KR500.tool, START, points)
    (tmp_path / "cell.toml").write_text(cell_text(KR500, None), encoding="utf-8")
    (tmp_path / "program.src").write_text(program_text(way, KR500, START, factor), encoding="utf-8")
    cell = load_cell(tmp_path / "cell.toml")
    kinematics = build(cell.robot)
    tool = cell.tool.T_flange_tcp[:3, 3]
    nothing = np.zeros(len(time), dtype=np.int32)
    scene = Scene(Recording("log", time, nothing, nothing, q), kinematics, tool)
    modules = load_program(tmp_path / "program.src", on_controller=True)
    match = matched(scene, of_program(modules, cell, kinematics, tool))
    found, speed = rounding(scene, match), feed(scene, match)
    assert (found.probability > 0.9) == (cdis > 0.0)
    if cdis:
        assert found.parameters["form"] == form
        assert found.parameters["cdis_mm"] == pytest.approx(1e3 * cdis, rel=0.02)
        assert found.parameters["apo_cdis_mm"] == pytest.approx(1e3 * cdis)
    if factor == 1.0:
        assert speed is None or speed.probability < 0.1
    else:
        assert speed.probability > 0.9
        assert speed.parameters["factor"] == pytest.approx(factor, rel=0.005)
