"""Jobs of several tools and setups: from the CAM file to the checked program, and back."""

import re

import numpy as np
import pinocchio
import pytest

import postproc
from postproc.cell.file import load_cell
from postproc.controller.modules import load_program
from postproc.kinematics import build
from postproc.paths import joint_paths, run_in_cell
from postproc.units import MM
from tests import wing
from tests.jobs import emitted as text
from tests.kinematics.test_forward import pinocchio_arm

SETUP = "[krl]\nsetup = true\n"
MSYS_2 = "400.0000,100.0000,0.0000,1.0000,0.0000,0.0000,0.0000,1.0000,0.0000"


@pytest.fixture
def job(tmp_path):
    """Return a function that writes CAM file and cell, and returns their paths."""

    def make(*tables, source=wing.apt_text, count=3, name="wing.cls", **changes):
        cam, cell = tmp_path / name, tmp_path / "cell.toml"
        cam.write_text(source(count))
        cell.write_text(wing.cell_text(*tables, **changes))
        return cam, cell

    return make


@pytest.fixture
def converted(job):
    """Return a function that writes the files of a good job, converted once for all tests."""

    def convert(*tables, **changes):
        cam, cell = job(*tables, **changes)
        return cam, cell, text.written_program(cam, cell)

    return convert


def tips(program, cell):
    """Return number of tool and base, and the tip in that base [mm], at the end of each motion.

    The joints are those of the text, the tip is found by pinocchio with the frames of the cell.
    """
    cell = load_cell(cell)
    modules, kinematics = load_program(program), build(cell.robot)
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    q = joint_paths(trace, cell, kinematics).q
    numbers = [trace.column(name).astype(int) for name in ("tool_number", "base_number")]
    tools = {tool.number: tool.T_flange_tcp for tool in cell.tools}
    bases = {base.number: base.T_robroot_base for base in cell.bases}
    model, flange = pinocchio_arm(cell.robot.geometry)
    data = model.createData()
    points = []
    for row, tool, base in zip(q, *numbers, strict=True):
        pinocchio.framesForwardKinematics(model, data, row)
        T = np.linalg.inv(bases[base]) @ data.oMf[flange].homogeneous @ tools[tool]
        points.append(T[:3, 3] / MM)
    return *numbers, np.array(points)


def assert_every_hole_is_drilled(program, cell, count):
    """The bottom of every hole is reached by the tip of its tool in its base, in order."""
    tool, base, points = tips(program, cell)
    at = 0
    for hole in wing.holes(count):
        bottom = np.array([hole.x, hole.y, -wing.DEPTHS[hole.tool]])
        mine = (tool == 6 + hole.tool) & (base == 2 + hole.setup)
        near = np.flatnonzero(mine & (np.linalg.norm(points - bottom, axis=1) < 0.01))
        near = near[near >= at]
        assert len(near), hole
        at = int(near[0]) + 1


def test_three_tools_in_two_setups(converted, run):
    cam, cell, program = converted(SETUP)
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"], report["collisions_checked"]) == (0, [], True)
    assert (report["matched"], report["tags"]) == (30, 30)
    assert_every_hole_is_drilled(program, cell, 3)
    text = program.read_text()
    calls = re.findall(r"^(PP_TOOL_CHANGE\(\d\)|BAS\(#TOOL,\d\)|BAS\(#BASE,\d\))", text, re.M)
    want = [
        f"{word}{number})"
        for setup in (3, 4)
        for tool in (1, 2, 3)
        for word, number in
        (("PP_TOOL_CHANGE(", tool), ("BAS(#TOOL,", 6 + tool), ("BAS(#BASE,", setup))
    ]  # fmt: skip
    assert calls == ["BAS(#TOOL,7)", "BAS(#BASE,3)", *want], "head, then every change"
    assert run("lint", program, "--json")[0] == 0


@pytest.mark.slow
def test_a_whole_panel_in_one_command(converted, run):
    """270 holes by three tools from two setups; every bottom found by pinocchio."""
    cam, cell, program = converted("[optimize]\nstep_deg = 30\n", count=45)
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"]) == (0, [])
    assert (report["matched"], report["tags"]) == (282, 282)
    assert_every_hole_is_drilled(program, cell, 45)


def test_tools_are_changed_at_home(converted):
    """Between two calls of the routine the arm stands at home, by joint angles, on both sides."""
    _, _, program = converted()
    lines = [line.split(" ;")[0] for line in program.read_text().splitlines()]
    home = [i for i, line in enumerate(lines) if line.startswith("PTP {A1 0.00000,A2 -90.00000")]
    moves = [i for i, line in enumerate(lines) if re.match(r"PTP|LIN|CIRC", line)]
    changes = [i for i, line in enumerate(lines) if line.startswith("PP_TOOL_CHANGE")]
    assert len(changes) == 6
    for change in changes[1:]:
        assert max(i for i in moves if i < change) in home
        assert min(i for i in moves if i > change) in home
    assert moves[0] in home
    assert moves[-1] in home


def test_every_file_selects_its_own_frames(converted, run):
    cam, cell, program = converted("[krl]\nmax_points_per_file = 20\n")
    files = sorted(program.parent.glob("wing_0*.src"))
    assert len(files) > 4
    for file in files:
        lines = file.read_text().splitlines()
        first = next(i for i, line in enumerate(lines) if re.match(r"PTP|LIN|CIRC", line))
        assert any(line.startswith("BAS(#TOOL,") for line in lines[:first])
        assert any(line.startswith("BAS(#BASE,") for line in lines[:first])
    assert run("verify", program, "--cell", cell, "--against", cam, "--json")[0] == 0
    assert_every_hole_is_drilled(program, cell, 3)


def test_forms_name_the_tool_of_their_point(converted, run):
    cam, cell, program = converted('[krl]\nmotion = "forms"\n')
    assert run("verify", program, "--cell", cell, "--against", cam, "--json")[0] == 0
    data = program.with_suffix(".dat").read_text()
    assert set(re.findall(r"TOOL_NO (\d+),BASE_NO (\d+)", data)) == {
        (str(tool), str(base)) for tool in (7, 8, 9) for base in (3, 4)
    }
    assert re.search(r"Tool\[9\] Base\[4\]", program.read_text())


def test_load_data_of_every_tool_with_a_mass(converted):
    text = wing.cell_text().replace("mass_kg = 81\ncog_mm = [0, 0, 200]\n", "")
    _, _, program = converted(SETUP)
    setup = program.with_name("wing_SETUP.src").read_text()
    for number, mass in ((7, 80), (8, 81), (9, 82)):
        assert f"LOAD_DATA[{number}]={{M {mass}.0000,CM {{X 0.0000,Y 0.0000,Z 200.0000" in setup
        assert f"TOOL_DATA[{number}]=" in setup
    assert {"BASE_DATA[3]", "BASE_DATA[4]"} <= set(re.findall(r"BASE_DATA\[\d\]", setup))
    assert text.count("mass_kg") == 2


def test_the_same_from_a_list(converted, run):
    cam, cell, program = converted(source=wing.csv_text, name="wing.csv")
    code, report, _ = run("verify", program, "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"]) == (0, [])
    assert_every_hole_is_drilled(program, cell, 3)


@pytest.mark.parametrize("source", [wing.apt_text, wing.csv_text])
def test_one_tool_missing_stops_with_its_lines(job, run, tmp_path, source):
    name = "wing.cls" if source is wing.apt_text else "wing.csv"
    cam, cell = job(tools=wing.TOOLS[:2], source=source, name=name)
    out = tmp_path / "out"
    call = ("convert", cam, "--cell", cell, "-o", out, "--json")
    code, document, err = run(*call)
    assert (code, document["files"], out.exists()) == (1, [], False)
    assert {item["code"] for item in document["failures"]} == {"WRD002"}
    lines = cam.read_text().splitlines()
    first = document["failures"][0]
    assert re.search(r"REAM|,3,MSYS_1|GOTO", lines[first["line"] - 1])
    assert "tool 3" in first["detail"]
    assert f'cam = ["{"REAM" if "REAM" in first["detail"] else 3}"]' in first["hint"]
    assert f"{cam}:{first['line']}: error WRD002" in err
    code, document, _ = run(*call, "--partial")
    assert code == 1
    assert "wing.src" in document["files"], "the stretches of the other tools"


def test_nothing_claimed_is_a_wrong_input(job, run, tmp_path):
    cam, cell = job()
    cell.write_text(re.sub(r"cam = .*\n", "", cell.read_text()))
    code, _, err = run("convert", cam, "--cell", cell, "-o", tmp_path / "out")
    assert code == 2
    assert re.match(rf"{re.escape(str(cam))}:\d+: error WRD002: tool 1, called in line 4", err)


def test_a_longer_cutter_is_refused_where_it_collides(job, run, tmp_path):
    """A roof 280 mm above the panel: the head of the reamer stands 33 mm below it, then in it."""
    roof = (
        '[[obstacles]]\nname = "roof"\nbox = { size_mm = [160, 160, 40] }\n'
        "xyz_mm = [1515, -300, 900]\n"
    )
    cam, cell = job(roof)
    call = ("convert", cam, "--cell", cell, "-o", tmp_path / "out", "--json")
    code, document, err = run(*call)
    assert (code, document["failures"]) == (0, []), err
    cell.write_text(wing.cell_text(roof, longer={3: 60.0}))
    code, document, _ = run(*call)
    assert code == 1
    assert {item["reason"] for item in document["failures"]} == {"collision"}
    assert all("roof" in item["detail"] for item in document["failures"])
    lines = cam.read_text().splitlines()
    third, fourth = (lines.index(text) + 1 for text in ("LOADTL/3", "MSYS/" + MSYS_2))
    assert {third < item["line"] < fourth for item in document["failures"]} == {True}


def test_a_part_clamped_anew_at_the_same_place(job, run, tmp_path):
    """The block of the first setup reaches 120 mm above that of the second: it is gone by then."""
    cam, cell = job()
    first = wing.base_text(1, '["MSYS_1"]', thick=200)
    second = wing.base_text(2, '["MCS_2"]', origin=(1500.0, -300.0, 480.0), thick=100)
    head, _, rest = cell.read_text().partition("[[bases]]")
    motion = "[motion]" + rest.partition("[motion]")[2]
    cell.write_text(head + first + second + motion)
    out = tmp_path / "out"
    code, document, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert (code, document["failures"]) == (0, []), err
    code, report, _ = run("verify", out / "wing.src", "--cell", cell, "--against", cam, "--json")
    assert (code, report["violations"], report["collisions_checked"]) == (0, [], True)
    stays = (
        '[[obstacles]]\nname = "block"\nbox = { size_mm = [330, 330, 119] }\n'
        "xyz_mm = [1650, -150, 540]\n"
    )
    cell.write_text(head + second + motion + stays)
    code, report, _ = run("verify", out / "wing.src", "--cell", cell, "--json")
    assert any("block" in item["detail"] for item in report["violations"]), "it would be hit"


def test_verify_sees_another_tool_in_the_text(converted, run):
    cam, cell, program = converted()
    verify = ("verify", program, "--cell", cell, "--against", cam, "--json")
    text = program.read_text()
    for wrong, by in (("BAS(#TOOL,8)", "BAS(#TOOL,7)"), ("BAS(#BASE,4)", "BAS(#BASE,3)")):
        program.write_text(text.replace(wrong, by), newline="")
        code, report, _ = run(*verify)
        assert code == 1
        assert "tool" in {item["kind"] for item in report["violations"]}, wrong
    program.write_text(text.replace("BAS(#TOOL,9)", "BAS(#TOOL,5)"), newline="")
    kinds = {item["kind"] for item in run(*verify)[1]["violations"]}
    assert "frame" in kinds


def test_setups_that_the_file_places_need_no_entry(job, run, tmp_path):
    """Both MSYS carried into one base: the holes lie where the matrices put them."""
    cam, cell = job()
    text = cell.read_text()
    head, _, rest = text.partition("[[bases]]")
    _, _, motion = rest.partition("[motion]")
    base = "[[bases]]\nnumber = 3\nframe = { xyz_mm = [1500, -200, 600] }\n"
    for claim, moved in (("", True), ('cam = ["MSYS_2"]\n', False)):
        cell.write_text(head + base + claim + "[motion]" + motion)
        out = tmp_path / f"out{moved}"
        code, document, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
        assert (code, document["failures"]) == (0, []), err
        _, _, points = tips(out / "wing.src", cell)
        shift = np.array([0, 0, 0]) if moved else -np.array(wing.SETUPS[2])
        for setup, origin in wing.SETUPS.items():
            bottom = np.add(origin, [15.0, 0.0, -12.0]) + shift
            assert np.linalg.norm(points - bottom, axis=1).min() < 0.01, (setup, claim)


def test_inspect_prints_the_tables_of_the_cell(job, run, capsys):
    """Filled in where dots stand, they claim everything that the file calls."""
    from postproc.cli import app
    from postproc.process import assign
    from postproc.readers import read

    cam, cell = job()
    assert app.run(["inspect", str(cam)]) == 0
    assert "for the cell, to be filled in" in capsys.readouterr().out
    tables = run("inspect", cam, "--json")[1]["cell_tables"]
    assert tables.count("[[tools]]") == 3
    assert tables.count("[[bases]]") == 2
    filled = tables.replace("# axis =", "axis =")
    cell.write_text(wing.HEAD + filled)
    assigned = assign(read(cam), load_cell(cell))
    assert not assigned.findings
    assert {load_cell(cell).tools[i].number for i in assigned.tool} == {1, 2, 3}


def test_without_home_a_folded_posture_is_found(job, run, tmp_path):
    cam, cell = job()
    cell.write_text(cell.read_text().replace("home_deg = [0, -90, 90, 0, 45, 0]\n", ""))
    out = tmp_path / "out"
    assert run("convert", cam, "--cell", cell, "-o", out, "--json")[0] == 0
    assert run("verify", out / "wing.src", "--cell", cell, "--against", cam, "--json")[0] == 0


def test_one_tool_without_a_claim_serves_a_file_of_one(job, run, tmp_path):
    cam, cell = job()
    cam.write_text(re.sub(r"LOADTL/[23]", "LOADTL/1", cam.read_text()))
    text = wing.cell_text(tools=wing.TOOLS[:1])
    cell.write_text(text.replace('cam = [1, "DRILL"]\n', ""))
    call = ("convert", cam, "--cell", cell, "-o", tmp_path / "out", "--json")
    code, document, err = run(*call)
    assert (code, document["failures"]) == (0, []), err


@pytest.mark.parametrize(
    ("change", "code", "words"),
    [
        ('[tool]\naxis = "+z"\n', "CEL012", "both [tool] and [[tools]]"),
        ("[workpiece]\nnumber = 2\n", "CEL012", "both [workpiece] and [[bases]]"),
        ('[[tools]]\nnumber = 7\naxis = "+z"\n', "CEL013", "entries 1 and 4 are both TOOL 7"),
        ('[[tools]]\nnumber = 1\naxis = "+z"\ncam = ["01"]\n', "CEL013", "both list '01'"),
        ('[[tools]]\nnumber = 1\naxis = "+z"\ncam = ["ream"]\n', "CEL013", "both list 'ream'"),
    ],
)
def test_entries_that_contradict_each_other(job, run, tmp_path, change, code, words):
    cam, cell = job()
    text = cell.read_text()
    cell.write_text(text.replace("[motion]", f"{change}[motion]"))
    exit_code, _, err = run("convert", cam, "--cell", cell, "-o", tmp_path / "out")
    assert exit_code == 2
    assert code in err.splitlines()[0]
    assert words in err.splitlines()[0]
    line = int(err.split(":")[1])
    assert cell.read_text().splitlines()[line - 1].startswith(("[[tools]]", "[[bases]]", "cam"))


MEASURED = "id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm\n"
BOX = ("--box", 1300, -300, 500, 1500, 300, 700, "--grid", 400)


def test_calls_with_one_tool_ask_which(job, run, tmp_path):
    """Nothing is assumed: neither the first tool nor one that the cell does not have."""
    _, cell = job()
    rows = tmp_path / "rows.csv"
    rows.write_text(MEASURED)
    calls = (
        ("sample", *BOX, "-o", tmp_path / "plan"),
        ("identify", rows, "-o", tmp_path / "model.toml"),
        ("diagnose", rows),
        ("predict", rows, "-o", tmp_path / "out.csv"),
    )
    for call in calls:
        code, _, err = run(*call, "--cell", cell)
        first, hint = err.splitlines()[:2]
        assert (code, first) == (
            2,
            f"{cell}:1: error CEL015: the cell has 3 tools: 7 drill, 8 csink, 9 ream",
        )
        assert "--tool N" in hint
        code, _, err = run(*call, "--cell", cell, "--tool", 2)
        assert (code, "CEL015: the cell has no tool 2" in err) == (2, True), err
    assert not (tmp_path / "plan").exists()


def test_a_measuring_plan_is_of_the_tool_that_is_named(job, run, tmp_path):
    """Frame, number and drawing are those of tool 9: its tip is in the box, by pinocchio."""
    stiff = "[stiffness]\njoint_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]\n"
    _, cell = job(stiff)
    out = tmp_path / "plan"
    code, _, err = run("sample", *BOX, "-o", out, "--cell", cell, "--tool", 9, "--json")
    assert code == 0, err
    text = (out / "sample.src").read_text()
    assert set(re.findall(r"BAS\(#TOOL,(\d+)\)", text)) == {"9"}
    rows = [line for line in (out / "sample.csv").read_text().splitlines() if line[0] != "#"]
    names = rows[0].split(",")
    loaded = load_cell(cell)
    model, flange = pinocchio_arm(loaded.robot.geometry)
    data = model.createData()
    tips = {}
    for row in (line.split(",") for line in rows[1:]):
        q = np.radians([float(row[names.index(f"q{joint}_deg")]) for joint in range(1, 7)])
        pinocchio.framesForwardKinematics(model, data, q)
        for place, tool in enumerate(loaded.tools):
            tip = data.oMf[flange].homogeneous @ tool.T_flange_tcp[:, 3] / MM
            tips.setdefault((place, row[1]), []).append(tip[:3])
    spread = {key: float(np.ptp(points, axis=0).max()) for key, points in tips.items()}
    assert max(value for (place, _), value in spread.items() if place == 2) < 0.01
    assert max(value for (place, _), value in spread.items() if place == 0) > 1.0


def one_tool_alone(folder, tool, setup, count=3):
    """Write the holes of one tool in one setup as a job of their own; return CAM file and cell."""
    text = wing.tool_text(tool, dict(wing.TOOLS)[tool]).replace("[[tools]]", "[tool]")
    text += wing.base_text(setup, "[]").replace("[[bases]]", "[workpiece]")
    text = re.sub(r"(?m)^cam = .*\n", "", text)
    cam, cell = folder / "alone.cls", folder / "alone.toml"
    cell.write_text(wing.HEAD + text + wing.HOME)
    lines = wing.apt_text(count).splitlines()
    starts = [i for i, line in enumerate(lines) if line.startswith("MSYS/")] + [len(lines) - 2]
    at = 3 * (setup - 1) + tool - 1
    own = lines[starts[at] + 1 : starts[at + 1]]
    cam.write_text("\n".join(["PARTNO wing", "UNITS/MM", *own, "SPINDL/OFF", "FINI", ""]))
    return cam, cell


STIFF = "[stiffness]\njoint_Nmm_per_rad = [1.58e10, 6.12e9, 5.28e9, 4.66e8, 2.19e8, 3.49e8]\n"


def without_solids(text, other):
    """Return the cell without the panel of one setup."""
    head, *bases = text.split("[[bases]]")
    bases[other - 1] = re.sub(r"(?m)^meshes = .*\n", "", bases[other - 1])
    return "[[bases]]".join([head, *bases])


@pytest.mark.parametrize(("tool", "setup"), [(1, 1), (3, 2)])
def test_stiffness_is_that_of_each_tool(job, run, tmp_path, tool, setup):
    """Tag by tag as in a cell that has only this tool and this setup."""
    cam, cell = job(STIFF)
    cell.write_text(without_solids(cell.read_text(), other=3 - setup))
    own_cam, own_cell = one_tool_alone(tmp_path, tool, setup)
    own_cell.write_text(own_cell.read_text() + STIFF)
    call = ("--json", "--dialect", "nx", "--step", 30, "--most", 100)
    code, whole, err = run("stiffness", cam, "--cell", cell, *call)
    assert code == 0, err
    code, alone, err = run("stiffness", own_cam, "--cell", own_cell, *call)
    assert code == 0, err
    mine = [tag for tag in whole["tags"] if tag["tag"] // 5 == 3 * (setup - 1) + tool - 1]
    assert len(mine) == len(alone["tags"]) == 4
    assert {tag["tool"] for tag in mine} == {6 + tool}
    for one, two in zip(mine, alone["tags"], strict=True):
        for name, values in two["N_per_mm"].items():
            known = [np.array(row, dtype=float) for row in (one["N_per_mm"][name], values)]
            np.testing.assert_allclose(*known, rtol=1e-9)
        assert one["can_be_run"] == two["can_be_run"]


def test_the_spin_map_is_that_of_each_tool(job, run, tmp_path):
    cam, cell = job(STIFF, "[optimize]\nstep_deg = 60\n")
    cell.write_text(without_solids(cell.read_text(), other=1))
    maps = []
    own_cam, own_cell = one_tool_alone(tmp_path, 3, 2)
    own_cell.write_text(own_cell.read_text() + STIFF + "[optimize]\nstep_deg = 60\n")
    for number, (source, where) in enumerate(((cam, cell), (own_cam, own_cell))):
        table = tmp_path / f"map{number}.csv"
        call = ("-o", tmp_path / f"out{number}", "--spin-map", table, "--json", "--dialect", "nx")
        code, document, err = run("convert", source, "--cell", where, *call)
        assert (code, document["failures"]) == (0, []), err
        rows = [line.split(",") for line in table.read_text().splitlines()[1:]]
        maps.append([(row[2], row[3], row[4]) for row in rows])
    own = len(maps[1])
    assert own == 5 * 6
    assert maps[0][-own:] == maps[1]


def test_check_looks_at_every_tool_and_base(job, run):
    _, cell = job()
    code, document, _ = run("check", cell, "--json")
    assert (code, document["ok"]) == (0, True)
    assert [tool["number"] for tool in document["tools"]] == [7, 8, 9]
    assert [base["number"] for base in document["bases"]] == [3, 4]
    assert document["tools"][2]["xyz_mm"] == [127.0, 0.0, 362.0]
    assert (document["tool"], document["workpiece"]) == (document["tools"][0], document["bases"][0])
    text = cell.read_text()
    broken = text.replace("mass_kg = 82", "mass_kg = 820").replace("mass_kg = 81\n", "")
    broken = broken.replace("[1500.0, 200.0, 600.0]", "[9500.0, 200.0, 600.0]")
    cell.write_text(broken)
    code, document, _ = run("check", cell, "--json")
    lines = broken.splitlines()
    found = {item["code"]: (lines[item["line"] - 1], item["text"]) for item in document["findings"]}
    assert code == 1
    assert found["CEL103"] == (
        "mass_kg = 820",
        "tool 9 ream: the tool weighs 820 kg, the robot carries 500 kg",
    )
    assert found["CEL102"][1].startswith("tool 8 csink: no mass_kg")
    assert found["CEL111"][0].startswith("frame = { xyz_mm = [9500.0")
    assert found["CEL111"][1].startswith("base 4: ")
    cell.write_text(wing.cell_text(longer={3: 400.0}))
    loaded = load_cell(cell)
    tip = (build(loaded.robot).fk(loaded.motion.home) @ loaded.tools[2].T_flange_tcp)[:3, 3] / MM
    post = '[[obstacles]]\nname = "post"\nbox = { size_mm = [20, 20, 20] }\n'
    post += f"xyz_mm = {[round(float(v), 3) for v in tip]}\n"
    cell.write_text(wing.cell_text(post, longer={3: 400.0}))
    code, document, _ = run("check", cell, "--json")
    home = [item["text"] for item in document["findings"] if item["code"] == "CEL112"]
    assert code == 1
    assert home == ["tool 9 ream: the robot collides at home: tool cutter and obstacle post"]


def test_measured_holes_are_found_in_the_setup_they_lie_in(converted, run, tmp_path):
    """Rows at the holes that the second tool makes in both setups, 0.2 mm off in the root's z."""
    cam, cell, program = converted("[measuring]\nsigma_mm = 0.01\n", count=12)
    loaded = load_cell(cell)
    modules, kinematics = load_program(program), build(loaded.robot)
    trace = run_in_cell(modules, modules[0].name, loaded, kinematics)
    q = joint_paths(trace, loaded, kinematics).q
    tool, _, points = tips(program, cell)
    bottom = (tool == 8) & (np.abs(points[:, 2] + wing.DEPTHS[2]) < 0.01)
    assert bottom.sum() == 24
    tip = (kinematics.fk(q[bottom]) @ loaded.tools[1].T_flange_tcp)[:, :3, 3] / MM
    rng = np.random.default_rng(5)
    rows = [MEASURED.strip()]
    for k, (angles, p) in enumerate(zip(np.degrees(q[bottom]), tip, strict=True)):
        values = [*angles, *(p + rng.normal([0.0, 0.0, 0.2], 0.01))]
        rows.append(",".join([f"R{k}", *(f"{value:.6f}" for value in values)]))
    measured = tmp_path / "rows.csv"
    measured.write_text("\n".join([*rows, ""]))
    call = ("diagnose", measured, "--cell", cell, "--program", cam, "--json")
    code, document, err = run(*call, "--tool", 8)
    assert code == 0, err
    found = document["where"]["program"]
    assert (found["rows"], found["rows_beside"]) == (24, 0)
    lines = cam.read_text().splitlines()
    second = lines.index("MSYS/" + MSYS_2) + 1
    counts = [
        sum(piece["n"] for piece in found["stretches"] if (piece["line"] > second) == later)
        for later in (False, True)
    ]
    assert counts == [12, 12]
    assert document["gap"]["rms_mm"] == pytest.approx(0.2, abs=0.02)
    wrong = run(*call, "--tool", 7)[1]
    assert wrong["gap"]["rms_mm"] > 5.0, "another tool is another tool point"
    code, _, err = run("identify", measured, "--cell", cell, "-o", tmp_path / "m.toml", "--tool", 8)
    assert "CEL015" not in err, "these rows carry no load, but the tool is known"


def test_normals_are_those_of_the_base_of_each_row(job):
    """The panel of the second base is drawn tilted by 10 deg about x in its own coordinates."""
    names = {1: "MSYS_1", 2: "MCS_2"}
    rows = [f"{150 + k},150,0,{1 + k % 3},{names[base]}" for base in (1, 2) for k in range(6)]
    rows += ["152,151,0,1,MCS_2", "152,152,0,1,MSYS_1"]
    cam, cell = job(
        source=lambda count: "\n".join(["x,y,z,tool,base", *rows, ""]), name="points.csv"
    )
    head, first, second = cell.read_text().split("[[bases]]")
    second = second.replace(
        "xyz_mm = [150, 150, -6.0]", "xyz_mm = [150, 150, -6.0], abc_deg = [0, 0, 10]"
    )
    cell.write_text("[[bases]]".join([head, first, second]))
    part = postproc.read(cam, load_cell(cell))
    tilt = np.radians(10.0)
    tilted = np.array([row.endswith("MCS_2") for row in rows])
    want = np.where(tilted[:, None], [0.0, -np.sin(tilt), np.cos(tilt)], [0.0, 0.0, 1.0])
    np.testing.assert_allclose(part.axes, want, atol=1e-9)


@pytest.mark.parametrize("assigned", [('["1"]', '["ADJUST_2"]'), ('["ADJUST_1"]', '["2"]')])
def test_work_offsets_by_number_are_bases(job, run, tmp_path, assigned):
    """CUTCOM/ADJUST,n is the number of a work offset; unclaimed it stops as it did."""
    cam, cell = job(tools=wing.TOOLS[:1])
    lines = wing.apt_text(2).splitlines()
    lines = [line for line in lines if not line.startswith(("MSYS", "LOADTL"))]
    holes = lines[2 : lines.index("CYCLE/OFF") + 3]
    cam.write_text(
        "\n".join([*lines[:2], "LOADTL/1", "CUTCOM/ADJUST,1", *holes, "CUTCOM/ADJUST,2", *holes,
                   "SPINDL/OFF", "FINI", ""])
    )  # fmt: skip
    text = cell.read_text()
    call = ("convert", cam, "--cell", cell, "-o", tmp_path / "out", "--json", "--dialect", "nx")
    code, _, err = run(*call)
    assert code == 2
    assert "WRD020: setup 1, line 4, is no base" in err
    for old, new in zip(('["MSYS_1"]', '["MCS_2"]'), assigned, strict=True):
        text = text.replace(old, new)
    cell.write_text(text)
    code, document, err = run(*call)
    assert (code, document["failures"]) == (0, []), err
    program = tmp_path / "out" / "wing.src"
    _, base, points = tips(program, cell)
    for number in (3, 4):
        bottom = points[base == number][:, 2].min()
        assert bottom == pytest.approx(-wing.DEPTHS[1], abs=0.01), number
    verify = ("verify", program, "--cell", cell, "--against", cam, "--json", "--dialect", "nx")
    assert run(*verify)[0] == 0


HOLE = "CYCLE/DRILL,FEDTO,9,MMPM,60,RAPTO,3,RTRCTO,20\nGOTO/20,90,0,0,0,1\nCYCLE/OFF\n"
SLOT = "RAPID\nGOTO/20,20,50,0,0,1\nFEDRAT/600,MMPM\nGOTO/20,20,10\nGOTO/50,20,10\n"


@pytest.mark.parametrize("before", [HOLE, SLOT], ids=["hole", "cut"])
@pytest.mark.parametrize("start", ["60,90,10", "50,20,10"], ids=["elsewhere", "same place"])
def test_a_cut_behind_a_change_of_tool_begins_by_a_joint_motion(before, start, tmp_path):
    """From home, where the tool is changed: what lies before is cut by another tool."""
    cell = """schema = "postproc.cell/1"
name = "two"
[robot]
model = "kuka_kr500_r2830"
[[tools]]
number = 1
cam = ["1"]
frame = { xyz_mm = [150, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
[[tools]]
number = 2
cam = ["2"]
frame = { xyz_mm = [180, 0, 300], abc_deg = [0, 0, 0] }
axis = "+x"
[workpiece]
frame = { xyz_mm = [1700, 0, 700], abc_deg = [0, 0, 0] }
[optimize]
step_deg = 60
refine = false
[motion]
home_deg = [0, -90, 90, 0, 30, 0]
"""
    cut = f"FEDRAT/600,MMPM\nGOTO/{start}\nGOTO/90,90,10\n"
    on = "SPINDL/1000,RPM,CLW\n"
    cam = f"UNITS/MM\nLOADTL/1\n{on}{before}LOADTL/2\n{on}{cut}SPINDL/OFF\nFINI\n"
    job = text.converted(tmp_path, cam, cell=cell)
    assert job.good, [str(finding) for finding in job.findings]
