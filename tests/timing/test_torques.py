"""Times that joints keep with the torques they have: profiles sampled, torques computed anew."""

from __future__ import annotations

import numpy as np
import pytest
import ruckig

from postproc.arrays import FloatArray
from postproc.timing import Torques, joint_move_time, slopes
from postproc.timing.bounded import JointPath, bounded_speed, segment_times

MASS, LENGTH, G = 30.0, 1.2, 9.80665


def pendulum(most: float) -> Torques:
    """A point mass on an arm that lies level at 0."""

    def of(row, q, qd, qdd) -> FloatArray:
        return MASS * LENGTH * (G * np.cos(q) + LENGTH * qdd)

    return Torques(of, np.array([most]))


def profile(way, speed, push, jerk, count=2001):
    """Return time, place, speed and acceleration along a move from rest to rest, by ruckig."""
    request, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    request.target_position = [way]
    request.max_velocity, request.max_acceleration = [speed], [push]
    request.max_jerk = [jerk]
    ruckig.Ruckig(1).calculate(request, trajectory)
    t = np.linspace(0.0, trajectory.duration, count)
    rows = np.array([np.ravel(trajectory.at_time(float(moment))) for moment in t])
    return t, *rows.T


@pytest.mark.parametrize(("start", "way"), [(-2.0, 1.5), (0.3, -0.9), (-0.2, 0.02), (1.2, 2.0)])
def test_a_joint_move_takes_as_much_longer_as_its_torque_asks(start, way):
    speed, push, ramp = 2.0, 8.0, 0.1
    t, s, _, a = profile(abs(way), speed, push, push / ramp)
    q, qdd = start + np.sign(way) * s, np.sign(way) * a
    for most in (400.0, 450.0, 600.0, 5000.0):
        got = joint_move_time([[start]], [[start + way]], speed, [push], ramp, pendulum(most))[0]
        longer = got / t[-1]
        needed = MASS * LENGTH * (G * np.cos(q) + LENGTH * qdd / longer**2)
        share = np.abs(needed).max() / most
        assert share < 1.01
        assert longer == pytest.approx(1.0) or share > 0.99
    assert longer == pytest.approx(1.0)


def test_where_a_joint_cannot_hold_still_its_torque_slows_nothing():
    speed, push, ramp = 2.0, 8.0, 0.1
    plain = joint_move_time([[-1.0]], [[1.0]], speed, [push], ramp)
    weak = joint_move_time([[-1e-3]], [[1e-3]], speed, [push], ramp, pendulum(300.0))
    short = joint_move_time([[-1e-3]], [[1e-3]], speed, [push], ramp)
    np.testing.assert_allclose(weak, short)
    assert np.isfinite(joint_move_time([[-1.0]], [[1.0]], speed, [push], ramp, pendulum(300.0)))
    assert plain > 0.0


def test_a_path_is_run_as_fast_as_the_torques_allow_and_no_faster():
    """The way of a double swing: torques of the profile found, by differences of its joints."""
    k, most = 4000, 420.0
    way = np.linspace(0.0, 3.0, k + 1)
    q = (1.3 * np.sin(1.7 * way))[:, None]
    row = np.zeros(k + 1, dtype=np.int64)
    first, second = slopes(row, way, q)
    torques = pendulum(most)
    joints = JointPath(
        row[1:], way[1:] / 3.0, q[1:], q[:1], np.zeros(1), np.array([np.inf]), 0.0, torques
    )
    bounds = joints.bounds(row, q, first, second)
    v, top, push = bounded_speed(np.diff(way), np.full(k, 99.0), np.full(k, 1e9), bounds)
    seconds = np.append(0.0, np.cumsum(segment_times(np.diff(way), v, top, push)))
    rate = np.diff(q[:, 0]) / np.diff(seconds)
    qdd = np.diff(rate) / (0.5 * (seconds[2:] - seconds[:-2]))
    share = np.abs(torques.of(row[1:-1], q[1:-1, 0], rate[1:], qdd)) / most
    assert np.percentile(share, 99) < 1.02
    assert np.median(share) > 0.98
