"""How far a configuration is from the places where the arm loses a direction of motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
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
    """Return the smallest singular value (...,) of the Jacobian.

    Args:
        kinematics: the arm.
        q: (..., 6) joint angles [rad].
        p_flange_tcp: (3,) TCP in the flange [m].

    Returns:
        [rad/rad], a metre counted as a radian; 0 at a singularity.
    """
    J = kinematics.jacobian(q, p_flange_tcp)
    return np.asarray(np.linalg.svd(J, compute_uv=False)[..., -1])


def _from_half_turns(angle: FloatArray) -> FloatArray:
    return np.abs(angle - np.pi * np.rint(angle / np.pi))
