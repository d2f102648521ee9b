"""Families of withheld causes: what is drawn, what the readings tell, what the marks say."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tools.blind import forms, running
from tools.blind.around import AROUND, UNLISTED
from tools.blind.beyond import kind_of, make
from tools.blind.campaign import Plan, drive
from tools.blind.cases import granted
from tools.blind.families import FAMILIES, MARKS, USUAL, table, write_family
from tools.blind.judging import judge
from tools.blind.robots import KR210
from tools.blind.sizes import rare, truth
from tools.blind.world import simulate

PLAN = Plan("wide_loads", 60, "three", 0.5, False, 0, False, 8.0)


def table_of(path: Path) -> list[dict[str, str]]:
    with path.open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_every_cause_moves_the_tool_by_a_real_amount() -> None:
    wrong = []
    for name, kind in {**AROUND, **UNLISTED}.items():
        marks = tuple(c for c in kind.needs if c not in ("time_s",))
        rows = drive(KR210, replace(PLAN, marks=marks), np.random.default_rng(4))
        effect = make(name, np.random.default_rng(5), KR210, rows)
        still = simulate(KR210, rows, []).point
        moved = np.sqrt(np.mean((simulate(KR210, rows, [effect]).point - still) ** 2))
        none = np.abs(simulate(KR210, rows, [effect.scaled(0.0)]).point - still).max()
        if not (1e-5 < moved < 5e-3 and none < 1e-12):
            wrong.append((name, moved, none))
    assert not wrong


@pytest.mark.slow
def test_families_have_what_their_names_say(tmp_path: Path) -> None:
    """Columns logged, causes and sizes of the first ones."""
    few = ("conditions", "tools", "rail")
    told = (*few, "outliers", "sizes", "mastering", "few", "unlisted")
    drawn = {n: write_family(tmp_path / n, n, 3 if n in few else 6, 11) for n in told}
    for name in few:
        for answer in drawn[name]:
            hidden = [t["name"] for t in answer["truth"] if t["name"] in AROUND]
            header = set(table_of(tmp_path / name / "cases" / answer["case"] / "measured.csv")[0])
            assert header & {"tool_no", "fixture", "pressure_bar", "e1_mm"}
            assert len(hidden) == (answer["kind"] != "none")
            assert {c for one in hidden for c in kind_of(one).needs} <= header
    names = ("load_click", "crash")
    assert [a["truth"][0]["name"] in names for a in drawn["outliers"]] == [True] * 6
    assert sum(len(a["genuine"]) > 0 for a in drawn["outliers"]) >= 4
    sizes = [t["strength"] for a in drawn["sizes"] for t in a["truth"] if t["role"] == "planned"]
    assert set(sizes) & {USUAL[0], USUAL[-1]}
    strengths = [t["strength"] for a in drawn["mastering"] for t in a["truth"]]
    assert max(strengths) > 10.0
    assert all(24 <= a["rows"] <= 60 for a in drawn["few"])
    listed = [any(t["outside"] for t in a["truth"]) for a in drawn["unlisted"]]
    assert listed == [True, False] * 3


@pytest.mark.slow
def test_a_family_is_that_of_its_seed(tmp_path: Path) -> None:
    again = [write_family(tmp_path / run, "readings", 3, 5) for run in ("a", "b")]
    assert again[0] == again[1]
    for path in (tmp_path / "a").rglob("*.csv"):
        assert path.read_bytes() == (tmp_path / "b" / path.relative_to(tmp_path / "a")).read_bytes()


def test_readings_tell_of_the_points() -> None:
    """Each form, worked back from its cells."""
    rng = np.random.default_rng(3)
    points = rng.uniform(-1, 1, (40, 3))

    def numbers(cells: forms.Cells, *names: str) -> np.ndarray:
        return np.array([cells[name] for name in names], dtype=float).T

    still = np.zeros_like(points)
    camera = forms.read("camera", points, still, rng)
    assert set(camera["z_mm"]) == {""}
    dial = forms.read("dial", points, still, rng)
    way = numbers(dial, "ux", "uy", "uz")
    along = np.sum(1e3 * points * way, axis=1) / np.linalg.norm(way, axis=1)
    np.testing.assert_allclose(numbers(dial, "u_mm")[:, 0], along, atol=0.02)
    bar = forms.read("ballbar", points, still, rng)
    post = numbers(bar, "from_x_mm", "from_y_mm", "from_z_mm")
    length = np.linalg.norm(1e3 * points - post, axis=1)
    np.testing.assert_allclose(numbers(bar, "length_mm")[:, 0], length, atol=1e-4)
    told = forms.read("sigmas", points, rng.normal(0, 3e-5, (40, 3)), rng)
    sigma = numbers(told, "sx_mm", "sy_mm", "sz_mm")
    off = (numbers(told, *forms.XYZ) - 1e3 * points) / sigma
    assert 0.8 < np.std(off) < 1.2


def test_rows_that_touch_a_plane_lie_in_it() -> None:
    rows = drive(KR210, replace(PLAN, design="patch", loads="none"), np.random.default_rng(4))
    effect = make("joint_offset", np.random.default_rng(5), KR210, rows)

    def real(now: object) -> np.ndarray:
        return simulate(KR210, now, [effect]).point

    touched, cells = forms.touch(KR210.arm, rows, real, np.random.default_rng(6))
    point, face = real(touched), np.array(cells["plane"])
    for name in set(face):
        here = point[face == name] - point[face == name].mean(axis=0)
        assert len(here) < 4 or np.linalg.svd(here, compute_uv=False)[2] < 1e-6


def test_only_one_set_up_of_the_instrument_is_left_out_for_new_rows(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    kept = "[effects.a]\nx = 1\n[instrument.tool_frames]\ny = 2\n[reach]\nz = 3\n"
    text = kept + "[instrument.tracker_creep]\nq = 1\n[instrument.reflector_creep]\nq = 1\n"
    model.write_text(text, encoding="utf-8")
    arm = running._arm(model).read_text(encoding="utf-8")
    assert arm == kept


def test_genuine_rows_and_calm_are_marked() -> None:
    rng = np.random.default_rng(2)
    case = granted(1, FAMILIES["outliers"](1, rng), rng)
    assert rare(case)
    answer = {
        **{"case": "0001", "kind": "outside", "registered": False, "noise_mm": 0.02},
        **{"truth": truth(case), "genuine": [f"r{k}" for k in range(20)]},
        **{"joint_share": None, "joints_explain": None, "joint_Nmm_per_rad": [1e9] * 6},
    }
    diagnosis = {"verdict": "no_gap", "adopted": [], "effects": []}
    marks = [
        judge(answer, {"seconds": 1.0, "diagnosis": diagnosis | {"outliers": gone}})
        for gone in (["r1", "r2", "r99"], [f"r{k}" for k in range(9)])
    ]
    assert [m["thrown"] for m in marks] == [False, True]
    assert all(m["false_calm"] for m in marks)
    text = table("outliers", marks)
    assert "| genuine rows thrown out | 0 | 0.50 | 2 |" in text
    assert "| false calm | 0 | 1.00 | 2 |" in text
    assert "2 x calm where crash is hidden" in text
    assert len(MARKS) == text.count("\n| ") - 1
