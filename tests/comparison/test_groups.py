"""The first line of a comparison says what the engineer did."""

import json
import re
import xml.etree.ElementTree as ET

import pytest

from postproc.cli.app import run

pytestmark = pytest.mark.usefixtures("batch_here")
CELL = """schema = "postproc.cell/1"
[robot]
model = "kuka_kr210_r2700_2"
[tool]
number = {tool}
frame = {{ xyz_mm = [{length}, 0, 250] }}
axis = "+x"
[workpiece]
number = {base}
frame = {{ xyz_mm = [{x}, -60, 700] }}
[process]
spindle = "unit"
[motion]
{home}
[krl]
setup = {setup}
cam_lines = {cam_lines}
max_points_per_file = {most}
"""
PLAIN = {"tool": 1, "length": 150, "base": 1, "x": 1400, "home": "", "setup": "false", "most": 500}
ROWS = [(f"{'ABC'[k // 4]}{k % 4 + 1}", k % 4 * 60, k // 4 * 50, 12, 120) for k in range(12)]
HOME = "home_deg = [0, -90, 90, 0, 30, 0]"


def edited(name, **changes):
    keys = ("id", "x", "y", "depth", "feed")
    rows = []
    for row in ROWS:
        values = dict(zip(keys, row, strict=True))
        rows.append(tuple((values | changes).values()) if row[0] == name else row)
    return rows


def swapped(a, b):
    rows = list(ROWS)
    rows[a], rows[b] = rows[b], rows[a]
    return rows


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Return a function that converts rows in a cell, once."""
    known = {}

    def make(rows=ROWS, cam_lines="true", **cell):
        key = tuple(rows), cam_lines, tuple(sorted(cell.items()))
        if key not in known:
            folder = tmp_path_factory.mktemp("part")
            (folder / "cell.toml").write_text(CELL.format(**(PLAIN | cell), cam_lines=cam_lines))
            lines = ["id,x,y,z,i,j,k,depth,feed"]
            lines += [f"{n},{x},{y},0,0,0,1,{depth},{feed}" for n, x, y, depth, feed in rows]
            (folder / "panel.csv").write_text("\n".join(lines) + "\n")
            arguments = ["convert", folder / "panel.csv", "--cell", folder / "cell.toml"]
            assert run([*map(str, arguments), "-o", str(folder / "out"), "-q"]) == 0
            known[key] = folder / "out"
        return known[key]

    return make


def answer(capsys, *arguments):
    capsys.readouterr()
    code = run([str(argument) for argument in arguments])
    return code, capsys.readouterr().out


# what the engineer did, and the beginning of the first line
EDITS = {
    "one hole moved": (
        {"rows": edited("B2", x=65)},
        "moved: B2 moved by (5, 0, 0) mm; 0 mm along and 5 mm",
    ),
    "all holes moved": (
        {"rows": [(n, x, y + 5, d, f) for n, x, y, d, f in ROWS]},
        "moved: 12 holes moved, all by (0, 5, 0) mm",
    ),
    "added": (
        {"rows": [*ROWS[:5], ("N1", 30, 25, 12, 120), *ROWS[5:]]},
        "added: 1 hole added: N1, at (30, 25, -12)",
    ),
    "removed": (
        {"rows": [*ROWS[:6], *ROWS[7:]]},
        "removed: 1 hole removed: B3, at (120, 50, -12)",
    ),
    "the first one removed": ({"rows": ROWS[1:]}, "removed: 1 hole removed: A1"),
    "the last two removed": ({"rows": ROWS[:-2]}, "removed: 2 holes removed: C3, C4"),
    "one feed": (
        {"rows": edited("C2", feed=90)},
        "process: feed 120 became 90 mm/min: C2",
    ),
    "all feeds": (
        {"rows": [(*row[:4], 150) for row in ROWS]},
        "process: feed 120 became 150 mm/min: A1, A2",
    ),
    "one depth": (
        {"rows": edited("C2", depth=14)},
        "process: depth +2 mm along the tool: C2",
    ),
    "two swapped": (
        {"rows": swapped(5, 7)},
        "order: B2 and B4 swapped, same holes",
    ),
    "order turned round": ({"rows": ROWS[::-1]}, "order: "),
    "tool number": ({"tool": 3}, "cell: tool 1 became 3: all 48 motions"),
    "base number": ({"base": 2}, "cell: base 1 became 2: all 48 motions"),
    "a home": ({"home": HOME}, "cell: a home at both ends, (0, -90, 90, 0, 30, 0) deg"),
    "base moved": (
        {"x": 1405},
        "cell: base 1 moved by (5, 0, 0) mm: 48 motions with it",
    ),
    "tool length": (
        {"length": 160},
        "cell: tool 1 moved by (10, 0, 0) mm: 48 motions with it",
    ),
}


@pytest.mark.slow
def test_the_first_line_says_what_was_done(made, capsys):
    failures = []
    for name, (edit, expected) in EDITS.items():
        code, out = answer(capsys, "diff", made() / "panel.src", made(**edit) / "panel.src")
        lines = out.splitlines()
        head = [line for line in lines if line.startswith("different: ")]
        if code != 1 or not lines[0].startswith(expected) or lines.index(head[0]) > 10:
            failures.append((name, lines[:3]))
    assert not failures


def test_what_the_set_up_module_enters(made, capsys):
    for edit, expected in (
        ({"x": 1405}, "BASE_DATA[1] moved by (5, 0, 0) mm"),
        ({"length": 160}, "TOOL_DATA[1] moved by (10, 0, 0) mm"),
    ):
        folders = made(setup="true"), made(setup="true", **edit)
        assert expected in "".join(answer(capsys, "diff", *folders)[1].splitlines()[:2])


@pytest.mark.parametrize(
    ("most", "tried"),
    [(500, ("added", "base", "tool")), (10, ("moved", "removed", "swap", "tool"))],
)
def test_what_the_manifest_knows(tmp_path, capsys, most, tried):
    """Of one file, and of a program that calls parts of 10 points: holes move between these."""

    def batch(name, rows=ROWS, **cell):
        folder = tmp_path / name
        (folder / "in").mkdir(parents=True)
        (folder / "cell.toml").write_text(
            CELL.format(**(PLAIN | {"most": most} | cell), cam_lines="true")
        )
        lines = ["id,x,y,z,i,j,k,depth,feed"]
        lines += [f"{n},{x},{y},0,0,0,1,{depth},{feed}" for n, x, y, depth, feed in rows]
        (folder / "in" / "panel.csv").write_text("\n".join(lines) + "\n")
        arguments = ["batch", folder / "in", "--cell", folder / "cell.toml", "-o", folder / "out"]
        assert answer(capsys, *arguments, "--jobs", 1, "-q")[0] == 0
        return folder / "out"

    old = batch("old")
    for name, edit, expected in (
        ("moved", {"rows": edited("B2", x=65)}, "moved: B2 moved by (5, 0, 0) mm"),
        ("added", {"rows": [("N1", 30, 25, 12, 120), *ROWS]}, "added: 1 hole added: N1, at (30"),
        ("removed", {"rows": ROWS[1:]}, "removed: 1 hole removed: A1, at (0, 0, -12)"),
        ("swap", {"rows": swapped(5, 7)}, "order: B2 and B4 swapped, same holes"),
        ("base", {"x": 1405}, "cell: base 1 moved by (5, 0, 0) mm: 48 motions with it"),
        ("tool", {"length": 160}, "cell: tool 1 moved by (10, 0, 0) mm: 48 motions with it"),
    ):
        if name not in tried:
            continue
        new = batch(name, **edit)
        said = answer(capsys, "diff", old, new)[1]
        assert said.startswith(expected)
        assert said.partition("different: ")[0].count("\n") <= 6
    assert (len(list(old.glob("*.src"))) > 3) == (most == 10)
    # a manifest of another text says nothing, nor do comments that somebody took out
    program = new / "panel.src"
    program.write_text(program.read_text().replace("; tool 1: ", "; "))
    assert "tool 1 moved" not in answer(capsys, "diff", old, new)[1]


def test_a_program_with_its_set_up_module_is_the_same_as_itself(made, capsys):
    program = made(setup="true", home=HOME) / "panel.src"
    assert answer(capsys, "diff", program, program) == (0, "same: 50 motions\n")


def test_hands_edits_are_told_as_what_they_are(made, tmp_path, capsys):
    text = (made() / "panel.src").read_text()
    line = next(row for row in text.splitlines() if row.startswith("PTP") and "line 8" in row)
    angle = line.partition("A1 ")[2].partition(",")[0]
    plunge = next(row for row in text.splitlines() if row.startswith("LIN") and "line 8" in row)
    beside = plunge.replace("X 120.0000", "X 180.0000").replace("Z 2.0000", "Z 60.0000")
    edits = {
        (line, line.replace(angle, f"{float(angle) + 3:.5f}")): "posture: joint targets moved by",
        (line, f"{line}\n{beside}"): "posture: the arm goes another way to B3",
        ("X 120.0000,Y 50.0000,Z 10.0000", "X 120.0000,Y 51.0000,Z 10.0000"): "moved: B3 moved",
        ("X 120.0000,Y 50.0000,Z 2.0000", "X 120.0000,Y 50.0000,Z 3.0000"): "process: approach",
        ("BAS(#VEL_PTP,50)", "BAS(#VEL_PTP,60)"): "process: $VEL_AXIS 50 became 60 %: all 48",
        ("$ADVANCE=3", "$ADVANCE=1"): "state: $ADVANCE 3 became 1",
        ("$VEL.CP=1.0", "PP_SPINDLE_ON(3000)\n$VEL.CP=1.0"): "process: added PP_SPINDLE_ON(3000)",
    }  # fmt: skip
    failures = []
    for (old, new), expected in edits.items():
        assert old in text
        (tmp_path / "panel.src").write_text(text.replace(old, new, 1))
        out = answer(capsys, "diff", made() / "panel.src", tmp_path / "panel.src")[1]
        if not out.startswith(expected):
            failures.append((expected, out.splitlines()[:2]))
    assert not failures


def test_programs_without_cam_lines_and_to_the_same_place(made, capsys):
    old = made(cam_lines="false") / "panel.src"
    moved = made(cam_lines="false", rows=edited("B2", x=65)) / "panel.src"
    code, out = answer(capsys, "diff", old, moved, "--json")
    group = json.loads(out)["groups"][0]
    assert (code, group["kind"], group["count"]) == (1, "moved", 1)
    assert old.read_text().splitlines()[int(group["ids"][0].split()[1]) - 1].startswith("LIN {X 60")
    assert json.loads(answer(capsys, "diff", old, old, "--json")[1])["groups"] == []


def test_a_few_turns_are_no_other_cell(made, tmp_path, capsys):
    old, new = made() / "panel.src", tmp_path / "panel.src"
    turned = re.sub(r"(X 60\.0+,Y 50\.0+,.*A )(-?[\d.]+)", _more, old.read_text())
    new.write_text(turned)
    (tmp_path / "panel.dat").write_text((old.parent / "panel.dat").read_text())
    groups = json.loads(answer(capsys, "diff", old, new, "--json")[1])["groups"]
    assert [(group["kind"], group["ids"]) for group in groups] == [("spin", ["B2"])]


def _more(found):
    return f"{found[1]}{float(found[2]) + 3.0:.5f}"


def test_the_document(made, capsys):
    new = made(rows=edited("B2", x=63, y=54))
    out = answer(capsys, "diff", made() / "panel.src", new / "panel.src", "--json")[1]
    groups = json.loads(out)["groups"]
    moved = groups[0]
    assert (moved["kind"], moved["ids"]) == ("moved", ["B2"])
    assert moved["worst"] == {
        "id": "B2", "dx_mm": 3.0, "dy_mm": 4.0, "dz_mm": 0.0,
        "along_mm": 0.0, "across_mm": 5.0, "tilt_deg": 0.0,
    }  # fmt: skip
    assert sum(group["kind"] == "spin" for group in groups) <= 1


def test_files_for_a_pull_request(made, tmp_path, capsys):
    page, suite = tmp_path / "a.md", tmp_path / "a.xml"
    files = ("--markdown", page, "--junit", suite)
    assert answer(capsys, "diff", made(), made(rows=ROWS[::-1]), *files)[0] == 1
    text = page.read_text().splitlines()
    assert len(text) <= 60
    assert any(line.startswith("| order |") for line in text)
    cases = {case.get("name"): case for case in ET.parse(suite).getroot()}
    assert cases["PANEL"].find("failure").get("message").startswith("order: ")
    assert answer(capsys, "diff", made(), made(), *files)[0] == 0
    assert ET.parse(suite).getroot().get("failures") == "0"


def test_lint_as_junit(made, tmp_path, capsys):
    suite = tmp_path / "lint.xml"
    assert answer(capsys, "lint", made(), "--junit", suite)[0] == 0
    assert [case.find("failure") for case in ET.parse(suite).getroot()] == [None, None]
    bad = tmp_path / "panel.src"
    bad.write_text((made() / "panel.src").read_text().replace("$VEL.CP=0.002", "$VEL.CP=-1", 1))
    assert answer(capsys, "lint", bad, "--junit", suite)[0] == 1
    failed = [c.get("name") for c in ET.parse(suite).getroot() if c.find("failure") is not None]
    assert failed == [str(bad)]
