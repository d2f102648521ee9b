"""A campaign planned for a diagnosis: where it goes, what it reads again, what it can tell."""

from __future__ import annotations

import csv
import json
import re
from collections import Counter

import numpy as np
import pytest

from postproc.cell.file import load_cell
from postproc.cli import app
from postproc.geometry.frames import apply
from postproc.kinematics import build
from tests.places import FIXTURES

CELL = FIXTURES / "measuring_plan" / "cell.toml"
BOX = np.array([1.2, -0.4, 0.7]), np.array([1.9, 0.4, 1.4])


@pytest.fixture(scope="module")
def planned(tmp_path_factory):
    folder = tmp_path_factory.mktemp("plan")
    box = [f"{1e3 * v:g}" for corner in BOX for v in corner]
    call = ["sample", "--cell", str(CELL), "--box", *box, "-o", str(folder), "--for-diagnosis"]
    assert app.run([*call, "--count", "24", "--load-kg", "40", "--quiet"]) == 0
    lines = (folder / "sample.csv").read_text().splitlines()
    return folder, list(csv.DictReader(line for line in lines if not line.startswith("#")))


def angles(rows):
    return np.deg2rad([[float(row[f"q{i}_deg"]) for i in range(1, 7)] for row in rows])


def test_postures_lie_in_the_box_and_turn_the_tool(planned):
    cell = load_cell(CELL)
    kinematics, (_, rows) = build(cell.robot), planned
    T = kinematics.fk(angles(rows))
    points = apply(T, np.asarray(cell.tool.T_flange_tcp)[:3, 3])
    assert np.all((points > BOX[0] - 1e-6) & (points < BOX[1] + 1e-6))
    assert np.all(kinematics.within_limits(angles(rows), cell.limits.joint_margin))
    turned = np.arccos(np.clip(np.einsum("ni,mi->nm", T[:, :3, 2], T[:, :3, 2]), -1, 1))
    assert np.rad2deg(turned.max()) > 60.0


def test_three_postures_are_read_again_from_one_side_all_through(planned):
    _, rows = planned
    loaded = [bool(float(row["fz_N"])) for row in rows]
    assert sum(loaded) == len(rows) // 2
    first = [row for row, on in zip(rows, loaded, strict=True) if not on]
    seen = Counter(row["id"].split("_")[0] for row in first)
    again = [name for name, count in seen.items() if count > 1]
    assert sorted(seen.values())[-3:] == [5, 5, 5]
    assert len(seen) == 24
    for name in again:
        where = [k for k, row in enumerate(first) if row["id"].startswith(f"{name}_")]
        assert where[0] < 3
        assert where[-1] > 0.7 * len(first)
        assert len({tuple(first[k][f"dir{i}"] for i in range(1, 7)) for k in where}) == 1


def test_each_joint_comes_from_both_sides(planned):
    _, rows = planned
    for i in range(1, 7):
        assert {row[f"dir{i}"] for row in rows} == {"-1", "1"}


def test_the_program_drives_it(planned, capsys):
    folder, _ = planned
    assert app.run(["verify", str(folder / "sample.src"), "--cell", str(CELL), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["ok"]


def test_the_page_says_what_the_plan_will_tell(tmp_path, capsys):
    box = [f"{1e3 * v:g}" for corner in BOX for v in corner]
    call = ["sample", "--cell", str(CELL), "--box", *box, "-o", str(tmp_path), "--for-diagnosis"]
    assert app.run([*call, "--count", "20", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert "sample.html" in told["files"]
    page = (tmp_path / "sample.html").read_text(encoding="utf-8")
    page = re.sub(r"<td [^>]*>", "<td>", page)
    small = [one for one in told["effects"] if (one["smallest_mm"] or 1e9) <= one["usual_mm"]]
    assert 0 < len(small) < len(told["effects"])
    assert f"tell {len(small)} of {len(told['effects'])} causes" in page
    for one in told["effects"]:
        words = "not by this plan" if one["smallest_mm"] is None else f"{one['smallest_mm']:.3f}"
        assert f"<td>{one['name'].replace('_', ' ')}</td><td>{words}</td>" in page
    for pair in told["cannot_separate"]:
        first, second = (name.replace("_", " ") for name in pair["effects"])
        assert f"<td>{first}</td><td>{second}</td>" in page
    for one in told["not_testable"]:
        assert one["name"].replace("_", " ") in page


def test_too_few_postures_are_refused(tmp_path, capsys):
    box = [f"{1e3 * v:g}" for corner in BOX for v in corner]
    call = ["sample", "--cell", str(CELL), "--box", *box, "-o", str(tmp_path), "--for-diagnosis"]
    assert app.run([*call, "--count", "8"]) == 2
    assert "STF024" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
