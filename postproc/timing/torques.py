"""What torques bound: at each place of a way, and how much slower a joint motion has to be.

At a place of a path q(s) the torques are linear in the acceleration u along it and the square x of
the speed, as accelerations of axes are, with what holds the arm still beside them. A joint motion
that takes k times as long needs 1/k^2 of what moves it, and the same to be held.

Source:
    Hollerbach 1984, "Dynamic scaling of manipulator trajectories", Journal of Dynamic Systems,
    Measurement, and Control 106 (1).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.records import dataclass

TorqueOf = Callable[[IndexArray, FloatArray, FloatArray, FloatArray], FloatArray]


@dataclass(frozen=True, slots=True)
class Torques:
    """What the joints need, and the most they have.

    Args:
        of: motions (k,), joints (k, d) [rad], speeds and accelerations (k, d) to torques (k, d)
            [N*m].
        most: (d,) limits [N*m], above 0.
    """

    of: TorqueOf
    most: FloatArray

    def rows(
        self, row: IndexArray, q: FloatArray, first: FloatArray, second: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return a, b, low, high (k, d): low <= a u + b x <= high keeps the limits.

        Where a joint cannot even hold still nothing is bounded: no speed helps there.

        Args:
            row: (k,) motions.
            q: (k, d) joints [rad].
            first: (k, d) q' [rad/m].
            second: (k, d) q'' [rad/m^2].
        """
        none = np.zeros_like(q)
        still = self.of(row, q, none, none)
        slope, curve = (self.of(row, q, none, first), self.of(row, q, first, second))
        holds = np.abs(still) < self.most
        low, high = (np.where(holds, end - still, end * np.inf) for end in (-self.most, self.most))
        return slope - still, curve - still, low, high

    def slower(self, row: IndexArray, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        """Return by how much longer, 1 at least, motions (m,) have to take.

        Args:
            row: (m,) motions.
            q: (m, t, d) joints at moments of each [rad].
            qd: (m, t, d) speeds [rad/s].
            qdd: (m, t, d) accelerations [rad/s^2].
        """
        shape = q.shape
        flat = [values.reshape(-1, shape[-1]) for values in (q, qd, qdd)]
        of, none = np.repeat(row, shape[1]), np.zeros_like(flat[0])
        still = self.of(of, flat[0], none, none)
        moving = self.of(of, *flat) - still
        room = self.most - np.sign(moving) * still
        with np.errstate(divide="ignore", invalid="ignore"):
            share = np.where(np.abs(still) < self.most, np.abs(moving) / room, 0.0)
        return np.asarray(np.sqrt(share.reshape(len(q), -1).max(axis=1, initial=1.0)))
