"""What every inverse kinematics can be asked for."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray

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
