"""Diagnoses of campaigns made by other formulas: names, verdicts, shrinkage on fresh rows."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.document import document, model_file
from postproc.gap.answers.predict import predict
from postproc.gap.fit.problem import pose_problem
from postproc.geometry.frames import apply, rotation_from_abc, transform
from postproc.measurement.file import read_measurements
from postproc.model.modelfile import load_model, save_model

FRAMES = {"base_frame", "tool_frame"}
MACHINE = (
    *("joint_offset", "link_geometry", "joint_compliance", "gravity_sag", "variable_stiffness"),
    *("backlash", "transmission_error", "thermal_drift", "servo_lag", "gear_coupling"),
    *("payload_error", "counterbalance", "encoder_scale", "bearing_runout", "load_creep"),
)


@pytest.fixture
def campaign(world, tmp_path):
    """Make measurements, fresh measurements and the path of the first."""

    def make(seed, causes, leave_out=(), move=None, **options):
        data, measured, fresh, points = world.make(seed, causes, **options)
        if move is not None:
            measured, points = apply(move, measured), apply(move, points)
        paths = tmp_path / "rows.csv", tmp_path / "fresh.csv"
        paths[0].write_text(world.csv(data, measured, leave_out))
        paths[1].write_text(world.csv(fresh, points))
        return read_measurements(paths[0]), read_measurements(paths[1])

    return make


def missed(prediction, rows):
    return float(np.sqrt(np.mean(np.sum((prediction.points - rows.position) ** 2, axis=1))))


@pytest.mark.slow
@pytest.mark.parametrize("name", MACHINE)
def test_one_cause_over_small_errors_of_the_frames(name, campaign, kinematics, cell):
    noise = 2e-5
    rows, fresh = campaign(41, {name: 3e-4}, n=160, noise=noise, background=1.5e-4, outliers=0.01)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert set(diagnosis.adopted) - FRAMES == {name}
    assert diagnosis.verdict == "explained"
    assert diagnosis.noise == pytest.approx(noise, rel=0.25)
    model = model_file(diagnosis, None)
    after = missed(predict(fresh, kinematics, cell, model), fresh)
    before = missed(predict(fresh, kinematics, cell), fresh)
    promised = diagnosis.total[1] / diagnosis.total[0]
    kept = np.sqrt(after**2 + 3 * noise**2) / np.sqrt(before**2 + 3 * noise**2)
    assert after < 0.2 * before
    assert kept == pytest.approx(promised, abs=0.06)


def test_noise_and_faults_alone_have_no_cause(campaign, kinematics, cell):
    rows, _ = campaign(42, {}, n=200, noise=5e-5, outliers=0.03)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert diagnosis.verdict == "no_gap"
    assert diagnosis.adopted == ()
    assert 2 <= diagnosis.outlier.sum() <= 10


OUTSIDE = (
    *("windup", "hardening", "bending", "lean", "step"),
    *("stretch", "hose", "fixture"),
)


@pytest.mark.slow
@pytest.mark.parametrize("name", OUTSIDE)
def test_a_cause_outside_of_the_library_gets_no_name(name, campaign, kinematics, cell):
    rows, _ = campaign(43, {name: 1.2e-4}, n=160, noise=2e-5, background=1e-4)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert diagnosis.verdict == "unexplained"
    assert not set(diagnosis.adopted) - FRAMES


@pytest.mark.slow
def test_three_causes_at_once(campaign, kinematics, cell):
    causes = {"joint_compliance": 3e-4, "backlash": 2e-4, "gravity_sag": 3e-4}
    rows, _ = campaign(44, causes, n=350, noise=2e-5, background=1e-4)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert set(diagnosis.adopted) - FRAMES == set(causes)


@pytest.mark.slow
def test_a_missing_column_is_said_and_nothing_else_blamed(campaign, kinematics, cell):
    rows, _ = campaign(45, {"backlash": 3e-4}, ("direction",), n=200)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell))
    assert diagnosis.verdict == "unexplained"
    assert not diagnosis.adopted
    missing = {item["name"]: item["needs"] for item in document(diagnosis)["not_testable"]}
    assert missing["backlash"] == [f"dir{i}" for i in range(1, 7)]


@pytest.mark.slow
def test_an_unknown_column_is_found(campaign, kinematics, cell, world, tmp_path):
    """Less than the noise is enough, alone and beside a cause ten times as large."""
    humidity = np.random.default_rng(1).uniform(30.0, 70.0, 200)
    path, missed = tmp_path / "rows.csv", []
    for cause, size in (({}, 1.0), ({}, 0.4), ({"backlash": 3e-4}, 0.4)):
        data, measured, *_ = world.make(46, cause, n=200)
        measured = measured + np.outer((humidity - 50.0) / 20.0, [size * 1e-4, 0.0, size * 5e-5])
        lines = world.csv(data, measured).splitlines()
        lines[0] += ",humidity"
        lines[1:] = [f"{line},{h:.2f}" for line, h in zip(lines[1:], humidity, strict=True)]
        path.write_text("\n".join(lines))
        diagnosis = diagnose(pose_problem(read_measurements(path), kinematics, cell))
        found = diagnosis.verdict == "unexplained" and diagnosis.tests[0].name == "humidity"
        if not found or set(diagnosis.adopted) - FRAMES != set(cause):
            missed.append((cause, size, diagnosis.verdict, diagnosis.adopted, diagnosis.tests[:2]))
    assert not missed


def test_registration_of_a_tracker_that_stands_anywhere(campaign, kinematics, cell, tmp_path):
    move = transform(rotation_from_abc([2.0, 0.3, -0.2]), [3.0, -1.0, 0.4])
    rows, fresh = campaign(47, {"backlash": 3e-4}, move=move, n=200, background=3e-4)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell, None, True))
    assert diagnosis.adopted == ("backlash",)
    assert diagnosis.verdict == "explained"
    path = tmp_path / "model.toml"
    path.write_bytes(save_model(model_file(diagnosis, None)))
    model = load_model(path)
    assert missed(predict(fresh, kinematics, cell, model), fresh) < 2e-5
    other = transform(rotation_from_abc([-1.0, 0.1, 0.2]), [0.0, 5.0, 0.0])
    elsewhere = apply(other, fresh.position)
    object.__setattr__(fresh, "position", elsewhere)
    assert missed(predict(fresh, kinematics, cell, model, True), fresh) < 2e-5


def test_a_model_that_knows_the_cause_leaves_no_gap(campaign, kinematics, cell):
    rows, _ = campaign(48, {"joint_compliance": 3e-4}, n=200)
    first = diagnose(pose_problem(rows, kinematics, cell))
    model = model_file(first, None)
    second = diagnose(pose_problem(rows, kinematics, cell, model))
    assert second.verdict == "no_gap"
    assert model_file(second, model).effects == model.effects


def test_the_same_rows_give_the_same_answer(campaign, kinematics, cell):
    rows, _ = campaign(49, {"servo_lag": 2e-4}, n=150)
    texts = [str(document(diagnose(pose_problem(rows, kinematics, cell)))) for _ in range(2)]
    assert texts[0] == texts[1]
