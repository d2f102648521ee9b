"""The inspect document: the contract's keys, and lengths by hand."""

import json
import math
from pathlib import Path

import numpy as np
import pytest

from postproc.cell import Reading, load_cell
from postproc.cli.app import run
from postproc.jobs.convert import ConvertRequest, read_toolpath
from postproc.readers import read
from postproc.report.inspection import distinct_axes, inspection

ROOT = Path(__file__).resolve().parents[2]

KEYS = {
    "schema": str, "format": str, "dialect": str, "units": str, "points": int, "rapid_points": int,
    "arcs": int, "holes": int, "tools": int, "tool_axes": int, "box_mm": list,
    "cutting_length_mm": float, "rapid_length_mm": float, "feeds_mm_min": list,
    "unknown_words": dict, "warnings": list,
}  # fmt: skip


@pytest.fixture(scope="module")
def facts(fixtures):
    return inspection(read(fixtures / "part.apt"))


def test_the_keys_of_the_contract(fixtures, capsys):
    assert run(["inspect", str(fixtures / "part.cls"), "--json"]) == 0
    out, err = capsys.readouterr()
    document = json.loads(out)
    assert document["schema"] == "postproc.inspect/1"
    for key, kind in KEYS.items():
        assert isinstance(document[key], kind), key
    assert document["warnings"][0] == {
        "line": 1, "text": "no UNITS record: read in mm, as the feeds say", "code": "APT110",
        "count": 1,
    }  # fmt: skip
    assert "APT110" in err


def test_counts(facts):
    counts = {key: facts[key] for key in ("points", "rapid_points", "arcs", "holes", "tools",
                                          "tool_axes", "tool_changes")}  # fmt: skip
    assert counts == {"points": 17, "rapid_points": 5, "arcs": 3, "holes": 3, "tools": 2,
                      "tool_axes": 1, "tool_changes": 2}  # fmt: skip


def test_box_and_feeds(facts):
    assert facts["box_mm"] == [[0.0, 0.0, -3.0], [80.0, 70.0, 50.0]]
    assert facts["feeds_mm_min"] == [120.0, 200.0, 600.0]


def test_cutting_length_goes_along_the_arcs(facts):
    straight = 5 + 30 + 20 + 20 + 5 + 8
    arcs = 2 * math.pi / 2 * 10 + 2 * math.pi * 5
    assert facts["cutting_length_mm"] == pytest.approx(straight + arcs, abs=1e-5)


def test_rapid_length_reaches_the_holes_and_leaves_from_the_retract_height(facts):
    first = math.hypot(10, 48) + 53 + math.dist((80, 40, 50), (20, 60, 2))
    to_holes = math.dist((20, 60, 5), (10, 70, 3))
    between = 2 * math.dist((10, 70, 12), (30, 70, 3))
    away = 50 - 12
    assert facts["rapid_length_mm"] == pytest.approx(first + to_holes + between + away, abs=1e-5)


def test_a_helix_counts_its_rise(fixtures):
    toolpath = read(fixtures / "nx_modes.cls")
    arc = math.hypot(2 * math.pi * 10, 2)
    straight = 5 + 10 + 10 + 10 + 50
    assert inspection(toolpath)["cutting_length_mm"] == pytest.approx(straight + arc, abs=1e-5)


def test_axes_closer_than_a_millionth_are_one():
    tilt = np.array([0.0, 1e-7, 1e-3])
    axes = np.column_stack([np.sin(tilt), np.zeros(3), np.cos(tilt)])
    assert distinct_axes(axes) == 2


def test_text_for_people(fixtures, capsys):
    assert run(["inspect", str(fixtures / "plain_inch.apt")]) == 0
    out, err = capsys.readouterr()
    assert "AUXFUN (1), MYWORD (2)" in out
    assert "in inch" in out
    assert "warning APT151" in err
    assert run(["inspect", str(fixtures / "plain_inch.apt"), "--quiet"]) == 0
    out, err = capsys.readouterr()
    assert out == ""
    assert "error WRD001" in err
    assert "warning" not in err


def test_joint_targets_have_no_place_in_the_box(fixtures):
    facts = inspection(read(fixtures / "tasks.xml"))
    assert facts["box_mm"] == [[500.0, 0.0, 500.0], [1000.0, 2100.0, 1200.0]]
    json.dumps(facts, allow_nan=False)


def test_help_has_an_example(capsys):
    assert run(["inspect", "--help"]) == 0
    assert "postproc inspect part.cls" in capsys.readouterr().out


READS = [
    ("inspect", ["x.aptsource"]),
    ("convert", ["x.aptsource", "--cell", "c.toml", "-o", "out"]),
    ("verify", ["p.src", "--against", "x.aptsource", "--cell", "c.toml"]),
    ("batch", ["x.aptsource", "--cell", "c.toml", "-o", "out"]),
    ("stiffness", ["x.aptsource", "--cell", "c.toml"]),
    ("diagnose", ["m.csv", "--program", "x.aptsource", "--cell", "c.toml"]),
]


@pytest.mark.parametrize("name", [name for name, _ in READS])
def test_all_commands_that_read_a_cam_file_share_its_options(name, capsys):
    assert run([name, "--help"]) == 0
    out = capsys.readouterr().out
    for option in (*Reading.__annotations__, "recover"):
        assert f"--{option.replace('_', '-')}" in out


@pytest.mark.parametrize(("name", "arguments"), READS)
def test_an_unknown_format_is_one_line_with_those_known(name, arguments, capsys):
    assert run([name, *arguments, "--format", "step"]) == 2
    first = capsys.readouterr().err.splitlines()[0]
    assert "error CLI001" in first
    assert "no reader is named 'step', expected apt, auto, csv, delmia, gcode" in first


@pytest.mark.parametrize(
    "words", ["depth,clearance,-,-,dwell,feed", "depth clearance - - dwell feed"]
)
def test_a_job_reads_with_all_of_them(words, fixtures):
    """Commas or blanks: the numbers 8, 3, 12, 2, 0.5, 120 of the file's drill cycle."""
    cell = ROOT / "fixtures" / "drilling_panel" / "cell.toml"
    request = ConvertRequest(str(fixtures / "part.aptsource"), str(cell), {"cycle_words": words})
    cycle = read_toolpath(request, load_cell(cell)).cycles[0]
    found = (cycle.depth, cycle.clearance, cycle.dwell, cycle.feed)
    assert found == pytest.approx((0.008, 0.003, 0.5, 0.002))


def test_inspect_reads_as_the_cell_says(tmp_path, capsys):
    (tmp_path / "part.csv").write_text("1 2 3 10\n4 5 6 10\n")
    (tmp_path / "cell.toml").write_text(
        'schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr500_r2830"\n'
        '[import]\ncolumns = "x,y,z,depth"\nunits = "inch"\n'
    )
    call = ["inspect", str(tmp_path / "part.csv"), "--json"]
    assert run(call) == 2
    capsys.readouterr()
    assert run([*call, "--cell", str(tmp_path / "cell.toml")]) == 0
    document = json.loads(capsys.readouterr().out)
    assert (document["units"], document["holes"]) == ("inch", 2)
    assert run([*call, "--cell", str(tmp_path / "cell.toml"), "--units", "mm"]) == 0
    assert json.loads(capsys.readouterr().out)["units"] == "mm"
