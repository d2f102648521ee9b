"""Joints near a pose: nothing that the closed form finds is beside the bound."""

import numpy as np
import pytest

from postproc.arrays import FloatArray
from postproc.cell import load_robot
from postproc.geometry import inverse, rotation_from_vector, transform
from postproc.kinematics import Kinematics, build
from postproc.kinematics.linear import linear_joints
from postproc.units import DEG

TOOL = transform(rotation_from_vector(np.array([0.3, 1.2, -0.4])), np.array([0.12, -0.05, 0.4]))


@pytest.fixture(scope="module")
def arm() -> Kinematics:
    return build(load_robot("KR 500 R2830"))


def ways_from(rng: np.random.Generator, count: int, size: float) -> FloatArray:
    """Three points times three turns, the first of each where the tool is."""
    way, turn = rng.normal(size=(2, count, 3, 3)) * size
    way[:, 0] = turn[:, 0] = 0.0
    shape = (count, 3, 3, 3)
    both = np.broadcast_to(way[:, :, None], shape), np.broadcast_to(turn[:, None], shape)
    return np.concatenate(both, axis=3).reshape(count, 9, 6)


def standing(rng: np.random.Generator, count: int, wrist: float) -> FloatArray:
    """Configurations spread over the arm's reach, A5 at an angle [rad] or to its other side."""
    low, high = np.array([[-90, -110, 30, -180, 0, -180], [90, -40, 120, 180, 0, 180]]) * DEG
    q = rng.uniform(low, high, (count, 6))
    q[:, 4] = wrist * rng.choice([-1.0, 1.0], count)
    return q


@pytest.mark.parametrize(
    ("wrist", "size"), [(3.0, 1e-4), (15.0, 1e-4), (15.0, 1e-3), (60.0, 1e-3), (60.0, 2e-3)]
)
def test_no_mixture_of_the_ways_leaves_the_bound(arm: Kinematics, wrist: float, size: float):
    """Poses on random mixtures of points and of turns, solved in the posture of the start."""
    rng = np.random.default_rng([int(wrist), int(size * 1e5)])
    count = 60
    q = standing(rng, count, wrist * DEG)
    T = arm.fk(q) @ TOOL
    ways = ways_from(rng, count, size)
    moved, slack = linear_joints(arm, q, T, np.broadcast_to(TOOL, (count, 4, 4)), ways)
    proven = np.isfinite(slack).all(axis=1)
    assert proven.sum() > 20
    for _ in range(40):
        share = np.einsum("na,nb->nab", *rng.dirichlet(np.full(3, 0.6), (2, count)))
        share = share.reshape(count, 9)
        way = np.einsum("nk,nkd->nd", share, ways)
        R = rotation_from_vector(way[:, 3:]) @ T[:, :3, :3]
        flange = transform(R, T[:, :3, 3] + way[:, :3]) @ inverse(TOOL)
        found, reached = arm.ik_in(flange, arm.slot(q))
        found = found + 2 * np.pi * np.round((q - found) / (2 * np.pi))
        off = np.abs(found - q - np.einsum("nk,nkd->nd", share, moved))
        assert reached[proven].all()
        assert (off <= slack + 1e-9)[proven].all()


def test_the_bound_is_of_second_order_and_not_wasteful(arm: Kinematics):
    """On ways a tenth as long the slack is a hundredth; on those of a dense cut it is little."""
    rng = np.random.default_rng(5)
    q = standing(rng, 50, 40.0 * DEG)
    T, tool = arm.fk(q) @ TOOL, np.broadcast_to(TOOL, (50, 4, 4))
    ways = ways_from(rng, 50, 1e-4)
    slack = linear_joints(arm, q, T, tool, ways)[1].max(axis=1)
    shorter = linear_joints(arm, q, T, tool, 0.1 * ways)[1].max(axis=1)
    assert np.median(slack) < 1e-5
    assert (np.abs(slack / shorter - 100.0) < 10.0).all()


def test_nothing_is_proven_where_the_arm_cannot_follow(arm: Kinematics):
    """At a straight wrist, past the reach, and from joints that are not those of the pose."""
    q = np.array([[5, -85, 105, 10, 0, 20], [5, -85, 105, 10, 50, 20], [5, -85, 105, 10, 50, 20]])
    q = q * DEG
    T, tool = arm.fk(q) @ TOOL, np.broadcast_to(TOOL, (3, 4, 4))
    T[2, 0, 3] += 1e-3
    ways = np.zeros((3, 2, 6))
    ways[:, 1, :3] = 1e-3
    ways[1, 1, :3] = 3.0
    assert np.isinf(linear_joints(arm, q, T, tool, ways)[1]).all()
