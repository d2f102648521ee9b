"""Designs in one campaign, and what an effect brings on one that it was not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.gap.answers.designs import Designs, designs, is_worse, transfers
from postproc.gap.choice.evidence import Evidence
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.data.dataset import make_samples
from postproc.gap.effect import EFFECTS
from postproc.gap.fit.linear import block_of
from postproc.gap.fit.regression import Regression
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


def bench_of(arm, rng, n, always=()):
    samples = make_samples(arm, random_q(rng, n))
    known = dict(EFFECTS)
    blocks = tuple(
        block_of(known[name], samples, known[name].prepare(samples))
        for name in ("base_frame", "tool_frame", "joint_offset", "gear_coupling")
    )
    y = blocks[2].X @ rng.normal(0.0, 1.0, 6) + rng.normal(0.0, 2e-5, (n, 3))
    return Regression(
        samples, y, np.full(n, 1.0 / 2e-5), np.zeros(n, dtype=np.int32), blocks, always
    )


@pytest.mark.parametrize("always", [(), ("base_frame", "tool_frame")])
def test_transfer_is_what_ridge_regression_does_on_the_design_left_out(arm, always):
    regression = bench_of(arm, np.random.default_rng(4), 90, always)
    label = Designs(np.repeat([0, 1, 2], 30), ("a", "b", "c"), "group")
    found = transfers(regression, label, ("joint_offset", "gear_coupling"))
    by_key = {b.key: b for b in regression.blocks}

    y = regression.y / 2e-5

    def columns(keys, rows):
        parts = [by_key[key].X[rows] for key in keys] or [np.zeros((sum(rows), 3, 0))]
        return np.concatenate(parts, axis=2).reshape(3 * sum(rows), -1) / 2e-5

    def ridge(A, r):
        p = A.shape[1]
        stacked = np.vstack([A, np.eye(p)])
        return np.linalg.lstsq(stacked, np.append(r, np.zeros(p)), rcond=None)[0]

    every = np.ones(90, dtype=bool)
    count = sum(by_key[key].X.shape[2] for key in always)

    def left(keys, numbers, k):
        """What numbers leave on a design, the frames adapted to it."""
        here = label.label == k
        r = y[here].ravel() - columns(keys, here) @ numbers
        B = columns(always, here)
        t = ridge(B, r)
        return float(np.sum((r - B @ t) ** 2) + t @ t)

    for key in found:
        rest = tuple(k for k in found if k != key)
        alone = ridge(columns((*always, *rest), every), y.ravel())[count:]
        company = ridge(columns((*always, *rest, key), every), y.ravel())[count:]
        company = company[: len(alone)]
        for k, name in enumerate(label.names):
            out = label.label != k
            r = y[out].ravel() - columns(rest, out) @ company
            own = ridge(columns((*always, key), out), r)[count:]
            with_it = left((*rest, key), np.append(company, own), k)
            expected = 0.5 * (left(rest, alone, k) - with_it)
            assert found[key][name] == pytest.approx(expected, rel=1e-6, abs=1e-4)
    assert min(found["joint_offset"].values()) > 100.0
    assert max(found["gear_coupling"].values()) < 10.0


def test_what_holds_in_one_design_only_makes_the_other_worse(arm):
    regression = bench_of(arm, np.random.default_rng(5), 120)
    label = Designs(np.repeat([0, 1], 60), ("a", "b"), "group")
    flipped = regression.y.copy()
    flipped[60:] *= -1.0
    wrong = Regression(
        regression.samples, flipped, regression.weight, regression.fold, regression.blocks, ()
    )
    found = transfers(wrong, label, ("joint_offset",))
    assert max(found["joint_offset"].values()) < -100.0
    assert transfers(regression, Designs(np.zeros(120, int), ("all",), ""), ("joint_offset",)) == {}


def test_a_model_that_holds_on_half_of_the_rows_only_is_worse_than_none(arm):
    regression = bench_of(arm, np.random.default_rng(6), 120)
    fold = np.repeat([0, 1], 60).astype(np.int32)
    evidence = {"joint_offset": Evidence(1.0, 1e-4)}
    choice = Choice({"joint_offset": Standing.ADOPTED}, evidence, {}, {})
    assert not is_worse(replace(regression, fold=fold), choice)
    flipped = regression.y.copy()
    flipped[60:] *= -1.0
    assert is_worse(replace(regression, fold=fold, y=flipped), choice)


@pytest.mark.parametrize(("last", "told"), [(1.0, False), (0.5, False), (-0.2, True)])
def test_what_a_model_brings_has_to_exceed_its_own_standard_error(arm, last, told):
    """Three quarters of the rows gain more than the last one loses, and that is not enough."""
    regression = bench_of(arm, np.random.default_rng(6), 120)
    y = regression.y.copy()
    y[90:] *= last
    fold = np.repeat([0, 1, 2, 3], 30).astype(np.int32)
    choice = Choice(
        {"joint_offset": Standing.ADOPTED}, {"joint_offset": Evidence(1.0, 1e-4)}, {}, {}
    )
    assert is_worse(replace(regression, fold=fold, y=y), choice) == told


def test_a_half_in_which_an_effect_hardly_shows_says_nothing_of_it(arm):
    regression = bench_of(arm, np.random.default_rng(5), 120)
    label = Designs(np.repeat([0, 1], 60), ("a", "b"), "layout")
    off = np.arange(120) < 60
    blocks, y = list(regression.blocks), regression.y.copy()
    k = next(i for i, block in enumerate(blocks) if block.key == "joint_offset")
    X = blocks[k].X.copy()
    X[off] = 0.0
    blocks[k] = replace(blocks[k], X=X)
    y[off] = 2e-5 * np.random.default_rng(6).normal(size=(60, 3))
    once = replace(regression, y=y, blocks=tuple(blocks))
    assert transfers(once, label, ("joint_offset",), only_told=True) == {"joint_offset": {}}
    # what shows in both halves is judged in both, and speaks against itself where it does not hold
    both = transfers(regression, label, ("joint_offset",), only_told=True)["joint_offset"]
    assert min(both.values()) > 100.0
    y = regression.y.copy()
    y[60:] *= -0.5
    wrong = transfers(replace(regression, y=y), label, ("joint_offset",), only_told=True)
    assert max(wrong["joint_offset"].values()) < -100.0
