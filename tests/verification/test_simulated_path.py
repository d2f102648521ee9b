"""The simulated path of a program: at its points the tool stands where the CAM file has it."""

import csv
import json

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli import app
from postproc.geometry import inverse, transform_from_kuka
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.kinematics import build
from tests.places import FIXTURES

PROGRAMS = {
    "trim_5axis": ("trim.src", "trim.cls"),
    "rail_milling": ("skin.src", "skin.cls"),
    "turntable": ("ring.src", "ring.csv"),
    "tool_changes": ("PLATE_7.src", "plate.apt"),
}


def files(name):
    program, source = PROGRAMS[name]
    folder = FIXTURES / name
    return folder / "expected" / program, folder / source, folder / "cell.toml"


@pytest.fixture(scope="module", params=PROGRAMS)
def simulated(request, tmp_path_factory):
    program, source, cell = map(str, files(request.param))
    out = tmp_path_factory.mktemp(request.param)
    call = ["verify", program, "--cell", cell, "--against", source, "--quiet", "--path"]
    for suffix in ("csv", "json"):
        assert app.run([*call, str(out / f"p.{suffix}")]) == 0
    rows = list(csv.DictReader((out / "p.csv").read_text().splitlines()))
    same = json.loads((out / "p.json").read_text())["rows"]
    known = load_cell(cell)
    return rows, same, known, read_toolpath(ConvertRequest(source, cell), known)


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def test_json_and_csv_say_the_same(simulated):
    rows, same, *_ = simulated
    assert rows == [{k: "" if v is None else str(v) for k, v in row.items()} for row in same]


def test_time_runs_and_joints_go_in_steps(simulated):
    rows, *_ = simulated
    time = column(rows, "time_s")
    assert (np.diff(time) >= 0.0).all()
    q = np.stack([column(rows, f"q{k}_deg") for k in range(1, 7)], axis=1)
    assert np.abs(np.diff(q, axis=0)).max() < 15.0
    assert (column(rows, "margin_deg") > 0.0).all()
    assert (column(rows, "speed_mm_s") < 4000.0).all()


def test_the_tool_is_where_the_joints_put_it(simulated):
    rows, _, cell, _ = simulated
    if len(cell.bases) > 1 or cell.external_axes or len(cell.tools) > 1:
        return
    q = np.deg2rad(np.stack([column(rows, f"q{k}_deg") for k in range(1, 7)], axis=1))
    expected = inverse(cell.T_robroot_base) @ build(cell.robot).fk(q) @ cell.tool.T_flange_tcp
    for row, T in zip(rows, expected, strict=True):
        xyz, abc = (
            [float(row[f"{n}_{u}"]) for n in names] for names, u in (("xyz", "mm"), ("abc", "deg"))
        )
        assert np.allclose(transform_from_kuka(xyz, abc), T, atol=1e-6)


def test_at_a_tag_the_tool_is_on_its_point(simulated):
    rows, *_, toolpath = simulated
    names = {toolpath.tag_name(k): k for k in range(len(toolpath))}
    seen = 0
    for row in rows:
        for name in row["tag"].split():
            point = np.array([float(row[f"{n}_mm"]) for n in "xyz"]) / 1e3
            tag = names[name]
            along = np.asarray(toolpath.axes[tag])
            off = point - toolpath.points[tag]
            assert np.linalg.norm(off - along * float(off @ along)) < 1e-5, row
            seen += 1
    assert seen >= len(toolpath) // 2


def test_another_ending_is_refused_before_anything_is_done(capfd):
    program, _, cell = map(str, files("trim_5axis"))
    assert app.run(["verify", program, "--cell", cell, "--path", "p.txt"]) == 2
    assert "CLI015" in capfd.readouterr().err
