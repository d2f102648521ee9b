"""Golden programs: every case of ``fixtures/``, made as a user makes it, byte by byte.

``commands.txt`` of a case holds the commands of a user in that folder: the first makes
``expected``, the others judge it. Accept a change on purpose by ``pytest tests/golden
--update-golden``, which tells what the robot would do differently: read it, then commit.
"""

from __future__ import annotations

import csv
import difflib
import json
import re
import shlex
import shutil
import sys
from pathlib import Path

import pytest

from postproc.cli import app
from tests.places import FIXTURES

KINDS = (".src", ".dat", ".csv")
"""What is compared; pages are not."""
MOST_OFF_MM = 0.01
"""A golden program may be this far from its CAM path."""
MOST_LINES = 40
AXES = ",".join(rf"A{i} (-?[\d.]+)" for i in range(1, 7))


def commands(case: str) -> list[list[str]]:
    """Return the words of each command of a case, without the program's name."""
    lines = (FIXTURES / case / "commands.txt").read_text(encoding="utf-8").splitlines()
    return [shlex.split(line)[1:] for line in lines if line.startswith("postproc ")]


def programs(folder: Path) -> dict[str, bytes]:
    """Return what is compared of a folder: name to content."""
    return {p.name: p.read_bytes() for p in sorted(folder.glob("*")) if p.suffix in KINDS}


PROGRAMS = ("convert", "sample")
"""Commands that write programs; a campaign is judged in ``tests/docs``."""
CASES = [
    case
    for case in sorted(path.parent.name for path in FIXTURES.glob("*/commands.txt"))
    if commands(case)[0][0] in PROGRAMS
]


def changes(old: Path, new: Path, capsys) -> str:
    """Tell what the robot would do differently, then the lines that differ."""
    capsys.readouterr()
    app.run(["diff", str(old), str(new)])
    told = [capsys.readouterr().out.rstrip()]
    before, after = programs(old), programs(new)
    for name in sorted({*before, *after}):
        texts = [files.get(name, b"").decode("latin-1").splitlines() for files in (before, after)]
        lines = list(difflib.unified_diff(*texts, f"expected/{name}", f"new/{name}", "", "", 0, ""))
        told += lines[:MOST_LINES]
        if len(lines) > MOST_LINES:
            told.append(f"... and {len(lines) - MOST_LINES} more lines of {name}")
    return "\n".join(told)


def judge(words: list[str], capsys) -> str:
    """Run a ``verify`` and return what is wrong with the program, nothing where it is good."""
    capsys.readouterr()
    code = app.run([*words, "--json", "--quiet"])
    report = json.loads(capsys.readouterr().out)
    if code != 0 or not report["ok"]:
        return json.dumps(report["violations"], indent=1)
    if "--against" in words and not report["max_position_error_mm"] < MOST_OFF_MM:
        return f"{report['max_position_error_mm']} mm off the CAM path"
    return ""


@pytest.mark.parametrize("case", CASES)
def test_the_command_makes_the_same_bytes(case, tmp_path, monkeypatch, capsys, pytestconfig):
    monkeypatch.chdir(FIXTURES / case)
    expected, new = Path("expected"), tmp_path / "new"
    words = [str(new) if word == "expected" else word for word in commands(case)[0]]
    code = app.run([*words, "--quiet"])
    assert code == 0, capsys.readouterr().err
    if programs(new) == programs(expected):
        return
    told = changes(expected, new, capsys) if expected.is_dir() else "a new case"
    if not pytestconfig.getoption("--update-golden"):
        pytest.fail(f"{told}\nif this is meant: pytest tests/golden --update-golden", pytrace=False)
    shutil.rmtree(expected, ignore_errors=True)
    expected.mkdir()
    for name, content in programs(new).items():
        (expected / name).write_bytes(content)
    with capsys.disabled():
        sys.stdout.write(f"\n{case}: accepted\n{told}\n")


@pytest.mark.parametrize("case", CASES)
def test_the_golden_program_is_good(case, monkeypatch, capsys):
    """A wrong program cannot be accepted: its text, run on the robot model, must do the job."""
    monkeypatch.chdir(FIXTURES / case)
    make, *checks = commands(case)
    assert checks
    assert all(words[0] == "verify" for words in checks)
    assert all(("--against" in words) == (make[0] == "convert") for words in checks)
    for words in checks:
        assert judge(words, capsys) == ""
    sources = [str(path) for path in Path("expected").glob("*.src")]
    assert app.run(["lint", *sources, "--quiet"]) == 0


def test_a_program_that_is_off_would_not_be_accepted(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(FIXTURES / "trim_5axis")
    text = Path("expected/trim.src").read_bytes()
    (tmp_path / "trim.src").write_bytes(text.replace(b"Z -5.0000,A 90", b"Z -4.9700,A 90", 1))
    (tmp_path / "trim.dat").write_bytes(Path("expected/trim.dat").read_bytes())
    _, check = commands("trim_5axis")
    assert judge(check, capsys) == ""
    check[check.index("expected/trim.src")] = str(tmp_path / "trim.src")
    assert '"position"' in judge(check, capsys)


def test_the_measuring_program_halts_at_every_posture_of_its_plan():
    """Read by other means than ours: the plan as a CSV, the program as lines of text."""
    folder = FIXTURES / "measuring_plan" / "expected"
    with (folder / "sample.csv").open(encoding="utf-8", newline="") as stream:
        rows = csv.DictReader(line for line in stream if not line.startswith("#"))
        planned = [tuple(row[f"q{i}_deg"] for i in range(1, 7)) for row in rows]
    text = (folder / "sample.src").read_bytes().decode("ascii")
    halts = re.findall(rf"^PTP \{{{AXES}\}}.*\r\nHALT", text, re.MULTILINE)
    assert len(planned) == 56
    assert halts == planned
