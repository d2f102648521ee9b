"""A wander of the readings in time: a first-order process as columns.

Zero mean, exponential correlation, along each axis; between knots straight. How large it is, and
which of a few correlation times it has, the evidence of the rows beside every candidate says.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.data import Samples
from postproc.records import dataclass

_KNOTS = 24
"""Most knots of the wander at a station."""
_SCALES = (0.02, 0.06, 0.2)
"""Correlation times tried, over the length of the campaign."""


@dataclass(frozen=True, slots=True)
class Wander:
    """A wander of unit size: its name, columns (n, 3, k) [m], correlation time [s]."""

    key: str
    X: FloatArray
    scale: float


def wanders(samples: Samples, unit: IntArray) -> tuple[Wander, ...]:
    """Return the wanders that readings may have.

    Args:
        samples: all rows of a campaign.
        unit: (n,) set-up of the measuring device; its wander starts anew with each.
    """
    time = samples.course
    if float(np.ptp(time)) <= 0.0:
        return ()
    length = max(float(np.ptp(time[unit == u])) for u in np.unique(unit))
    found = []
    for share in _SCALES:
        scale = share * length
        parts = [_station(time, unit == u, scale) for u in np.unique(unit)]
        f = np.concatenate(parts, axis=1)
        X = np.einsum("ij,nk->nijk", np.eye(3), f).reshape(len(f), 3, -1)
        found.append(Wander(f"wander:{share:g}", np.asarray(X), scale))
    return tuple(found)


def _station(time: FloatArray, here: np.ndarray, scale: float) -> FloatArray:
    """Return (n, k) the wander of one station between knots."""
    start, end = float(time[here].min()), float(time[here].max())
    count = int(np.clip(2.0 * (end - start) / scale, 3, _KNOTS))
    knots = np.linspace(start, max(end, start + 1.0), count)
    step = knots[1] - knots[0]
    hat = np.maximum(1.0 - np.abs(time[:, None] - knots) / step, 0.0) * here[:, None]
    K = np.exp(-np.abs(knots[:, None] - knots) / scale)
    return np.asarray(hat @ np.linalg.cholesky(K + 1e-9 * np.eye(count)))
