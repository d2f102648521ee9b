"""What convert and stiffness say to a person, held against what is so."""

import json

import numpy as np
import pytest

from postproc.cell import load_cell
from postproc.cli.app import run
from postproc.kinematics import build
from tests.cells import FEED, STIFFNESS, cell_text
from tests.report.conftest import data_of

HOLES = "id,x,y,z,i,j,k,depth\n" + "".join(
    f"H{k:02d},{60 * (k % 6)},{60 * (k // 6)},0,0,0,1,10\n" for k in range(12)
)


def call(capsys, *arguments):
    code = run([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(code), out, err


@pytest.fixture
def part(tmp_path):
    (tmp_path / "holes.csv").write_text(HOLES)
    return tmp_path


HAND = '[process]\nspindle = "hand"\n'


def cell_of(folder, *tables, **changes):
    path = folder / "cell.toml"
    path.write_text(cell_text(FEED, STIFFNESS, *tables, **changes))
    return path


def test_the_program_that_is_named_is_the_one_to_start(part, capsys):
    cell = cell_of(part, "[krl]\nmax_points_per_file = 20\n", HAND)
    code, out, _ = call(capsys, "convert", part / "holes.csv", "--cell", cell, "-o", part / "out")
    assert code == 0
    assert len(list((part / "out").glob("*.src"))) > 1
    assert [row for row in out.splitlines() if row.startswith("program ")] == [
        f"program  {part / 'out' / 'holes.src'}"
    ]


@pytest.mark.causes
def test_tags_out_of_reach_are_one_sentence_with_the_move_that_frees_them(part, capsys):
    arguments = ("convert", part / "holes.csv", "-o", part / "out", "--cell")
    code, _, err = call(capsys, *arguments, cell_of(part, origin=(3700, 0, 700)))
    assert code == 1
    lines = err.splitlines()
    assert sum("error PLN101" in line for line in lines) == 5
    assert "... and 7 more of PLN101 (lines 7-13)" in lines
    first = lines[0]
    assert first.startswith("all 12 tags are out of reach: ")
    moved = -float(first.split("move the part ")[1].split(" mm towards A1")[0])
    near = cell_of(part, origin=(3700 + moved, 0, 700))
    assert call(capsys, *arguments, near)[0] == 0
    short = cell_of(part, origin=(3700 + 0.9 * moved, 0, 700))
    assert call(capsys, *arguments, short)[0] == 1


@pytest.mark.slow
@pytest.mark.causes
def test_a_hole_is_never_offered_a_tilt(part, capsys):
    (part / "holes.csv").write_text("".join(HOLES.splitlines(keepends=True)[:3]))
    box = """[[obstacles]]
name = "lid"
box = { size_mm = [1600, 1600, 100] }
xyz_mm = [1850, 30, 850]
"""
    cell = cell_of(part, box)
    code, out, err = call(
        capsys, "convert", part / "holes.csv", "--cell", cell, "-o", part / "out", "--json"
    )
    assert code == 1
    assert all(row["reason"] == "collision" for row in json.loads(out)["failures"])
    assert "tilt" not in out + err


def test_the_best_rotation_can_be_run(part, capsys):
    wall = """[[obstacles]]
name = "wall"
box = { size_mm = [100, 300, 800] }
xyz_mm = [1850, 480, 900]
"""
    arguments = ("stiffness", part / "holes.csv", "--json", "--cell")
    free = json.loads(call(capsys, *arguments, cell_of(part))[1])["tags"]
    code, out, _ = call(capsys, *arguments, cell_of(part, wall))
    beside = json.loads(out)["tags"]
    assert code == 0
    assert any(not all(tag["can_be_run"]) for tag in beside)
    for tag, alone in zip(beside, free, strict=True):
        spins = json.loads(out)["spins_deg"]
        assert tag["can_be_run"][spins.index(tag["best"]["axial"]["spin_deg"])]
        assert tag["best"]["axial"]["N_per_mm"] < alone["best"]["axial"]["N_per_mm"] + 1e-3


def test_the_page_shows_how_near_the_arm_comes(part, capsys):
    cell = cell_of(part, origin=(3700, 0, 700))
    page = part / "page.html"
    arguments = ("convert", part / "holes.csv", "--cell", cell, "-o", part / "out")
    assert call(capsys, *arguments, "--report", page)[0] == 1
    data = data_of(page.read_bytes())
    assert "no pose was planned" in data["no_spin_map"]
    kinematics = build(load_cell(cell).robot)
    for tag, pose in data["poses"].items():
        words = pose["note"]
        assert "closest the arm gets" in words
        tip = kinematics.fk(np.array(pose["q"])) @ [0.107, 0.0, 0.362, 1.0]
        x, y = 60 * (int(tag) % 6), 60 * (int(tag) // 6)
        gap = np.linalg.norm(tip[:3] * 1000 - [3700 + x, y, 700])
        assert gap == pytest.approx(float(words.split(": ")[1].split(" mm")[0]), abs=1.0)


def test_quiet_leaves_errors_and_nothing_else(part, capsys):
    arguments = ("convert", part / "holes.csv", "-o", part / "out", "--cell")
    cell = cell_of(part, origin=(3700, 0, 700))
    code, out, err = call(capsys, *arguments, cell, "--quiet")
    assert (code, out) == (1, "")
    assert "error PLN101" in err
    assert "note" not in err
    assert "warning" not in err
    assert call(capsys, *arguments, cell_of(part), "--quiet") == (0, "", "")
