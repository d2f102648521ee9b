"""Noise of a campaign: what counts as a reading taken again, and what the instrument adds."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from postproc.gap.fit.noise import Source, noise_of
from postproc.gap.fit.revisits import revisits

SIGMA = 3e-5


@pytest.fixture
def poses(samples):
    """Twelve poses, each read five times from one side, standing still, without a load."""
    row = np.repeat(np.arange(12), 5)
    same = samples.rows(row)
    still = np.zeros_like(same.qd)
    return replace(same, qd=still, wrench=0.0 * same.wrench, temperature=None)


def noise(samples, y, told=None, rest=1e-3):
    n = len(samples)
    instrument = None if told is None else np.full(n, told)
    return noise_of(samples, y, np.ones(n, bool), np.zeros(n, np.int32), instrument, rest)


def test_readings_taken_again_tell_the_noise(poses):
    y = np.random.default_rng(1).normal(0, SIGMA, (60, 3))
    found = noise(poses, y)
    assert found.source is Source.REPEATS
    assert found.sigma == pytest.approx(SIGMA, rel=0.2)


def test_readings_under_other_loads_are_no_repeats(poses):
    """How a pose gives is what is sought: here it gives along the load, which no gear does."""
    rng = np.random.default_rng(2)
    force = rng.normal(0, 800.0, (60, 3))
    loaded = replace(poses, wrench=np.column_stack([force, np.zeros((60, 3))]))
    y = rng.normal(0, SIGMA, (60, 3)) + 3e-7 * force
    every = np.ones(60, bool), np.zeros(60, np.int32)
    assert not revisits(loaded, y, *every).sufficient
    assert noise(loaded, y).source is Source.ASSUMED
    assert noise(loaded, y, told=SIGMA).sigma == pytest.approx(SIGMA)


def test_loads_that_move_nothing_do_not_count(poses):
    rng = np.random.default_rng(3)
    light = np.column_stack([rng.normal(0, 1.0, (60, 3)), np.zeros((60, 3))])
    y = rng.normal(0, SIGMA, (60, 3))
    assert noise(replace(poses, wrench=light), y).source is Source.REPEATS


@pytest.mark.parametrize(("told", "between"), [(1.2, True), (0.8, True), (4.0, False)])
def test_repeats_and_an_instrument_that_agree_are_taken_together(poses, told, between):
    y = np.random.default_rng(4).normal(0, SIGMA, (60, 3))
    alone, both = noise(poses, y).sigma, noise(poses, y, told * SIGMA).sigma
    if between:
        freedom = noise(poses, y).freedom
        square = (freedom * alone**2 + 40 * (told * SIGMA) ** 2) / (freedom + 40)
        assert both == pytest.approx(np.sqrt(square), rel=0.02)
    else:
        assert both == alone


@pytest.mark.slow
def test_conditions_that_take_freedom_do_not_make_readings_alike(samples):
    """Few poses, many conditions: what they leave is small, and no reading's noise is."""
    six = samples.rows(np.repeat(np.arange(6), 5))
    rng = np.random.default_rng(7)
    logged = replace(
        six,
        qd=rng.uniform(-1.0, 1.0, (30, 6)),
        wrench=0.0 * six.wrench,
        direction=rng.choice([-1.0, 1.0], (30, 6)),
        temperature=rng.uniform(15.0, 30.0, 30),
    )
    every = np.ones(30, bool), np.zeros(30, np.int32)
    told = [revisits(logged, rng.normal(0, SIGMA, (30, 3)), *every).noise for _ in range(300)]
    assert min(told) > 0.5 * SIGMA
    assert np.median(told) == pytest.approx(SIGMA, rel=0.1)


def test_sides_that_nobody_logged_make_two_scatters(poses):
    rng = np.random.default_rng(7)
    side = 10.0 * SIGMA * rng.choice([-1.0, 1.0], (60, 1)) * np.ones(3)
    unlogged = replace(poses, direction=None)
    found = noise(unlogged, rng.normal(0, SIGMA, (60, 3)) + side)
    assert found.sigma < 2.0 * SIGMA


def test_a_wander_faster_than_the_readings_is_noise(poses):
    """It moves each reading its own way: no campaign can tell it from white noise."""
    time = 30.0 * (12 * np.tile(np.arange(5), 12) + np.repeat(np.arange(12), 5))
    C = SIGMA**2 * np.exp(-np.abs(time[:, None] - time) / 28.0)
    for seed in range(6):
        y = np.linalg.cholesky(C) @ np.random.default_rng(seed).normal(size=(60, 3))
        found = noise(replace(poses, time=time, course=time), y)
        assert found.sigma == pytest.approx(SIGMA, rel=0.3)


@pytest.mark.parametrize("wander", [0.0, 3.0])
def test_repeats_say_how_large_a_wander_may_be(poses, wander):
    """Five readings of each pose over two hours, in another order each time."""
    rng = np.random.default_rng(5)
    time = np.concatenate([k * 1400.0 + 115.0 * rng.permutation(12) for k in range(5)])
    time = time.reshape(5, 12).T.ravel()
    C = np.exp(-np.abs(time[:, None] - time) / 1500.0)
    course = wander * SIGMA * np.linalg.cholesky(C + 1e-9 * np.eye(60)) @ rng.normal(size=(60, 3))
    y = rng.normal(0, SIGMA, (60, 3)) + course
    found = noise(replace(poses, time=time, course=time), y)
    assert all(most > wander * SIGMA for _, most in found.bounds)
    assert found.lets(wander * SIGMA, 1500.0)
    if not wander:
        assert not found.lets(1.5 * SIGMA, 1500.0)


def test_what_follows_a_column_is_no_noise(poses):
    """Tools that are each off by something, a pressure that shifts, a shift that turns A1."""
    rng = np.random.default_rng(11)
    R, J = poses.frames[:, 6, :3, :3], poses.jacobian
    n, wrong = len(poses), []
    tool, pressure = rng.integers(0, 3, n), rng.uniform(5.0, 7.0, n)
    off = rng.normal(0, 2e-4, (3, 3))
    cases = {
        "tool_no": (tool + 1, np.einsum("nij,nj->ni", R, off[tool])),
        "tool": (np.array(["A", "B", "C"])[tool], np.einsum("nij,nj->ni", R, off[tool])),
        "pressure": (pressure, np.outer(pressure - 6.0, off[0])),
        "shift": (np.array(["early", "late"])[tool % 2], 1e-4 * J[:, :, 0] * (tool % 2)[:, None]),
    }
    for name, (column, moved) in cases.items():
        y = rng.normal(0, SIGMA, (n, 3)) + moved
        found = noise(replace(poses, extra={name: column, "weather": rng.normal(size=n)}), y)
        if abs(found.sigma / SIGMA - 1.0) > 0.35:
            wrong.append((name, found.sigma))
    assert not wrong
