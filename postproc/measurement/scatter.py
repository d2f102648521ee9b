"""Scatter of points in space and the lengths of their errors, for equal noise on all axes."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray

MEAN_LENGTH = 1.5958
"""Mean length of a Gaussian vector in space over its sd per axis: of chi with three freedoms."""
_MEDIAN_LENGTH = 1.5382


def robust_sigma(length: FloatArray) -> float:
    """Return the sd per axis from the lengths (n,) of errors; some of them may be faults."""
    return float(np.median(length)) / _MEDIAN_LENGTH
