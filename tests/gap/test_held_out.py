"""What a candidate brings on rows left out, against fits made anew."""

from types import SimpleNamespace

import numpy as np
import pytest

from postproc.gap.posterior.evidence import Optimum, held_out, left_out
from postproc.gap.posterior.prior import Equations

SIGMA, LOADED = 1e-5, 1
"""Noise [m] of a good tracker, and the label of the only rows that see the last number."""


def world(seed):
    """Return columns as large as frames beside one that only a part of the rows sees."""
    rng = np.random.default_rng(seed)
    label = np.repeat(np.arange(3), 40)
    frames = rng.normal(0.0, 1.0, (120, 3, 12))
    give = rng.normal(0.0, 1e-3, (120, 3, 6)) * (label == LOADED)[:, None, None]
    truth = rng.normal(0.0, 1.0, 12), rng.normal(0.0, 0.3, 6)
    z = frames @ truth[0] + give @ truth[1] + rng.normal(0.0, SIGMA, (120, 3))
    parts = [SimpleNamespace(key="frames", X=frames), SimpleNamespace(key="give", X=give)]
    equations = Equations.of(parts, z, np.tile(np.eye(3), (120, 1, 1)))
    deviation = np.concatenate([np.full(12, 1e3), np.full(6, 20.0)])
    keys = ("frames", "give")
    nothing = np.zeros(0)
    at = Optimum(keys, 0.0, {}, SIGMA, nothing, nothing, deviation, 0.0, 0.0, 0.0)
    return equations, at, label


def missed(equations, at, label, k, use):
    """Return by how much [sigma] rows of a label are missed, fitted anew to the others."""
    here = label[equations.row] == k
    A, z = equations.A[:, use] / SIGMA, equations.z / SIGMA
    prior = np.diag(1.0 / at.deviation[use])
    rows = np.vstack([A[~here], prior]), np.append(z[~here], np.zeros(len(prior)))
    return z[here] - A[here] @ np.linalg.lstsq(*rows, rcond=None)[0]


@pytest.mark.parametrize("seed", range(5))
def test_a_number_that_only_the_rows_left_out_see_does_no_harm(seed):
    equations, at, label = world(seed)
    every, frames = np.arange(18), np.arange(12)
    expected = [
        0.5
        * (
            np.sum(missed(equations, at, label, k, frames) ** 2)
            - np.sum(missed(equations, at, label, k, every) ** 2)
        )
        for k in range(3)
    ]
    got = held_out(equations, at, {"give": ["give"]}, label)["give"]
    size = np.sum(missed(equations, at, label, LOADED, frames) ** 2)
    np.testing.assert_allclose(got, expected, atol=1e-6 * size)
    square = sum(np.sum(missed(equations, at, label, k, every) ** 2) for k in range(3))
    got = left_out(equations, at, label)[0]
    assert got == pytest.approx(SIGMA * np.sqrt(square / 120), rel=1e-6)
