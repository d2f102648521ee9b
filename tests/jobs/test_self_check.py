"""The self-check: effects put into a campaign's own rows, and what is then said of them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.cli.app import run
from postproc.gap import effect_of
from postproc.jobs import self_check as module
from tools.blind.campaign import Plan, drive
from tools.blind.robots import KR210, cell_text
from tools.blind.world import nominal

SIGMA_MM = 0.03


@pytest.fixture
def campaign(tmp_path):
    """Fifty readings of an arm without any effect."""
    rng = np.random.default_rng(6)
    rows = drive(KR210, Plan("wide_noload", 50, "none", 0.5, False, 0, False, 4.0), rng)
    points = 1e3 * nominal(KR210, rows) + rng.normal(0, SIGMA_MM, (50, 3))
    head = "q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm," + ",".join(
        f"dir{k}" for k in range(1, 7)
    )
    lines = [
        ",".join(f"{v:.7f}" for v in (*np.rad2deg(q), *p)) + "," + ",".join(f"{d:g}" for d in side)
        for q, p, side in zip(rows.q, points, rows.direction, strict=True)
    ]
    (tmp_path / "rows.csv").write_text("\n".join([head, *lines]) + "\n", encoding="utf-8")
    text = cell_text(KR210, None) + f"\n[measuring]\nsigma_mm = {SIGMA_MM}\n"
    (tmp_path / "cell.toml").write_text(text, encoding="utf-8")
    return ["diagnose", str(tmp_path / "rows.csv"), "--cell", str(tmp_path / "cell.toml")]


@pytest.mark.slow
def test_what_is_put_in_is_said(campaign, monkeypatch, capsys) -> None:
    wanted = ("backlash", "joint_offset")
    monkeypatch.setattr(module, "_shown", lambda _: [effect_of(name) for name in wanted])
    assert run([*campaign, "--self-check", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["verdict"] == "no_gap"
    checked = told["self_check"]
    assert [(one["effect"], one["size"]) for one in checked] == [
        (name, size) for name in wanted for size in module.SIZES
    ]
    for one in checked:
        assert one["named"] + one["missed"] == pytest.approx(1.0)
        if one["size"] >= 1.0:
            assert one["named"] == 1.0, one
            assert one["true_shrinkage"] > 0.6, one
            assert abs(one["shrinkage"] - one["true_shrinkage"]) < 0.15, one
    monkeypatch.setattr(module, "_shown", lambda _: [effect_of("backlash")])
    monkeypatch.setattr(module, "SIZES", module.SIZES[:1])
    assert run([*campaign, "--self-check"]) == 0
    words = capsys.readouterr().out
    assert "backlash: 0.3 x named" in words


def test_a_diagnosis_without_it_has_none(campaign, capsys) -> None:
    assert run([*campaign, "--json"]) == 0
    assert "self_check" not in json.loads(capsys.readouterr().out)
