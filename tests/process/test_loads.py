"""Wrenches against the power that they do."""

import numpy as np

from postproc.process.loads import moved_wrench, weight_wrench


def test_moving_a_wrench_keeps_its_power():
    rng = np.random.default_rng(7)
    wrench, lever = rng.normal(size=(20, 6)), rng.normal(size=(20, 3))
    speed, turn = rng.normal(size=(20, 3)), rng.normal(size=(20, 3))
    there = speed + np.cross(turn, lever)
    moved = moved_wrench(wrench, lever)
    power = np.sum(wrench[:, :3] * there + wrench[:, 3:] * turn, axis=1)
    np.testing.assert_allclose(np.sum(moved[:, :3] * speed + moved[:, 3:] * turn, axis=1), power)


def test_a_weight_pulls_down_and_turns_by_its_lever():
    gravity = np.array([0.0, 0.0, -10.0])
    found = weight_wrench(3.0, gravity, np.array([[0.2, 0.0, 0.5], [0.0, -0.1, 0.0]]))
    np.testing.assert_allclose(found, [[0, 0, -30, 0, 6, 0], [0, 0, -30, 3, 0, 0]], atol=1e-15)
