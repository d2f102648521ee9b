"""Times against closed forms, and proof that nothing can reach a network."""

from __future__ import annotations

import socket

import numpy as np
import pytest

from postproc.timing import profile
from postproc.timing.profile import (
    RAMP,
    Bends,
    axis_speed_cap,
    chain_profile,
    joint_move_time,
    line_time,
    path_times,
)


def double_s(way, speed, acceleration, jerk):
    """Rest-to-rest time with limited jerk, closed form of the double-S profile."""
    if speed * jerk >= acceleration**2:
        ramp = speed / acceleration + acceleration / jerk
    else:
        ramp = 2.0 * np.sqrt(speed / jerk)
    if way >= speed * ramp:
        return way / speed + ramp
    if way >= 2.0 * acceleration**3 / jerk**2:
        a = acceleration
        return a / jerk + np.sqrt((a / jerk) ** 2 + 4.0 * way / a)
    return 4.0 * np.cbrt(way / (2.0 * jerk))


@pytest.mark.parametrize("seed", range(5))
def test_line_time_is_the_double_s(seed):
    rng = np.random.default_rng(seed)
    way = 10.0 ** rng.uniform(-4, 0.5, 40)
    speed = 10.0 ** rng.uniform(-3, 0.3, 40)
    got = line_time(way, speed, acceleration=2.3, ramp=0.1)
    want = [double_s(w, v, 2.3, 23.0) for w, v in zip(way, speed, strict=True)]
    assert np.allclose(got, want, rtol=5e-6)


def test_a_way_on_which_the_acceleration_is_just_reached_has_a_time():
    got = line_time(np.array([0.046]), np.array([2.0]), acceleration=2.299999999999999, ramp=0.1)
    assert got == pytest.approx([0.4], rel=1e-8)


def test_absurd_ways_have_a_time():
    way, speed = np.array([1e5, 1.01e5, 1e9, 1e15]), np.full(4, 1.15)
    got = line_time(way, speed, acceleration=2.3, ramp=0.1)
    assert np.allclose(got, [double_s(w, 1.15, 2.3, 23.0) for w in way], rtol=1e-9)


def joint_moves(seed):
    rng = np.random.default_rng(seed)
    a, b = rng.uniform(-2, 2, (2, 300, 6))
    b[::3] = a[::3] + rng.normal(size=(100, 6)) * 1e-3
    b[::7, 1:4] = a[::7, 1:4]
    return a, b, rng.uniform(0.5, 2.0, 6), rng.uniform(0.6, 5.0, 6)


def test_axes_of_a_joint_move_share_one_profile_that_none_exceeds():
    """The way from 0 to 1 that all axes go is a double S; its limits are the tightest of theirs."""
    a, b, speed, push = joint_moves(7)
    got = joint_move_time(a, b, speed, push, ramp=0.15)
    with np.errstate(divide="ignore"):
        top, most = ((limit / np.abs(b - a)).min(axis=1) for limit in (speed, push))
    want = [double_s(1.0, v, acc, acc / 0.15) for v, acc in zip(top, most, strict=True)]
    assert np.allclose(got, want, rtol=1e-6)
    alone = [
        max(double_s(abs(d), v, p, p / 0.15) for d, v, p in zip(row, speed, push, strict=True) if d)
        for row in b - a
    ]
    assert (got >= np.array(alone) * (1.0 - 1e-6)).all()
    assert (got > np.array(alone) * 1.01).any()
    assert joint_move_time(a[:1], a[:1], speed, push)[0] == 0.0


def test_joint_moves_of_like_axes_take_as_long_as_ruckig_says_of_all_six():
    """Where the axes differ in speed only by a factor, sharing a profile costs nothing."""
    ruckig = pytest.importorskip("ruckig")
    a, b, speed, _ = joint_moves(8)
    push = 1.7 * speed
    for start, end, time in zip(a, b, joint_move_time(a, b, speed, push, ramp=0.2), strict=True):
        request = ruckig.InputParameter(6)
        request.current_position, request.target_position = start.tolist(), end.tolist()
        request.max_velocity, request.max_acceleration = speed.tolist(), push.tolist()
        request.max_jerk = (push / 0.2).tolist()
        request.synchronization = ruckig.Synchronization.Phase
        trajectory = ruckig.Trajectory(6)
        ruckig.Ruckig(6).calculate(request, trajectory)
        assert time == pytest.approx(trajectory.duration, rel=1e-6)


def test_chain_at_constant_feed():
    """Trapezoid plus the jerk ramp: s/v + v/a + ramp, however finely the way is cut."""
    for knots in (2, 11, 1001):
        way = np.linspace(0.0, 2.0, knots)
        time = chain_profile(way, np.full(knots - 1, 0.5), 2.0, ramp=0.1).duration.sum()
        assert time == pytest.approx(2.0 / 0.5 + 0.5 / 2.0 + 0.1, rel=1e-9)


def test_chain_is_never_faster_than_its_caps_or_its_acceleration():
    rng = np.random.default_rng(2)
    way = np.concatenate([[0.0], np.cumsum(10.0 ** rng.uniform(-4, -2, 400))])
    cap = rng.uniform(0.01, 0.3, 400)
    result = chain_profile(way, cap, 1.5)
    assert (result.speed[1:-1] <= np.minimum(cap[1:], cap[:-1]) + 1e-12).all()
    assert result.speed[0] == result.speed[-1] == 0.0
    change = np.abs(np.diff(result.speed**2)) / (2.0 * np.diff(way))
    assert change.max() <= 1.5 + 1e-9
    assert (result.duration >= np.diff(way) / cap - 1e-12).all()


def test_a_stop_in_the_middle_costs_time():
    way, cap = np.array([0.0, 0.5, 1.0]), np.full(2, 0.5)
    whole = chain_profile(way, cap, 2.0).duration.sum()
    halves = 2.0 * chain_profile(way[:2], cap[:1], 2.0).duration.sum()
    assert halves > whole + 0.2


def test_axis_cap():
    """0.2 rad over 0.1 m on an axis of 1 rad/s: 0.5 m/s; standing axes do not count."""
    cap = axis_speed_cap([[0.2, 0.0], [0.0, 0.0]], [0.1, 0.1], [1.0, 1.0])
    assert cap[0] == pytest.approx(0.5)
    assert np.isinf(cap[1])


def test_no_waypoint_and_no_network(monkeypatch):
    """ruckig sends problems with intermediate waypoints to a service: no such call is made."""

    def refuse(*args, **kwargs):
        raise AssertionError("network access")

    monkeypatch.setattr(socket, "socket", refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    monkeypatch.setattr(socket, "getaddrinfo", refuse)
    monkeypatch.setattr(profile._RestToRest, "_parts", None)
    assert line_time([0.3], 0.2)[0] > 0.0
    assert joint_move_time(np.zeros((1, 6)), np.ones((1, 6)), np.ones(6), np.ones(6))[0] > 0.0
    _, request, trajectory = profile._RestToRest._parts
    assert request.intermediate_positions == []
    assert trajectory.intermediate_durations in ([], [trajectory.duration])


def test_path_times_are_those_of_each_chain():
    length, speed = np.array([0.05, 0.2, 0.1, 0.3, 0.0]), np.array([0.01, 0.1, 0.2, 0.2, 0.1])
    chain, turning = np.array([1, 2, 2, 2, 3]), np.array([0.0, 0.0, 9.0, 0.0, 0.5])
    push = np.full(5, 2.3)
    got = path_times(length, speed, chain, turning, push)
    way = np.array([0.0, 0.2, 0.3, 0.6])
    blended = chain_profile(way, speed[1:4], 2.3).duration
    want = [double_s(0.05, 0.01, 2.3, 23.0), blended[0], 9.0, blended[2], 0.5]
    assert np.allclose(got, want, rtol=5e-6)
    assert path_times(*np.zeros((2, 0)), np.zeros(0, dtype=int), np.zeros(0)).shape == (0,)


def bezier_radius(angle, distance):
    """Smallest radius of the quadratic curve that rounds a corner, sampled densely."""
    corner = np.array([0.0, 0.0])
    start = corner - distance * np.array([1.0, 0.0])
    end = corner + distance * np.array([np.cos(angle), np.sin(angle)])
    t = np.linspace(0.0, 1.0, 20001)[:, None]
    points = (1 - t) ** 2 * start + 2 * t * (1 - t) * corner + t**2 * end
    first = np.gradient(points, axis=0)
    second = np.gradient(first, axis=0)
    cross = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    bend = np.abs(cross) / np.linalg.norm(first, axis=1) ** 3
    return 1.0 / bend[10:-10].max()


@pytest.mark.parametrize("angle", [3.0, 30.0, 90.0, 140.0])
def test_a_corner_is_passed_at_what_turns_at_the_radius_of_its_rounding(angle):
    way = np.radians(angle)
    heading = np.array([[2.0, 0.0, 0.0], [np.cos(way), np.sin(way), 0.0]])
    bends = Bends(heading, heading, np.full(2, np.inf), np.array([0.001, np.inf]))
    speed = bends.corner_speeds(np.array([0.1, 0.1]), np.array([2.0, 3.0]))
    assert speed == pytest.approx(np.sqrt(2.0 * bezier_radius(way, 0.001)), rel=1e-3)
    short = bends.corner_speeds(np.array([0.1, 0.0005]), np.array([2.0, 3.0]))
    assert short == pytest.approx(speed / 2.0)


def test_corners_and_arcs_cost_time():
    """A square of 1 m/s with corners of 1 mm is slower than a straight way; a small arc is too."""
    heading = np.array([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    length, speed, chain = np.full(4, 0.5), np.full(4, 1.0), np.zeros(4, dtype=int)
    straight = path_times(length, speed, chain, np.zeros(4))
    bends = Bends(heading, heading, np.full(4, np.inf), np.full(4, 1e-3))
    turned = path_times(length, speed, chain, np.zeros(4), bends=bends)
    lost = 1.0 - np.sqrt(2.3 * bezier_radius(0.5 * np.pi, 1e-3))
    assert turned.sum() - straight.sum() == pytest.approx(3 * lost**2 / 2.3, rel=1e-3)
    arc = Bends(heading, np.roll(heading, -1, axis=0), np.full(4, 0.02), np.zeros(4))
    round_ = path_times(length, speed, chain, np.zeros(4), bends=arc)
    assert round_.sum() > 2.0 / np.sqrt(2.3 * 0.02)


def test_a_way_that_turns_back_or_stands_has_a_finite_time():
    heading = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])
    bends = Bends(heading, heading, np.full(3, np.inf), np.full(3, np.inf))
    length = np.array([0.1, 0.1, 0.0])
    times = path_times(length, np.full(3, 0.5), np.zeros(3, dtype=int), np.zeros(3), bends=bends)
    assert times.sum() == pytest.approx(4.0 * np.sqrt(0.1 / 2.3) + RAMP, rel=1e-4)
