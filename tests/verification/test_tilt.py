"""Tilt of the tool against the CAM file: what the cell allows, and nothing more."""

from dataclasses import replace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cell.schema import TiltRange
from postproc.controller import load_program
from postproc.geometry.frames import rotation_about
from postproc.model.toolpath import Arcs, Cycle, MotionKind, ToolPath
from postproc.units import DEG
from postproc.verification.cam.elements import Arc
from postproc.verification.cam.tilt import Tilts
from postproc.verification.verify import verify
from tests.samples import CELL_TEXT

UP = np.array([0.0, 0.0, 1.0])
ALLOWED = TiltRange((-5 * DEG, 15 * DEG), (0.0, 10 * DEG), 5 * DEG)


def path_of(points, kinds, **changes):
    n = len(points)
    nothing = np.full(n, -1)
    columns = {
        "path": "p.cls", "name": "p", "format": "apt", "dialect": "nx", "units": "mm",
        "points": np.array(points, dtype=float), "axes": np.tile(UP, (n, 1)), "kind": kinds,
        "feed": np.full(n, 0.01), "line": np.arange(n) + 1, "operation": np.zeros(n),
        "tool": nothing, "arc": nothing, "cycle": nothing, "arcs": Arcs.none(),
    }  # fmt: skip
    return ToolPath(**(columns | changes))


def cell_of(tmp_path, lead="[0, 0]", side="[0, 0]"):
    file = tmp_path / "cell.toml"
    file.write_text(f"{CELL_TEXT}[optimize]\nlead_deg = {lead}\nside_tilt_deg = {side}\n")
    return load_cell(file)


def tilts_of(tmp_path, toolpath):
    return replace(Tilts.of(toolpath, cell_of(tmp_path, "[-5, 15]", "[0, 10]")), allowed=ALLOWED)


def leaning(lead, side):
    """The tool axis, into the part, with the holder leaning by two turns; feed along x."""
    tilted = rotation_about([0.0, 1.0, 0.0], np.array(lead * DEG)) @ UP
    forward = rotation_about([0.0, 1.0, 0.0], np.array(lead * DEG)) @ [1.0, 0.0, 0.0]
    return -(rotation_about(forward, np.array(side * DEG)) @ tilted)


LINE = path_of([[0, 0, 0], [0.1, 0, 0], [0.2, 0, 0]], [0, 1, 1])


@pytest.mark.parametrize(
    ("lead", "side", "error"),
    [
        (0, 0, 0), (15, 0, 0), (-5, 0, 0), (0, 10, 0), (15, 10, 0), (7, 3, 0),
        (16, 0, 1), (-7, 0, 2), (0, 10.5, 0.5), (0, -0.25, 0.25), (90, 0, 75), (180, 0, 165),
    ],
)  # fmt: skip
def test_the_error_is_what_lies_beyond_the_range(tmp_path, lead, side, error):
    found, _ = tilts_of(tmp_path, LINE).judge(np.arange(3), np.tile(leaning(lead, side), (3, 1)))
    assert found / DEG == pytest.approx(error, abs=1e-6)


def test_the_tilt_used_is_the_angle_to_the_cam_axis(tmp_path):
    _, tilt = tilts_of(tmp_path, LINE).judge(np.arange(1), leaning(12, 5)[None])
    assert np.cos(tilt[0]) == pytest.approx(np.cos(12 * DEG) * np.cos(5 * DEG), abs=1e-12)


def test_where_nothing_is_allowed(tmp_path):
    kinds = [MotionKind.RAPID, MotionKind.LINEAR, MotionKind.LINEAR, MotionKind.RAPID, 3]
    points = [[0, 0, 0.1], [0, 0, 0], [0.1, 0, 0], [0.2, 0, 0.1], [0.2, 0, 0]]
    cycles = (Cycle("drill", 0.006, 0.002, 0.01, feed=0.002),)
    toolpath = path_of(points, kinds, cycle=[-1, -1, -1, -1, 0], cycles=cycles)
    found, _ = tilts_of(tmp_path, toolpath).judge(np.arange(5), np.tile(leaning(4, 0), (5, 1)))
    assert found / DEG == pytest.approx([4, 0, 0, 4, 4], abs=1e-6)


def test_lead_goes_round_with_an_arc(tmp_path):
    arcs = Arcs(np.zeros((1, 3)), UP[None], np.ones(1), np.array([np.pi]))
    toolpath = path_of([[0, -1, 0], [0, 1, 0]], [0, 2], arc=[-1, 0], arcs=arcs)
    tilts = tilts_of(tmp_path, toolpath)
    arc = Arc(*np.asarray(toolpath.points), np.zeros(3), UP, np.pi)
    share = np.linspace(0.1, 0.9, 9)
    with_it = rotation_about(UP, np.pi * share) @ leaning(10, 0)
    assert (tilts.beyond(1, share, with_it, arc) < 1e-9).all()
    standing = np.tile(leaning(14, 0), (9, 1))
    # Half way round, what led at the start leans sideways by as much: 4 deg more than allowed.
    assert tilts.beyond(1, share, standing, arc)[4] / DEG == pytest.approx(4.0, abs=1e-6)


PROGRAM = """&ACCESS RVP
DEF P( )
BAS(#INITMOV,0)
BAS(#TOOL,1)
BAS(#BASE,1)
PTP {A1 0,A2 -60,A3 90,A4 0,A5 60,A6 0}
$VEL.CP=0.010000
%s
END
"""


def lines(*stops):
    """Path motions to (x, lead), the tool axis +x of the TCP down: B is 90 deg less the lead."""
    rows = (f"LIN {{X {x},Y 0.0,Z 0.0,A 180.0,B {90.0 - lead},C 0.0}}" for x, lead in stops)
    return "\n".join(rows)


def judged(tmp_path, body, lead, toolpath=LINE):
    src = tmp_path / "p.src"
    src.write_text(PROGRAM % body, newline="\r\n")
    (tmp_path / "p.dat").write_text("&ACCESS RVP\nDEFDAT P\nENDDAT\n", newline="\r\n")
    modules = load_program(src)
    return verify(modules, "P", cell_of(tmp_path, lead), toolpath, collisions=False)


def axis_findings(report):
    return [item for item in report.violations if item.code == "axis"]


@pytest.mark.parametrize(
    ("stops", "findings"),
    [
        ([(0, 0), (100, 0), (200, 0)], 0),
        ([(0, 5), (100, 5), (200, 2)], 0),
        ([(0, 0), (100, 5.02), (200, 0)], 1),
        ([(0, 0), (100, -0.02), (200, 0)], 1),
        # Between the tags, where no tag tells: a stop on the way, leaning too far.
        ([(0, 0), (50, 4), (100, 0), (200, 0)], 0),
        ([(0, 0), (50, 9), (100, 0), (200, 0)], 1),
    ],
)
def test_programs(tmp_path, stops, findings):
    report = judged(tmp_path, lines(*stops), "[0, 5]")
    assert len(axis_findings(report)) == findings
    most = max(min(max(lead, 0), 5) for x, lead in stops if x != 50)
    assert report.to_dict()["max_tilt_deg"] == pytest.approx(most, abs=1e-4)


def test_a_cell_without_tilt_refuses_any(tmp_path):
    report = judged(tmp_path, lines((0, 0), (100, 2), (200, 0)), "[0, 0]")
    assert len(axis_findings(report)) == 1
    assert report.to_dict()["max_axis_error_deg"] == pytest.approx(2.0, abs=1e-4)
    assert report.to_dict()["max_tilt_deg"] == 0.0
