"""What turning about the tool axis does to the arm."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import TINY, FloatArray
from postproc.geometry import apply, inverse
from postproc.kinematics.model import Kinematics


def is_coaxial_with_axis_6(
    kinematics: Kinematics, T_flange_tcp: ArrayLike, axis_tcp: ArrayLike
) -> bool:
    """Return whether the tool axis lies on axis 6.

    Then turning about the tool axis turns axis 6 alone: the other axes, and with them stiffness
    and reach, stay as they are, so there is nothing to optimise.

    Args:
        kinematics: the arm.
        T_flange_tcp: (4, 4) TCP in the flange [m].
        axis_tcp: (3,) unit tool axis in the TCP frame.
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
