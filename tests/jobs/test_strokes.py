"""Straight strokes along the tool axis, from any source: the tool does not roll in the part.

Measured on the emitted text: its joints, carried to the tool by pinocchio.
"""

import itertools
import re

import numpy as np
import pinocchio
import pytest

from postproc.cell.file import load_cell
from postproc.cli import app
from postproc.controller.modules import load_program
from postproc.kinematics import build
from postproc.paths import joint_paths, run_in_cell
from tests.cells import FEED, STIFFNESS, cell_text
from tests.kinematics.test_forward import pinocchio_arm

PLACES = [(0, 0), (60, 40), (140, -30), (220, 80), (300, 0), (-80, -120)]
MOST_ROLL_DEG = 0.001
DEEP = """
schema = "postproc.cell/1"
[robot]
model = "kuka_kr560_r3100_2"
[tool]
frame = { xyz_mm = [-40.0, 0.0, 420.0], abc_deg = [0, -60, 0] }
axis = "-x"
[workpiece]
frame = { xyz_mm = [2700.0, 500.0, -100.0], abc_deg = [0, 0, 90] }
[stiffness]
joint_Nmm_per_rad = [1e10, 5e9, 4e9, 3e8, 2e8, 2.5e8]
[motion]
feed_mm_min = 300
"""
REAMED = """
schema = "postproc.cell/1"
[robot]
model = "kuka_kr10_r1100_2"
[tool]
frame = { xyz_mm = [60, 0, 110], abc_deg = [0, 45, 0] }
axis = "+z"
[workpiece]
frame = { xyz_mm = [550, -40, 200], abc_deg = [0, 0, 0] }
[stiffness]
joint_Nmm_per_rad = [3e8, 2.5e8, 1.5e8, 3e7, 2e7, 1e7]
[motion]
feed_mm_min = 300
home_deg = [0, -90, 90, 0, 45, 0]
"""


def drilled():
    """Holes as NX writes them without a cycle: rapid above, feed in, rapid out, all straight."""
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW"]
    for x, y in PLACES:
        lines += [f"RAPID\nGOTO/{x},{y},50,0,0,1", f"RAPID\nGOTO/{x},{y},3", "FEDRAT/120,MMPM"]
        lines += [f"GOTO/{x},{y},-12", f"RAPID\nGOTO/{x},{y},50"]
    return "\n".join([*lines, "SPINDL/OFF", "FINI", ""])


def milled():
    """Slots: feed in, a long way to the side, feed out."""
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW"]
    for x, y in PLACES:
        lines += [f"RAPID\nGOTO/{x},{y},50,0,0,1", "FEDRAT/120,MMPM", f"GOTO/{x},{y},-12"]
        lines += [f"GOTO/{x + 180},{y + 200},-12", f"GOTO/{x + 180},{y + 200},20"]
    return "\n".join([*lines, "SPINDL/OFF", "FINI", ""])


def listed():
    """The same holes as a list with tilted axes."""
    axis = np.array([0.3, -0.2, 1.0]) / np.linalg.norm([0.3, -0.2, 1.0])
    rows = ["x,y,z,i,j,k,motion"]
    for x, y in PLACES:
        for height, motion in ((50, "rapid"), (3, "linear"), (-12, "linear"), (50, "linear")):
            point = np.array([x, y, 0.0]) + height * axis
            rows.append(",".join([*(f"{v:.6f}" for v in (*point, *axis)), motion]))
    return "\n".join([*rows, ""])


def given():
    """The same with whole orientations that turn about the axis from point to point."""
    rows = ["x,y,z,a,b,c,motion"]
    for k, (x, y) in enumerate(PLACES):
        for j, (z, motion) in enumerate(((50, "rapid"), (-12, "linear"), (50, "linear"))):
            rows.append(f"{x},{y},{z},{17 * j + 40 * k},90,0,{motion}")
    return "\n".join([*rows, ""])


def motions(program, cell):
    """Return poses before and after each path motion (m, 4, 4) [m], and its line."""
    cell = load_cell(cell)
    modules, kinematics = load_program(program), build(cell.robot)
    trace = run_in_cell(modules, modules[0].name, cell, kinematics)
    model, flange = pinocchio_arm(cell.robot.geometry)
    data, poses = model.createData(), []
    for q in joint_paths(trace, cell, kinematics).q:
        pinocchio.framesForwardKinematics(model, data, q)
        poses.append(data.oMf[flange].homogeneous @ cell.tool.T_flange_tcp)
    poses = np.array(poses)
    rows = np.flatnonzero(trace.is_cp[1:])
    return poses[rows], poses[rows + 1], trace.line[rows + 1]


@pytest.mark.parametrize(
    ("source", "name"),
    [(drilled, "part.cls"), (milled, "part.cls"), (listed, "part.csv"), (given, "part.csv")],
)
@pytest.mark.parametrize("strategy", ["global", "smooth", "each"])
def test_no_roll_in_a_straight_stroke(run, tmp_path, source, name, strategy):
    cam, cell, out = tmp_path / name, tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text(source())
    cell.write_text(cell_text(STIFFNESS, FEED, f'[optimize]\nstrategy = "{strategy}"\n'))
    call = ("convert", cam, "--cell", cell, "-o", out, "--json")
    code, document, err = run(*call)
    assert (code, document["failures"]) == (0, []), err
    assert "PLN308" not in {item["code"] for item in document["warnings"]}
    before, after, line = motions(out / "part.src", cell)
    axis = before[:, :3, 0]
    way = after[:, :3, 3] - before[:, :3, 3]
    along = np.abs(np.einsum("ni,ni->n", way, axis))
    low = np.minimum(before[:, 2, 3], after[:, 2, 3]) < 0.7 + 0.02  # the part's surface, and above
    stroke = (along > 0.9999 * np.linalg.norm(way, axis=1)) & (along > 1e-3) & low
    assert stroke.sum() >= 2 * len(PLACES)
    turn = np.einsum("nji,njk->nik", before[:, :3, :3], after[:, :3, :3])
    roll = np.degrees(np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    text = (out / "part.src").read_text().splitlines()
    worst = int(np.argmax(np.where(stroke, roll, 0.0)))
    assert roll[stroke].max() <= MOST_ROLL_DEG, text[line[worst] - 1]
    assert run("verify", out / "part.src", "--cell", cell, "--against", cam, "--json")[0] == 0


def test_a_roll_between_two_cuts_is_told(capsys, tmp_path):
    """Down from one long cut to the next: the note says what is measured on the text."""
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW", "RAPID", "GOTO/0,0,50,0,0,1", "FEDRAT/600,MMPM"]
    for level in range(1, 6):
        x = 0 if level % 2 else 400
        lines += [f"GOTO/{x},{x / 2},{-5 * level}", f"GOTO/{400 - x},{200 - x / 2},{-5 * level}"]
    cam, cell, out = tmp_path / "part.cls", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text("\n".join([*lines, "SPINDL/OFF", "FINI", ""]))
    cell.write_text(cell_text(STIFFNESS, FEED))
    assert app.run(["convert", str(cam), "--cell", str(cell), "-o", str(out)]) == 0
    (note,) = re.findall(r"note PLN308: .*? up to ([\d.]+) deg", capsys.readouterr().err)
    before, after, _ = motions(out / "part.src", cell)
    way = after[:, :3, 3] - before[:, :3, 3]
    stroke = np.abs(way[:, 2]) > 0.9999 * np.linalg.norm(way, axis=1)
    stroke &= (np.abs(way[:, 2]) > 1e-3) & (after[:, 2, 3] < 0.7)
    turn = np.einsum("nji,njk->nik", before[:, :3, :3], after[:, :3, :3])
    roll = np.degrees(np.arccos(np.clip((np.trace(turn, axis1=1, axis2=2) - 1) / 2, -1, 1)))
    assert roll[stroke].max() == pytest.approx(float(note), rel=0.06)


def test_a_deep_stroke_turns_to_what_suits_its_bottom(run, tmp_path):
    """Where the tool may turn above a hole, A5 near its limit at the bottom draws it aside."""
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW"]
    for x, y in ((0, 0), (50, 60), (120, 130), (190, 150), (260, 150)):
        lines += [f"RAPID\nGOTO/{x},{y},90,0,0,1", "FEDRAT/120,MMPM", f"GOTO/{x},{y},-93"]
        lines += [f"RAPID\nGOTO/{x},{y},90"]
    cam, cell, out = tmp_path / "part.cls", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text("\n".join([*lines, "SPINDL/OFF", "FINI", ""]))
    cell.write_text(DEEP)
    code, document, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    assert document["grades"]["good"] == 15


@pytest.mark.parametrize("strategy", ["each", "global", "smooth"])
def test_a_bound_of_losses_is_kept_on_strokes_and_told_of_what_is_run(run, tmp_path, strategy):
    """Reamed along tilted axes: the largest loss is one number, and the bound holds for it."""
    lines = ["UNITS/MM", "SPINDL/3000,RPM,CLW"]
    for x, y in itertools.product((-60, 0, 60), (-80, 0, 80)):
        axis = np.array([x / 500, y / 500, 1.0])
        axis /= np.linalg.norm(axis)
        for motion, height in (("RAPID", 50), ("RAPID", 3), ("", -8), ("", 3), ("RAPID", 50)):
            at = ",".join(f"{v:.6f}" for v in (*((x, y, 0) + height * axis), *axis))
            lines += [motion or "FEDRAT/120,MMPM", f"GOTO/{at}"]
    cam, cell, out = tmp_path / "part.cls", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text("\n".join([*lines, "SPINDL/OFF", "FINI", ""]))
    bound = f'[optimize]\nstrategy = "{strategy}"\nloss_bound_percent = 3\n'
    cell.write_text(REAMED + bound)
    code, document, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    assert document["stiffness"]["lost_max_percent"] <= 3.0
    assert "PLN305" not in {item["code"] for item in document["warnings"]}


def test_a_turn_of_strokes_gives_away_no_stiffness_for_travel_that_nobody_counts(run, tmp_path):
    """Deep holes, each by itself: what its strategy does not weigh does not turn a stroke."""
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW"]
    for x, y in PLACES:
        lines += [f"RAPID\nGOTO/{x},{y},50,0,0,1", "FEDRAT/300,MMPM", f"GOTO/{x},{y},-200"]
        lines += [f"RAPID\nGOTO/{x},{y},50"]
    cam, cell, out = tmp_path / "part.cls", tmp_path / "cell.toml", tmp_path / "out"
    cam.write_text("\n".join([*lines, "SPINDL/OFF", "FINI", ""]))
    each = '[optimize]\nstrategy = "each"\npreset = "fastest"\n'
    cell.write_text(cell_text(STIFFNESS, FEED, each))
    code, document, err = run("convert", cam, "--cell", cell, "-o", out, "--json")
    assert code == 0, err
    assert document["grades"]["good"] == 3 * len(PLACES)
    assert document["stiffness"]["lost_max_percent"] < 10.0


def test_a_pin_inside_a_stroke_holds_for_all_of_it(run, tmp_path):
    lines = ["UNITS/MM", "SPINDL/2000,RPM,CLW"]
    for x, y in PLACES[:2]:
        lines += [f"RAPID\nGOTO/{x},{y},50,0,0,1", "FEDRAT/300,MMPM", f"GOTO/{x},{y},-40"]
        lines += [f"RAPID\nGOTO/{x},{y},50"]
    cam, cell, chosen = tmp_path / "part.cls", tmp_path / "cell.toml", tmp_path / "map.csv"
    cam.write_text("\n".join([*lines, "SPINDL/OFF", "FINI", ""]))
    cell.write_text(cell_text(STIFFNESS, FEED, "[optimize]\npins = { 1 = 25, 4 = -15 }\n"))
    call = ("convert", cam, "--cell", cell, "-o", tmp_path / "out", "--spin-map", chosen)
    code, _, err = run(*call, "--quiet")
    assert code == 0, err
    rows = [row.split(",") for row in chosen.read_text().splitlines()[1:]]
    spins = {int(row[0]): float(row[5]) for row in rows}
    assert spins == pytest.approx({0: 25, 1: 25, 2: 25, 3: -15, 4: -15, 5: -15})
