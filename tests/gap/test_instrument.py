"""What measured or held the arm is named so, and stays out of its model; pages say nothing else."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.predict import predict
from postproc.gap.fit.problem import pose_problem
from postproc.gap.robot_model import effect_of
from postproc.jobs.diagnose import DiagnosisJob
from postproc.measurement.file import read_measurements
from postproc.model.modelfile import load_model, save_model
from tools.blind.pages import contradictions

SIGMA = 2e-5


def shifted(world, data, rng, name):
    """Return what moves the readings (n, 3) [m], and the columns that were logged with it."""
    n = len(data["q"])
    parts = world.chain(world.Truth(), data["q"])
    R = parts[6][0] @ world.R_FLANGE
    part = data["time"] / data["time"][-1]
    if name == "reflector_creep":
        return R @ rng.normal(0, 2e-4, 3) * (1.0 - np.exp(-part / 0.3))[:, None], {}
    if name == "tracker_creep":
        return part[:, None] * rng.normal(0, 2e-4, 3), {}
    if name == "tool_frames":
        tool = rng.integers(0, 3, n)
        return np.einsum("nij,nj->ni", R, rng.normal(0, 3e-4, (3, 3))[tool]), {"tool_no": tool + 1}
    if name == "fixture_frames":
        at = rng.integers(0, 2, n)
        words = np.array(["left", "right"])[at]
        return rng.normal(0, 3e-4, (2, 3))[at], {"fixture": words}
    if name == "rail":
        e1 = rng.uniform(0, 4000, n)
        bow = np.sin(2 * np.pi * e1 / 4000)[:, None] * np.array([0.0, 2e-4, -3e-4])
        return bow + (e1 / 4000 - 0.5)[:, None] * np.array([4e-4, 0, 0]), {"e1_mm": e1}
    return np.zeros((n, 3)), {}


CAMPAIGNS = (
    ("reflector_creep", {}),
    ("tracker_creep", {"backlash": 3e-4}),
    ("tool_frames", {}),
    ("fixture_frames", {}),
    ("rail", {"joint_offset": 1e-3}),
    ("", {"windup": 3e-4}),
)
"""What is of the instrument, and what of the arm; the last is in no list."""


@pytest.fixture(scope="module")
def told(world, kinematics, cell, tmp_path_factory):
    """The jobs, with how far fresh rows are missed by no model and by that of the arm [m]."""
    folder, found = tmp_path_factory.mktemp("instrument"), {}
    for number, (name, causes) in enumerate(CAMPAIGNS):
        rng = np.random.default_rng(700 + number)
        data, measured, fresh, points = world.make(700 + number, causes, 70, SIGMA, repeats=0)
        moved, columns = shifted(world, data, rng, name)
        head, *lines = world.csv(data, measured + moved).splitlines()
        more = {"sigma_mm": np.full(len(lines), SIGMA * 1e3)} | columns
        text = [",".join([head, *more])]
        text += [
            ",".join([line, *map(str, row)])
            for line, *row in zip(lines, *more.values(), strict=True)
        ]
        (folder / "rows.csv").write_text("\n".join(text) + "\n")
        (folder / "fresh.csv").write_text(world.csv(fresh, points))
        job = DiagnosisJob(
            diagnose(pose_problem(read_measurements(folder / "rows.csv"), kinematics, cell)),
            cell,
            None,
            None,
        )
        path = folder / "model.toml"
        path.write_bytes(save_model(job.model))
        assert save_model(load_model(path)) == path.read_bytes()
        rows, missed = read_measurements(folder / "fresh.csv"), []
        for model in (None, load_model(path)):
            got = predict(rows, kinematics, cell, model and type(model)(model.effects))
            missed.append(np.sqrt(np.mean(np.sum((got.points - rows.position) ** 2, axis=1))))
        found[name] = job, causes, missed
    return found


def test_the_instrument_is_named_and_stays_out_of_the_arm(told):
    wrong = []
    for name, (job, causes, missed) in told.items():
        model, adopted = job.model, set(job.adopted)
        if name and (name not in adopted or set(model.instrument) != {name}):
            wrong.append((name, adopted, tuple(model.instrument)))
        if name and name not in model.reach.spread:
            wrong.append((name, "is sure", tuple(model.reach.spread)))
        if name and adopted != {name, *causes}:
            wrong.append((name, "also", adopted - {name, *causes}))
        if any(not effect_of(one).is_arms for one in model.effects):
            wrong.append((name, "in the arm", tuple(model.effects)))
        if missed[1] > 1.1 * missed[0] + SIGMA:
            wrong.append((name, "worse on fresh rows", missed))
    assert not wrong


def test_no_sentence_of_a_page_contradicts_its_numbers(told):
    found = {name: contradictions(job.document, job.page()) for name, (job, *_) in told.items()}
    assert not {name: told for name, told in found.items() if told}
