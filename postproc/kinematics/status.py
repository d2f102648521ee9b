"""KUKA's status and turn, and the branch slot they belong to.

Status bit 0 is set overhead (wrist centre behind axis 1 in the frame that turns with it), bit 1
when A3 is above the angle at which the arm is stretched, bit 2 when A5 is negative. Turn bit i - 1
is set when axis i is negative; 0 counts as positive. Bits 3 and 4 of the status stay 0 (bit 4 marks
points taught on an absolutely accurate robot). Both steer PTP motions only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import ROUNDING, IntArray
from postproc.kinematics.model import Kinematics


def turn(q: ArrayLike) -> IntArray:
    """Return KUKA's T (...,) of joint angles (..., 6) [rad], whole turns included."""
    negative = np.asarray(q, dtype=np.float64) < -ROUNDING
    return np.asarray(negative @ (1 << np.arange(6)), dtype=np.int32)


def status_turn(kinematics: Kinematics, q: ArrayLike) -> tuple[IntArray, IntArray]:
    """Return KUKA's S and T, each (...,), of joint angles (..., 6) [rad].

    The bit of A5 is taken from the sign of A5 itself in both, as controllers do, so that
    S bit 2 equals T bit 4.
    """
    T = turn(q)
    S = (np.asarray(kinematics.slot(q)) & 0b011) | ((T >> 4) & 1) << 2
    return np.asarray(S, dtype=np.int32), T
