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
    assert told["promise"]["at_the_job_mm"] is None
    assert f"by {told['promise']['rms_left_mm']:.3f} mm rms" in page
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


def test_a_job_is_promised_less_than_the_box_by_postures_chosen_for_it(planned, tmp_path, capsys):
    """Read by the cell's and the call's own options; no file, no plan; nothing else changes."""
    box = [f"{1e3 * v:g}" for corner in BOX for v in corner]
    cell, part = tmp_path / "cell.toml", tmp_path / "part.csv"
    frame = "\n[workpiece]\nframe = { xyz_mm = [1500, -100, 900], abc_deg = [0, 0, 0] }\n"
    cell.write_text(CELL.read_text(encoding="utf-8") + frame, encoding="utf-8")
    rows = [f"{x},{y},0,0,0,1" for x in (0, 4) for y in (0, 4, 8)]
    part.write_text("\n".join(["a,b,c,d,e,f", *rows]) + "\n", encoding="utf-8")
    call = ["sample", "--cell", str(cell), "--box", *box, "--count", "24", "--load-kg", "40"]
    how = ["--columns", "x,y,z,i,j,k", "--units", "inch"]
    out = tmp_path / "plan"
    assert app.run([*call, *how, "--for", str(part), "-o", str(out), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    promise, left_out = told["promise"], told["left_out"]
    assert left_out == []
    assert promise["rows"] == told["readings"]
    assert 0.0 < promise["at_the_job_mm"] < promise["rms_left_mm"]
    seen = {e["name"] for e in told["effects"] if (e["smallest_mm"] or 1e9) <= e["usual_mm"]}
    assert seen == set(promise["can_tell"])
    text = f"{promise['rms_left_mm']:.3f} mm at fresh poses, {promise['at_the_job_mm']:.3f} mm at"
    for name in ("sample.csv", "sample.src"):
        assert text in (out / name).read_text(encoding="utf-8")
    assert f"{promise['at_the_job_mm']:.3f} mm rms" in (out / "sample.html").read_text("utf-8")
    assert "at the job" not in (planned[0] / "sample.csv").read_text(encoding="utf-8")
    wrong = [([], "nobody.csv", "IO001"), (["--units", "inch", "--columns", "x,y"], part, "CSV")]
    for more, file, code in wrong:
        assert app.run([*call, *more, "--for", str(file), "-o", str(tmp_path / "no")]) == 2
        assert code in capsys.readouterr().err.splitlines()[0]
    part.write_text("x,y,z,i,j,k\n9000,0,0,0,0,1\n", encoding="utf-8")
    assert app.run([*call, "--for", str(part), "-o", str(tmp_path / "no")]) == 2
    assert capsys.readouterr().err.startswith(f"{part}:2: error STF029: ")
    assert not (tmp_path / "no").exists()


def test_too_few_postures_are_refused(tmp_path, capsys):
    box = [f"{1e3 * v:g}" for corner in BOX for v in corner]
    call = ["sample", "--cell", str(CELL), "--box", *box, "-o", str(tmp_path), "--for-diagnosis"]
    assert app.run([*call, "--count", "8"]) == 2
    assert "STF024" in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
