"""Holes as drilling cells run them: routines around each, a unit that feeds, a restart."""

import re

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cli import app
from postproc.controller import EventWord
from postproc.controller.modules import load_program
from postproc.kinematics import build
from postproc.paths import joint_paths, run_in_cell
from tests import wing
from tests.cells import cell_text
from tests.jobs.emitted import written_program

UNIT = '[process]\nfeed_by = "unit"\n'
ROBOT = '[process]\nhole = ["clamp", "drill", "unclamp"]\n'
STEPS = ("PP_CLAMP", "PP_DRILL", "PP_UNCLAMP")


@pytest.fixture
def converted(tmp_path):
    """Return a function that writes the files of a good job, converted once for all tests."""

    def write(*tables, text=None, name="wing.cls", count=3, **changes):
        cam, cell = tmp_path / name, tmp_path / "cell.toml"
        cam.write_text(text or wing.apt_text(count))
        cell.write_text(wing.cell_text(*tables, **changes))
        return cam, cell, written_program(cam, cell)

    return write


def ran(program, cell):
    """Return the calls of steps (name, arguments, motion), end points [mm] and tools, as run."""
    cell = load_cell(cell)
    modules, kinematics = load_program(program), build(cell.robot)
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    names = {name.upper() for name in (cell.krl.hooks[step] for step in cell.process.hole)}
    calls = [
        (event.name, event.arguments, event.motion)
        for event in trace.events
        if event.word is EventWord.HOOK and event.name in names
    ]
    paths = joint_paths(trace, cell, kinematics)
    return calls, paths.end_point * 1e3, trace.column("tool_number").astype(int)


def started_at(program, hole):
    """Set the hole to begin with in the data list of the main program."""
    data = program.with_suffix(".dat")
    text = data.read_text()
    assert text.count("INT PP_START_HOLE=1") == 1
    changed = text.replace("INT PP_START_HOLE=1", f"INT PP_START_HOLE={hole}")
    data.write_text(changed, newline="")


def wanted_calls(count, steps=STEPS):
    holes = wing.holes(count)
    feeds = {1: 250.0, 2: 120.0, 3: 90.0}
    return [
        (step, number, wing.DEPTHS[hole.tool], feeds[hole.tool], 2000.0)
        for number, hole in enumerate(holes, start=1)
        for step in steps
    ]


def test_the_unit_feeds_and_the_robot_stands(converted, run):
    cam, cell, program = converted(UNIT)
    calls, points, _ = ran(program, cell)
    assert [(name, *values) for name, values, _ in calls] == wanted_calls(3)
    assert points[:, 2].min() > 2.99, "no motion goes below where the feed begins"
    for name, values, motion in calls:
        hole = wing.holes(3)[int(values[0]) - 1]
        np.testing.assert_allclose(points[motion - 1], [hole.x, hole.y, 3.0], atol=0.01), name
    verify = ("verify", program, "--cell", cell, "--against", cam, "--json")
    code, report, _ = run(*verify)
    assert (code, report["violations"]) == (0, [])
    assert run("lint", program, "--json")[0] == 0


def test_the_robot_feeds_between_the_steps(converted, run):
    cam, cell, program = converted(ROBOT)
    calls, points, _ = ran(program, cell)
    assert [(name, *values) for name, values, _ in calls] == wanted_calls(3)
    for (_, values, clamp), (_, _, drill), (_, _, unclamp) in zip(
        calls[::3], calls[1::3], calls[2::3], strict=True
    ):
        hole = wing.holes(3)[int(values[0]) - 1]
        assert clamp == drill < unclamp
        between = points[clamp:unclamp]
        assert between[:, 2].min() == pytest.approx(-wing.DEPTHS[hole.tool], abs=0.01)
        np.testing.assert_allclose(between[:, :2], [[hole.x, hole.y]] * len(between), atol=0.01)
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"]) == (0, [])


def test_a_hole_with_its_steps_stands_in_one_file(tmp_path, run, converted):
    converted(UNIT, "[krl]\nmax_points_per_file = 2\n")  # its strokes are two motions
    cam, cell, _ = converted(ROBOT, "[krl]\nmax_points_per_file = 12\n")
    cell.write_text(cell.read_text().replace("max_points_per_file = 12", "max_points_per_file = 2"))
    code, _, err = run("convert", cam, "--cell", cell, "-o", tmp_path / "none")
    assert code == 2
    assert "cell.toml:1: error EMT302: max_points_per_file is 2, but the" in err


def test_routines_may_have_names_of_their_own(converted):
    hooks = '[krl.hooks]\nmeasure = "NOSE_MEASURE"\n'
    steps = '[process]\nfeed_by = "unit"\nhole = ["measure", "drill"]\n'
    _, cell, program = converted(steps, hooks)
    calls, _, _ = ran(program, cell)
    assert [name for name, _, _ in calls[:2]] == ["NOSE_MEASURE", "PP_DRILL"]


@pytest.mark.parametrize(
    ("change", "kind"),
    [
        (lambda t: re.sub(r"PP_CLAMP\(2,.*\n", "", t), "event"),
        (lambda t: re.sub(r"(PP_CLAMP\(2,.*\n)(.*PP_DRILL\(2,.*\n)", r"\2\1", t), "event"),
        (lambda t: t.replace("PP_DRILL(4,2.0", "PP_DRILL(4,3.0"), "event"),
        (lambda t: t.replace("PP_UNCLAMP(5,", "PP_UNCLAMP(6,"), "event"),
        (lambda t: re.sub(r"( *PP_UNCLAMP\(1,.*\n)((?:.*\n){2})", r"\2\1", t), "event"),
    ],
)
def test_verify_counts_and_orders_the_steps(converted, run, change, kind):
    cam, cell, program = converted(UNIT)
    text = program.read_text()
    changed = change(text)
    assert changed != text
    program.write_text(changed, newline="")
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert code == 1
    assert kind in {item["kind"] for item in report["violations"]}


def test_drill_moves_that_are_written_out_are_a_finding(tmp_path, run):
    cell, cam = tmp_path / "cell.toml", tmp_path / "wing.cls"
    cell.write_text(wing.cell_text(UNIT))
    lines = wing.apt_text(2).splitlines()
    at = lines.index("CYCLE/OFF")
    lines[at:at] = ["CYCLE/OFF", "FEDRAT/MMPM,200.", "GOTO/0.,0.,3.", "GOTO/0.,0.,-5."]
    cam.write_text("\n".join([*lines, ""]))
    call = ("convert", cam, "--cell", cell, "-o", tmp_path / "out", "--json")
    code, document, _ = run(*call)
    (failure,) = document["failures"]
    assert (code, failure["code"]) == (1, "PRC010")
    assert failure["line"] in (at + 3, at + 4)
    cell.write_text(wing.cell_text())
    assert run(*call)[0] == 0


@pytest.mark.parametrize("hole", [2, 9, 18, 19])
@pytest.mark.parametrize("mode", [UNIT, ROBOT])
def test_a_program_begins_at_any_hole(converted, run, hole, mode):
    """Exactly the rest is done, each hole with its tool and in its base, and nothing is hit."""
    _, cell, program = converted(mode, "[krl]\nmax_points_per_file = 25\n")
    whole, _, _ = ran(program, cell)
    started_at(program, hole)
    calls, points, tools = ran(program, cell)
    due = [item for item in whole if item[1][0] >= hole]
    assert [(name, values) for name, values, _ in calls] == [(n, v) for n, v, _ in due]
    holes = wing.holes(3)
    for name, values, motion in calls:
        mine = holes[int(values[0]) - 1]
        assert tools[motion - 1] == 6 + mine.tool
        np.testing.assert_allclose(points[motion - 1, :2], [mine.x, mine.y], atol=0.01), name
    below = points[points[:, 2] < -1.0]
    if mode is ROBOT:
        last = [tuple(np.round(p[:2], 1)) for p in below]
        assert set(last) == {(h.x, h.y) for h in holes[hole - 1 :]}
    _, report, _ = run("verify", program, "--cell", cell, "--json")
    wrong = {item["kind"] for item in report["violations"]}
    assert not wrong & {"collision", "joint_limit", "axis_speed", "turn", "unreachable", "start"}


def test_hole_100_of_a_list_in_several_files(converted):
    rows = [f"N{i},{(i % 30) * 10},{(i // 30) * 10},0,0,0,1,6,1,MSYS_1" for i in range(120)]
    text = "\n".join(["id,x,y,z,i,j,k,depth,tool,base", *rows, ""])
    keys = "[optimize]\nstep_deg = 45\n[krl]\nmax_points_per_file = 90\n"
    _, cell, program = converted(UNIT, keys, text=text, name="list.csv")
    assert len(list(program.parent.glob("list_0*.src"))) > 1
    started_at(program, 100)
    calls, points, _ = ran(program, cell)
    assert [values[0] for _, values, _ in calls] == [n for n in range(100, 121) for _ in STEPS]
    reached = points[np.abs(points[:, 2] - 2.0) < 0.01][:, :2]
    done = np.unique(np.round(reached, 1), axis=0)
    assert len(done) == 21


@pytest.mark.parametrize("template", ["default", "drilling_unit"])
def test_the_example_has_every_routine(converted, run, template):
    keys = f'[krl]\nhooks_example = true\ntemplate = "{template}"\n'
    _, cell, program = converted(UNIT, keys, count=1)
    hooks = program.with_name("PP_HOOKS.src")
    text = hooks.read_text()
    for step in STEPS:
        assert f"GLOBAL DEF {step}(HOLE:IN,DEPTH:IN,FEED:IN,SPEED:IN)" in text
    assert run("lint", program, hooks, "--json")[0] == 0
    assert run("verify", program, "--cell", cell, "--json")[0] == 0


def test_keys_of_holes_are_checked(tmp_path, run):
    cell = tmp_path / "cell.toml"
    for tables, words in (
        ('[process]\nfeed_by = "unit"\nhole = []\n', "process.hole is empty"),
        ('[process]\nhole = ["clamp", "clamp"]\n', "'clamp' appears twice"),
        ('[process]\nhole = ["stop"]\n', "'stop' is called by the CAM file"),
        ('[krl.hooks]\nclmp = "X"\n', "unknown key 'krl.hooks.clmp'"),
        ('[process]\nhole = ["clamp"]\n[krl.hooks]\nclamp = "A B"\n', "expected the name"),
    ):
        cell.write_text(wing.cell_text(tables))
        code, _, err = run("check", cell)
        assert code == 2
        assert words in err, err


def drilled_and(kind, feed=900, more=""):
    return (
        "UNITS/MM\nLOADTL/1\nSPINDL/900,RPM,CLW\nRAPID\nGOTO/0,0,50,0,0,1\nCYCLE/DRILL,FEDTO,9,MMPM,"
        f"60,RAPTO,3\nGOTO/20,0,0\nCYCLE/OFF\nCYCLE/{kind},FEDTO,9,MMPM,{feed},RAPTO,3{more}\n"
        "GOTO/20,0,0\nCYCLE/OFF\nSPINDL/OFF\nFINI\n"
    )


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        ("TAP", "", "a tap cycle,"),
        ("RIGID", ",PITCH,1", "a rigid tap cycle,"),
        ("REAM", ",DWELL,1", "a ream cycle and a dwell,"),
        ("BRKCHP", ",STEP,3", "pecks,"),
    ],
)
def test_what_a_unit_has_to_know_of_its_tool_is_noted(tmp_path, run, kind, more, words):
    cam, cell, out = tmp_path / "part.apt", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text(drilled_and(kind, more=more))
    cell.write_text(cell_text(UNIT))
    code, _, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    notes = [line for line in err.splitlines() if "PRC011" in line]
    assert len(notes) == 1
    assert words in notes[0]
    assert "line 10 on" in notes[0]
    assert run("verify", out / "part.src", "--cell", cell, "--against", cam, "--json")[0] == 0


@pytest.mark.parametrize(
    ("kind", "more", "words"),
    [
        ("TAP", ",PITCH,1.5", "the feed gives 1 mm a turn, the pitch is 1.5 mm"),
        ("REVERS", "", "a left-hand tap, but the spindle turns clockwise"),
    ],
)
def test_a_unit_does_not_tap_what_contradicts_itself(tmp_path, run, kind, more, words):
    cam, cell, out = tmp_path / "part.apt", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text(drilled_and(kind, more=more))
    cell.write_text(cell_text(UNIT))
    code, document, _ = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert (code, document["files"]) == (1, [])
    assert [item["code"] for item in document["failures"]] == ["PRC002"]
    assert words in document["failures"][0]["detail"]


RAIL = """\
[[external_axes]]
name = "E1"
kind = "rail"
axis = "+y"
range_mm = [-1000, 1000]
speed_mm_s = 500
"""


def test_with_external_axes_it_is_told_that_there_is_no_restart(tmp_path, capsys):
    cam, cell, out = tmp_path / "wing.cls", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text(wing.apt_text(1))
    cell.write_text(wing.cell_text(ROBOT, RAIL))
    call = ["convert", str(cam), "--cell", str(cell), "-o", str(out)]
    assert app.run(call) == 0
    assert "note PRC012" in capsys.readouterr().err
    assert "PP_START_HOLE" not in (out / "wing.dat").read_text() + (out / "wing.src").read_text()
    assert (
        app.run(["verify", str(out / "wing.src"), "--cell", str(cell), "--against", str(cam)]) == 0
    )
    cell.write_text(wing.cell_text(ROBOT))
    assert app.run(call) == 0
    assert "PRC012" not in capsys.readouterr().err
    assert "INT PP_START_HOLE=1" in (out / "wing.dat").read_text()


def test_a_long_cut_between_numbered_holes_is_parted(converted):
    rows = wing.apt_text(2).split("\n")
    behind = next(row for row, line in enumerate(rows) if line.startswith("CYCLE/OFF")) + 1
    cut = [f"GOTO/{x}.,0.,5.,0.,0.,1." for x in range(0, 40)]
    rows[behind:behind] = ["RAPID", "GOTO/0.,0.,20.,0.,0.,1.", "FEDRAT/600.,MMPM", *cut]
    _, _, program = converted(ROBOT, "[krl]\nmax_points_per_file = 30\n", text="\n".join(rows))
    assert len(list(program.parent.glob("*_0*.src"))) > 2
