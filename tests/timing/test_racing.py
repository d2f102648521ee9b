"""Samples where an axis races: against closed forms of the wrist, axis 1 and the stretched arm."""

import numpy as np
import pytest

from postproc.timing import Samples, resolved

LENGTH = 0.04


def passing(miss, at):
    """Axis 1 under a wrist that passes it by: miss [m], at [m] along the way; rate 1 / miss."""
    return lambda s: np.arctan((s - at) / miss)


def stretching(left, _):
    """The elbow of an arm that is drawn out; left [m] of reach at the end of the way."""
    return lambda s: np.sqrt(left + LENGTH - s)


def run(curves, pieces, speed=0.1, top=2.0, lost=False):
    """Return the coarse samples, the fine ones and how often places were asked for."""
    row = np.repeat(np.arange(len(curves)), pieces + 1)
    share = np.tile(np.arange(pieces + 1) / pieces, len(curves))
    asked = []

    def places_at(row, share, near):
        asked.append(len(row))
        q = [curves[r](LENGTH * s) for r, s in zip(row, share, strict=True)]
        return np.full((len(row), 1), np.nan) if lost else np.array(q).reshape(-1, 1)

    coarse = Samples(row, share, places_at(row, share, None))
    asked.clear()
    time = np.full(len(curves), LENGTH / speed)
    return coarse, resolved(coarse, time, np.array([top]), places_at), sum(asked)


def fastest(samples, motion):
    """The largest mean rate [rad/m] over a piece."""
    mine = samples.row == motion
    rate = np.diff(samples.places[mine, 0]) / np.diff(samples.share[mine]) / LENGTH
    return np.abs(rate).max()


@pytest.mark.parametrize("pieces", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("miss", [0.002, 0.007, 0.02])
@pytest.mark.parametrize("at", [0.0, 0.0131, 0.02, 0.04])
def test_a_wrist_that_passes_axis_1(miss, at, pieces):
    _, fine, _ = run([passing(miss, at)], pieces)
    assert fastest(fine, 0) == pytest.approx(1.0 / miss, rel=0.03)


@pytest.mark.parametrize("pieces", [1, 2, 3, 4, 7])
@pytest.mark.parametrize("left", [2e-5, 5e-4, 5e-3])
def test_an_arm_that_is_drawn_out(left, pieces):
    coarse, fine, asked = run([stretching(left, None)], pieces)
    assert fastest(fine, 0) == pytest.approx(0.5 / np.sqrt(left), rel=0.03)
    assert asked < 80
    if left < 1e-4:
        assert fastest(coarse, 0) < 0.5 * fastest(fine, 0)


def test_only_motions_that_race_get_samples_in_order():
    coarse, fine, _ = run([np.sin, passing(0.003, 0.01), np.sin], 4)
    for motion in (0, 2):
        one, other = coarse.of(coarse.row == motion), fine.of(fine.row == motion)
        np.testing.assert_array_equal(one.share, other.share)
    assert (np.diff(fine.row + fine.share) > 0.0)[np.diff(fine.row) == 0].all()
    assert np.isin(coarse.row + 10.0 * coarse.share, fine.row + 10.0 * fine.share).all()
    expected = passing(0.003, 0.01)(LENGTH * fine.share[fine.row == 1])
    np.testing.assert_array_equal(fine.places[fine.row == 1, 0], expected)


def test_slow_axes_are_not_asked_about():
    coarse, fine, asked = run([passing(0.02, 0.02)], 4, top=1000.0)
    assert fine is coarse
    assert asked == 0


def test_what_is_out_of_reach_ends_the_search():
    coarse, fine, _ = run([passing(0.003, 0.01)], 4, lost=True)
    assert fine is coarse
    empty = Samples(np.zeros(0, dtype=int), np.zeros(0), np.zeros((0, 1)))
    assert resolved(empty, np.zeros(0), np.ones(1), None) is empty
