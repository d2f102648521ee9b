"""Inverse kinematics: against py-opw-kinematics, against forward kinematics, at singular poses."""

import numpy as np
import py_opw_kinematics as opw
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import RigidTransform

from postproc.cell.cell import OpwGeometry
from postproc.cell.robotfile import load_robot
from postproc.kinematics import build
from postproc.kinematics.model import closed_form
from postproc.kinematics.opw import arm_of
from postproc.units import DEG

MANY = 100_000
KR500 = build(load_robot("kuka_kr500_r2830"))
OUR_SLOT_IN_THEIRS = [
    4 * w + 2 * overhead + (1 - e) for w in (0, 1) for e in (0, 1) for overhead in (0, 1)
]


def oracle(geometry):
    lengths = {key: getattr(geometry, key) for key in ("a1", "a2", "b", "c1", "c2", "c3", "c4")}
    model = opw.KinematicModel(
        **lengths,
        offsets=tuple(geometry.offsets),
        flip_axes=tuple(bool(sign < 0) for sign in geometry.signs),
    )
    return opw.Robot(model, degrees=False)


def apart(a, b):
    """Largest difference of joint angles, whole turns aside."""
    return np.abs((a - b + np.pi) % (2.0 * np.pi) - np.pi).max(axis=-1)


def pose_error(kinematics, q, T):
    return np.abs(kinematics.fk(q) - T).max(axis=(-1, -2))


def skewed_arm():
    """A lateral offset, all signs turned, odd offsets: nothing of KUKA's is left."""
    geometry = OpwGeometry(
        a1=0.2, a2=-0.1, b=0.15, c1=0.6, c2=0.8, c3=0.7, c4=0.12,
        signs=np.array([1, -1, -1, 1, -1, 1]), offsets=np.array([0.3, -0.4, 1.1, 0.2, 0.0, -0.7]),
    )  # fmt: skip
    limit = np.full(6, np.pi)
    return closed_form(arm_of(geometry), -limit, limit)


@pytest.mark.slow
@pytest.mark.parametrize("kinematics", [KR500, skewed_arm()], ids=["kr500", "skewed"])
def test_all_branches_equal_py_opw_on_many_poses(kinematics):
    q = np.random.default_rng(1).uniform(-np.pi, np.pi, (MANY, 6))
    T = kinematics.fk(q)
    ours, valid = kinematics.ik(T)
    theirs = oracle(kinematics.arm.geometry).reach(RigidTransform.from_matrix(T)).joints
    if kinematics is KR500:
        theirs = theirs[:, OUR_SLOT_IN_THEIRS]
        exists = np.isfinite(theirs[:, :, 0])
        np.testing.assert_array_equal(valid | ~exists, True)
        assert np.count_nonzero(valid & ~exists) < 10  # borders of reach within rounding
        assert np.quantile(apart(ours, theirs)[valid & exists], 0.9999) < 1e-6
    else:
        gap = apart(ours[:, :, None], theirs[:, None])[valid[:, :, None].repeat(8, 2)]
        assert np.count_nonzero(valid.sum(1) != np.isfinite(theirs[:, :, 0]).sum(1)) < 10
        assert np.quantile(np.nanmin(gap.reshape(-1, 8), axis=1), 0.9999) < 1e-6
    row, slot = np.nonzero(valid)
    assert pose_error(kinematics, ours[row, slot], T[row]).max() < 1e-9


def test_each_configuration_is_found_in_its_own_slot(robot):
    kinematics = build(robot)
    q = np.random.default_rng(2).uniform(-np.pi, np.pi, (20_000, 6))
    branches, valid = kinematics.ik(kinematics.fk(q))
    row, slot = np.arange(len(q)), kinematics.slot(q)
    assert valid[row, slot].all()
    assert np.quantile(apart(branches[row, slot], q), 0.999) < 1e-9
    assert apart(branches[row, slot], q).max() < 1e-5  # rounding grows near singular poses
    reached = np.nonzero(valid)
    np.testing.assert_array_equal(kinematics.slot(branches[reached]), reached[1])


@settings(max_examples=300, deadline=None)
@given(st.lists(st.floats(-180.0, 180.0), min_size=6, max_size=6))
def test_every_branch_of_any_pose_leads_back_to_it(angles):
    q = np.array(angles) * DEG
    T = KR500.fk(q)
    branches, valid = KR500.ik(T)
    assert valid.any()
    assert np.isfinite(branches[valid]).all()
    assert np.isnan(branches[~valid]).all()
    assert np.abs(branches[valid]).max() <= np.pi + 1e-12
    assert pose_error(KR500, branches[valid], T).max() < 1e-8


def test_straight_wrist_keeps_all_branches_and_its_documented_choice():
    q = np.random.default_rng(3).uniform(-2.5, 2.5, (MANY, 6))
    q[:, 4] = 0.0
    T = KR500.fk(q)
    branches, valid = KR500.ik(T)
    slot = KR500.slot(q)
    row = np.arange(len(q))
    assert valid[row, slot].all()
    assert (valid.sum(axis=1) % 2 == 0).all()
    reached = np.nonzero(valid)
    assert pose_error(KR500, branches[reached], T[reached[0]]).max() < 1e-8
    own = branches[row, slot]
    np.testing.assert_array_equal(own[:, 3], 0.0)
    assert np.abs(own[:, 4]).max() < 1e-8
    assert apart(own[:, 5:], q[:, 3:4] + q[:, 5:]).max() < 1e-7
    other = branches[row, slot ^ 4]
    assert apart(other[:, 3:4], np.pi).max() < 1e-12


def test_folded_wrist_is_solved_too():
    limit = np.full(6, 2.0 * np.pi)
    kinematics = closed_form(KR500.arm, -limit, limit)
    q = np.random.default_rng(4).uniform(-2.5, 2.5, (2000, 6))
    q[:, 4] = np.pi
    T = kinematics.fk(q)
    branches, valid = kinematics.ik(T)
    reached = np.nonzero(valid)
    assert pose_error(kinematics, branches[reached], T[reached[0]]).max() < 1e-8
    split = kinematics.split_wrist(branches[:, 0], q)
    is_there = valid[:, 0]
    assert pose_error(kinematics, split[is_there], T[is_there]).max() < 1e-8


def test_split_wrist_takes_a4_from_the_reference_and_keeps_the_pose():
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.0, 1.0, (500, 6))
    q[:, 4] = 0.0
    branches, _ = KR500.ik(KR500.fk(q))
    own = branches[np.arange(len(q)), KR500.slot(q)]
    split = KR500.split_wrist(own, q)
    np.testing.assert_allclose(split, q, atol=1e-7)
    bent = own.copy()
    bent[:, 4] = 0.3
    np.testing.assert_array_equal(KR500.split_wrist(bent, q), bent)


@pytest.mark.parametrize("side", ["stretched", "folded"])
def test_stretched_and_folded_arm_keep_both_elbow_slots(side):
    q = np.random.default_rng(6).uniform(-2.0, 2.0, (MANY, 6))
    q[:, 2] = KR500.arm.elbow_threshold + (0.0 if side == "stretched" else np.pi)
    T = KR500.fk(q)
    branches, valid = KR500.ik(T)
    overhead = (KR500.arm.reach(q) < 0.0).astype(int)
    wrist = 4 * (q[:, 4] < 0.0)
    row = np.arange(len(q))
    for elbow in (0, 2):
        slot = overhead + elbow + wrist
        assert valid[row, slot].all()
        assert pose_error(KR500, branches[row, slot], T).max() < 1e-7
        assert np.quantile(apart(branches[row, slot], q), 0.99) < 1e-6  # square root of rounding


def test_wrist_centre_over_axis_1_leaves_a1_at_zero():
    q = np.array([0.7, -np.pi / 2.0, 0.0, 0.2, 0.9, 0.1])
    step = 1e-6 * np.eye(6)[2]
    for _ in range(60):  # turn A3 until the wrist centre stands over axis 1
        x = KR500.arm.reach(q)
        q[2] -= x * 1e-6 / (KR500.arm.reach(q + step) - x + 1e-300)
    assert abs(KR500.arm.reach(q)) < 1e-12
    T = KR500.fk(q)
    branches, valid = KR500.ik(T)
    assert valid[0, :2].any()
    for slot in np.flatnonzero(valid[0]):
        assert pose_error(KR500, branches[0, slot], T) < 1e-8
        assert apart(branches[0, slot, :1], np.pi * (slot & 1)) < 1e-9


def test_poses_out_of_reach_have_no_branch():
    T = np.tile(np.eye(4), (3, 1, 1))
    T[0, :3, 3] = [10.0, 0.0, 1.0]
    T[1, :3, 3] = [0.5, 0.0, 1.045 - 0.29]  # wrist centre on axis 2
    T[1, :3, 0], T[1, :3, 2] = [-1.0, 0.0, 0.0], [0.0, 0.0, -1.0]
    T[2] = KR500.fk(np.zeros(6))
    branches, valid = KR500.ik(T)
    assert not valid[:2, 0].any()
    assert not valid[0].any()
    assert valid[2].any()
    assert np.isnan(branches[0]).all()


def test_results_do_not_depend_on_how_poses_are_grouped():
    q = np.random.default_rng(7).uniform(-2.0, 2.0, (5000, 6))
    T = KR500.fk(q)
    whole, valid = KR500.ik(T)
    for i in (0, 1023, 1024, 4999):
        alone, valid_alone = KR500.ik(T[i])
        np.testing.assert_array_equal(alone[0], whole[i])
        np.testing.assert_array_equal(valid_alone[0], valid[i])
    assert KR500.ik(np.zeros((0, 4, 4)))[0].shape == (0, 8, 6)


@pytest.mark.parametrize("kinematics", [KR500, skewed_arm()], ids=["kr500", "skewed"])
def test_one_branch_is_the_same_as_all_of_them(kinematics):
    rng = np.random.default_rng(9)
    q = rng.uniform(-2.5, 2.5, (4000, 6))
    q[:500, 4] = 0.0
    T = kinematics.fk(q)
    T[-500:, :3, 3] *= 1.6
    T[-1, 0, 0] = np.nan
    branches, valid = kinematics.ik(T)
    assert not valid[-500:].all()
    for slot in range(8):
        one, reached = kinematics.ik_in(T, np.full(len(T), slot))
        np.testing.assert_array_equal(one, branches[:, slot])
        np.testing.assert_array_equal(reached, valid[:, slot])
    mixed = rng.integers(0, 8, len(T))
    one, reached = kinematics.ik_in(T, mixed)
    np.testing.assert_array_equal(one, branches[np.arange(len(T)), mixed])
    np.testing.assert_array_equal(reached, valid[np.arange(len(T)), mixed])
    assert kinematics.ik_in(T[:0], mixed[:0])[0].shape == (0, 6)


@pytest.mark.parametrize("wrong", [np.nan, np.inf, -np.inf])
def test_a_pose_that_is_no_number_has_no_branch_and_spoils_no_other(wrong):
    T = KR500.fk(np.random.default_rng(8).uniform(-2.0, 2.0, (4, 6)))
    good, _ = KR500.ik(T)
    T[1, 0, 3] = T[2, 1, 1] = wrong
    branches, valid = KR500.ik(T)
    assert not valid[1:3].any()
    assert np.isnan(branches[1:3]).all()
    np.testing.assert_array_equal(branches[[0, 3]], good[[0, 3]])


def check_some_branches(arm, T, q, valid):
    """Asked for some branches the arm gives those of q (n, 8, 6), all that are valid (n, 8)."""
    low, high = np.array([-2.0, -2.2, -1.5, -2.5, -1.8, -3.0]), np.array([2, 0.5, 2.6, 3, 2, 2.5])
    with np.errstate(invalid="ignore"):
        wanted = valid & ((q >= low) & (q <= high)).all(axis=2)
    pose, slot, some, reached = arm.ik_where(T, lambda j, a: (a >= low[j]) & (a <= high[j]))
    assert len(pose) > 5
    assert np.array_equal(np.argwhere(wanted), np.column_stack([pose, slot]))
    assert np.array_equal(reached, valid)
    assert np.abs(some - q[wanted]).max() < 1e-9
    rows, which = np.arange(len(T)), np.arange(len(T)) % 4
    both, good = arm.ik_wrists(T, which)
    for wrist in (0, 1):
        assert np.array_equal(good[:, wrist], valid[rows, which + 4 * wrist])
        assert np.allclose(both[good[:, wrist], wrist], q[rows, which + 4 * wrist][good[:, wrist]])


@pytest.mark.parametrize("arm", [KR500, skewed_arm()], ids=["kr500", "skewed"])
def test_asking_for_some_branches_gives_those_of_all(arm):
    T = arm.fk(np.random.default_rng(4).uniform(-np.pi, np.pi, (3000, 6)))
    T[::3, :3, 3] *= 1.2  # some out of reach
    check_some_branches(arm, T, *arm.ik(T))
