"""Stiffness indices of a task: how hard the tool point resists along a direction.

Two families, both [N/m], both vectorised over leading axes:

- ``directional`` and what is built on it: the force along n per displacement along n of the free
  tool, 1/(nᵀ C_dd n). This is what a machining force really meets.
- ``ellipsoid`` and ``ellipsoid_normal``: the ellipsoid index of Jiao et al. 2022, Eqs. (15) to
  (25) and (43), to compare with the paper. It is a power mean with exponent -4 of the principal
  stiffnesses of a tool whose rotation is held, so it is pulled to the softest axis and can rank
  poses otherwise than the true stiffness does.

Shapes and frames as in ``postproc.stiffness.cartesian``: jacobian (..., 6, n) at the tool point,
axes of ``robroot``; c_joint (n,) or (..., n) [rad/(N*m)]; directions (..., 3) unit, ``robroot``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.stiffness.cartesian import compliance_rotation_held, translational_compliance


def directional(jacobian: ArrayLike, c_joint: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Return 1/(nᵀ C_dd n) = 1/Σ c_i (n · J_i)² (...,) [N/m], no matrix formed.

    Infinite where no joint can move the tool point along the direction.

    Source:
        Jiao et al. 2022, Eqs. (1) and (41): d = E(C) f; here d along f = n per newton.
    """
    J = np.asarray(jacobian, dtype=np.float64)
    n = np.asarray(direction, dtype=np.float64)
    return of_rates(np.matmul(n[..., None, :], J[..., :3, :])[..., 0, :], c_joint)


def of_rates(rates: ArrayLike, c_joint: ArrayLike) -> FloatArray:
    """Return the stiffness (...,) [N/m] along a direction in which joints move the tool point.

    Args:
        rates: (..., n) n · J_i [m/rad], of each joint along the direction.
        c_joint: (n,) or (..., n) [rad/(N*m)].
    """
    along = np.asarray(rates, dtype=np.float64)
    each = np.asarray(c_joint, dtype=np.float64) * along * along
    give = np.ascontiguousarray(np.moveaxis(each, -1, 0)).sum(axis=0)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / give)


def radial(jacobian: ArrayLike, c_joint: ArrayLike, tool_axis: ArrayLike) -> FloatArray:
    """Return the stiffness (...,) [N/m] of the weakest direction across the tool axis.

    1/(largest eigenvalue of C_dd restricted to the plane normal to ``tool_axis``): the same for
    every choice of axes in that plane.
    """
    C = translational_compliance(jacobian, c_joint)
    u, v = _plane_axes(tool_axis)
    uu, vv, uv = _form(C, u, u), _form(C, v, v), _form(C, u, v)
    largest = 0.5 * (uu + vv) + np.hypot(0.5 * (uu - vv), uv)
    with np.errstate(divide="ignore"):
        return np.asarray(1.0 / largest)


def ellipsoid(jacobian: ArrayLike, c_joint: ArrayLike, direction: ArrayLike) -> FloatArray:
    """Return the paper's ellipsoid index k along a direction (...,) [N/m].

    With σ_i, e_i the singular values of the stiffness K = K_fd of the held tool, Eqs. (15) and
    (16), and the direction in its eigenvector frame, k = (Σ e_i²/σ_i⁴)^(-1/4). Written without
    eigenvectors: k = (eᵀ (KᵀK)⁻² e)^(-1/4) = |K⁻² e|^(-1/2), which needs no inverse of J.

    Args:
        jacobian: (..., 6, n).
        c_joint: (n,) or (..., n) [rad/(N*m)].
        direction: (..., 3) unit.

    Source:
        Jiao et al. 2022, Eqs. (16) to (25); kx, ky, kz are this along the tool's axes.
    """
    give = compliance_rotation_held(jacobian, c_joint)
    twice = give @ (give @ np.asarray(direction, dtype=np.float64)[..., None])
    with np.errstate(divide="ignore"):
        return np.asarray(np.linalg.norm(twice[..., 0], axis=-1) ** -0.5)


def ellipsoid_normal(k_y: ArrayLike, k_z: ArrayLike, theta: ArrayLike) -> FloatArray:
    """Return the paper's kv = sqrt((kz cos θ)² + (ky sin θ)²) (...,) [N/m], Eq. (43).

    θ is the rotation about the tool's x axis [rad]. Stiffnesses are not components of a vector:
    this is off the true directional value by factors of 0.85 to 2.6; ``directional`` along the
    path's normal is what it stands for.
    """
    y = np.asarray(k_y, dtype=np.float64) * np.sin(theta)
    z = np.asarray(k_z, dtype=np.float64) * np.cos(theta)
    return np.asarray(np.hypot(y, z))


def _plane_axes(axis: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors (..., 3) that span the plane normal to unit ``axis`` (..., 3)."""
    n = np.asarray(axis, dtype=np.float64)
    start = np.where(np.abs(n[..., 2:3]) < 0.9, [0.0, 0.0, 1.0], [1.0, 0.0, 0.0])
    u = np.cross(start, n)
    u /= np.linalg.norm(u, axis=-1, keepdims=True)
    return u, np.cross(n, u)


def _form(C: FloatArray, left: FloatArray, right: FloatArray) -> FloatArray:
    value: FloatArray = np.einsum("...i,...ij,...j->...", left, C, right)
    return value
