"""What this package asks of the kinematics: where links and flange are for given joint angles."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import vee


class Arm(Protocol):
    """The part of ``postproc.kinematics`` that is used here; vectorised over leading axes."""

    def __hash__(self) -> int:
        """Return that of the object: solids are kept by arm."""

    def link_frames(self, q: FloatArray) -> FloatArray:
        """Return T_robroot_link (..., 7, 4, 4) of links 0..6 for q (..., 6) [rad]."""

    def links_of(self, q: FloatArray) -> FloatArray:
        """Return ``link_frames`` of (n, 6) as (7, 3, 4, n): configurations last, row 4 left out."""

    def fk(self, q: FloatArray) -> FloatArray:
        """Return T_robroot_flange (..., 4, 4) for q (..., 6) [rad]."""


def joint_axes(arm: Arm) -> tuple[FloatArray, FloatArray]:
    """Return direction (6, 3) and a point (6, 3) [m] of each joint axis, in its link's frame.

    Link i turns about axis i, which stands still in the frames of links i - 1 and i. The motion of
    link i over half a radian of joint i is a pure turn whose fixed line is the axis.
    """
    angle = 0.5
    zero = arm.link_frames(np.zeros(6))
    directions, points = np.empty((6, 3)), np.empty((6, 3))
    for joint in range(6):
        q = np.zeros(6)
        q[joint] = angle
        M = np.linalg.inv(zero[joint + 1]) @ arm.link_frames(q)[joint + 1]
        R = M[:3, :3]
        directions[joint] = vee(R) / np.linalg.norm(vee(R))
        points[joint] = np.linalg.lstsq(np.eye(3) - R, M[:3, 3], rcond=None)[0]
    return directions, points
