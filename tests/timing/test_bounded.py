"""Chains whose axes are bounded: against closed forms, differences, a convex solver and ruckig."""

from __future__ import annotations

import numpy as np
import pytest
import ruckig
from scipy.optimize import minimize

from postproc.timing import JointPath, joint_move_time, path_times
from postproc.timing.bounded import Bounds, bounded_speed, segment_times, slopes


def curve(seed, knots, axes=3):
    """Return a smooth joint path: knots so far apart, joints there, limits."""
    rng = np.random.default_rng(seed)
    way = np.sort(np.concatenate([[0.0, 1.0], rng.uniform(0.0, 1.0, knots - 2)]))
    way = 0.8 * np.linspace(0.0, 1.0, knots) + 0.2 * way
    waves = 1.0 + np.arange(3)[:, None]
    size, phase = rng.normal(size=(3, axes)) / waves, rng.uniform(0.0, 6.0, (3, axes))
    q = (size * np.sin(3.0 * waves * way[:, None, None] + phase)).sum(axis=1)
    return np.diff(way), q, rng.uniform(1.0, 4.0, axes)


def slopes_of(step, q):
    """Return q' and q'' at the knots of one motion."""
    way = np.concatenate([[0.0], np.cumsum(step)])
    return slopes(np.zeros(len(way), dtype=np.int64), way, q)


def bounds_of(first, second, low, high):
    """Return bounds [low, high] (d,) at all knots."""
    return Bounds(first, second, *(np.tile(end, (len(first), 1)) for end in (low, high)))


def joints_of(way, q, limits, ramp=0.0):
    """Return the same as one motion of as many samples."""
    k = len(way) - 1
    row = np.zeros(k, dtype=np.int64)
    return JointPath(row, way[1:] / way[-1], q[1:], q[:1], np.zeros(1), limits, ramp)


@pytest.mark.parametrize("knots", [2, 3, 11, 400])
def test_a_straight_joint_line_is_the_trapezoid_of_its_slowest_axis(knots):
    """The first axis turns 1.5 rad a metre and speeds up by 3 rad/s^2: 2 m/s^2 along the way."""
    way = np.linspace(0.0, 2.0, knots)
    q = np.outer(way, [1.5, 0.2])
    times = path_times(
        *(np.array([2.0]), np.array([0.5]), np.zeros(1, dtype=int), np.zeros(1), 9.0),
        joints_of(way, q, np.array([3.0, 3.0]), 0.1),
    )
    assert times[0] == pytest.approx(2.0 / 0.5 + 0.5 / 2.0 + 0.1, rel=1e-9)


@pytest.mark.parametrize("seed", range(4))
def test_a_straight_joint_line_takes_as_long_as_ruckig_says_of_its_axes(seed):
    """Cruising between both ramps: jerk is what a filter of the trapezoid gives."""
    rng = np.random.default_rng(seed)
    slope, push, ramp = rng.uniform(-2.0, 2.0, 6), rng.uniform(1.0, 3.0, 6), 0.12
    way = np.linspace(0.0, 3.0, 50)
    top = 0.6
    want = joint_move_time([np.zeros(6)], [3.0 * slope], np.abs(slope) * top, push, ramp)
    got = path_times(
        *(np.array([3.0]), np.array([top]), np.zeros(1, dtype=int), np.zeros(1), 99.0),
        joints_of(way, np.outer(way, slope), push, ramp),
    )
    assert got == pytest.approx(want, rel=1e-6)


@pytest.mark.parametrize("seed", range(6))
def test_no_axis_is_asked_for_more_and_some_axis_for_all_of_it(seed):
    step, q, limits = curve(seed, 3000)
    k = len(step)
    bounds = bounds_of(*slopes_of(step, q), -limits, limits)
    v, top, push = bounded_speed(step, np.full(k, 99.0), np.full(k, 1e9), bounds)
    seconds = np.concatenate([[0.0], np.cumsum(segment_times(step, v, top, push))])
    rate = np.diff(q, axis=0) / np.diff(seconds)[:, None]
    share = np.abs(np.diff(rate, axis=0)) / (0.5 * (seconds[2:] - seconds[:-2]))[:, None] / limits
    assert np.percentile(share.max(axis=1), 99) < 1.02
    assert np.median(share.max(axis=1)) > 0.98


@pytest.mark.parametrize("lopsided", [False, True])
@pytest.mark.parametrize("seed", range(4))
def test_it_is_the_fastest_way_that_a_convex_solver_finds(seed, lopsided):
    """Squares of speeds are the unknowns: bounds are linear in them, the time is convex.

    Lopsided is what a weight makes of the torques of a joint.
    """
    step, q, limits = curve(seed, 70)
    k = len(step)
    cap, push = np.full(k, 1.2), np.full(k, 3.0)
    first, second = slopes_of(step, q)
    shift = np.random.default_rng(seed).uniform(-0.8, 0.8, len(limits)) * limits * lopsided
    low, high = -limits - shift, limits - shift

    def room(x):
        whole = np.concatenate([[0.0], x, [0.0]])
        u = np.diff(whole) / (2.0 * step)
        found = [3.0 - u, 3.0 + u]
        for at in (slice(0, -1), slice(1, None)):
            asked = first[at] * u[:, None] + second[at] * whole[at, None]
            found += [np.ravel(high - asked), np.ravel(asked - low)]
        return np.concatenate(found)

    def seconds(x):
        v = np.sqrt(np.concatenate([[0.0], np.maximum(x, 1e-12), [0.0]]))
        return (2.0 * step / (v[1:] + v[:-1])).sum()

    mine, _, _ = bounded_speed(step, cap, push, bounds_of(first, second, low, high))
    for share in (0.2, 0.5, 0.05):  # by rounding, the solver may give up halfway
        best = minimize(
            *(seconds, share * mine[1:-1] ** 2),
            method="SLSQP",
            bounds=[(1e-9, 1.2**2)] * (k - 1),
            constraints={"type": "ineq", "fun": room},
            options={"maxiter": 400, "ftol": 1e-10},
        )
        if best.success:
            break
    assert best.success
    assert best.fun * (1.0 - 1e-6) < seconds(mine[1:-1] ** 2) < 1.02 * best.fun


def test_each_motion_of_a_chain_has_its_own_time_and_the_ramp_is_spread():
    step, q, limits = curve(3, 401)
    way = np.concatenate([[0.0], np.cumsum(step)])
    length = np.array([way[100], way[400] - way[100]])
    row = np.repeat([0, 1], [100, 300])
    start = np.array([0.0, way[100]])[row]
    joints = JointPath(
        row, (way[1:] - start) / length[row], q[1:], q[[0, 100]], np.full(2, 1e-4), limits, 0.1
    )
    both = path_times(length, np.full(2, 9.0), np.zeros(2, int), np.zeros(2), 99.0, joints)
    one = path_times(
        *(way[-1:], np.full(1, 9.0), np.zeros(1, int), np.zeros(1), 99.0),
        joints_of(way, q, limits, 0.1),
    )
    assert both.sum() == pytest.approx(one[0], rel=1e-2)
    assert (both > 0.0).all()


def test_what_the_axes_do_not_bound_is_as_without_them():
    way = np.linspace(0.0, 1.0, 30)
    q = 1e-3 * np.outer(way, [1.0, 2.0])
    plain = (np.array([1.0]), np.array([0.2]), np.zeros(1, int), np.zeros(1), 2.3)
    with_axes = path_times(*plain, joints_of(way, q, np.array([5.0, 5.0]), 0.1))
    assert with_axes == pytest.approx(path_times(*plain), rel=1e-3)


def test_a_corner_is_as_slow_as_its_blend_is_short():
    """The slope turns by 2 rad/m within twice the blend: v^2 2/(2b) = 3 rad/s^2 there."""
    row, share = np.repeat([0, 1], 50), np.tile(np.arange(1, 51) / 50.0, 2)
    q = np.where(row == 0, 0.2 * share, 0.2 - 0.2 * share)[:, None]  # up 1 rad/m, and down again
    start = np.array([[0.0], [0.2]])

    def seconds(blend, more=1):
        keep = np.arange(more - 1, 100, more)
        path = JointPath(
            *(row[keep], share[keep], q[keep], start, np.full(2, blend)), np.array([3.0]), 0.0
        )
        way = np.full(2, 0.2)
        return path_times(way, np.full(2, 9.0), np.zeros(2, int), np.zeros(2), 99.0, path).sum()

    for blend in (1e-3, 4e-3, 16e-3):
        corner = np.sqrt(3.0 * blend)
        straight = 0.2 - blend
        peak = np.sqrt(0.5 * corner**2 + 3.0 * straight)
        want = 2.0 * ((2.0 * peak - corner) / 3.0 + blend / corner)
        assert seconds(blend) == pytest.approx(want, rel=0.02)
        assert seconds(blend, 10) == pytest.approx(seconds(blend), rel=0.02)


@pytest.mark.parametrize("way", [0.0005, 0.002, 0.01, 0.2])
def test_a_short_stroke_from_stop_to_stop_is_the_double_s_of_the_axis_that_bounds_it(way):
    """One axis, straight in joint space: what ruckig says of it, not its ramp on top of that."""
    share = np.arange(1, 41) / 40.0
    q = 0.5 * way * share[:, None]
    joints = JointPath(
        np.zeros(40, int), share, q, np.zeros((1, 1)), np.full(1, np.inf), np.array([0.6]), 0.1
    )
    plain = (np.array([way]), np.array([0.1]), np.zeros(1, int), np.zeros(1), 9.0)
    request, trajectory = ruckig.InputParameter(1), ruckig.Trajectory(1)
    request.current_position, request.target_position = [0.0], [way]
    request.max_velocity, request.max_acceleration, request.max_jerk = [0.1], [1.2], [12.0]
    ruckig.Ruckig(1).calculate(request, trajectory)
    assert path_times(*plain, joints)[0] == pytest.approx(trajectory.duration, rel=1e-6)
