"""The example package is found by its entry points and keeps every contract."""

import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "docs" / "examples" / "plugin"

CELL = """\
schema = "postproc.cell/1"
[robot]
model = "kuka_kr500_r2830"
[tool]
frame = { xyz_mm = [107, 0, 362], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
"""


@pytest.fixture
def environment(tmp_path):
    """An environment in which the package counts as installed."""
    project = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
    info = tmp_path / "site" / f"postproc_example-{project['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    )
    groups = project["entry-points"].items()
    text = "".join(
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in parts.items())
        for group, parts in groups
    )
    (info / "entry_points.txt").write_text(text)
    path = os.pathsep.join([str(tmp_path / "site"), str(EXAMPLE)])
    return {**os.environ, "PYTHONPATH": path}


def call(environment, *arguments):
    return subprocess.run(
        [sys.executable, "-m", "postproc", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )


def test_the_parts_are_listed_with_their_origin(environment):
    done = call(environment, "plugins", "--json")
    assert done.returncode == 0
    text = done.stdout
    for name in ("probe", "tracker_scale", "joint_list"):
        assert f'"{name}"' in text
    assert text.count('"postproc-example"') == 3
    json.loads(text)


def test_the_reader_reads_and_refuses(environment, tmp_path):
    good = tmp_path / "points.probe"
    good.write_text("PROBE 0 0 0\nPROBE 50 0 0\nPROBE 50 50 5\n")
    done = call(environment, "inspect", str(good), "--json")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert (document["format"], document["points"]) == ("probe", 3)
    assert document["box_mm"] == [[0.0, 0.0, 0.0], [50.0, 50.0, 5.0]]
    bad = tmp_path / "bad.probe"
    bad.write_text("PROBE 0 0 0\nPROBE 50 left 0\n")
    done = call(environment, "inspect", str(bad))
    assert done.returncode == 2
    assert done.stderr.startswith(f"{bad}:2: error PRB001")


def test_its_points_become_a_program(environment, tmp_path):
    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "points.probe").write_text("PROBE 0 0 0\nPROBE 50 0 0\n")
    done = call(
        environment,
        *("convert", str(tmp_path / "points.probe"), "--cell", str(tmp_path / "cell.toml")),
        *("-o", str(tmp_path / "out")),
    )
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "points.src").is_file()


def test_the_effect_keeps_the_contract(monkeypatch):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    from postproc_example.effect import TRACKER_SCALE

    from postproc.testing import check_effect

    check_effect(TRACKER_SCALE)


def test_the_emitter_writes_the_plan(monkeypatch, tmp_path):
    monkeypatch.syspath_prepend(str(EXAMPLE))
    from postproc_example.emitter import joint_list

    from postproc.cell.file import load_cell
    from postproc.jobs.convert import ConvertRequest, make_plan, read_toolpath

    (tmp_path / "cell.toml").write_text(CELL)
    (tmp_path / "p.csv").write_text("x,y,z,i,j,k\n0,0,0,0,0,1\n50,0,0,0,0,1\n")
    request = ConvertRequest(str(tmp_path / "p.csv"), str(tmp_path / "cell.toml"))
    cell = load_cell(request.cell)
    plan = make_plan(read_toolpath(request, cell), cell, request, None)
    files = joint_list(plan, cell)
    assert files == joint_list(plan, cell)
    angles = np.array(
        [[float(v) for v in line.split()] for line in files["p.txt"].split(b"\n")[:-1]]
    )
    np.testing.assert_allclose(np.radians(angles), plan.q, atol=1e-7)
