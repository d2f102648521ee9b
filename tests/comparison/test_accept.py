"""Accepting a new version copies exactly what belongs to it."""

import json

import pytest

from postproc.cli.app import run

MAIN = "DEF {name} ( )\n{body}END\n"


def program(folder, name, *lines):
    folder.mkdir(exist_ok=True)
    body = "".join(f"{line}\n" for line in lines)
    (folder / f"{name}.src").write_bytes(MAIN.format(name=name, body=body).encode())


def pose(x):
    return f"LIN {{X {x},Y 0,Z 500,A 0,B 90,C 0}}"


def names(folder):
    return sorted(p.name for p in folder.iterdir())


@pytest.fixture
def folders(tmp_path):
    old, new = tmp_path / "old", tmp_path / "new"
    program(old, "WING", pose(900), "WING_1()")
    program(old, "WING_1", pose(950))
    program(old, "GONE", pose(1000))
    (old / "notes.txt").write_text("mine")
    program(new, "WING", pose(901), "WING_1()")
    program(new, "WING_1", pose(951))
    program(new, "FRESH", pose(1000))
    (new / "manifest.json").write_text("{}")
    return old, new


def test_a_folder(folders, capsys):
    old, new = folders
    assert run(["diff", str(old), str(new), "--json"]) == 1
    capsys.readouterr()
    assert run(["diff", str(old), str(new), "--update", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["same"] is False
    changed = ["FRESH.src", "GONE.src", "WING.src", "WING_1.src", "manifest.json"]
    assert document["updated"] == [str(old / name) for name in changed]
    assert names(old) == ["FRESH.src", "WING.src", "WING_1.src", "manifest.json", "notes.txt"]
    assert (old / "WING.src").read_bytes() == (new / "WING.src").read_bytes()
    assert run(["diff", str(old), str(new)]) == 0


def test_a_program_with_its_sub_programs(folders):
    old, new = folders
    assert run(["diff", str(old / "WING.src"), str(new / "WING.src"), "--update"]) == 0
    assert names(old) == ["GONE.src", "WING.src", "WING_1.src", "notes.txt"]
    assert (old / "WING_1.src").read_bytes() == (new / "WING_1.src").read_bytes()


def test_another_name_is_refused(folders, capsys):
    old, new = folders
    before = (old / "WING.src").read_bytes()
    assert run(["diff", str(old / "WING.src"), str(new / "FRESH.src"), "--update"]) == 2
    assert "error DIF002" in capsys.readouterr().err
    assert (old / "WING.src").read_bytes() == before
