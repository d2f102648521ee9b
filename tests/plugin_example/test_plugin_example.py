"""The example package, as if it were installed: every part is used and keeps its contract."""

import importlib
import json
import os
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

import postproc
from postproc.cell import load_cell
from postproc.kinematics import build
from postproc.testing import check_effect, check_emitter, check_objective, check_reader
from tests.cells import FEED, STIFFNESS, cell_text

EXAMPLE = Path(__file__).resolve().parents[2] / "docs" / "examples" / "plugin"
PROJECT = tomllib.loads((EXAMPLE / "pyproject.toml").read_text())["project"]
PARTS = {
    (group.removeprefix("postproc."), name): place
    for group, parts in PROJECT["entry-points"].items()
    for name, place in parts.items()
}
POINTS = "PROBE 0 0 0\nPROBE 50 0 0\nPROBE 50 50 5\n"
HOLES = "id,x,y,z,i,j,k\na,0,0,0,0,0,1\nb,50,0,0,0,0,1\nc,50,40,0,0,0,1\n"


@pytest.fixture
def installed(tmp_path):
    """Return a function that calls the command line where the package counts as installed."""
    info = tmp_path / "site" / f"postproc_example-{PROJECT['version']}.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {PROJECT['name']}\nVersion: {PROJECT['version']}\n"
    )
    lines = [f"[postproc.{group}]\n{name} = {place}" for (group, name), place in PARTS.items()]
    (info / "entry_points.txt").write_text("\n".join(lines))
    places = (tmp_path / "site", EXAMPLE, Path(postproc.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, places))}

    def call(*arguments):
        return subprocess.run(
            [sys.executable, "-m", "postproc", *map(str, arguments)],
            env=environment,
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )

    return call


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    path.write_text(cell_text(FEED, STIFFNESS))
    return path


@pytest.fixture
def part(monkeypatch):
    """Return a function: an entry point's part."""
    monkeypatch.syspath_prepend(str(EXAMPLE))

    def load(*key):
        module, name = PARTS[key].split(":")
        return getattr(importlib.import_module(module), name)

    return load


def test_one_part_of_each_kind_is_listed_with_its_origin(installed):
    done = installed("plugins", "--json")
    assert done.returncode == 0
    assert done.stderr == ""
    ours = [p for p in json.loads(done.stdout)["plugins"] if p["origin"] == PROJECT["name"]]
    assert {(p["group"], p["name"]) for p in ours} == set(PARTS)
    assert [p["group"] for p in ours] == ["readers", "emitters", "effects", "objectives"]
    assert all(p["version"] == PROJECT["version"] and p["problem"] is None for p in ours)


def test_every_part_keeps_its_contract(part, tmp_path):
    (tmp_path / "points.probe").write_text(POINTS)
    check_reader(part("readers", "probe"), tmp_path / "points.probe")
    check_emitter(part("emitters", "joint_list"))
    check_effect(part("effects", "rail_wave"))
    check_objective(part("objectives", "low_arm"))


def test_its_reader_is_found_by_content_and_by_name(installed, tmp_path):
    (tmp_path / "points.probe").write_text(POINTS)
    for form in ((), ("--format", "probe")):
        done = installed("inspect", "points.probe", "--json", *form)
        assert done.returncode == 0, done.stderr
        document = json.loads(done.stdout)
        assert (document["format"], document["points"]) == ("probe", 3)
        assert document["box_mm"] == [[0.0, 0.0, 0.0], [50.0, 50.0, 5.0]]
    (tmp_path / "bad.probe").write_text("PROBE 0 0 0\nPROBE 50 left 0\n")
    done = installed("inspect", "bad.probe")
    assert done.returncode == 2
    assert done.stderr.startswith("bad.probe:2: error PRB001")


def test_what_it_reads_becomes_a_kuka_program(installed, tmp_path, cell):
    (tmp_path / "points.probe").write_text(POINTS)
    done = installed("convert", "points.probe", "--cell", cell, "-o", "out", "--format", "probe")
    assert done.returncode == 0, done.stderr
    program = (tmp_path / "out" / "points.src").read_text()
    assert program.count("LIN") >= 2


def test_its_reader_names_the_files_that_a_batch_takes(installed, tmp_path, cell):
    (tmp_path / "parts").mkdir()
    (tmp_path / "parts" / "points.probe").write_text(POINTS)
    done = installed("batch", "parts", "--cell", cell, "-o", "out", "--jobs", "1")
    assert done.returncode == 0, done.stderr
    assert (tmp_path / "out" / "points.src").is_file()
    version = json.loads((tmp_path / "out" / "manifest.json").read_text())
    assert "postproc-example 0.1.0" in json.dumps(version)


@pytest.mark.parametrize("way", ["call", "cell"])
def test_its_emitter_writes_what_convert_lands(installed, tmp_path, cell, way):
    """The angles in the file are those at which the nominal arm has its tool on the points."""
    (tmp_path / "holes.csv").write_text(HOLES)
    more = ("--emitter", "joint_list")
    if way == "cell":
        cell.write_text(cell.read_text() + '[krl]\nemitter = "joint_list"\n')
        more = ()
    call = ("convert", "holes.csv", "--cell", cell, "-o", "out", "--json", "--report", "page.html")
    done = installed(*call, *more)
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["files"] == ["holes.txt"]
    assert document["failures"] == []
    assert [p.name for p in (tmp_path / "out").iterdir()] == ["holes.txt"]
    assert (tmp_path / "page.html").stat().st_size > 10_000
    lines = [line.split() for line in (tmp_path / "out" / "holes.txt").read_text().splitlines()]
    angles = np.radians(
        [[float(text) for text in line[1:7]] for line in lines if line[0] != "WAIT"]
    )
    loaded = load_cell(cell)
    tcp = (build(loaded.robot).fk(angles) @ loaded.tool.T_flange_tcp)[:, :3, 3]
    for point in ((1.7, 0.0, 0.7), (1.75, 0.0, 0.7), (1.75, 0.04, 0.7)):
        assert np.linalg.norm(tcp - point, axis=1).min() < 1e-6


def test_what_its_emitter_cannot_write_is_refused_by_name(installed, tmp_path, cell):
    (tmp_path / "mill.apt").write_text(
        "UNITS/MM\nSPINDL/9000,RPM,CLW\nFEDRAT/600,MMPM\nGOTO/0,0,0,0,0,1\nGOTO/50,0,0\nFINI\n"
    )
    done = installed("convert", "mill.apt", "--cell", cell, "-o", "out", "--emitter", "joint_list")
    assert done.returncode == 2
    assert done.stderr.startswith("mill.apt:2: error EXM003: no spindle_on")
    assert not (tmp_path / "out").exists()


def test_its_emitter_has_no_program_that_runs_others(installed, tmp_path, cell):
    (tmp_path / "holes.csv").write_text(HOLES)
    call = ("batch", "holes.csv", "--cell", cell, "-o", "out", "--split", "count:2", "--jobs", "1")
    done = installed(*call, "--emitter", "joint_list")
    assert done.returncode == 1
    assert "BAT042" in done.stderr
    assert not list((tmp_path / "out").glob("*.txt"))


def test_its_effect_is_adopted_where_it_is_the_cause(installed, tmp_path, cell):
    """Rows of the nominal arm, read by a tracker whose heights wave by 0.3 mm, and noise."""
    loaded = load_cell(cell)
    rng = np.random.default_rng(5)
    low, high = np.radians([-40, -90, 40, -90, -80, -90]), np.radians([40, -40, 110, 90, -20, 90])
    q = rng.uniform(low, high, (160, 6))
    xyz = (build(loaded.robot).fk(q) @ loaded.tool.T_flange_tcp)[:, :3, 3] * 1000.0
    xyz[:, 2] += 0.3 * np.sin(2.0 * np.pi * xyz[:, 0] / 500.0 + 0.6)
    xyz += rng.normal(scale=0.02, size=xyz.shape)
    head = ",".join([*(f"q{k}_deg" for k in range(1, 7)), "x_mm", "y_mm", "z_mm", "sigma_mm"])
    rows = np.column_stack([np.degrees(q), xyz, np.full(len(q), 0.02)])
    np.savetxt(tmp_path / "rows.csv", rows, delimiter=",", header=head, comments="", fmt="%.6f")
    done = installed("diagnose", "rows.csv", "--cell", cell, "--json", "-o", "out")
    assert done.returncode == 0, done.stderr
    document = json.loads(done.stdout)
    assert document["adopted"] == ["rail_wave"]
    assert document["verdict"] == "explained"
    found = document["effects"][0]
    assert found["name"] == "rail_wave"
    assert found["parameters"]["sine_mm"] == pytest.approx(0.3 * np.cos(0.6), abs=0.01)
    assert found["parameters"]["cosine_mm"] == pytest.approx(0.3 * np.sin(0.6), abs=0.01)
    assert "[instrument.rail_wave]" in (tmp_path / "out" / "model.toml").read_text()
    assert installed("predict", "rows.csv", "--cell", cell, "--model", "out/model.toml",
                     "-o", "points.csv").returncode == 0  # fmt: skip


def test_its_objective_changes_what_is_chosen(installed, tmp_path, cell):
    (tmp_path / "holes.csv").write_text(HOLES)
    programs = {}
    for objective in ("normal", "low_arm"):
        call = ("convert", "holes.csv", "--cell", cell, "-o", objective, "--objective", objective)
        done = installed(*call)
        assert done.returncode == 0, done.stderr
        programs[objective] = (tmp_path / objective / "holes.src").read_text()
    assert programs["normal"] != programs["low_arm"]
