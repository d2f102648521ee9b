"""Stiffness and compliance of the arm at the tool point, from its Jacobian.

Model: every joint is a linear torsion spring; links, base and tool are rigid; the change of the
Jacobian under load (the complementary stiffness of Chen and Kao 2000) is neglected. Everything is
built from the compliance C = J Kθ⁻¹ Jᵀ, which exists in every pose; the Jacobian is never
inverted, so nothing here blows up at a singular pose.

Equation numbers are those of Jiao et al. 2022 (Chin. J. Mech. Eng. 35:115). All functions are
vectorised over leading axes. Jacobians are (..., 6, n), rows linear then angular, axes of
``robroot``, at the tool point; wrenches (..., 6) force then moment ON the tool at the tool point,
same axes; joint compliance ``c_joint`` (n,) or (..., n) [rad/(N*m)], >= 0 (0 = a rigid joint).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.errors import StiffnessError


def joint_compliance(k_joint: ArrayLike) -> FloatArray:
    """Return c = 1/k [rad/(N*m)] (...,) from joint stiffness k [N*m/rad].

    Infinite stiffness gives 0. NaN (a joint the data could not see) stays NaN.

    Raises:
        StiffnessError: STF001 if a stiffness is zero or negative.
    """
    k = np.asarray(k_joint, dtype=np.float64)
    if bool(np.any(k <= 0.0)):
        raise StiffnessError("STF001", f"joint stiffness must be positive, got {k.min():g} N*m/rad")
    return np.asarray(1.0 / k)


def compliance(jacobian: ArrayLike, c_joint: ArrayLike) -> FloatArray:
    """Return the Cartesian compliance C = J Kθ⁻¹ Jᵀ.

    Args:
        jacobian: (..., 6, n).
        c_joint: (n,) or (..., n) [rad/(N*m)].

    Returns:
        (..., 6, 6) symmetric: translation per force [m/N] upper left, rotation per moment
        [rad/(N*m)] lower right.

    Source:
        Jiao et al. 2022, Eq. (1) with Eq. (2).
    """
    J = np.asarray(jacobian, dtype=np.float64)
    c = np.asarray(c_joint, dtype=np.float64)
    C: FloatArray = (J * c[..., None, :]) @ np.swapaxes(J, -1, -2)
    return C


def translational_compliance(jacobian: ArrayLike, c_joint: ArrayLike) -> FloatArray:
    """Return C_dd (..., 3, 3) [m/N]: how far the tool point gives way per newton on it.

    The rotation of the tool is free; this is the matrix E(J Kθ⁻¹ Jᵀ) of Eq. (41).

    Args:
        jacobian: (..., 6, n) or its linear rows (..., 3, n).
        c_joint: (n,) or (..., n) [rad/(N*m)].

    Example:
        >>> J = np.zeros((6, 1)); J[2, 0] = 2.0                      # 2 m arm that moves along z
        >>> float(translational_compliance(J, np.array([2.5e-7]))[2, 2])
        1e-06
    """
    return compliance(np.asarray(jacobian, dtype=np.float64)[..., :3, :], c_joint)


def compliance_rotation_held(jacobian: ArrayLike, c_joint: ArrayLike) -> FloatArray:
    """Return K_fd⁻¹ = C_dd - C_dδ C_δδ⁻¹ C_δd (..., 3, 3) [m/N] without inverting J.

    K_fd is the force-translation block of K = C⁻¹ (Eqs. 13-15). It belongs to a tool whose rotation
    is clamped (δ = 0), 1.4 to 11 times stiffer than the free tool on the arm of the paper: use it
    only to compare with the paper. At a singular pose it only loses rank (a direction the clamped
    tool cannot yield in). NaN where the joints do not span all rotations.
    """
    C = compliance(jacobian, c_joint)
    cross = C[..., 3:, :3]
    held: FloatArray = C[..., :3, :3] - np.swapaxes(cross, -1, -2) @ (
        _inverse(C[..., 3:, 3:]) @ cross
    )
    return held


def joint_torque(jacobian: ArrayLike, wrench: ArrayLike) -> FloatArray:
    """Return Jᵀ F (..., n) [N*m], the torque that a wrench (..., 6) puts on each joint."""
    torque: FloatArray = np.einsum(
        "...ij,...i->...j",
        np.asarray(jacobian, dtype=np.float64),
        np.asarray(wrench, dtype=np.float64),
    )
    return torque


def regressor(jacobian: ArrayLike, wrench: ArrayLike) -> FloatArray:
    """Return A (..., 6, n) of D = A c (Eqs. 3 and 5): column i is J_i (J_i · F)."""
    J = np.asarray(jacobian, dtype=np.float64)
    A: FloatArray = J * joint_torque(J, wrench)[..., None, :]
    return A


def _inverse(matrix: FloatArray) -> FloatArray:
    """Invert (..., 3, 3) by cofactors; NaN where the matrix is singular to working precision."""
    rows = [matrix[..., i, :] for i in range(3)]
    cofactors = np.stack(
        [np.cross(rows[1], rows[2]), np.cross(rows[2], rows[0]), np.cross(rows[0], rows[1])],
        axis=-1,
    )
    determinant = np.einsum("...i,...i->...", rows[0], cofactors[..., :, 0])
    size = np.linalg.norm(matrix, axis=(-2, -1))
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = cofactors / determinant[..., None, None]
    singular = ~(np.abs(determinant) > 1e-14 * size**3)
    return np.where(singular[..., None, None], np.nan, inverse)
