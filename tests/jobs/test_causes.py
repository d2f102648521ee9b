"""Broken jobs: the first sentence names what broke them, and what it says makes them good."""

import json
import re
from dataclasses import replace

import pytest

from postproc.cell import edited_cell, load_cell
from postproc.cli import app
from postproc.jobs.convert import ConvertRequest, convert, explained
from tests.jobs.broken import broken, converted, told

pytestmark = pytest.mark.causes
SAMPLE = (("singular", 1), ("metres", 0), ("inch", 8201), ("axis", 0), ("fixture", 0))
"""A margin, units (once with one tag alone too far), a tool and a solid; a place and a limit below.
All kinds and more of each:
``python -m tests.jobs.broken``."""


@pytest.mark.slow
def test_what_is_broken_is_named_and_the_cure_is_proven(tmp_path):
    found = {case: told(*case, tmp_path) for case in SAMPLE}
    assert [(case, *one) for case, one in found.items() if one is None or one[1]] == []


def test_the_least_move_is_least(tmp_path):
    draw, done = broken("far", 3, tmp_path)
    (cause,) = explained(done, ConvertRequest(done.toolpath.path, done.cell.path)).causes
    assert cause.proven
    assert cause.remedy.endswith("towards A1")
    x, y, z = draw.at
    far = 1.0 - 0.9 * cause.amount / (x * x + y * y) ** 0.5
    assert not converted(replace(draw, at=(x * far, y * far, z)), tmp_path).good


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder in which a job with too wide a margin of the joints stands."""
    monkeypatch.chdir(tmp_path)
    assert broken("margin", 0, tmp_path) is not None
    return tmp_path


def test_the_sentence_stands_first_and_in_the_document(folder, capfd):
    call = "convert holes.csv --cell cell.toml -o out -q"
    assert app.run([*call.split(), "--json"]) == 1
    out, err = capfd.readouterr()
    (cause,) = json.loads(out)["causes"]
    assert err.splitlines()[0] == cause["text"]
    assert cause["proven"]
    value = re.search(r"joint_margin_deg = ([\d.]+) and all", cause["text"]).group(1)
    assert cause["changes"] == [{"path": ["limits", "joint_margin_deg"], "value": float(value)}]
    text = (folder / "cell.toml").read_text()
    (folder / "cell.toml").write_text(
        re.sub(r"joint_margin_deg = \d+", f"joint_margin_deg = {value}", text)
    )
    assert app.run(call.split()) == 0


@pytest.mark.slow
def test_two_causes_are_two_sentences(folder):
    text = (folder / "cell.toml").read_text()
    lid = '[[obstacles]]\nname = "lid"\nbox = { size_mm = [500, 500, 20] }\n'
    place = re.search(r"\[workpiece\].*?xyz_mm = (\[.*?\])", text, re.DOTALL).group(1)
    x, y, z = json.loads(place)
    lid += f"xyz_mm = [{x}, {y}, {z + 60}]\n"
    (folder / "cell.toml").write_text(text.replace("[limits]", f"{lid}[limits]"))
    request = ConvertRequest("holes.csv", "cell.toml")
    found = explained(convert(request), request).causes
    assert [cause.proven for cause in found] == [True, True], found
    assert {"lid" in cause.blame for cause in found} == {True, False}
    assert any("joint_margin_deg" in cause.blame for cause in found)
    (folder / "new.toml").write_bytes(
        edited_cell(load_cell("cell.toml"), found[0].changes, "new.toml")
    )
    assert convert(ConvertRequest("holes.csv", "new.toml")).good
