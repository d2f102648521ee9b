"""Whole turns, limits, status and turn, distances to singular poses."""

import itertools

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from postproc.cell.cell import OpwGeometry
from postproc.cell.robotfile import load_robot
from postproc.errors import KinematicsError
from postproc.kinematics import build
from postproc.kinematics.model import closed_form
from postproc.kinematics.opw import arm_of
from postproc.kinematics.singular import (
    elbow_distance,
    shoulder_distance,
    smallest_singular_value,
    status_turn,
    turn,
    wrist_distance,
)
from postproc.units import DEG

KR500 = build(load_robot("kuka_kr500_r2830"))
TURN = 2.0 * np.pi


def test_turns_are_all_combinations_inside_the_limits():
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (60, 6))
    variants, rows = KR500.turns(q)
    found = {
        (int(row), tuple(np.rint((v - q[row]) / TURN).astype(int)))
        for v, row in zip(variants, rows, strict=True)
    }
    wanted = set()
    for row, angles in enumerate(q):
        for steps in itertools.product((-1, 0, 1), repeat=6):
            moved = angles + TURN * np.array(steps)
            if (moved >= KR500.q_min).all() and (moved <= KR500.q_max).all():
                wanted.add((row, steps))
    assert found == wanted
    assert KR500.within_limits(variants).all()


def test_turns_skip_unreachable_branches():
    variants, rows = KR500.turns(np.full((3, 6), np.nan))
    assert variants.shape == (0, 6)
    assert rows.shape == (0,)


@given(
    st.lists(st.floats(-180.0, 180.0), min_size=6, max_size=6),
    st.lists(st.floats(-350.0, 350.0), min_size=6, max_size=6),
)
def test_nearest_is_the_best_of_all_turns(angles, reference):
    q, q_ref = np.array(angles) * DEG, np.array(reference) * DEG
    near = KR500.nearest(q, q_ref)
    steps = TURN * np.arange(-3, 4)
    for joint in range(6):
        options = q[joint] + steps
        inside = (options >= KR500.q_min[joint]) & (options <= KR500.q_max[joint])
        allowed = options[inside] if inside.any() else options
        best = np.abs(allowed - q_ref[joint]).min()
        assert abs(abs(near[joint] - q_ref[joint]) - best) < 1e-9


def test_limits_and_margin():
    inside = 0.5 * (KR500.q_min + KR500.q_max)
    assert KR500.within_limits(inside)
    assert KR500.within_limits(KR500.q_max)
    assert not KR500.within_limits(KR500.q_max, margin=2.0 * DEG)
    outside = np.stack([inside, KR500.q_max + 0.1 * DEG])
    assert KR500.within_limits(outside).tolist() == [True, False]


@pytest.mark.parametrize(
    ("q_deg", "status", "turn_bits"),
    [
        ((0, -90, 90, 0, 0, 0), 2, 2),
        ((0, -90, 90, 0, 10, 0), 2, 2),
        ((0, -90, 90, 0, -10, 0), 6, 18),
        ((-10, -90, 90, -200, -10, 300), 6, 1 + 2 + 8 + 16),
        ((10, -90, 90, 160, 10, -60), 2, 2 + 32),
        ((0, -130, -60, 0, 30, 0), 1, 2 + 4),
        ((0, 10, -90, 0, 30, 0), 0, 4),
    ],
)
def test_status_and_turn_of_known_poses(q_deg, status, turn_bits):
    S, T = status_turn(KR500, np.array(q_deg) * DEG)
    assert (int(S), int(T)) == (status, turn_bits)


def test_status_and_turn_rules_hold_everywhere():
    q = np.random.default_rng(2).uniform(KR500.q_min, KR500.q_max, (5000, 6))
    S, T = status_turn(KR500, q)
    np.testing.assert_array_equal((S >> 2) & 1, (T >> 4) & 1)
    np.testing.assert_array_equal((S >> 2) & 1, q[:, 4] < 0.0)
    np.testing.assert_array_equal(T, sum((q[:, i] < 0.0) << i for i in range(6)))
    g = KR500.arm.geometry
    stretched = np.arctan2(-g.a2, g.c3)  # height and length of the wrist centre over axis 3
    np.testing.assert_array_equal((S >> 1) & 1, q[:, 2] > stretched)
    wrist_centre = KR500.link_frames(q)[:, 5, :3, 3]
    forward = np.stack([np.cos(q[:, 0]), -np.sin(q[:, 0])], axis=1)
    np.testing.assert_array_equal(S & 1, (wrist_centre[:, :2] * forward).sum(axis=1) < 0.0)
    np.testing.assert_array_equal(KR500.slot(q), S)


def test_rounding_below_zero_counts_as_zero():
    assert int(turn(np.array([-1e-16, 0.0, -0.0, 1e-16, -1e-17, 0.0]))) == 0


def test_distances_vanish_at_their_singular_poses_and_with_them_the_jacobian():
    q = np.random.default_rng(3).uniform(-1.0, 1.0, (100, 6)) + np.array([0, -1.2, 1.5, 0, 1.5, 0])
    assert (smallest_singular_value(KR500, q) > 1e-3).all()
    straight = q.copy()
    straight[:, 4] = 0.0
    stretched = q.copy()
    stretched[:, 2] = np.arctan2(-KR500.arm.geometry.a2, KR500.arm.geometry.c3)
    np.testing.assert_allclose(wrist_distance(KR500, straight), 0.0, atol=1e-12)
    np.testing.assert_allclose(elbow_distance(KR500, stretched), 0.0, atol=1e-12)
    for singular in (straight, stretched):
        np.testing.assert_allclose(smallest_singular_value(KR500, singular), 0.0, atol=1e-12)
    np.testing.assert_allclose(
        wrist_distance(KR500, q), np.abs(q[:, 4]).clip(max=np.pi / 2), atol=1
    )
    assert (shoulder_distance(KR500, q) > 0.0).all()


def test_same_robot_object_gives_the_same_kinematics():
    robot = load_robot("kuka_kr6_r900_2")
    assert build(robot) is build(robot)


def test_an_arm_without_length_is_refused():
    geometry = OpwGeometry(0, 0, 0, 1, 0, 1, 0.1, signs=np.ones(6), offsets=np.zeros(6))
    with pytest.raises(KinematicsError, match="KIN001"):
        closed_form(arm_of(geometry), -np.ones(6), np.ones(6))
