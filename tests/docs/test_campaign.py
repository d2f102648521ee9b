"""The campaign of the examples: made as its script says, diagnosed as it was made, and kept."""

import json
import tomllib

import numpy as np
import pytest

from postproc.cli import app
from tests.places import FIXTURES
from tools.dev.hidden_twin import K_PAPER
from tools.dev.make_campaign import CREEP_MM_PER_H, OFFSETS_DEG, campaign

CASE = FIXTURES / "drift_campaign"


def numbers(path):
    """Return the numbers of a model file by effect and key."""
    effects = tomllib.loads(path.read_text(encoding="utf-8"))["effects"]
    return {
        (effect, key): np.array(value, dtype=float)
        for effect, table in effects.items()
        for key, value in table.items()
        if isinstance(value, list | float)
    }


@pytest.fixture(scope="module")
def diagnosed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("campaign")
    rows, cell = str(CASE / "measured.csv"), str(CASE / "cell.toml")
    assert app.run(["diagnose", rows, "--cell", cell, "-o", str(folder), "--quiet"]) == 0
    return folder


def test_the_rows_are_those_of_the_script():
    assert (CASE / "measured.csv").read_text(encoding="ascii") == campaign()


def test_the_model_is_the_truth_and_the_kept_one(diagnosed):
    found, kept = (numbers(folder / "model.toml") for folder in (diagnosed, CASE / "expected"))
    assert found.keys() == kept.keys()
    for key, value in found.items():
        assert np.allclose(value, kept[key], rtol=0.02, atol=2e-4, equal_nan=True), key
    offset = found["joint_offset", "offset_deg"]
    assert np.abs(offset - OFFSETS_DEG)[[1, 4]].max() < 0.003
    stiffness = found["joint_compliance", "stiffness_Nmm_per_rad"]
    assert np.abs(stiffness / (K_PAPER * 1e3) - 1.0)[[1, 2, 4]].max() < 0.05


def test_the_creeping_stand_is_not_blamed_on_the_arm(capsys):
    rows, cell = str(CASE / "measured.csv"), str(CASE / "cell.toml")
    app.run(["diagnose", rows, "--cell", cell, "--json", "--quiet"])
    document = json.loads(capsys.readouterr().out)
    assert "thermal_drift" not in document["adopted"]
    assert np.linalg.norm(CREEP_MM_PER_H) * 1.5 > 10 * document["noise_mm"]
    follows = [d["name"] for d in document["residual"]["depends_on"] if d["p_value"] < 0.01]
    creeping = any(entry["name"] == "tracker_creep" for entry in document["residual"]["resembles"])
    assert creeping or "time" in follows or "tracker_creep" in document["adopted"]
