"""Numbers of a cell and a controller side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.errors import Severity
from postproc.records import dataclass

LENGTH_MM = 1e-3
ANGLE_DEG = 1e-3
SPEED = 1e-3
"""Share of a speed."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One number that differs: key of the cell, both values in units of the key, weight, words."""

    key: str
    at: tuple[str | int, ...]
    cell: Any
    controller: Any
    severity: Severity
    text: str


@dataclass(slots=True)
class Counted:
    """How many numbers have been compared."""

    numbers: int = 0

    def differ(self, a: ArrayLike, b: ArrayLike, tolerance: float) -> bool:
        """Return whether two equally long lists of numbers are apart."""
        own, other = np.atleast_1d(np.asarray(a, float)), np.atleast_1d(np.asarray(b, float))
        self.numbers += own.size
        return not bool(np.abs(own - other).max() <= tolerance)
