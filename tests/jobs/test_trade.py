"""``convert --trade``: every preset planned, beside the one that is written."""

from __future__ import annotations

import json

import pytest

from postproc.cli import app
from tests.places import FIXTURES

CASE = FIXTURES / "drilling_panel"
PRESETS = ("stiffest", "balanced", "fastest")


@pytest.fixture(scope="module")
def converted(tmp_path_factory):
    """Return a function: options to the document of ``convert --json``."""

    def run(*options, capsys):
        folder = tmp_path_factory.mktemp("out")
        holes = (CASE / "panel.csv").read_text(encoding="utf-8").splitlines(keepends=True)
        (folder / "some.csv").write_text("".join(holes[:61]), encoding="utf-8")
        words = [
            str(folder / "some.csv"),
            "--cell",
            str(CASE / "cell.toml"),
            "-o",
            str(folder / "out"),
        ]
        assert app.run(["convert", *words, *options, "--json"]) == 0
        return json.loads(capsys.readouterr().out)

    return run


@pytest.mark.slow
def test_each_row_is_what_that_preset_alone_would_give(converted, capsys):
    rows = {row["preset"]: row for row in converted("--trade", capsys=capsys)["trade"]}
    assert tuple(rows) == PRESETS
    assert [name for name in PRESETS if rows[name]["chosen"]] == ["balanced"]
    for name in ("stiffest", "fastest"):
        alone = converted("--preset", name, capsys=capsys)
        row = rows[name]
        assert alone["trade"] == []
        assert row["cycle_time_s"] == pytest.approx(alone["cycle_time_s"])
        assert row["lost_mean_percent"] == alone["stiffness"]["lost_mean_percent"]
        assert row["min_N_per_mm"] == pytest.approx(alone["stiffness"]["min_N_per_mm"], abs=1e-3)
        assert row["grades"] == alone["grades"]
        assert row["clearance_mm"] == alone["clearance"]["smallest_mm"]
    assert rows["stiffest"]["lost_mean_percent"] <= rows["balanced"]["lost_mean_percent"]
    assert rows["balanced"]["lost_mean_percent"] <= rows["fastest"]["lost_mean_percent"]
