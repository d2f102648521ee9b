"""The command ``explain``."""

import json
import subprocess
import sys

import pytest

from postproc.cli import app
from postproc.codes import find, groups


def run(arguments, capsys):
    code = app.run(arguments)
    captured = capsys.readouterr()
    return code, captured.out, captured.err


@pytest.mark.parametrize("name", ["APT010", "apt010", " Apt010 "])
def test_a_code_in_any_case_gives_title_cause_and_remedy(name, capsys):
    code, out, err = run(["explain", name], capsys)
    assert (code, err) == (0, "")
    title, cause, remedy = out.split("\n\n")
    assert title == "APT010 (error): Unit of length unknown"
    assert cause.startswith("Cause: ")
    assert remedy.startswith("Remedy: ")
    assert "--units mm" in remedy
    assert max(map(len, out.splitlines())) <= 88


def test_a_code_of_several_severities_names_none(capsys):
    assert run(["explain", "KRL105"], capsys)[1].startswith("KRL105: Lint")


def test_json_has_the_same_texts(capsys):
    code, out, err = run(["explain", "pln102", "--json"], capsys)
    entry = find("PLN102")
    assert (code, err) == (0, "")
    assert json.loads(out) == {
        "schema": "postproc.explain/1",
        "code": "PLN102",
        "severity": "error",
        "title": entry.title,
        "cause": entry.cause,
        "remedy": entry.remedy,
    }


@pytest.mark.parametrize(
    ("name", "expected"),
    [("APT011", "APT012"), ("ATP012", "APT012"), ("PLN20", "PLN101"), ("?", "explain lists all")],
)
def test_an_unknown_code_names_the_nearest(name, expected, capsys):
    code, out, err = run(["explain", name, "--json"], capsys)
    assert (code, json.loads(out)["schema"]) == (2, "postproc.error/1")
    assert err.startswith(f"postproc:1: error CLI014: no finding or word is called {name!r}")
    assert expected in err


def test_without_a_code_all_are_listed_by_prefix(capsys):
    code, out, err = run(["explain"], capsys)
    assert (code, err) == (0, "")
    blocks = [block.splitlines() for block in out.strip().split("\n\n")]
    assert [block[0].split()[0] for block in blocks] == [group.prefix for group in groups()]
    listed = [line.split()[0] for block in blocks for line in block[1:]]
    assert listed == [entry.code for group in groups() for entry in group.entries]


def test_the_list_as_json(capsys):
    code, out, _ = run(["explain", "--json"], capsys)
    codes = json.loads(out)["codes"]
    assert code == 0
    assert {"code": "PLN205", "severity": "error", "title": "Cut without a feed"} in codes


def test_quiet_says_nothing(capsys):
    assert run(["explain", "APT010", "--quiet"], capsys) == (0, "", "")
    assert run(["explain", "-q"], capsys) == (0, "", "")


def test_explain_loads_no_numbers():
    code = (
        "import sys; from postproc.cli import app; code = app.run(['explain'])\n"
        "heavy = {'numpy', 'scipy', 'trimesh', 'pinocchio', 'coal', 'lxml', 'pydantic', 'rich'}\n"
        "assert code == 0\nassert not heavy & set(sys.modules), heavy & set(sys.modules)"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)
