"""Broken jobs: the first sentence names what broke them, and what it says makes them good."""

import json
import re

import numpy as np

from postproc.cli import app
from postproc.jobs.causes import causes
from postproc.jobs.convert import ConvertRequest, explained
from postproc.units import MM
from tests.jobs.broken import KINDS, broken, good, made


def test_what_is_broken_is_named_and_the_cure_is_proven(tmp_path):
    wrong, count = [], 0
    for kind, words in KINDS.items():
        for seed in (0, 2):
            done = broken(kind, np.random.default_rng(seed), tmp_path)
            if done is None:
                continue
            count += 1
            request = ConvertRequest(done.toolpath.path, done.cell.path)
            (cause,) = explained(done, request).causes
            if words not in cause.text or not cause.proven:
                wrong.append((kind, seed, cause.text))
    assert wrong == []
    assert count >= 7


def test_the_least_move_is_least(tmp_path):
    done = broken("reach", np.random.default_rng(0), tmp_path)
    request = ConvertRequest(done.toolpath.path, done.cell.path)
    (cause,) = explained(done, request).causes
    assert cause.remedy.endswith("towards A1")
    x, y, z = done.cell.T_robroot_base[:3, 3] / MM
    for share, is_good in ((1.0, True), (0.9, False)):
        far = 1.0 - share * cause.amount / np.hypot(x, y)
        assert good(tmp_path, made(tmp_path, frame=(x * far, y * far, z))).good == is_good


def test_the_sentence_stands_first_and_in_the_document(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)
    assert broken("margin", np.random.default_rng(0), tmp_path) is not None
    assert (
        app.run(["convert", "holes.csv", "--cell", "cell.toml", "-o", "out", "--json", "-q"]) == 1
    )
    out, err = capfd.readouterr()
    (cause,) = json.loads(out)["causes"]
    assert err.splitlines()[0] == cause["text"]
    assert cause["proven"]
    value = re.search(r"joint_margin_deg = ([\d.]+) and all", cause["text"]).group(1)
    text = (tmp_path / "cell.toml").read_text()
    (tmp_path / "cell.toml").write_text(
        re.sub(r"joint_margin_deg = \d+", f"joint_margin_deg = {value}", text)
    )
    assert app.run(["convert", "holes.csv", "--cell", "cell.toml", "-o", "out", "-q"]) == 0


def test_a_cure_that_does_not_hold_is_not_told(tmp_path):
    done = broken("margin", np.random.default_rng(0), tmp_path)
    (cause,) = causes(done.toolpath, done.cell, done.findings, lambda cell: False)
    assert (cause.remedy, cause.proven) == ("", False)
    assert "no single change" in cause.text
