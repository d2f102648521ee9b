"""Holes in free order from the command line: any order is right, but every hole once and whole."""

import re

import pytest

LINE = re.compile(r"^LIN \{X (-?\d+\.\d+),Y (-?\d+\.\d+),Z (-?\d+\.\d+)", re.M)

FREE = """\
[optimize]
free_order = true
"""
HOLES = [(x, y) for y in (0, 60, 120) for x in (0, 150, 30, 120, 60, 90)]
PART = """\
PARTNO/PLATE
UNITS/MM
LOADTL/1
SPINDL/3000,RPM,CLW
CYCLE/DRILL,RAPTO,5,FEDTO,12,MMPM,300
{holes}
CYCLE/OFF
RAPID
GOTO/0,0,100,0,0,1
FINI
"""


@pytest.fixture
def job(tmp_path, cell, run):
    """Return folder, program text and a call of verify with a cell of free and of bound order."""
    source = tmp_path / "plate.apt"
    source.write_text(PART.format(holes="\n".join(f"GOTO/{x},{y},0,0,0,1" for x, y in HOLES)))
    free = tmp_path / "free.toml"
    free.write_text(cell.read_text() + FREE)
    code, _, err = run("convert", source, "--cell", free, "-o", tmp_path / "out", "--json")
    assert code == 0, err
    program = next((tmp_path / "out").glob("*.src"))

    def verify(with_cell=free, text=None):
        if text is not None:
            program.write_bytes(text.encode("ascii"))
        return run("verify", program, "--cell", with_cell, "--against", source, "--json")

    return program.read_bytes().decode("ascii"), verify


def kinds(report):
    return {violation["kind"] for violation in report["violations"]}


def drilled(text):
    """Return places (x, y) in the order in which the program reaches the depth of 12 mm."""
    points = [tuple(map(float, match)) for match in LINE.findall(text)]
    return [(x, y) for x, y, z in points if abs(z + 12) < 1e-3]


def test_another_order_is_right_only_where_the_cell_leaves_it_free(job, cell):
    text, verify = job
    order = drilled(text)
    assert sorted(order) == sorted((float(x), float(y)) for x, y in HOLES)
    assert order != [(float(x), float(y)) for x, y in HOLES]
    code, report, err = verify()
    assert (code, report["ok"]) == (0, True), err
    assert report["max_position_error_mm"] <= 0.01
    code, report, _ = verify(cell)
    assert code == 1
    assert kinds(report) == {"order"}


def test_a_wrong_depth_is_still_found(job):
    text, verify = job
    x, y = drilled(text)[7]
    place = rf"(LIN \{{X {x:.4f},Y {y:.4f},Z )-12\.0000"
    changed, count = re.subn(place, r"\g<1>-11.5000", text)
    assert count == 1
    code, report, _ = verify(text=changed)
    assert code == 1
    assert "depth" in kinds(report)
    assert any("0.500 mm higher" in v["detail"] for v in report["violations"])


def test_a_hole_left_out_and_one_drilled_twice(job):
    text, verify = job
    first, second = drilled(text)[7], drilled(text)[8]
    a, b = (f"X {x:.4f},Y {y:.4f}," for x, y in (first, second))
    code, report, _ = verify(text=text.replace(a, b))
    assert code == 1
    assert {"depth", "order"} <= kinds(report), "it still goes to the top of the hole left out"
    assert any("drilled 2 times" in v["detail"] for v in report["violations"])


def test_a_wrong_feed_is_still_found(job):
    text, verify = job
    changed, count = re.subn(r"\$VEL\.CP=0\.0050*\b", "$VEL.CP=0.007", text)
    assert count >= 1
    code, report, _ = verify(text=changed)
    assert code == 1
    assert "feed" in kinds(report)


def test_a_hole_that_is_reamed_is_drilled_before(tmp_path, cell, run):
    places = HOLES[:8]
    gotos = "\n".join(f"GOTO/{x},{y},0,0,0,1" for x, y in places)
    again = "CYCLE/BRKCHP,RAPTO,5,FEDTO,12,STEP,4,MMPM,300\n"
    twice = f"{gotos}\n{again}{gotos}\nCYCLE/REAM,RAPTO,5,FEDTO,8,MMPM,300\n{gotos}"
    source = tmp_path / "plate.apt"
    source.write_text(PART.format(holes=twice).replace("FEDTO,12,MMPM", "FEDTO,3,MMPM"))
    free = tmp_path / "free.toml"
    free.write_text(cell.read_text() + FREE)
    code, _, err = run("convert", source, "--cell", free, "-o", tmp_path / "out", "--json")
    assert code == 0, err
    program = next((tmp_path / "out").glob("*.src"))
    points = [tuple(map(float, match)) for match in LINE.findall(program.read_text())]
    for x, y in places:
        depths = [z for a, b, z in points if (a, b) == (x, y) and z < 0.0]
        assert depths[0] == -3.0
        assert depths[-1] == -8.0
        assert min(depths) == -12.0
        assert depths.index(-12.0) < len(depths) - 1
    code, _, err = run("verify", program, "--cell", free, "--against", source, "--json")
    assert code == 0, err
