"""Campaigns as they come: few rows, copies, blanks, swapped readings, wrong units."""

from __future__ import annotations

import json

import numpy as np
import pytest

from postproc.cli.app import run
from tests.places import PANEL_CELL

NOISE = 2e-5
XYZ = ("x_mm", "y_mm", "z_mm")


@pytest.fixture
def diagnosed(world, tmp_path, capsys):
    """Diagnose rows with a known cause once their table has been spoilt."""

    def make(spoil, n=120, causes=None, cell=PANEL_CELL, register=False):
        causes = {"backlash": 2e-4} if causes is None else causes
        data, measured, *_ = world.make(61, causes, n=n, noise=NOISE)
        lines = [line.split(",") for line in world.csv(data, measured).splitlines()]
        lines = spoil(lines)
        path = tmp_path / "rows.csv"
        path.write_text("\n".join(",".join(line) for line in lines) + "\n")
        call = ["diagnose", str(path), "--cell", str(cell), "--json"]
        assert run([*call, "--register"] if register else call) == 0
        return json.loads(capsys.readouterr().out)

    return make


def kinds(found):
    return {(remark["kind"], tuple(remark["ids"])) for remark in found["remarks"]}


def scaled(rows, names, factor):
    def spoil(lines):
        at = [lines[0].index(name) for name in names]
        for k in rows if rows is not None else range(len(lines) - 1):
            for i in at:
                lines[k + 1][i] = repr(float(lines[k + 1][i]) * factor)
        return lines

    return spoil


def test_copied_rows_count_once(diagnosed):
    whole = diagnosed(lambda lines: lines)
    found = diagnosed(lambda lines: lines + [list(line) for line in lines[1:5]])
    assert kinds(found) == {("copy", ("p0", "p1", "p2", "p3"))}
    assert found["adopted"] == whole["adopted"] == ["backlash"]
    assert found["noise"] == whole["noise"]


def test_a_blank_temperature_lies_between_the_others(diagnosed):
    def spoil(lines):
        lines[6][lines[0].index("temp_C")] = ""
        lines[9][lines[0].index("x_mm")] = ""
        return lines

    found = diagnosed(spoil)
    assert kinds(found) == {("blank", ("p5",))}
    assert found["rows"]["total"] == 120
    assert found["adopted"] == ["backlash"]


@pytest.mark.parametrize("register", [False, True])
def test_swapped_readings_of_neighbours_are_exchanged(diagnosed, register):
    def spoil(lines):
        at = [lines[0].index(name) for name in XYZ]
        for k in (10, 40, 77):
            for i in at:
                lines[k][i], lines[k + 1][i] = lines[k + 1][i], lines[k][i]
        return lines

    found = diagnosed(spoil, register=register)
    assert kinds(found) == {("swapped", ("p9", "p10", "p39", "p40", "p76", "p77"))}
    assert found["noise_mm"] == pytest.approx(NOISE * 1e3, rel=0.35)
    assert found["adopted"] == ["backlash"]


@pytest.mark.slow
@pytest.mark.parametrize(
    ("names", "factor", "register"),
    [
        (XYZ, 1e-3, True),
        (XYZ, 1 / 25.4, False),
        (("z_mm",), 1e-3, True),
        ([f"q{i}_deg" for i in range(1, 7)], np.pi / 180, False),
    ],
)
def test_a_column_in_another_unit_is_converted(diagnosed, names, factor, register):
    found = diagnosed(scaled(None, names, factor), register=register)
    assert [remark["kind"] for remark in found["remarks"]] == ["unit"]
    assert found["adopted"] == ["backlash"]


def test_some_rows_in_another_unit_are_converted(diagnosed):
    found = diagnosed(scaled((7, 8, 9), XYZ, 1e-3))
    assert kinds(found) == {("unit", ("p7", "p8", "p9"))}
    assert found["adopted"] == ["backlash"]


@pytest.mark.parametrize("n", [12, 17, 25, 41])
@pytest.mark.parametrize("register", [False, True])
def test_few_rows_have_an_answer(diagnosed, n, register):
    found = diagnosed(lambda lines: lines[: n + 1], register=register)
    assert found["verdict"] in ("undetermined", "unexplained", "explained", "no_gap")
    if found["noise"]["source"] == "assumed":
        assert found["verdict"] in ("undetermined", "unexplained")
    assert len(found["adopted"]) <= n // 8
    needs = [word for item in found["not_testable"] for word in item["needs"]]
    assert n > 20 or any("rows" in word for word in needs)
