"""The commands lint, verify and diff: exit codes, documents, one clear line for bad input."""

import json
from pathlib import Path

import pytest

from postproc.cli.app import run
from tests.samples import APT_TEXT

FIXTURES = Path(__file__).parents[1] / "krl" / "data"


@pytest.fixture
def part(emitted, tmp_path):
    """Folder with a program of ours, its cell and its CAM file."""
    cell, _, files = emitted("dense", "inline", "8.6", 15)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    (tmp_path / "cell.toml").write_text(Path(cell.path).read_text())
    (tmp_path / "demo.apt").write_text(APT_TEXT)
    return tmp_path


def call(capsys, *arguments):
    code = run([str(argument) for argument in arguments])
    out, err = capsys.readouterr()
    return int(code), out, err


def spoil(path, old, new):
    content = path.read_bytes()
    assert old.encode() in content
    path.write_bytes(content.replace(old.encode(), new.encode(), 1))


def test_lint_of_a_file_and_of_a_folder(part, capsys):
    code, out, _ = call(capsys, "lint", part / "demo.src")
    assert code == 0
    assert "0 errors" in out
    code, out, _ = call(capsys, "lint", part, "--json")
    document = json.loads(out)
    assert (code, document["schema"], document["ok"]) == (0, "postproc.lint/1", True)
    assert {finding["severity"] for finding in document["issues"]} <= {"note"}


def test_lint_tells_file_and_line(part, capsys):
    spoil(part / "demo_002.src", "$VEL.CP=", "$VEL.CP=-")
    code, out, _ = call(capsys, "lint", part, "--json")
    document = json.loads(out)
    assert (code, document["ok"]) == (1, False)
    error = next(finding for finding in document["issues"] if finding["severity"] == "error")
    assert error["code"] == "KRL115"
    assert error["file"].endswith("demo_002.src")
    line = (part / "demo_002.src").read_text().splitlines()[error["line"] - 1]
    assert line.startswith("$VEL.CP=-")
    # the file that was asked for is good; what it calls is only read along
    assert call(capsys, "lint", part / "demo.src")[0] == 0


def test_lint_knows_what_the_controller_has(tmp_path, capsys):
    (tmp_path / "A.src").write_text("DEF A( )\nr=rFromConfig\nMY_HELPER(1)\nEND\n")
    (tmp_path / "A.dat").write_text("DEFDAT A\nDECL REAL r\nENDDAT\n")
    config = tmp_path / "system" / "$config.dat"
    config.parent.mkdir()
    config.write_text("DEFDAT $CONFIG\nDECL REAL rFromConfig=1.0\nENDDAT\n")
    assert call(capsys, "lint", tmp_path / "A.src")[0] == 1
    options = ("--config", config, "--routine", "my_helper")
    code, out, _ = call(capsys, "lint", tmp_path / "A.src", *options)
    assert code == 0
    assert "MY_HELPER" not in out


def test_verify_against_the_cam_file(part, capsys):
    arguments = ("verify", part / "demo.src", "--cell", part / "cell.toml")
    code, out, _ = call(capsys, *arguments, "--against", part / "demo.apt", "--json")
    document = json.loads(out)
    assert (code, document["schema"], document["ok"]) == (0, "postproc.verify/1", True)
    assert document["violations"] == []
    assert document["tags"] == document["matched"] == 15
    assert document["max_position_error_mm"] < 0.001
    assert document["max_axis_error_deg"] < 0.001
    assert document["cycle_time_s"] > 60
    code, out, _ = call(capsys, *arguments)
    assert code == 0
    assert out.splitlines()[-1].startswith("good")


def test_verify_names_the_bad_line(part, capsys):
    spoil(part / "demo_001.src", "Y -100.0000", "Y -101.0000")
    arguments = ("verify", part / "demo.src", "--cell", part / "cell.toml")
    code, out, _ = call(capsys, *arguments, "--against", part / "demo.apt", "--json")
    document = json.loads(out)
    assert code == 1
    worst = document["worst"]["position"]
    assert worst["file"].endswith("demo_001.src")
    assert document["max_position_error_mm"] == pytest.approx(1.0, abs=1e-3)
    violation = document["violations"][0]
    line = (part / "demo_001.src").read_text().splitlines()[violation["line"] - 1]
    assert "Y -101.0000" in line
    assert call(capsys, *arguments)[0] == 0  # by itself the program is sound


def test_verify_says_what_it_does_not_know(part, capsys):
    path = part / "demo.src"
    arguments = ("verify", path, "--cell", part / "cell.toml")
    plain = json.loads(call(capsys, *arguments, "--json")[1])["motions"]
    assert plain["judged"] == plain["in_text"]
    assert plain["unknown"] == []
    assert "not known" not in call(capsys, *arguments)[1]
    sub = next(part.glob("demo_001.src"))
    lines = sub.read_text().split("\n")
    first = next(i for i, line in enumerate(lines) if line.startswith("LIN"))
    sub.write_text("\n".join([*lines[:first], "ELSEWHERE()", *lines[first:]]))
    code, out, _ = call(capsys, *arguments)
    assert code == 1
    assert f"not known  {sub}:{first + 2}: what happens right before it is not known" in out
    assert f"{plain['in_text'] - 1} of {plain['in_text']} motions of the text" in out


def test_diff_of_files_and_folders(part, tmp_path, capsys):
    other = tmp_path / "other"
    other.mkdir()
    for name in part.glob("demo*.[sd]*"):
        (other / name.name).write_bytes(name.read_bytes())
    code, out, _ = call(capsys, "diff", part / "demo.src", other / "demo.src")
    assert (code, out.split(":")[0]) == (0, "same")
    spoil(other / "demo_003.src", "X 5.0000", "X 5.0500")
    code, out, _ = call(capsys, "diff", part / "demo.src", other / "demo.src", "--json")
    document = json.loads(out)
    assert (code, document["same"], document["counts"]) == (1, False, {"moved": 1})
    assert document["differences"][0]["distance_mm"] == pytest.approx(0.05)
    assert call(capsys, "diff", part / "demo.src", other / "demo.src", "--tol-mm", 0.1)[0] == 0


BAD = [
    (b"", "KRL002"),
    (b"\x00\x01\x02" * 100, "KRL001"),
    (b"x,y,z\n1,2,3\n", "KRL005"),
    (b"DEF A( )\nLIN {X 1.0", "KRL004"),
    (b"DEF A( )\nLIN {X 1.0}\n", "KRL006"),
]


@pytest.mark.parametrize(("content", "code"), BAD)
@pytest.mark.parametrize("command", ["verify", "diff"])
def test_bad_programs_are_one_line_and_exit_code_2(part, tmp_path, capsys, command, content, code):
    (tmp_path / "A.src").write_bytes(content)
    rest = ("--cell", part / "cell.toml") if command == "verify" else (part / "demo.src",)
    status, out, err = call(capsys, command, tmp_path / "A.src", *rest)
    assert (status, out) == (2, "")
    first = err.splitlines()[0]
    assert f": error {code}: " in first
    assert first.startswith(str(tmp_path / "A.src"))
    assert "Traceback" not in err


@pytest.mark.parametrize("command", ["verify", "lint", "diff"])
def test_missing_files(part, tmp_path, capsys, command):
    rest = {"verify": ("--cell", part / "cell.toml"), "lint": (), "diff": (part / "demo.src",)}
    status, _, err = call(capsys, command, tmp_path / "none.src", *rest[command])
    assert status == 2
    assert "error IO001" in err


def test_lint_of_what_is_no_krl(tmp_path, capsys):
    (tmp_path / "A.src").write_bytes(b"PK\x03\x04")
    assert call(capsys, "lint", tmp_path / "A.src")[0] == 2
    assert call(capsys, "lint", tmp_path / "part.cls")[0] == 2
    empty = tmp_path / "empty"
    empty.mkdir()
    assert call(capsys, "lint", empty)[0] == 2


@pytest.mark.parametrize("command", ["verify", "lint", "diff"])
def test_help_has_an_example(capsys, command):
    code, out, _ = call(capsys, command, "--help")
    assert code == 0
    assert f"postproc {command} " in out
