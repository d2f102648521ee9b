"""Registration of a tracker and a reflector that sits beside the loaded tool point."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.answers.document import document, model_file
from postproc.gap.answers.predict import predict
from postproc.gap.answers.summary import summary
from postproc.gap.fit.problem import pose_problem
from postproc.geometry.frames import apply, rotation_from_abc, transform
from postproc.measurement.file import read_measurements
from postproc.model.modelfile import ModelFile, load_model, save_model
from postproc.stiffness.identify.identify import identify
from postproc.stiffness.identify.models import IdentifyOptions

REFLECTOR = np.array([0.05, -0.08, 0.1])
NOISE = 1.2e-5
TRACKER = transform(rotation_from_abc(np.array([2.0, 0.3, -0.2])), np.array([3.0, -1.0, 0.4]))


@pytest.fixture
def loaded(world, tmp_path):
    """Rows of a soft arm that is loaded at the tool point and measured beside it."""

    def make(seed, reflector=REFLECTOR, move=TRACKER, n=150, loads_there=False):
        rng = np.random.default_rng(seed)
        truth = world.Truth(reflector=np.array(reflector))
        if loads_there:
            truth.tcp = truth.tcp + world.R_FLANGE @ truth.reflector
            truth.reflector = np.zeros(3)
        c = 1.0 / (world.K0 * np.array([1.3, 0.8, 1.2, 0.7, 1.1, 0.9]))
        truth.joint.append(lambda data, now: c * world.load_torque(data, now))
        data = world.campaign(rng, n, 0)
        points = apply(move, world.solve(truth, data)) + rng.normal(0.0, NOISE, (n, 3))
        path = tmp_path / f"rows{seed}.csv"
        path.write_text(world.csv(data, points))
        k = [float(v) for v in 1e3 / c]
        table = {"joint_compliance": {"stiffness_Nmm_per_rad": k}}
        rows = read_measurements(path)
        return replace(rows, sigma=np.full(n, NOISE)), ModelFile(table)

    return make


def test_a_load_acts_at_the_tool_point_and_not_at_the_reflector(loaded, kinematics, cell):
    rows, model = loaded(1)
    assert predict(rows, kinematics, cell, model, True).rms < 1.1 * 3.0**0.5 * NOISE


def test_tracker_and_reflector_are_found(loaded, kinematics, cell):
    from postproc.gap.data.dataset import samples_of
    from postproc.gap.fit.registration import register
    from postproc.gap.robot_model import RobotModel
    from postproc.measurement.rows import set_ups

    rows, model = loaded(2)
    robot = RobotModel.of(kinematics, cell, model)
    samples, places = samples_of(robot.arm, rows), set_ups(rows)
    found = register(samples, np.asarray(rows.position), robot.states, places)
    tcp = cell.tool.T_flange_tcp[:3, 3]
    np.testing.assert_allclose(found.p_flange_point - tcp, REFLECTOR, atol=5e-6)
    np.testing.assert_allclose(found.T_measured_robroot, TRACKER, atol=1e-5)


def test_stiffness_of_a_registered_campaign_serves_another_reflector(loaded, kinematics, cell):
    rows, model = loaded(3)
    diagnosis = diagnose(pose_problem(rows, kinematics, cell, None, True))
    assert diagnosis.adopted == ("joint_compliance",)
    assert diagnosis.verdict == "explained"
    there, _ = loaded(4, reflector=-REFLECTOR, move=np.linalg.inv(TRACKER))
    fitted = model_file(diagnosis, None)
    assert predict(there, kinematics, cell, fitted, True).rms < 1.25 * 3.0**0.5 * NOISE
    assert predict(there, kinematics, cell, model, True).rms < 1.1 * 3.0**0.5 * NOISE


def test_rows_tell_that_the_loads_act_at_the_reflector(loaded, kinematics, cell, tmp_path):
    rows, model = loaded(5, loads_there=True)
    assert predict(rows, kinematics, cell, model, True).rms < 1.1 * 3.0**0.5 * NOISE
    problem = pose_problem(rows, kinematics, cell, None, True)
    diagnosis = diagnose(problem)
    assert diagnosis.adopted == ("joint_compliance",)
    assert diagnosis.verdict == "explained"
    assert document(diagnosis)["registration"]["loads_at"] == "reflector"
    assert any("act at the reflector" in line for line in summary(document(diagnosis)))
    path = tmp_path / "model.toml"
    path.write_bytes(save_model(model_file(diagnosis, None)))
    kept = load_model(path)
    assert kept.registration.loads_at_point
    assert predict(rows, kinematics, cell, kept).rms < 1.1 * 3.0**0.5 * NOISE


def test_identify_and_diagnose_register_alike(world, kinematics, cell, tmp_path):
    rng = np.random.default_rng(20)
    truth = world.Truth(reflector=REFLECTOR)
    c = 1.0 / (world.K0 * np.array([1.3, 0.8, 1.2, 0.7, 1.1, 0.9]))
    truth.joint.append(lambda data, now: c * world.load_torque(data, now))
    data = world.campaign(rng, 160, 0)
    data["q"][80:] = data["q"][:80]
    data["wrench"][:80] = 0.0
    path = tmp_path / "pairs.csv"
    points = apply(TRACKER, world.solve(truth, data)) + rng.normal(0.0, NOISE, (160, 3))
    path.write_text(world.csv(data, points))
    rows, tcp = read_measurements(path), cell.tool.T_flange_tcp[:3, 3]
    identified = identify(rows, kinematics, tcp, IdentifyOptions("constant", register=True))
    problem = pose_problem(rows, kinematics, cell, None, True)
    one, other = identified.registration, problem.registration
    np.testing.assert_allclose(one.T_measured_robroot, other.T_measured_robroot, atol=1e-12)
    np.testing.assert_allclose(one.p_flange_point, other.p_flange_point, atol=1e-12)
    # and it is the truth: loads do not pull; nor does what the diagnosis adds beside an effect
    final = model_file(diagnose(problem), None).registration
    for found in (one, final):
        np.testing.assert_allclose(found.p_flange_point - tcp, REFLECTOR, atol=1.5e-5)
        np.testing.assert_allclose(found.T_measured_robroot, TRACKER, atol=3e-5)


@pytest.mark.parametrize("seed", range(6, 12))
def test_loads_stay_at_the_tool_point_without_proof(loaded, kinematics, cell, seed):
    problem = pose_problem(loaded(seed)[0], kinematics, cell, None, True)
    assert not problem.registration.loads_at_point
    # so small a distance cannot be seen, and does not matter
    near = pose_problem(
        loaded(seed, reflector=[0.003, 0, 0], loads_there=True)[0], kinematics, cell, None, True
    )
    assert not near.registration.loads_at_point
