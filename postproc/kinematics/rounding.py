"""How far a tool point may pass approximated corners, and distances that keep a tolerance."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import FloatArray, IndexArray, stepped
from postproc.geometry import onto_line
from postproc.units import MM

_ROUNDS = 4
_DIGITS = 0.0002 * MM
"""By so much the digits of a text may move how far a corner is passed."""


def corner_miss(a: FloatArray, corner: FloatArray, b: FloatArray) -> FloatArray:
    """Return how far (c,) [m] a tool point may pass corners approximated from a to b (c, 3)."""
    return onto_line(corner, a, b)[1]


def within_tolerance(
    distance: FloatArray,
    miss: Callable[[IndexArray, FloatArray], FloatArray],
    tolerance: FloatArray | float,
) -> FloatArray:
    """Return the approximation distances (c,) [m] by which no corner is passed too far.

    ``miss``: corners (k,) and their distances (k,) [m] to how far they may be passed (k,) [m];
    ``tolerance`` of all or each. Those that keep it stay as they are, the others are round ones, 0
    where none was found.
    """
    kept, at = distance.copy(), np.arange(len(distance))
    most = np.broadcast_to(np.maximum(tolerance - _DIGITS, 0.0), distance.shape)
    for _ in range(_ROUNDS):
        passed = miss(at, kept[at])
        far = passed > most[at]
        at, passed = at[far], passed[far]
        if not len(at):
            return kept
        kept[at] = stepped(kept[at] * most[at] / passed)
    kept[at] = 0.0
    return kept
