"""Rigid transforms and KUKA's A, B, C angles.

``T_a_b`` maps coordinates in frame b to coordinates in frame a (the pose of b in a), so inner
names meet in a chain: ``T_robroot_tag = T_robroot_base @ T_base_tag``. All functions are
vectorised over leading axes and take and give float64 arrays in metres and radians.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.units import DEG, MM

AXES = {
    f"{sign}{name}": direction * np.eye(3)[place]
    for place, name in enumerate("xyz")
    for sign, direction in (("+", 1.0), ("-", -1.0))
}
"""Axes of a frame by sign and name, each a unit vector (3,)."""


def axis_name(direction: FloatArray) -> str:
    """Return the name of the axis of ``AXES`` nearest to a direction (3,)."""
    return max(AXES, key=lambda name: float(AXES[name] @ direction))


_HALF_TURN_BACK = -np.pi + 1e-9
"""An angle [rad] below this is half a turn but for the last digits of its rotation."""


def transform(R_a_b: ArrayLike, p_a_b: ArrayLike) -> FloatArray:
    """Return (..., 4, 4) from a rotation (..., 3, 3) and an origin (..., 3) [m]."""
    R = np.asarray(R_a_b, dtype=np.float64)
    p = np.asarray(p_a_b, dtype=np.float64)
    shape = np.broadcast_shapes(R.shape[:-2], p.shape[:-1])
    T = np.zeros((*shape, 4, 4))
    T[..., :3, :3] = R
    T[..., :3, 3] = p
    T[..., 3, 3] = 1.0
    return T


def inverse(T_a_b: ArrayLike) -> FloatArray:
    """Return ``T_b_a`` (..., 4, 4)."""
    T = np.asarray(T_a_b, dtype=np.float64)
    R_b_a = np.swapaxes(T[..., :3, :3], -1, -2)
    return transform(R_b_a, -np.einsum("...ij,...j->...i", R_b_a, T[..., :3, 3]))


def apply(T_a_b: ArrayLike, points_b: ArrayLike) -> FloatArray:
    """Return points (..., 3) [m] of frame b in frame a."""
    T = np.asarray(T_a_b, dtype=np.float64)
    moved: FloatArray = (
        np.einsum("...ij,...j->...i", T[..., :3, :3], np.asarray(points_b, dtype=np.float64))
        + T[..., :3, 3]
    )
    return moved


def rotation_x(angle: ArrayLike) -> FloatArray:
    """Return (..., 3, 3), turn about x by ``angle`` [rad]."""
    return _rotation(angle, 1, 2)


def rotation_y(angle: ArrayLike) -> FloatArray:
    """Return (..., 3, 3), turn about y by ``angle`` [rad]."""
    return _rotation(angle, 2, 0)


def rotation_z(angle: ArrayLike) -> FloatArray:
    """Return (..., 3, 3), turn about z by ``angle`` [rad]."""
    return _rotation(angle, 0, 1)


def _rotation(angle: ArrayLike, first: int, second: int) -> FloatArray:
    a = np.asarray(angle, dtype=np.float64)
    R = np.zeros((*a.shape, 3, 3))
    third = 3 - first - second
    R[..., third, third] = 1.0
    R[..., first, first] = R[..., second, second] = np.cos(a)
    R[..., second, first] = np.sin(a)
    R[..., first, second] = -R[..., second, first]
    return R


def rotation_about(axis: ArrayLike, angle: ArrayLike) -> FloatArray:
    """Return (..., 3, 3), turn by ``angle`` (...,) [rad] about unit ``axis`` (..., 3)."""
    n, a = np.asarray(axis, dtype=np.float64), np.asarray(angle, dtype=np.float64)
    K = skew(n)
    if K.ndim == 2:  # one axis for all angles: one product
        parts = np.stack([np.sin(a), 1.0 - np.cos(a)], axis=-1) @ np.stack([K, K @ K]).reshape(2, 9)
        return np.asarray(np.eye(3) + parts.reshape(*a.shape, 3, 3))
    a = a[..., None, None]
    R: FloatArray = np.eye(3) + np.sin(a) * K + (1.0 - np.cos(a)) * (K @ K)
    return R


def rotation_from_vector(vector: ArrayLike) -> FloatArray:
    """Return (..., 3, 3) from axis times angle (..., 3) [rad]; exactly 1 for zero."""
    v = np.asarray(vector, dtype=np.float64)
    angle = np.linalg.norm(v, axis=-1)
    return rotation_about(v / np.maximum(angle, 1e-15)[..., None], angle)


def skew(vector: ArrayLike) -> FloatArray:
    """Return (..., 3, 3) with ``skew(a) @ b == cross(a, b)``."""
    v = np.asarray(vector, dtype=np.float64)
    S = np.zeros((*v.shape[:-1], 3, 3))
    S[..., 0, 1], S[..., 0, 2], S[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return S - np.swapaxes(S, -1, -2)


def vee(matrix: ArrayLike) -> FloatArray:
    """Return (..., 3) of which ``skew`` gives the matrix minus its transpose: 2 sin(angle) axis."""
    D = np.asarray(matrix, dtype=np.float64)
    return np.stack(
        [D[..., 2, 1] - D[..., 1, 2], D[..., 0, 2] - D[..., 2, 0], D[..., 1, 0] - D[..., 0, 1]],
        axis=-1,
    )


def rotation_from_abc(abc: ArrayLike) -> FloatArray:
    """Return (..., 3, 3) from KUKA angles A, B, C (..., 3) [rad]: R = Rz(A) Ry(B) Rx(C)."""
    angles = np.asarray(abc, dtype=np.float64)
    R: FloatArray = (
        rotation_z(angles[..., 0]) @ rotation_y(angles[..., 1]) @ rotation_x(angles[..., 2])
    )
    return R


def abc_from_rotation(R_a_b: ArrayLike) -> FloatArray:
    """Return KUKA A, B, C (..., 3) [rad] of a rotation (..., 3, 3).

    B lies in [-90, 90] degrees. In gimbal lock (B = +-90 degrees, KUKA's own cannon pose among
    them) only A -+ C is defined: C is set to 0 and A carries the whole angle. A half turn is
    +180 degrees, never -180, whatever the last digit of the rotation is.
    """
    R = np.asarray(R_a_b, dtype=np.float64)
    cos_b = np.hypot(R[..., 0, 0], R[..., 1, 0])
    b = np.arctan2(-R[..., 2, 0], cos_b)
    locked = cos_b < 1e-9
    a = np.where(
        locked,
        np.arctan2(-R[..., 0, 1], R[..., 1, 1]),
        np.arctan2(R[..., 1, 0], R[..., 0, 0]),
    )
    c = np.where(locked, 0.0, np.arctan2(R[..., 2, 1], R[..., 2, 2]))
    abc = np.stack([a, b, c], axis=-1)
    return np.where(abc < _HALF_TURN_BACK, -abc, abc)


def transform_from_kuka(xyz_mm: ArrayLike, abc_deg: ArrayLike) -> FloatArray:
    """Return (..., 4, 4) [m] from KUKA's X, Y, Z [mm] and A, B, C [deg]."""
    return transform(
        rotation_from_abc(np.asarray(abc_deg, dtype=np.float64) * DEG),
        np.asarray(xyz_mm, dtype=np.float64) * MM,
    )


def kuka_from_transform(T_a_b: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return X, Y, Z [mm] and A, B, C [deg], each (..., 3)."""
    T = np.asarray(T_a_b, dtype=np.float64)
    return T[..., :3, 3] / MM, abc_from_rotation(T[..., :3, :3]) / DEG


def rotation_angle(R_a: ArrayLike, R_b: ArrayLike) -> FloatArray:
    """Return the angle (...,) [rad] between two rotations, exact for tiny and for half turns."""
    D = np.swapaxes(np.asarray(R_a, dtype=np.float64), -1, -2) @ np.asarray(R_b, dtype=np.float64)
    sine = 0.5 * np.linalg.norm(vee(D), axis=-1)
    cosine = 0.5 * (np.trace(D, axis1=-2, axis2=-1) - 1.0)
    return np.asarray(np.arctan2(sine, cosine))


def twist_about(R: FloatArray, axis: FloatArray) -> FloatArray:
    """Return the turn (...,) [rad] of rotations R about ``axis`` (3,), their tilt of it taken off.

    The tilt is the smallest rotation that carries the axis along; after a half turn of the axis the
    twist means nothing.
    """
    along = np.trace(R, axis1=-2, axis2=-1) - (R @ axis) @ axis
    return np.asarray(np.arctan2(vee(R) @ axis, along))


def axis_angle(R_a: FloatArray, R_b: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return unit axis (m, 3) in frame a and angle (m,) [rad] of the rotation from R_a to R_b."""
    D = np.swapaxes(R_a, -1, -2) @ R_b
    angle, found = rotation_angle(R_a, R_b), vee(D)
    size = np.linalg.norm(found, axis=1)
    axis = found / np.maximum(size, 1e-300)[:, None]
    axis[size < 1e-14] = (1.0, 0.0, 0.0)
    for row in np.flatnonzero(angle > np.pi - 1e-4):
        # Near a half turn the difference vanishes; D + 1 then is twice the axis' outer product.
        values, vectors = np.linalg.eigh(0.5 * (D[row] + D[row].T))
        best = vectors[:, int(np.argmax(values))]
        axis[row] = best if float(best @ found[row]) >= 0.0 else -best
    return axis, angle


def slerp(R_a: FloatArray, R_b: FloatArray, share: FloatArray) -> FloatArray:
    """Return the orientations (m, 3, 3) at ``share`` (m,) 0..1 of the rotation from R_a to R_b."""
    axis, angle = axis_angle(R_a, R_b)
    R: FloatArray = R_a @ rotation_about(axis, angle * share)
    return R


def angle_between(a: ArrayLike, b: ArrayLike) -> FloatArray:
    """Return the angle (...,) [rad] between vectors (..., 3), exact for tiny angles."""
    u = np.asarray(a, dtype=np.float64)
    v = np.asarray(b, dtype=np.float64)
    cross = np.linalg.norm(np.cross(u, v), axis=-1)
    return np.asarray(np.arctan2(cross, np.einsum("...i,...i->...", u, v)))


def turned_between(a: ArrayLike, b: ArrayLike, share: ArrayLike) -> FloatArray:
    """Return unit vectors (..., 3) at ``share`` (...,) 0..1 of the even turn from a to b (..., 3).

    Vectors that point against each other have no such turn; theirs is straight through zero.
    """
    u, v = np.asarray(a, dtype=np.float64), np.asarray(b, dtype=np.float64)
    angle, s = angle_between(u, v)[..., None], np.asarray(share, dtype=np.float64)[..., None]
    sine = np.sin(angle)
    is_even = sine > 1e-9
    below = np.where(is_even, sine, 1.0)
    first = np.where(is_even, np.sin((1.0 - s) * angle) / below, 1.0 - s)
    second = np.where(is_even, np.sin(s * angle) / below, s)
    mixed = first * u + second * v
    return np.asarray(mixed / np.maximum(np.linalg.norm(mixed, axis=-1, keepdims=True), 1e-12))


def across(axes: ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Return two unit vectors (..., 3) square to unit axes (..., 3) and to each other.

    The first is square to the frame's own axis that the axis is farthest from, too; axis, first and
    second are right-handed.
    """
    axis = np.asarray(axes, dtype=np.float64)
    first = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis), axis=-1)])
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(axis, first)


def orthonormalised(R_a_b: ArrayLike) -> FloatArray:
    """Return the nearest rotation (..., 3, 3): pose text of 6 decimals is not orthonormal."""
    u, _, vt = np.linalg.svd(np.asarray(R_a_b, dtype=np.float64))
    sign = np.linalg.det(u @ vt)
    u[..., :, 2] *= sign[..., None]
    R: FloatArray = u @ vt
    return R
