"""What keeps a name from being called too surely, and a drift from being called noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import nnls

from postproc.gap.answers.diagnose import diagnose
from postproc.gap.data.dataset import FADES
from postproc.gap.fit.noise import Noise, Source
from postproc.gap.fit.problem import pose_problem
from postproc.gap.posterior.classes import Part, groups_of, wandering
from postproc.gap.robot_model import effect_of
from postproc.measurement.file import read_measurements


@pytest.mark.parametrize(("ratio", "told"), [(1.0, False), (2.0, True)])
def test_a_wander_far_above_the_white_noise_is_a_course_of_time(ratio, told):
    white = 2e-5
    noise = Noise(white, Source.REPEATS, white=white, wander=ratio * white)
    small = Part("time", "station", "ramp", 0.1 * white, 20.0)
    parts = wandering(noise, (small,))
    assert [p.shape for p in parts] == (["wander", "ramp"] if told else ["ramp"])
    if told:
        assert parts[0].rms == pytest.approx(np.sqrt(3.0) * noise.wander)
        assert wandering(noise, parts) == parts


def test_a_drift_is_no_noise_where_no_time_was_logged(world, kinematics, cell, tmp_path):
    data, measured, *_ = world.make(51, {"step": 3e-4}, n=160, noise=2e-5)
    path = tmp_path / "rows.csv"
    path.write_text(world.csv(data, measured, ("time", "temp")))
    diagnosis = diagnose(pose_problem(read_measurements(path), kinematics, cell))
    assert diagnosis.problem.samples.time is None
    assert diagnosis.verdict == "unexplained"
    assert diagnosis.unexplained[0].kind == "time"
    assert "row" in diagnosis.unexplained[0].shape


def test_what_earlier_loads_leave_is_their_relaxed_sum(samples):
    torque, time = samples.load_torque(), np.asarray(samples.time)
    before = np.concatenate([time[:1], time[:-1]])
    for k, fade in enumerate(FADES):
        since, until = time[:, None] - before, time[:, None] - time
        share = np.where(until >= 0, np.exp(-until / fade) - np.exp(-since / fade), 0.0)
        told = samples.column("past").reshape(len(time), len(FADES), 6)[:, k]
        np.testing.assert_allclose(told, share @ torque, atol=1e-9 * np.abs(torque).max())


@pytest.mark.parametrize("fade", [350.0, 520.0, 700.0, 1600.0, 2500.0])
def test_the_fixed_delays_stand_for_any_between_them(samples, fade):
    """A relaxation of another delay, written out, by one number for each delay that is none."""
    torque, time = samples.load_torque(), np.asarray(samples.time)
    before = np.concatenate([time[:1], time[:-1]])
    since, until = time[:, None] - before, time[:, None] - time
    share = np.where(until >= 0, np.exp(-until / fade) - np.exp(-since / fade), 0.0)
    told = samples.column("past").reshape(len(time), len(FADES), 6)
    for joint in range(6):
        wanted = share @ torque[:, joint]
        assert nnls(told[:, :, joint], wanted)[1] < 0.04 * np.linalg.norm(wanted)


def test_a_spring_is_refused_only_where_its_second_wave_is_surely_large(samples):
    spring = effect_of("counterbalance")
    theta = np.array([0.0, 1.0, 0.9, 0.0]) * 1e-4
    assert spring.objection(theta, np.full(4, 1e-6), samples.arm)
    assert not spring.objection(theta, np.full(4, 3e-5), samples.arm)


@pytest.mark.parametrize(
    ("half_gap", "unusual"),
    [
        ([-9.0, -5.0, -4.0, 0.0, 1.0, 0.5], True),
        ([9.0, 5.0, 4.0, 0.0, -1.0, -0.5], False),
        ([9.0, 5.0, -4.0, 0.0, 0.0, 0.0], False),
    ],
)
def test_play_leaves_joints_behind(half_gap, unusual):
    unit = np.full(6, 2e-5)
    assert effect_of("backlash").is_unusual(np.array(half_gap) * unit, unit) == unusual


def test_no_effect_has_the_formula_of_an_approach_that_grows_with_load(samples):
    rival = {(g.kind, g.shape): g.is_rival for g in groups_of(samples)}
    assert rival["approach", "grows with load"]
    assert rival["speed", "quadratic"]
    assert not rival["approach", "constant"]
    assert not rival["speed", "proportional"]
