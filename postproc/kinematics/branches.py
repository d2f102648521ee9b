"""The eight branches of a six-axis arm, KUKA's status bits, and what every inverse is asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray, IntArray
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


MayStand = Callable[[int, FloatArray], BoolArray]
"""Which principal values [rad] of a joint 0..5 it may stand at, turned as it will."""


class Solver(ABC):
    """Inverse kinematics in eight fixed branch slots."""

    __slots__ = ()

    @abstractmethod
    def solve(self, T_robroot_flange: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 8, 6) principal values and valid (n, 8) for poses (n, 4, 4)."""

    @abstractmethod
    def solve_in(
        self, T_robroot_flange: FloatArray, slot: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 6) and valid (n,) in one branch slot (n,) of each pose."""

    def solve_wrists(
        self, T_robroot_flange: FloatArray, arm: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 2, 6) and valid (n, 2) in slots ``arm`` (n,) and ``arm + 4``."""
        T, slot = np.repeat(T_robroot_flange, 2, axis=0), np.repeat(arm, 2)
        slot[1::2] += 4
        q, valid = self.solve_in(T, slot)
        return q.reshape(-1, 2, 6), valid.reshape(-1, 2)

    def solve_where(
        self, T_robroot_flange: FloatArray, may: MayStand
    ) -> tuple[IndexArray, IndexArray, FloatArray, BoolArray]:
        """Return the branches of poses (n, 4, 4) of which every joint may stand where it does.

        Pose (k,), rising, slot (k,), rising within a pose, and q (k, 6) of each; valid (n, 8) as
        of ``solve``, whether or not joints may stand there.
        """
        q, valid = self.solve(T_robroot_flange)
        rows = np.flatnonzero(valid)
        for joint in range(6):
            rows = rows[may(joint, q.reshape(-1, 6)[rows, joint])]
        pose, slot = np.divmod(rows, 8)
        return pose, slot, q[pose, slot], valid
