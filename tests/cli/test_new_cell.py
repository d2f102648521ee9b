"""The commands ``new-cell`` and ``check``."""

import json
import os
import pty
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import trimesh

from postproc.cell.file import load_cell
from postproc.cli import app

FIXTURE = Path(__file__).parents[1] / "cell" / "data" / "drilling_kr500.toml"


def run(arguments, capsys):
    code = app.run([str(argument) for argument in arguments])
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_the_written_cell_loads_and_means_what_was_said(tmp_path, capsys):
    path = tmp_path / "new" / "drilling.toml"
    code, out, err = run(
        ["new-cell", "-o", path, "--robot", "kuka_kr210_r2700_2", "--tool-xyz", 10, 0, 300,
         "--tool-abc", 0, 90, 0, "--tool-axis", "-y", "--tool-mass", 42,
         "--workpiece-xyz", 1500, -200, 700, "--json"],
        capsys,
    )  # fmt: skip
    assert (code, err) == (0, "")
    assert json.loads(out)["robot"] == "kuka_kr210_r2700_2"
    cell = load_cell(path)
    assert cell.name == "drilling"
    np.testing.assert_allclose(cell.tool.T_flange_tcp[:3, 3], [0.01, 0.0, 0.3])
    np.testing.assert_allclose(cell.tool.T_flange_tcp[:3, 0], [0, 0, -1], atol=1e-15)
    np.testing.assert_array_equal(cell.tool.axis, [0, -1, 0])
    assert cell.tool.mass == 42
    np.testing.assert_allclose(cell.T_robroot_base[:3, 3], [1.5, -0.2, 0.7])
    defaults = load_cell_with_robot_only(tmp_path)
    for part in ("limits", "optimize", "krl"):
        assert getattr(cell, part) == getattr(defaults, part)


def load_cell_with_robot_only(folder):
    path = folder / "smallest.toml"
    path.write_text('schema = "postproc.cell/1"\n[robot]\nmodel = "kuka_kr210_r2700_2"\n')
    return load_cell(path)


def test_every_key_stands_in_the_file_with_its_meaning(tmp_path, capsys):
    path = tmp_path / "cell.toml"
    assert run(["new-cell", "-o", path, "--robot", "kuka_kr500_r2830"], capsys)[0] == 0
    text = path.read_text(encoding="utf-8")
    for words in (
        "joint_margin_deg = 2.0  # distance from the joint limits",
        "# joint_Nmm_per_rad = ...",
        "# [[obstacles]]",
        "# home_deg = ...",
        "# meshes = ...",
    ):
        assert words in text
    assert max(len(line) for line in text.splitlines()) <= 100


def test_a_urdf_is_named_relative_to_the_file(tmp_path, capsys):
    joints = "".join(
        f'<link name="l{i}"/><joint name="j{i}" type="revolute"><parent link="l{i - 1}"/>'
        f'<child link="l{i}"/><limit lower="-1" upper="2" velocity="3"/></joint>'
        for i in range(6)
    )
    (tmp_path / "arm.urdf").write_text(f'<robot name="toy"><link name="l-1"/>{joints}</robot>')
    path = tmp_path / "cells" / "cell.toml"
    assert run(["new-cell", "-o", path, "--urdf", tmp_path / "arm.urdf"], capsys)[0] == 0
    assert 'urdf = "../arm.urdf"' in path.read_text()
    assert load_cell(path).robot.name == "toy"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "CLI010"),
        (["-o", "a.toml"], "CLI012"),
        (["-o", "a.toml", "--robot", "kuka_kr500"], "kuka_kr500_r2830"),
        (["-o", "a.toml", "--robot", "kuka_kr500_r2830", "--tool-mass", "-1"], "tool.mass_kg"),
        (["-o", "a.toml", "--robot", "kuka_kr500_r2830", "--tool-xyz", "nan", "0", "0"], "finite"),
        (["-o", "a.toml", "--urdf", "nothing.urdf"], "no such file"),
        (["-o", "there.toml", "--robot", "kuka_kr500_r2830"], "there.toml:1: error CLI011"),
        (["-o", "a.toml", "--robot", "kuka_kr500_r2830", "--tool-axis", "z"], "CLI001"),
    ],
)
def test_wrong_calls_write_nothing(arguments, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("there.toml").write_text("precious")
    code, out, err = run(["new-cell", *arguments], capsys)
    assert (code, out) == (2, "")
    assert words in err.splitlines()[0]
    assert [path.name for path in tmp_path.iterdir()] == ["there.toml"]
    assert Path("there.toml").read_text() == "precious"


def test_force_overwrites(tmp_path, capsys):
    path = tmp_path / "cell.toml"
    path.write_text("old")
    code, *_ = run(["new-cell", "-o", path, "--robot", "kuka_kr6_r900_2", "--force"], capsys)
    assert code == 0
    assert load_cell(path).robot.name == "kuka_kr6_r900_2"


def test_reference_of_all_keys(capsys):
    code, out, _ = run(["new-cell", "--keys"], capsys)
    assert code == 0
    assert out.startswith("# cell.toml")
    assert "| `joint_margin_deg` |" in out


def test_a_terminal_is_asked_for_what_is_missing(tmp_path):
    path = tmp_path / "cell.toml"
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "postproc", "new-cell", "-o", str(path)]
    answers = [
        *("kr210", "KR 210 R2700-2", "1 2 x", "1 2 3", "", "+x", "12.5", "7", "no.stl", ""),
        *("", "1000 0 500", "", "4", "", "1 2", "0 -90 90 0 30 0", "", "4000", "900"),
    ]
    with subprocess.Popen(
        command, stdin=follower, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        os.close(follower)
        os.write(leader, ("\n".join(answers) + "\n").encode())
        out, err = process.communicate(timeout=120)
    os.close(leader)
    assert process.returncode == 0, err
    assert b"kuka_kr210_r2700_prime" in err  # kr210 may be many
    assert b"expected three numbers" in err
    assert b"expected six numbers" in err
    assert b"no such file 'no.stl'" in err
    assert b"postproc check" in out
    cell = load_cell(path)
    assert cell.robot.name == "kuka_kr210_r2700_2"
    np.testing.assert_allclose(cell.tool.T_flange_tcp[:3, 3], [1e-3, 2e-3, 3e-3])
    np.testing.assert_allclose(cell.T_robroot_base[:3, 3], [1.0, 0.0, 0.5])
    assert cell.tool.mass == 12.5
    assert (cell.tool.number, cell.workpiece.number) == (7, 4)
    np.testing.assert_allclose(np.degrees(cell.motion.home), [0, -90, 90, 0, 30, 0])
    assert cell.motion.feed == pytest.approx(0.015)
    assert (cell.process.spindle, cell.process.spindle_turns) == ("program", 4000 / 60)


def test_a_terminal_is_shown_a_place_for_a_file(tmp_path):
    path, cam = tmp_path / "cell.toml", tmp_path / "holes.csv"
    cam.write_text("x,y,z,i,j,k,depth\n0,0,0,0,0,-1,5\n900,300,0,0,0,-1,5\n")
    leader, follower = pty.openpty()
    command = [sys.executable, "-m", "postproc", "new-cell", "-o", str(path)]
    answers = ["KR 210 R2700-2", "150 0 250", "", "+x", "0", "", "", str(cam)]
    answers += ["", "", "", "hand", ""]
    with subprocess.Popen(
        command, stdin=follower, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        os.close(follower)
        os.write(leader, ("\n".join(answers) + "\n").encode())
        _, err = process.communicate(timeout=60)
    os.close(leader)
    assert process.returncode == 0, err
    assert b"all 2 tags are reached" in err
    assert b"CAM origin" not in err, "it is not asked for any more"
    # the holes are drilled from below in the file: the part is turned over
    assert load_cell(path).T_robroot_base[2, 2] < -0.99


def drilling(count=4, step=60.0, axis=(0, 0, 1)):
    """Return a list of holes on a square grid."""
    rows = [f"{i * step},{j * step},0,{axis[0]},{axis[1]},{axis[2]},12,300"
            for i in range(count) for j in range(count)]  # fmt: skip
    return "\n".join(["x,y,z,i,j,k,depth,feed", *rows, ""])


@pytest.mark.slow
@pytest.mark.parametrize(
    ("robot", "tool", "count", "step", "axis"),
    [
        ("kuka_kr500_r2830", (107, 0, 362), 4, 300.0, (0, 0, 1)),
        ("kuka_kr210_r2700_2", (150, 0, 250), 3, 400.0, (0, 0, -1)),
        ("kuka_kr210_r2700_2", (150, 0, 250), 4, 100.0, (0.6, 0, 0.8)),
        ("kuka_kr6_r900_2", (40, 0, 90), 4, 25.0, (0, 1, 0)),
    ],
)
def test_the_proposed_place_is_reached(robot, tool, count, step, axis, tmp_path, capsys):
    """`convert` reaches every hole there, and where the part is 50 mm off in x, y and z."""
    cam, path = tmp_path / "holes.csv", tmp_path / "cell.toml"
    cam.write_text(drilling(count, step, axis))
    code, out, err = run(
        ["new-cell", "-o", path, "--robot", robot, "--tool-xyz", *tool, "--tool-axis", "+x",
         "--input", cam, "--tool-number", 7, "--base-number", 3, "--feed", 500,
         "--home", 0, -90, 90, 0, 45, 0, "--json"],
        capsys,
    )  # fmt: skip
    assert code == 0, err
    place = json.loads(out)["place"]
    assert (place["tags"], place["margin_deg"] > 0) == (count * count, True)
    assert all(value % 10 == 0 for value in place["xyz_mm"])
    cell = load_cell(path)
    assert (cell.tool.number, cell.workpiece.number) == (7, 3)
    text = path.read_text()
    x, y, z = place["xyz_mm"]
    assert f"xyz_mm = [{x}, {y}, {z}]" in text
    for shift in ((0, 0, 0), (50, -50, 50)):
        moved = [x + shift[0], y + shift[1], z + shift[2]]
        path.write_text(text.replace(f"xyz_mm = [{x}, {y}, {z}]", f"xyz_mm = {moved}"))
        call = ["convert", cam, "--cell", path, "-o", tmp_path / "out", "--json"]
        code, out, err = run(call, capsys)
        assert (code, json.loads(out)["failures"]) == (0, []), err


def test_no_place_writes_no_cell(tmp_path, capsys):
    cam, path = tmp_path / "holes.csv", tmp_path / "cell.toml"
    cam.write_text(drilling(4, 1200.0))
    call = ["new-cell", "-o", path, "--robot", "kuka_kr6_r900_2", "--tool-axis", "+x"]
    code, _, err = run([*call, "--input", cam], capsys)
    assert code == 2
    assert f"{cam}:1: error CEL016: no place was found where kuka_kr6_r900_2" in err
    assert "3600 x 3600 x 0 mm" in err
    assert not path.exists()


def test_meshes_are_named_relative_to_the_cell(tmp_path, monkeypatch, capsys):
    mesh = tmp_path / "head.stl"
    trimesh.creation.box((80, 80, 90)).export(mesh)
    path = tmp_path / "cells" / "cell.toml"
    call = ["new-cell", "-o", path, "--robot", "kuka_kr500_r2830", "--tool-mesh", mesh]
    monkeypatch.chdir(tmp_path)
    code, _, err = run([*call, "--workpiece-mesh", mesh], capsys)
    assert code == 0, err
    assert path.read_text().count('file = "../head.stl"') == 2
    cell = load_cell(path)
    assert cell.tool.meshes[0].file.samefile(mesh)
    assert cell.workpiece.meshes[0].file.samefile(mesh)


def changed(folder, *changes, add=""):
    text = FIXTURE.read_text(encoding="utf-8")
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    path = folder / "cell.toml"
    path.write_text(text + add, encoding="utf-8")
    return path


def checked(path, capsys):
    code, out, _ = run(["check", path, "--json"], capsys)
    document = json.loads(out)
    assert document["ok"] == (code == 0)
    return code, document, {finding["code"]: finding for finding in document["findings"]}


def test_check_says_what_the_cell_is(capsys):
    code, document, findings = checked(FIXTURE, capsys)
    assert code == 0
    assert document["schema"] == "postproc.check/1"
    assert document["robot"] == "kuka_kr500_r2830"
    assert document["tool"]["xyz_mm"] == [107.0, 0.0, 362.0]
    assert document["tool"]["axis"] == "+x"
    assert "-z" in document["workpiece"]["reachable_along"]
    assert set(findings) == {"CEL117", "CEL145", "CEL147"}
    code, out, err = run(["check", FIXTURE], capsys)
    assert code == 0
    assert "robot      kuka_kr500_r2830" in out
    assert "note CEL117" in err


COAXIAL = [("[107, 0, 362]", "[0, 0, 362]"), ('axis = "+x"', 'axis = "+z"')]
FINDINGS = [
    ("CEL101", 0, COAXIAL, "gains no stiffness"),
    ("CEL102", 0, [("mass_kg = 120.0\n", "")], "no mass_kg"),
    ("CEL103", 1, [("mass_kg = 120.0", "mass_kg = 700")], "carries 500 kg"),
    ("CEL104", 0, [("cog_mm = [0, 0, 180]\n", "")], "centre of gravity"),
    ("CEL105", 0, [('meshes = [{ name = "panel"', "#")], "workpiece has no meshes"),
    ("CEL106", 0, [(", cutting = true", "")], "every cut collides"),
    ("CEL107", 0, [("r2830", "r2800_2"), ("[stiffness]\njoint", "#")], "no joint stiffness"),
    ("CEL108", 0, [("[stiffness]\njoint", "#")], "Jiao et al. 2022"),
    ("CEL109", 0, [("3.49e8]", "3.49e5]")], "is it in N*m/rad"),
    ("CEL110", 0, [("frame = { xyz_mm = [1500", "#")], "no workpiece frame"),
    ("CEL111", 0, [("[1500, 0, 600], abc", "[9500, 0, 600], abc")], "cannot be reached"),
    ("CEL115", 1, [('"axial"', '"process"')], "force_N is zero"),
    ("CEL116", 0, [("feed_mm_min = 600\n", "")], "without a feed are refused"),
    ("PLN202", 1, [('"axial"', '"axal"')], "axal"),
    ("EMT340", 1, [("[krl]\n", '[krl]\nemitter = "fanuc"\n')], "expected kuka_krl"),
]


@pytest.mark.parametrize(("code", "exit_code", "changes", "words"), FINDINGS)
def test_check_finds(code, exit_code, changes, words, tmp_path, capsys):
    answer, _, findings = checked(changed(tmp_path, *changes), capsys)
    assert answer == exit_code
    assert words in findings[code]["text"]
    assert findings[code]["line"] > (1 if code != "CEL107" else 0)


@pytest.mark.parametrize(
    ("home", "code", "exit_code"),
    [
        ([0, -90, 90, 0, 30, 0], None, 0),
        ([0, -90, 90, 0, 0, 0], "CEL114", 0),
        ([0, -129, 90, 0, 30, 0], "CEL113", 0),
        ([0, 0, 130, 0, 30, 0], "CEL112", 1),
    ],
)
def test_check_looks_at_home(home, code, exit_code, tmp_path, capsys):
    path = changed(tmp_path, ("rapid_percent = 50", f"rapid_percent = 50\nhome_deg = {home}"))
    answer, _, findings = checked(path, capsys)
    assert answer == exit_code
    assert set(findings) - {"CEL117", "CEL145"} == ({code} if code else set())


def test_check_of_a_file_that_does_not_load(tmp_path, capsys):
    path = changed(tmp_path, ("clearance_mm", "clearence_mm"))
    code, out, err = run(["check", path, "--json"], capsys)
    assert (code, json.loads(out)["schema"]) == (2, "postproc.error/1")
    assert "error CEL002: unknown key 'limits.clearence_mm'" in err.splitlines()[0]


def test_a_home_is_given_refused_or_proposed(tmp_path, capsys):
    """What is proposed in a pipe is a comment that can be put in, and check asks for a home."""
    path = tmp_path / "cell.toml"
    call = ["new-cell", "-o", path, "--force", "--robot", "kuka_kr210_r2700_2", "--home"]
    assert run([*call, 0, -90, 90, 0, 45, 0], capsys)[0] == 0
    np.testing.assert_allclose(np.degrees(load_cell(path).motion.home), [0, -90, 90, 0, 45, 0])
    assert "CEL147" not in checked(path, capsys)[2]
    assert run([*call, "none"], capsys)[0] == 0
    assert "is free of collision" not in path.read_text()
    assert load_cell(path).motion.home is None
    assert run(call[:-1], capsys)[0] == 0
    (line,) = (row for row in path.read_text().splitlines() if "is free of collision" in row)
    code, _, findings = checked(path, capsys)
    assert (code, findings["CEL147"]["severity"]) == (0, "warning")
    proposed = line.removeprefix("# ").split(" is free")[0]
    path.write_text(path.read_text().replace("# home_deg = ...", proposed))
    assert not {"CEL112", "CEL113", "CEL147"} & set(checked(path, capsys)[2])
