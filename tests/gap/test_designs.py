"""Designs in one campaign, and what an effect brings on one that it was not fitted to."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.gap.data import designs
from postproc.gap.data.dataset import make_samples
from postproc.gap.robot_model import RobotModel


@pytest.fixture
def arm(cell, kinematics):
    return RobotModel.of(kinematics, cell).arm


def random_q(rng, n):
    return rng.uniform(
        np.radians([-60, -115, 10, -170, 20, -170]),
        np.radians([60, -15, 120, 170, 100, 170]),
        (n, 6),
    )


def grid_q(kinematics, q_start, rng, n):
    """Other places at the very orientation of a pose."""
    T = np.repeat(kinematics.fk(q_start[None]), 8 * n, axis=0)
    T[:, :3, 3] += rng.uniform(-0.25, 0.25, (8 * n, 3))
    q, good = kinematics.ik(T)
    return q[:, 0][good[:, 0]][:n] if good[:, 0].sum() >= n else q[good][:n]


def test_labels_of_the_file_are_designs_where_few_hold_most_rows(arm):
    rng = np.random.default_rng(1)
    samples = make_samples(arm, random_q(rng, 100))
    found = designs(samples, ["mon"] * 60 + ["tue"] * 38 + ["odd"] * 2)
    assert found.source == "group"
    assert found.names == ("mon", "tue")
    assert np.bincount(found.label).tolist() == [62, 38]
    # a label for each tag says nothing of designs
    assert designs(samples, [f"T{k // 3}" for k in range(100)]).source == ""
    assert len(designs(samples)) == 1


def test_grids_at_one_orientation_sweeps_and_varied_poses(arm, kinematics):
    rng = np.random.default_rng(2)
    start = random_q(rng, 2)
    start[:, 3:] = [[0.4, 0.9, 0.2], [-0.6, 0.8, 1.0]]
    start[:, :3] = [[0.1, -1.2, 1.3], [0.2, -1.1, 1.4]]
    grids = [grid_q(kinematics, q, rng, 25) for q in start]
    assert [len(g) for g in grids] == [25, 25]
    sweep = np.tile(start[0], (20, 1))
    sweep[:, 1] += np.linspace(0.0, 0.5, 20)
    q = np.concatenate([*grids, random_q(rng, 30), sweep])
    found = designs(make_samples(arm, q))
    truth = np.repeat([0, 1, 2, 3], [25, 25, 30, 20])
    names = [found.names[found.label[np.flatnonzero(truth == k)[0]]] for k in range(4)]
    assert len(set(names)) == 4
    assert names[2:] == ["varied poses", "sweep of A2"]
    for k in range(4):
        share = np.mean(found.label[truth == k] == found.names.index(names[k]))
        # the first row of a sweep may belong to what came before
        assert share >= 0.95


def test_repeats_of_one_pose_are_no_design(arm):
    rng = np.random.default_rng(3)
    q = random_q(rng, 60)
    q[:20] = q[0] + rng.normal(0.0, 1e-5, (20, 6))
    assert len(designs(make_samples(arm, q))) == 1
