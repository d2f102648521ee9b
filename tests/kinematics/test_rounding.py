"""Approximation distances by which tool points pass corners within a tolerance."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.kinematics import corner_miss, within_tolerance

MM = 1e-3


@pytest.mark.parametrize("tolerance", [0.02 * MM, 0.2 * MM, 1.0 * MM])
def test_distances_keep_the_tolerance_and_no_more_is_taken_off_than_rounding(tolerance):
    rng = np.random.default_rng(7)
    corner = rng.uniform(-1.0, 1.0, (400, 3))
    ways = rng.normal(size=(2, 400, 3))
    ways /= np.linalg.norm(ways, axis=2, keepdims=True)
    wished = rng.uniform(0.05, 5.0, 400) * MM

    def miss(rows, distance):
        ends = corner[rows] + distance[:, None] * ways[:, rows]
        return corner_miss(ends[0], corner[rows], ends[1])

    every = np.arange(400)
    kept = within_tolerance(wished, miss, tolerance)
    # by hand: the chord passes the corner of an isosceles triangle by d cos(half of its angle)
    half = 0.5 * np.arccos(np.clip(np.einsum("ni,ni->n", *ways), -1.0, 1.0))
    np.testing.assert_allclose(miss(every, kept), kept * np.cos(half), atol=1e-12)
    assert (kept * np.cos(half) <= tolerance).all()
    fits = wished * np.cos(half) < 0.99 * tolerance
    np.testing.assert_array_equal(kept[fits], wished[fits])
    assert (kept <= wished).all()
    assert (kept >= 0.75 * np.minimum(wished, (tolerance - 0.0002 * MM) / np.cos(half))).all()


def test_what_no_distance_keeps_is_an_exact_stop():
    stubborn = within_tolerance(np.full(3, MM), lambda rows, d: np.full(len(rows), MM), 0.1 * MM)
    np.testing.assert_array_equal(stubborn, np.zeros(3))
