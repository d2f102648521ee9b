"""Poses along controller motions: the TCP on a line or an arc, the orientation about one axis.

A controller with variable orientation leads the tool from the start to the end orientation about
one fixed axis, in step with the path; circles likewise. All functions are vectorised over rows.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry.frames import rotation_about, rotation_from_vector, slerp, transform


def line_poses(T_a: FloatArray, T_b: FloatArray, share: FloatArray) -> FloatArray:
    """Return the poses (m, 4, 4) at ``share`` (m,) 0..1 of straight motions from T_a to T_b."""
    p = T_a[:, :3, 3] + share[:, None] * (T_b[:, :3, 3] - T_a[:, :3, 3])
    return transform(slerp(T_a[:, :3, :3], T_b[:, :3, :3], share), p)


def onto_line(
    points: FloatArray, start: FloatArray, end: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the share (...) 0..1 of lines nearest to points (..., 3), and how far off [m]."""
    way, here = end - start, points - start
    square = np.maximum(np.einsum("...i,...i->...", way, way), 1e-24)
    share = np.clip(np.einsum("...i,...i->...", here, way) / square, 0.0, 1.0)
    return share, np.linalg.norm(here - share[..., None] * way, axis=-1)


def arc_poses(
    T_a: FloatArray,
    T_b: FloatArray,
    centre: FloatArray,
    normal: FloatArray,
    sweep: FloatArray,
    share: FloatArray,
    tilts: tuple[FloatArray, FloatArray] | None = None,
) -> FloatArray:
    """Return the poses (m, 4, 4) at ``share`` of arcs or helices from T_a to T_b.

    A tilt of the tool goes round with the arc: what lead is at its start stays lead. The rest of
    the orientation turns as along a line.

    Args:
        T_a: (m, 4, 4) start poses.
        T_b: (m, 4, 4) end poses.
        centre: (m, 3) [m].
        normal: (m, 3) unit, counterclockwise.
        sweep: (m,) [rad].
        share: (m,) 0..1.
        tilts: (m, 3) [rad] by which the tool is tilted at start and end, axis times angle; None:
            it is not.
    """
    R_a, R_b = T_a[:, :3, :3], T_b[:, :3, :3]
    if tilts is None or not (tilts[0].any() or tilts[1].any()):
        R = slerp(R_a, R_b, share)
    else:
        back = rotation_about(normal, -sweep)
        start, end = tilts[0], np.einsum("mij,mj->mi", back, tilts[1])
        along = rotation_about(normal, sweep * share)
        tilt = np.einsum("mij,mj->mi", along, start + share[:, None] * (end - start))
        first, last = (rotation_from_vector(-w) for w in tilts)
        upright = slerp(first @ R_a, last @ R_b, share)
        R = rotation_from_vector(tilt) @ upright
    return transform(R, arc_points(T_a[:, :3, 3], T_b[:, :3, 3], centre, normal, sweep, share))


def arc_points(
    start: FloatArray,
    end: FloatArray,
    centre: FloatArray,
    normal: FloatArray,
    sweep: FloatArray,
    share: FloatArray,
) -> FloatArray:
    """Return points (m, 3) on arcs; radius and height run linearly to meet the end exactly."""
    from_centre = start - centre
    rise_a = np.einsum("ij,ij->i", from_centre, normal)
    rise_b = np.einsum("ij,ij->i", end - centre, normal)
    flat = from_centre - rise_a[:, None] * normal
    flat_end = (end - centre) - rise_b[:, None] * normal
    radius_a = np.linalg.norm(flat, axis=1)
    radius_b = np.linalg.norm(flat_end, axis=1)
    side = np.cross(normal, flat)
    angle = sweep * share
    scale = 1.0 + share * (radius_b / np.maximum(radius_a, 1e-15) - 1.0)
    around = np.cos(angle)[:, None] * flat + np.sin(angle)[:, None] * side
    rise = rise_a + share * (rise_b - rise_a)
    points: FloatArray = centre + scale[:, None] * around + rise[:, None] * normal
    return points


def path_length(
    start: FloatArray, end: FloatArray, radius: FloatArray, sweep: FloatArray
) -> FloatArray:
    """Return the length (m,) [m]: straight where ``sweep`` is 0, else that of the arc or helix."""
    straight = np.linalg.norm(end - start, axis=1)
    return np.asarray(np.where(sweep > 0.0, np.maximum(radius * sweep, straight), straight))
