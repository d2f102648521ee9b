"""``postproc diagnose`` and ``postproc predict`` as a user calls them."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.cli.app import run
from tests.places import PANEL_CELL

CELL = str(PANEL_CELL)


@pytest.fixture
def rows(world, tmp_path):
    data, measured, fresh, points = world.make(51, {"joint_compliance": 3e-4}, n=160)
    (tmp_path / "fresh.csv").write_text(world.csv(fresh, points))
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, measured))
    return path


def test_diagnose_prints_one_document_and_writes_page_and_model(rows, tmp_path, capsys):
    out = tmp_path / "out"
    assert run(["diagnose", str(rows), "--cell", CELL, "--json", "-o", str(out)]) == 0
    document = json.loads(capsys.readouterr().out)
    assert document["schema"] == "postproc.diagnosis/1"
    assert document["verdict"] == "explained"
    assert document["adopted"] == ["joint_compliance"]
    assert set(document["gap"]) == {"rms_mm", "p95_mm", "max_mm"}
    effect = document["effects"][0]
    assert effect["name"] == "joint_compliance"
    assert effect["adopted"]
    assert effect["probability"] > 0.95
    assert 0.8 < effect["shrinkage_ci"][0] <= effect["shrinkage"] <= effect["shrinkage_ci"][1] < 1
    assert len(effect["parameters"]["stiffness_Nmm_per_rad"]) == 6
    assert sum(joint["share"] for joint in document["where"]["joints"]) == pytest.approx(
        1, abs=1e-3
    )
    assert document["where"]["conditions"][0]["name"] == "load"
    assert document["residual"]["explained_share"] > 0.98
    page = (out / "report.html").read_text()
    assert "data-chart" in page
    assert "http://" not in page.replace("http://www.w3.org", "")
    predicted = tmp_path / "p.csv"
    model = ["--model", str(out / "model.toml")]
    fresh = str(tmp_path / "fresh.csv")
    assert run(["predict", fresh, "--cell", CELL, *model, "-o", str(predicted), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rms_mm"] < 0.02
    assert predicted.read_text().splitlines()[0].startswith("id,x_mm,y_mm,z_mm")
    assert len(predicted.read_text().splitlines()) == 201


def test_a_gap_above_the_asked_tolerance_is_a_bad_answer(rows, capsys):
    assert run(["diagnose", str(rows), "--cell", CELL, "--tol-mm", "0.1"]) == 1
    assert "Cause: the joints give way" in capsys.readouterr().out


def test_points_of_another_frame_ask_for_registration(world, tmp_path, capsys):
    data, measured, *_ = world.make(52, {}, n=60)
    path = tmp_path / "far.csv"
    path.write_text(world.csv(data, measured + 2.0))
    assert run(["diagnose", str(path), "--cell", CELL]) == 2
    error = capsys.readouterr().err
    assert "far.csv" in error.splitlines()[0]
    assert "GAP004" in error.splitlines()[0]
    assert "--register" in error


def test_too_few_rows_are_an_error_and_nothing_is_written(world, tmp_path, capsys):
    data, measured, *_ = world.make(53, {}, n=40)
    path = tmp_path / "few.csv"
    path.write_text("\n".join(world.csv(data, measured).splitlines()[:5]))
    out = tmp_path / "out"
    assert run(["diagnose", str(path), "--cell", CELL, "-o", str(out)]) == 2
    assert "GAP003" in capsys.readouterr().err.splitlines()[0]
    assert not out.exists()


def spoilt(path, name, change):
    """Write a table with one column or more changed; return where it stands."""
    head, *lines = [line.split(",") for line in path.read_text().splitlines()]
    which = [k for k, column in enumerate(head) if column.startswith(name)]
    for line in lines:
        for k in which:
            line[k] = repr(change(float(line[k])))
    other = path.with_name("spoilt.csv")
    other.write_text("\n".join(",".join(line) for line in [head, *lines]) + "\n")
    return other


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "change"),
    [("temp_C", lambda v: v + 273.15), ("q", lambda v: v * 3.141592653589793 / 180.0)],
)
def test_predict_reads_a_file_as_diagnose_does(rows, tmp_path, capsys, name, change):
    """The same rows in kelvin or radians: said, and every row answered as if they were not."""
    fresh, out = tmp_path / "fresh.csv", tmp_path / "out"
    assert run(["diagnose", str(rows), "--cell", CELL, "-o", str(out), "--quiet"]) == 0
    call = ["--cell", CELL, "--model", str(out / "model.toml"), "--json", "-o"]
    right, other = tmp_path / "right.csv", tmp_path / "other.csv"
    capsys.readouterr()
    assert run(["predict", str(fresh), *call, str(right)]) == 0
    assert json.loads(capsys.readouterr().out)["remarks"] == []
    assert run(["predict", str(spoilt(fresh, name, change)), *call, str(other)]) == 0
    said = capsys.readouterr()
    remarks = json.loads(said.out)["remarks"]
    assert [remark["kind"] for remark in remarks] == ["unit"]
    assert remarks[0]["text"] in said.err
    for one, two in zip(*(p.read_text().splitlines()[1:] for p in (right, other)), strict=True):
        (a, *p), (b, *q) = one.split(","), two.split(",")
        assert a == b
        assert [float(v) for v in p] == pytest.approx([float(v) for v in q], abs=1e-3)


def test_predict_refuses_a_row_without_a_reading(rows, tmp_path, capsys):
    lines = rows.read_text().splitlines()
    column = lines[0].split(",").index("x_mm")
    cells = lines[5].split(",")
    cells[column] = "nan"
    rows.write_text("\n".join([*lines[:5], ",".join(cells), *lines[6:]]) + "\n")
    out = tmp_path / "p.csv"
    assert run(["predict", str(rows), "--cell", CELL, "-o", str(out)]) == 2
    assert "rows.csv:6: error MEA007" in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize("n", [30, 60])
def test_one_pose_read_again_and_again_has_an_answer(rows, capsys, n):
    """What repeats scatter by is known then, and nothing of causes."""
    head, first, *_ = rows.read_text().splitlines()
    columns = head.split(",")
    lines, scatter = [], np.random.default_rng(n).normal(0.0, 0.02, (n, 3))
    for k in range(n):
        cells = first.split(",")
        for name, off in zip(("x_mm", "y_mm", "z_mm"), scatter[k], strict=True):
            at = columns.index(name)
            cells[at] = f"{float(cells[at]) + off:.4f}"
        for name in ("id", "time_s"):
            if name in columns:
                cells[columns.index(name)] = str(k)
        lines.append(",".join(cells))
    rows.write_text("\n".join([head, *lines]) + "\n")
    assert run(["diagnose", str(rows), "--cell", CELL, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["noise"]["source"] == "repeats"
    assert all(effect["probability"] <= 0.5 for effect in found["effects"])
