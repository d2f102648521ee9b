"""Several stations and reflectors in one campaign, made by other formulas."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from postproc.cli.app import run
from postproc.gap.data.split import split
from postproc.geometry.frames import apply, rotation_from_abc, transform
from postproc.model.modelfile import load_model
from tests.places import PANEL_CELL

NOISE = 1.2e-5
FRAMES = {
    "north": transform(rotation_from_abc(np.array([2.0, 0.3, -0.2])), np.array([3.0, -1.0, 0.4])),
    "south": transform(rotation_from_abc(np.array([-0.7, 0.1, 0.2])), np.array([-2.0, 4.0, 1.0])),
}
PLACES = {"a": np.array([0.05, -0.08, 0.1]), "b": np.array([-0.06, 0.02, 0.05])}
CELL = str(PANEL_CELL)


@pytest.fixture
def campaign(world, tmp_path):
    """Rows of an arm with wrong zeros, by station and reflector; the arm is the same in all."""

    def make(name, labels, n=60, seed=1, column=True):
        rng = np.random.default_rng(seed)
        data = world.campaign(rng, n * len(labels), 0)
        data["wrench"][:] = 0.0
        points = np.zeros((n * len(labels), 3))
        rows = np.arange(len(points)) % len(labels)
        for k, (station, reflector) in enumerate(labels):
            truth = world.Truth(reflector=PLACES[reflector])
            zero = np.array([0.0, 6e-4, -5e-4, 4e-4, 0.0, 0.0])
            truth.joint.append(lambda d, now, zero=zero: np.tile(zero, (len(d["q"]), 1)))
            points[rows == k] = apply(FRAMES[station], world.solve(truth, data))[rows == k]
        points += rng.normal(0.0, NOISE, points.shape)
        lines = world.csv(data, points, ("wrench",)).splitlines()
        if column:
            words = [",".join(labels[k]) for k in rows]
            lines[1:] = [f"{line},{w},0.012" for line, w in zip(lines[1:], words, strict=True)]
            lines[0] += ",station,reflector,sigma_mm"
        path = tmp_path / name
        path.write_text("\n".join(lines) + "\n")
        return path

    return make


def document(capsys, *arguments):
    assert run([*map(str, arguments), "--cell", CELL, "--register", "--json"]) == 0
    return json.loads(capsys.readouterr().out)


def rms(capsys, rows, model, out, *more):
    call = ["predict", str(rows), "--cell", CELL, "--model", str(model), "-o", str(out), "--json"]
    code = run([*call, *more])
    shown = capsys.readouterr()
    return json.loads(shown.out)["rms_mm"] if code == 0 else shown.err


def test_each_station_and_reflector_has_its_own_place(campaign, tmp_path, capsys):
    pairs = [("north", "a"), ("south", "a"), ("south", "b")]
    rows = campaign("rows.csv", pairs)
    found = document(capsys, "diagnose", rows, "-o", tmp_path / "out")
    assert found["verdict"] == "explained"
    assert found["noise"]["source"] == "instrument"
    assert set(found["adopted"]) <= {"joint_offset", "link_geometry"}
    assert found["adopted"]
    model = tmp_path / "out" / "model.toml"
    kept = load_model(model).registration
    assert set(kept.stations) == set(FRAMES)
    assert set(kept.reflectors) == set(PLACES)
    # what no gauge touches: how the stations stand to each other, how the reflectors lie
    between = kept.stations["north"] @ np.linalg.inv(kept.stations["south"])
    np.testing.assert_allclose(between, FRAMES["north"] @ np.linalg.inv(FRAMES["south"]), atol=8e-5)
    apart = np.linalg.norm(kept.reflectors["a"] - kept.reflectors["b"])
    assert apart == pytest.approx(np.linalg.norm(PLACES["a"] - PLACES["b"]), abs=2e-5)
    fresh = campaign("fresh.csv", [("south", "b"), ("north", "a")], seed=2)
    assert rms(capsys, fresh, model, tmp_path / "p.csv") < 0.035
    assert "GAP007" in rms(
        capsys,
        _renamed(fresh, "south", "west"),
        model,
        tmp_path / "p.csv",
    )
    assert rms(capsys, fresh, model, tmp_path / "p.csv", "--register") < 0.035


def _renamed(path, old, new):
    path = path.rename(path.with_name("other.csv"))
    path.write_text(path.read_text().replace(f",{old},", f",{new},"))
    return path.rename(path.with_name("fresh.csv"))


def test_files_without_the_column_are_stations_of_their_own(campaign, tmp_path, capsys):
    first = campaign("first.csv", [("north", "a")], column=False)
    second = campaign("second.csv", [("south", "a")], seed=3, column=False)
    found = document(capsys, "diagnose", first, second, "-o", tmp_path / "out")
    assert found["verdict"] == "undetermined"
    assert found["noise"] | {"sigma_mm": None, "source": "assumed"} == found["noise"]
    assert found["noise_mm"] is None
    assert found["next_measurements"][0]["why"].startswith("revisit")
    kept = load_model(tmp_path / "out" / "model.toml").registration
    assert set(kept.stations) == {"first", "second"}
    assert found["residual"]["rms_mm"] < 0.03


def test_no_set_up_is_left_out_as_a_whole(samples):
    """Its frame would be unknown, and its rows missed by whatever the prior allows."""
    large, small = 48, 12
    set_up = np.repeat([[0, 0], [1, 0]], [large, small], axis=0).astype(np.int32)
    parts = split(replace(samples, set_up=set_up), None)
    first = split(samples, None)
    late = np.arange(large + small) * (int(first.stretch.max()) + 1) // (large + small)
    assert np.array_equal(first.stretch[np.argsort(samples.course)], late)
    for unit, size in ((0, large), (1, small)):
        here = set_up[:, 0] == unit
        kept = np.bincount(parts.stretch[here])
        assert len(kept) == int(parts.stretch.max()) + 1
        assert kept.max() <= np.ceil(size / len(kept))
        assert len(np.unique(parts.fold[here])) > 1
        assert not np.all(parts.sealed[here])
