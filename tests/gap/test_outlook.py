"""What a plan is said to tell, against closed forms and against campaigns measured then."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.stats import ncx2

from postproc.gap import act, effect_of, outlook
from postproc.gap.answers.outlook import _Bench, _called, _Seen
from postproc.gap.posterior import DECISIVE, Candidate, Sort
from postproc.gap.robot_model import State

SIGMA = 2e-5


def test_one_number_is_seen_from_the_size_of_the_closed_form():
    """A column of length g in noise: half of g z^2 / (1 + g) beats its price, z^2 as ncx2."""
    rows, length = 100, 40.0
    X = np.zeros((3 * rows, 1))
    X[::3, 0] = length / np.sqrt(rows)
    bench = _Bench.of(np.zeros((3 * rows, 1)), SIGMA)
    g = length**2
    limit = 2.0 * (9.0 + 0.5 * np.log1p(g)) * (1.0 + g) / g
    needed = brentq(lambda d: ncx2.sf(limit, 1, d**2) - 0.98, 0.1, 50.0)
    columns, family = SIGMA * X.reshape(rows, 3, 1), np.zeros(1, dtype=int)
    one = Candidate("one", "one", Sort.CLASS, "one", columns, family, DECISIVE - 9.0)
    promised = _called(_Seen.of(one, bench), bench)
    assert promised == pytest.approx(SIGMA * needed / np.sqrt(rows), rel=0.12)


def test_what_frames_imitate_is_never_seen(samples):
    found = {one.name: one for one in outlook(samples, SIGMA).effects}
    assert "base_frame" not in found
    still = samples.at(np.tile(samples.q[:1], (len(samples), 1)))
    constant = {one.name: one for one in outlook(still, SIGMA).effects}
    assert np.isnan(constant["joint_offset"].smallest)
    assert found["joint_offset"].smallest < 1e-3


@pytest.mark.slow
def test_less_noise_and_more_rows_show_smaller_effects(samples):
    def sizes(rows, sigma):
        return {one.name: one.smallest for one in outlook(rows, sigma).effects}

    usual = sizes(samples, SIGMA)
    quiet, few = sizes(samples, 0.5 * SIGMA), sizes(samples.rows(np.arange(30)), SIGMA)
    for name in ("backlash", "joint_offset", "servo_lag"):
        assert quiet[name] == pytest.approx(0.5 * usual[name], rel=0.25)
        # NaN: at no size; what follows the pose alone is bounded by the noise of a reading
        assert not few[name] <= (1.0 if name == "joint_offset" else 1.2) * usual[name]


def test_what_follows_the_pose_alone_is_promised_from_the_noise_of_a_reading(samples):
    """No number of readings parts it from all else that follows the pose a little."""
    many = samples.rows(np.tile(np.arange(len(samples)), 6))
    found = {one.name: one.smallest for one in outlook(many, SIGMA).effects}
    assert found["joint_offset"] > SIGMA
    assert found["backlash"] < SIGMA


def test_a_column_that_is_not_logged_is_said(samples):
    blind = outlook(replace(samples, direction=None), SIGMA)
    assert blind.not_testable["backlash"] == tuple(f"dir{i}" for i in range(1, 7))
    assert "backlash" not in {one.name for one in blind.effects}


@pytest.mark.slow
@pytest.mark.parametrize(("name", "silent"), [("backlash", 0.4), ("joint_offset", 0.2)])
def test_nine_of_ten_campaigns_show_the_promised_size(name, silent, samples):
    """Likelihood ratios of the exact effect, frames free, against the size that is promised.

    A joint offset needs more than to be seen: it follows the pose alone, as much else does.
    """
    promised = next(one for one in outlook(samples, SIGMA).effects if one.name == name).smallest
    effect = effect_of(name)
    rng = np.random.default_rng(5)
    n, frames = len(samples), []
    for k in range(3):
        frames += [np.eye(3)[k] + 0 * samples.point, np.cross(np.eye(3)[k], samples.point)]
        frames += [samples.frames[:, 6, :3, k]]
    F = np.stack(frames, axis=2).reshape(3 * n, -1)

    def shown(size):
        theta = rng.normal(size=6) * [p.typical for p in effect.parameters(samples.arm, {})]
        moved = act(samples, [(effect, State(theta))])[0] - samples.point
        moved *= size / np.sqrt(np.mean(np.sum(moved**2, axis=1)))
        y = moved.ravel() + SIGMA * rng.normal(size=3 * n)
        columns = samples.jacobian * (samples.direction[:, None] if name == "backlash" else 1.0)
        both = np.hstack([F, columns.reshape(3 * n, 6)])
        left = [np.sum((y - A @ np.linalg.lstsq(A, y, rcond=1e-9)[0]) ** 2) for A in (F, both)]
        # what six more numbers must bring to be called, with odds of 10000 to 1
        return 0.5 * (left[0] - left[1]) / SIGMA**2 > 3.0 + np.log(1e4) + 6.0

    assert np.mean([shown(2.0 * promised) for _ in range(40)]) > 0.85
    assert np.mean([shown(silent * promised) for _ in range(40)]) < 0.6


def test_a_sag_is_expected_of_all_joints_alike():
    """One weight pulls at all of them: what only looks for it more widely is no arm."""
    numbers = effect_of("gravity_sag").drawn(np.random.default_rng(1).normal(size=(400, 16)))
    alike = np.corrcoef(numbers[:, :6].T)
    assert np.min(alike) > 0.9
    free = effect_of("joint_offset").drawn(np.random.default_rng(1).normal(size=(400, 6)))
    assert np.max(np.abs(np.corrcoef(free.T) - np.eye(6))) < 0.2
