"""What a configuration is: KUKA's S and T, how far from singularities, whether A6 is the tool axis.

Status bit 0 is set overhead (wrist centre behind axis 1 in the frame that turns with it), bit 1
when A3 is above the angle at which the arm is stretched, bit 2 when A5 is negative. Turn bit i - 1
is set when axis i is negative; 0 counts as positive. Bits 3 and 4 of the status stay 0 (bit 4 marks
points taught on an absolutely accurate robot). Both steer PTP motions only.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import ROUNDING, TINY, FloatArray, IntArray
from postproc.geometry import apply, inverse
from postproc.kinematics.model import Kinematics
from postproc.units import DEG

STRETCHED = 3.0 * DEG
"""An arm nearer to being stretched than this is worth a warning, and no pose to look for."""


def wrist_distance(kinematics: Kinematics, q: ArrayLike) -> FloatArray:
    """Return how far A5 (...,) [rad] is from the straight or the folded wrist, in [0, pi/2]."""
    return _from_half_turns(kinematics.branches.wrist_angle(q))


def elbow_distance(kinematics: Kinematics, q: ArrayLike) -> FloatArray:
    """Return how far A3 (...,) [rad] is from the stretched or the folded arm, in [0, pi/2]."""
    return _from_half_turns(kinematics.branches.elbow_angle(q))


def shoulder_distance(kinematics: Kinematics, q: ArrayLike) -> FloatArray:
    """Return the distance (...,) of the wrist centre from the plane of axes 1 and 2.

    In metres for an ortho-parallel arm with spherical wrist; for any other arm the shoulder's
    factor of the Jacobian's determinant, whose zero is the singularity.
    """
    return np.abs(kinematics.branches.reach(q))


def smallest_singular_value(
    kinematics: Kinematics, q: ArrayLike, p_flange_tcp: ArrayLike = (0.0, 0.0, 0.0)
) -> FloatArray:
    """Return the smallest singular value (...,) of the Jacobian [rad/rad], a metre as a radian."""
    J = kinematics.jacobian(q, p_flange_tcp)
    return np.asarray(np.linalg.svd(J, compute_uv=False)[..., -1])


def _from_half_turns(angle: FloatArray) -> FloatArray:
    return np.abs(angle - np.pi * np.rint(angle / np.pi))


def is_coaxial_with_axis_6(
    kinematics: Kinematics, T_flange_tcp: ArrayLike, axis_tcp: ArrayLike
) -> bool:
    """Return whether the tool axis (3,), in the TCP frame, lies on axis 6.

    Then turning about the tool axis turns axis 6 alone: the other axes, and with them stiffness and
    reach, stay as they are, so there is nothing to optimise.
    """
    point, direction = axis_6_in_flange(kinematics)
    T = np.asarray(T_flange_tcp, dtype=np.float64)
    tool = T[:3, :3] @ np.asarray(axis_tcp, dtype=np.float64)
    is_parallel = float(np.linalg.norm(np.cross(tool, direction))) < TINY
    off_line = float(np.linalg.norm(np.cross(T[:3, 3] - point, direction)))
    return is_parallel and off_line < TINY


def axis_6_in_flange(kinematics: Kinematics) -> tuple[FloatArray, FloatArray]:
    """Return a point (3,) [m] and the unit direction (3,) of axis 6 in the flange frame."""
    zero = np.zeros(6)
    T_flange_robroot = inverse(kinematics.fk(zero))
    origin_6 = kinematics.link_frames(zero)[6, :3, 3]
    direction = T_flange_robroot[:3, :3] @ kinematics.jacobian(zero)[3:, 5]
    return apply(T_flange_robroot, origin_6), np.asarray(direction)


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
