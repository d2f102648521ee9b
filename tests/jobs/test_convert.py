"""The main job from the command line: programs, failing tags, wrong input."""

import json
import re

import numpy as np
import pytest

from postproc.jobs.convert import ConvertRequest, convert
from tests.places import PANEL

SQUARE = """\
PARTNO/SQUARE
UNITS/MM
LOADTL/1
SPINDL/9000,RPM,CLW
RAPID
GOTO/0,0,50,0,0,1
FEDRAT/600,MMPM
GOTO/0,0,0
GOTO/100,0,0
GOTO/100,80,0
CIRCLE/80,80,0,0,0,1,20
GOTO/80,100,0
GOTO/0,100,0
GOTO/0,0,0
RAPID
GOTO/0,0,50
FINI
"""

DELAYED = """\
DELAY/40
CYCLE/DRILL,FEDTO,8.,MMPM,150.,RAPTO,3.,DWELL,2.5
GOTO/100,40,0
CYCLE/OFF
FEDRAT/600,MMPM
GOTO/100,80,0"""


def write(folder, name, text):
    path = folder / name
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return path


def points_of(text):
    """Cartesian end points of the LIN and CIRC lines of a program, in mm."""
    number = r"(-?\d+\.\d+)"
    ends = re.findall(rf"^(?:LIN|CIRC .*?,)\s*\{{X {number},Y {number},Z {number}", text, re.M)
    return np.array(ends, dtype=float)


def test_a_path_becomes_a_program_that_passes_its_points(tmp_path, cell, run):
    source = write(tmp_path, "square.apt", SQUARE)
    out = tmp_path / "out"
    code, document, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    assert document["tags"] == 8
    assert document["failures"] == []
    assert document["files"] == ["square.src", "square.dat"]
    assert {p.name for p in out.iterdir()} == set(document["files"])
    text = (out / f"{document['program']}.src").read_bytes().decode("ascii")
    assert text.count("\r\n") == text.count("\n")
    ends = points_of(text)
    for wanted in [(0, 0, 0), (100, 0, 0), (100, 80, 0), (80, 100, 0), (0, 100, 0), (0, 0, 50)]:
        assert np.abs(ends - wanted).max(axis=1).min() < 1e-3
    code, report, err = run(
        "verify", out / f"{document['program']}.src", "--cell", cell, "--against", source, "--json"
    )
    assert code == 0, err
    assert report["ok"]
    assert report["max_position_error_mm"] <= 0.01
    assert report["max_axis_error_deg"] <= 0.005
    assert report["cycle_time_s"] == pytest.approx(document["cycle_time_s"], rel=1e-4)


def test_waits_count_in_the_time_of_both_commands(tmp_path, cell, run):
    times = []
    for name, text in (("a", SQUARE), ("b", SQUARE.replace("GOTO/100,80,0", DELAYED))):
        source, out = write(tmp_path, f"{name}.apt", text), tmp_path / name
        document = run("convert", source, "--cell", cell, "-o", out, "--json")[1]
        program = out / f"{document['program']}.src"
        report = run("verify", program, "--cell", cell, "--against", source, "--json")[1]
        times.append((document["cycle_time_s"], report["cycle_time_s"]))
        assert times[-1][0] == pytest.approx(times[-1][1], rel=1e-4)
    assert times[1][0] - times[0][0] > 42.5


def test_a_feed_that_no_program_may_ask_for_is_named_before_planning(tmp_path, cell, run):
    text = SQUARE.replace("FEDRAT/600,", "FEDRAT/300000,")
    source = write(tmp_path, "square.apt", text)
    code, document, err = run("convert", source, "--cell", cell, "-o", tmp_path / "o", "--json")
    assert code == 1
    assert err.count("PRC003") == 1
    assert "square.apt:8: error PRC003: a feed of 5 m/s at 6 tags" in err
    assert not (tmp_path / "o").exists() or not list((tmp_path / "o").iterdir())
    assert document["timing_s"]["plan"] < 1.0


def test_the_same_input_gives_the_same_bytes(tmp_path, cell, run):
    source = write(tmp_path, "square.apt", SQUARE)
    for folder in ("one", "two"):
        assert run("convert", source, "--cell", cell, "-o", tmp_path / folder, "--quiet")[0] == 0
    one, two = ({p.name: p.read_bytes() for p in (tmp_path / f).iterdir()} for f in ("one", "two"))
    assert one == two
    assert all(b"\r\n" in content for content in one.values())


@pytest.mark.slow
def test_the_panel_converts_with_its_page(tmp_path, run):
    code, document, err = run(
        "convert", PANEL / "panel.csv", "--cell", PANEL / "cell.toml", "-o", tmp_path / "out",
        "--report", tmp_path / "page.html", "--json",
    )  # fmt: skip
    assert code == 0, err
    assert document["tags"] == 240
    stiffness = document["stiffness"]
    assert stiffness["mean_N_per_mm"] > stiffness["initial_mean_N_per_mm"]
    page = (tmp_path / "page.html").read_text()
    assert page.count("R12H20") >= 1
    assert not re.search(r"(src|href)=[\"']https?:", page)
    data = json.loads(re.search(r'id="data">(.*?)</script>', page, re.S)[1])
    assert "R12H20" in json.dumps(data)
    assert {body["kind"] for body in data["bodies"]} >= {"link", "tool", "workpiece", "obstacle"}


def test_unreachable_tags_are_named_with_their_lines_and_nothing_is_written(tmp_path, cell, run):
    source = write(tmp_path, "far.csv", "x,y,z,i,j,k\n0,0,0,0,0,1\n9000,0,0,0,0,1\n10,0,0,0,0,1\n")
    out = tmp_path / "out"
    code, document, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    assert code == 1
    assert [(f["tag"], f["line"], f["reason"]) for f in document["failures"]] == [
        (1, 3, "unreachable")
    ]
    assert not out.exists() or not list(out.iterdir())
    assert f"{source}:3: error PLN101" in err


def test_a_colliding_fixture_is_named(tmp_path, cell, run):
    with cell.open("a") as stream:
        stream.write(
            "[[tool.meshes]]\ncylinder = { radius_mm = 40, length_mm = 200 }\n"
            "xyz_mm = [0, 0, 362]\nabc_deg = [0, 90, 0]\n"
            '[[obstacles]]\nname = "clamp"\nbox = { size_mm = [400, 400, 400] }\n'
            "xyz_mm = [1700, 0, 900]\nabc_deg = [0, 0, 0]\n"
        )
    source = write(tmp_path, "hole.csv", "x,y,z,i,j,k,depth\n0,0,0,0,0,1,5\n")
    code, document, _ = run("convert", source, "--cell", cell, "-o", tmp_path / "out", "--json")
    assert code == 1
    assert document["failures"][0]["reason"] == "collision"
    assert "clamp" in document["failures"][0]["detail"]


def test_partial_writes_the_good_stretches(tmp_path, cell, run):
    rows = "".join(f"{x},0,0,0,0,1,5\n" for x in (0, 50, 9000, 100, 150))
    source = write(tmp_path, "some.csv", "x,y,z,i,j,k,depth\n" + rows)
    out = tmp_path / "out"
    code, document, _ = run("convert", source, "--cell", cell, "-o", out, "--partial", "--json")
    assert code == 1
    assert [f["tag"] for f in document["failures"]] == [2]
    text = (out / f"{document['program']}.src").read_text()
    assert len(re.findall(r"^PTP \{A1", text, re.M)) >= 2


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("empty.apt", b""),
        ("binary.apt", bytes(range(256)) * 40),
        ("cut.apt", SQUARE.encode()[:130]),
        ("nan.csv", b"x,y,z,i,j,k\n0,0,nan,0,0,1\n"),
        ("inf.csv", b"x,y,z,i,j,k\n0,0,inf,0,0,1\n"),
        ("huge.csv", b"x,y,z,i,j,k\n0,0,1e308,0,0,1\n"),
        ("zero.csv", b"x,y,z,i,j,k\n0,0,0,0,0,0\n"),
        ("no_motion.apt", b"PARTNO/X\nUNITS/MM\nFINI\n"),
        ("bad.xml", b"<OLPData><Resource"),
    ],
)
def test_wrong_input_is_one_line_and_no_file(tmp_path, cell, run, name, content):
    source = write(tmp_path, name, content)
    out = tmp_path / "out"
    code, document, err = run("convert", source, "--cell", cell, "-o", out, "--json")
    assert (code, document["schema"]) == (2, "postproc.error/1")
    assert re.match(rf"{re.escape(str(source))}:\d+: error [A-Z]+\d+: .+", err.splitlines()[0])
    assert "Traceback" not in err
    assert not out.exists()


def test_an_inch_file_read_as_mm_is_not_silent(tmp_path, cell, run):
    source = write(tmp_path, "inch.apt", SQUARE.replace("UNITS/MM", "UNITS/INCH"))
    code, document, _ = run("convert", source, "--cell", cell, "-o", tmp_path / "o", "--json")
    assert code == 1
    assert {f["reason"] for f in document["failures"]} <= {
        "unreachable",
        "joint_limit",
        "singular",
        "check",
    }


def test_a_feed_that_nobody_gives_is_an_error(tmp_path, cell, run):
    cell.write_text(cell.read_text().replace("feed_mm_min = 600\n", ""))
    source = write(tmp_path, "nofeed.apt", SQUARE.replace("FEDRAT/600,MMPM\n", ""))
    code, _, err = run("convert", source, "--cell", cell, "-o", tmp_path / "o", "--json")
    assert code in (1, 2)
    assert "feed" in err


def test_every_stage_is_named_before_it_runs(tmp_path, cell):
    told = []
    request = ConvertRequest(str(write(tmp_path, "square.cls", SQUARE)), str(cell))
    result = convert(request, lambda done, total, what: told.append((done, total, what)))
    assert result.good
    stages = ["read", "plan", "place", "search", "refine", "route", "emit", "check"]
    assert list(dict.fromkeys(what for _, _, what in told)) == stages
    # where nobody knows how much there is to do, none of it is said to be done
    assert all(done <= total for done, total, _ in told)
    assert list(result.timing) == ["read", "plan", "emit", "check", "total"]
