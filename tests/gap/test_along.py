"""Measured rows on a CAM path: where along it the gap lies."""

from __future__ import annotations

import json
from types import SimpleNamespace

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cli.app import run
from postproc.errors import DataError
from postproc.gap.answers.along import along
from postproc.gap.data.dataset import make_samples
from postproc.gap.robot_model import RobotModel
from postproc.model.toolpath import Arcs, Cycle, MotionKind, Operation, ToolPath
from tests.cells import cell_text

START = np.radians([5.0, -80.0, 95.0, 20.0, 60.0, -30.0])


@pytest.fixture
def bench(tmp_path, kinematics):
    """A cell whose workpiece lies at the tool point of a pose; joints for points of the part."""
    path = tmp_path / "cell.toml"
    path.write_text(cell_text())
    T_flange_tcp = load_cell(path).tool.T_flange_tcp
    T = kinematics.fk(START[None])[0] @ T_flange_tcp
    path.write_text(cell_text(origin=tuple((1e3 * T[:3, 3]).round(6).tolist())))

    def joints(points):
        poses = np.repeat(T[None], len(points), axis=0)
        poses[:, :3, 3] += points
        q, good = kinematics.ik(poses @ np.linalg.inv(T_flange_tcp))
        gap = np.where(good, np.abs(q - START).max(axis=2), np.inf)
        return q[np.arange(len(q)), np.argmin(gap, axis=1)]

    return load_cell(path), path, joints, T[:3, 3]


def bent_path():
    """300 mm along x, a quarter turn of radius 100 mm, a hole 20 mm deep, a rapid back."""
    points = np.array([[0, 0, 0], [0.3, 0, 0], [0.4, 0.1, 0], [0.4, 0.2, 0], [0, 0, 0.05]])
    none = np.full(5, -1)
    return ToolPath(
        path="bent.apt",
        name="bent",
        format="apt",
        dialect="apt",
        units="mm",
        points=points,
        axes=np.tile([0.0, 0.0, 1.0], (5, 1)),
        kind=np.array(
            [
                MotionKind.RAPID,
                MotionKind.LINEAR,
                MotionKind.ARC,
                MotionKind.HOLE,
                MotionKind.RAPID,
            ]
        ),
        feed=np.full(5, 0.01),
        line=np.arange(1, 6),
        operation=np.array([0, 0, 0, 1, 1]),
        tool=none,
        arc=np.array([-1, -1, 0, -1, -1]),
        cycle=np.array([-1, -1, -1, 0, -1]),
        operations=(Operation("edge"), Operation("hole")),
        arcs=Arcs(
            np.array([[0.3, 0.1, 0]]),
            np.array([[0, 0, 1.0]]),
            np.array([0.1]),
            np.array([np.pi / 2]),
        ),
        cycles=(Cycle("drill", depth=0.02, clearance=0.005, retract=0.03),),
    )


def rows_at(bench, kinematics, points, ids=None):
    cell, _, joints, _ = bench
    samples = make_samples(RobotModel.of(kinematics, cell).arm, joints(np.asarray(points)))
    ids = ids or tuple(str(k) for k in range(len(points)))
    problem = SimpleNamespace(samples=samples, measurements=SimpleNamespace(ids=ids))
    return SimpleNamespace(problem=problem), cell


def test_lines_arcs_and_strokes_of_holes_are_found(bench, kinematics):
    angle = 0.7
    on_arc = [0.3 + 0.1 * np.sin(angle), 0.1 - 0.1 * np.cos(angle), 0.0]
    points = [[0.123, 0.001, 0], on_arc, [0.4, 0.2, -0.015], [0.2, 0.1, 0.025], [0.2, 0.2, 0.2]]
    found = along(*_swap(rows_at(bench, kinematics, points)))
    turn = 0.3 + 0.1 * np.pi / 2
    back = np.linalg.norm([0.4, 0.2, -0.05])
    expected = [0.123, 0.3 + 0.1 * angle, turn + 0.1, turn + 0.1 + 0.5 * back]
    np.testing.assert_allclose(found.way[:4], expected, atol=2e-6)
    assert np.isnan(found.way[4])
    assert found.tag.tolist() == [1, 2, 3, 4, -1]


def test_cuts_count_before_rapids_that_come_by(bench, kinematics):
    found = along(*_swap(rows_at(bench, kinematics, [[0.0, 0.0, 0.0]])))
    assert found.way[0] == pytest.approx(0.0, abs=1e-9)


def test_rows_far_from_the_path_are_an_error(bench, kinematics):
    with pytest.raises(DataError, match=r"bent\.apt:1: error GAP006: .* 300 mm off"):
        along(*_swap(rows_at(bench, kinematics, [[0.1, 0.0, -0.3]])))


def _swap(pair):
    return pair[0], bent_path(), pair[1]


@pytest.mark.slow
def test_the_gap_is_told_by_stretch(bench, tmp_path, capsys):
    _, path, joints, origin = bench
    rng = np.random.default_rng(1)
    way = np.sort(rng.uniform(0.0, 0.4, 80))
    points = np.column_stack([way, np.zeros(80), np.zeros(80)])
    points[0], points[-1] = [0, 0, 0], [0.3, 0.2, 0.1]
    q = np.degrees(joints(points))
    gap = np.where(way < 0.2, 2e-4, 6e-4)
    measured = 1e3 * (origin + points + gap[:, None] * [0, 0, 1] + rng.normal(0, 2e-6, (80, 3)))
    head = [*(f"q{i}_deg" for i in range(1, 7)), "x_mm", "y_mm", "z_mm"]
    lines = [",".join(f"{v:.6f}" for v in (*a, *b)) for a, b in zip(q, measured, strict=True)]
    (tmp_path / "rows.csv").write_text("\n".join([",".join(head), *lines]))
    cam = ["id,x,y,z,i,j,k,operation", "a,0,0,0,0,0,1,one", "b,200,0,0,0,0,1,one"]
    (tmp_path / "part.csv").write_text("\n".join([*cam, "c,400,0,0,0,0,1,two"]))
    call = ["diagnose", str(tmp_path / "rows.csv"), "--cell", str(path), "--json"]
    out = tmp_path / "out"
    more = ["--program", str(tmp_path / "part.csv"), "-o", str(out)]
    assert run([*call, *more]) == 0
    entry = json.loads(capsys.readouterr().out)["where"]["program"]
    assert entry["name"] == "part"
    assert entry["length_mm"] == pytest.approx(400.0)
    assert entry["rows_beside"] == 1
    stretches = entry["stretches"]
    assert sum(s["n"] for s in stretches) == entry["rows"]
    assert {s["operation"] for s in stretches} == {"one", "two"}
    for s in stretches:
        small = s["to_mm"] <= 200.0
        assert s["operation"] == ("one" if small else "two")
        assert s["line"] == (3 if small else 4) or s["from_mm"] == 0.0
        assert s["rms_mm"] == pytest.approx(0.2 if small else 0.6, abs=0.01)
        inside = (1e3 * way > s["from_mm"]) & (1e3 * way <= s["to_mm"])
        assert s["n"] <= inside.sum() + 1
    page = (out / "report.html").read_text()
    assert "Gap along the program" in page
    assert run(call) == 0
    assert "program" not in json.loads(capsys.readouterr().out)["where"]
