"""The eight branches of a six-axis arm: three signs, which are KUKA's status bits."""

from __future__ import annotations

from abc import ABC, abstractmethod

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, IntArray
from postproc.units import TURN


def wrapped(angle: ArrayLike) -> FloatArray:
    """Return angles [rad] brought into [-pi, pi] by whole turns."""
    a = np.asarray(angle, dtype=np.float64)
    return np.asarray(a - TURN * np.rint(a / TURN))


class Branches(ABC):
    """Distances to the three borders between branches."""

    __slots__ = ()

    @property
    @abstractmethod
    def elbow_threshold(self) -> float:
        """A3 [rad] where the arm is stretched; status bit 1 is set above it."""

    @property
    @abstractmethod
    def wrist_threshold(self) -> float:
        """A5 [rad] where axes 4 and 6 fall together; status bit 2 is set below it."""

    @abstractmethod
    def reach(self, q: ArrayLike) -> FloatArray:
        """Return a signed distance (...,) that is negative overhead; status bit 0 is set there."""

    def elbow_angle(self, q: ArrayLike) -> FloatArray:
        """Return how far A3 (...,) [rad] is above the stretched arm, in [-pi, pi]."""
        return wrapped(np.asarray(q, dtype=np.float64)[..., 2] - self.elbow_threshold)

    def wrist_angle(self, q: ArrayLike) -> FloatArray:
        """Return how far A5 (...,) [rad] is above the straight wrist, in [-pi, pi]."""
        return wrapped(np.asarray(q, dtype=np.float64)[..., 4] - self.wrist_threshold)

    def slot(self, q: ArrayLike) -> IntArray:
        """Return the branch (...,) 0..7: overhead + 2 elbow + 4 wrist."""
        bits = (
            (self.reach(q) < 0.0)
            + 2 * (self.elbow_angle(q) > 0.0)
            + 4 * (self.wrist_angle(q) < 0.0)
        )
        return np.asarray(bits, dtype=np.int32)
