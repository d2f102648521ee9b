"""Approximation distances that a text can tell in few lines."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.planning.route.corners import evened

MM = 1e-3


def changes(blend: np.ndarray) -> int:
    """Return how often a text sets the distance anew: exact stops need none."""
    told = blend[blend > 0.0]
    return 1 + int((np.diff(told) != 0.0).sum())


@pytest.mark.parametrize("seed", range(5))
def test_no_distance_is_longer_than_it_may_be_nor_shorter_than_needs_be(seed):
    rng = np.random.default_rng(seed)
    most = rng.uniform(0.03, 3.0, 500) * MM
    most[rng.random(500) < 0.1] = 0.0
    even = evened(most, 1.0 * MM)
    assert (even <= most).all()
    assert (even <= 1.0 * MM).all()
    assert ((even > 0.0) == (most > 0.0)).all()
    blended = most > 0.0
    # half for the sake of neighbours, 0.8 for a round value
    assert (even[blended] >= 0.39 * np.minimum(most[blended], 1.0 * MM)).all()


def test_distances_that_differ_in_their_digits_are_told_once():
    rng = np.random.default_rng(3)
    most = rng.uniform(0.45, 0.5, 2000) * MM
    even = evened(most, 0.5 * MM)
    assert changes(even) == 1
    np.testing.assert_allclose(even, 0.4 * MM)


def test_a_single_wide_corner_among_narrow_ones_is_not_told():
    most = np.full(60, 0.4 * MM)
    most[30] = 0.7 * MM
    assert changes(evened(most, 1.0 * MM)) == 1


def test_what_nothing_speaks_against_comes_back_behind_a_short_one():
    most = np.full(60, 2.0 * MM)
    most[20] = 0.3 * MM
    even = evened(most, 1.0 * MM)
    np.testing.assert_allclose(np.delete(even, 20), 1.0 * MM)
    assert even[20] == pytest.approx(0.3 * MM)


def test_nothing_to_blend():
    np.testing.assert_array_equal(evened(np.zeros(4), 1.0 * MM), np.zeros(4))
    assert evened(np.zeros(0), 1.0 * MM).shape == (0,)
