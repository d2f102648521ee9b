"""The certificate of a diagnosis: its numbers against the rows, its page against its numbers."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from postproc.cli.app import run
from tools.blind.campaign import Plan, drive
from tools.blind.effects import LIBRARY
from tools.blind.pages import contradictions, sentences
from tools.blind.robots import KR210, cell_text
from tools.blind.world import Hidden, nominal, simulate

SIGMA = 2e-5
STATED = """
[measuring]
sigma_mm = 0.02
instrument = "Tracker T"
serial = "0815"
operator = "A. Measurer"
"""


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A campaign of 60 poses, two of them read six times more; its diagnosis."""
    folder = tmp_path_factory.mktemp("certificate")
    rng = np.random.default_rng(8)
    plan = Plan("wide_noload", 60, "none", 0.5, False, 0, False, 4.0)
    rows = drive(KR210, plan, rng)
    rows = rows.take(np.array([*range(60), *[3] * 6, *[40] * 6]))
    hidden = Hidden("joint_offset", {"offset": np.array([0, 1, -2, 1, 2, 0]) * 3e-4}, 1.0,
                    LIBRARY["joint_offset"].change)  # fmt: skip
    point = simulate(KR210, rows, [hidden]).point
    point = 1e3 * (point + rng.normal(0, SIGMA, (72, 3)))
    lines = ["id,q1_deg,q2_deg,q3_deg,q4_deg,q5_deg,q6_deg,x_mm,y_mm,z_mm,time_s"]
    for k, (q, p) in enumerate(zip(np.rad2deg(rows.q), point, strict=True)):
        numbers = ",".join(f"{v:.9f}" for v in (*q, *p))
        lines.append(f"r{k},{numbers},{60 * k}")
    (folder / "measured.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    (folder / "cell.toml").write_text(cell_text(KR210, None) + STATED, encoding="utf-8")
    call = ["diagnose", str(folder / "measured.csv"), "--cell", str(folder / "cell.toml"), "--json"]
    assert run([*call, "-o", str(folder / "out"), "--quiet"]) == 0
    np.save(folder / "commanded.npy", 1e3 * nominal(KR210, rows))
    return folder


def test_numbers_are_those_of_the_rows(written: Path, capsys: pytest.CaptureFixture[str]) -> None:
    call = ["diagnose", str(written / "measured.csv"), "--cell", str(written / "cell.toml")]
    assert run([*call, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)["certificate"]
    assert told["stated"] == {
        **{"instrument": "Tracker T", "serial": "0815", "operator": "A. Measurer"}
    }
    with (written / "measured.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    point = np.array([[float(row[f"{a}_mm"]) for a in "xyz"] for row in rows])
    assert told["rows"]["total"] == len(rows)
    assert told["rows"]["used"] + len(told["rows"]["not_used"]) == len(rows)
    q1 = [float(row["q1_deg"]) for row in rows]
    np.testing.assert_allclose(told["validity"]["joints_deg"][0], [min(q1), max(q1)], atol=0.01)
    commanded = np.load(written / "commanded.npy")
    for pose, at in zip(told["iso9283"]["poses"], (3, 40), strict=True):
        mine = [at, *range(60, 66)] if at == 3 else [at, *range(66, 72)]
        centre = point[mine].mean(axis=0)
        apart = np.sqrt(np.sum((point[mine] - centre) ** 2, axis=1))
        rp = apart.mean() + 3 * np.sqrt(np.sum((apart - apart.mean()) ** 2) / 6)
        assert pose["pose"] == f"r{at}"
        assert pose["readings"] == 7
        assert pose["rp_mm"] == pytest.approx(rp, abs=2e-4)
        assert pose["ap_mm"] == pytest.approx(np.linalg.norm(centre - commanded[at]), abs=2e-3)
    held = told["held_out"]
    assert sum(held["before"]) == sum(held["after"]) == held["rows"] == told["rows"]["used"]
    assert held["rms_mm"][1] < 0.1 * held["rms_mm"][0]


def test_the_page_says_what_its_numbers_say(
    written: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    call = ["diagnose", str(written / "measured.csv"), "--cell", str(written / "cell.toml")]
    run([*call, "--json"])
    content = json.loads(capsys.readouterr().out)
    page = (written / "out" / "report.html").read_bytes()
    assert contradictions(content, page) == []
    words = sentences(page)
    for word in ("Tracker T", "0815", "A. Measurer", "not stated", "ISO 9283"):
        assert word in words
    assert f"{content['certificate']['uncertainty']['reading_mm']:.4f} mm" in words
