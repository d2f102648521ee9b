"""Curves of the TCP between two targets: circles through three points, splines.

KUKA does not publish the curve of SPL; it is taken as a cubic with the
directions of the neighbouring points, which passes the programmed points exactly.
All functions are vectorised over rows.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray
from postproc.geometry.frames import rotation_about
from postproc.records import dataclass
from postproc.units import DEG

STEP_SWEEP = 15.0 * DEG
"""Longest piece [rad] of an arc between two sampled poses: its chord is 0.3 % shorter."""


@dataclass(frozen=True, slots=True)
class Circles:
    """Arcs (c,): centre, unit normal (counterclockwise), radius [m], sweep [rad] > 0.

    ``valid`` (c,): the three points lie on one circle and are apart.
    """

    centre: FloatArray
    normal: FloatArray
    radius: FloatArray
    sweep: FloatArray
    valid: BoolArray


def circles(start: FloatArray, auxiliary: FloatArray, end: FloatArray) -> Circles:
    """Return the arcs from start over the auxiliary point to the end, points (c, 3) [m]."""
    a, b = auxiliary - start, end - start
    cross = np.cross(a, b)
    area = np.linalg.norm(cross, axis=1)
    length = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1)
    apart = np.linalg.norm(end - auxiliary, axis=1) > ROUNDING
    valid = (area > 1e-6 * np.maximum(length, ROUNDING)) & (length > ROUNDING**2) & apart
    with np.errstate(divide="ignore", invalid="ignore"):
        normal = np.where(valid[:, None], cross / area[:, None], [0.0, 0.0, 1.0])
        aa = np.einsum("ij,ij->i", a, a)[:, None]
        bb = np.einsum("ij,ij->i", b, b)[:, None]
        to_centre = np.cross(aa * b - bb * a, cross) / (2.0 * area[:, None] ** 2)
    to_centre = np.where(valid[:, None], to_centre, 0.0)
    centre = start + to_centre
    radius = np.linalg.norm(to_centre, axis=1)
    sweep = angle_about(normal, start - centre, end - centre)
    return Circles(centre, normal, radius, np.where(valid, sweep, 0.0), valid)


def angle_about(normal: FloatArray, u: FloatArray, v: FloatArray) -> FloatArray:
    """Return the angle (c,) in (0, 2 pi] from u to v, counterclockwise about the normal."""
    sine = np.einsum("ij,ij->i", normal, np.cross(u, v))
    cosine = np.einsum("ij,ij->i", u, v)
    angle: FloatArray = np.arctan2(sine, cosine)
    return np.where(angle <= 0.0, angle + 2.0 * np.pi, angle)


def around(
    start: FloatArray, centre: FloatArray, normal: FloatArray, angle: FloatArray
) -> FloatArray:
    """Return points (c, 3): ``start`` turned about the axis through ``centre``."""
    R = rotation_about(normal, angle)
    points: FloatArray = centre + np.einsum("ijk,ik->ij", R, start - centre)
    return points


def spline_tangents(
    start: FloatArray, end: FloatArray, follows: BoolArray, precedes: BoolArray
) -> tuple[FloatArray, FloatArray]:
    """Return the derivatives (m, 3) per unit share at start and end (m, 3) of consecutive motions.

    ``follows``, ``precedes`` (m,): the motion before, or behind, belongs to the same block.
    """
    chord = end - start
    size = np.linalg.norm(chord, axis=1, keepdims=True)
    before, after = np.roll(chord, 1, axis=0), np.roll(chord, -1, axis=0)
    size_before, size_after = np.roll(size, 1, axis=0), np.roll(size, -1, axis=0)
    at_start = size * (before + chord) / np.maximum(size_before + size, ROUNDING)
    at_end = size * (chord + after) / np.maximum(size + size_after, ROUNDING)
    return (
        np.where(follows[:, None], at_start, chord),
        np.where(precedes[:, None], at_end, chord),
    )


def spline_points(
    start: FloatArray, end: FloatArray, at_start: FloatArray, at_end: FloatArray, share: FloatArray
) -> FloatArray:
    """Return points (r, 3) of cubics with given ends and derivatives at ``share`` (r,) 0..1."""
    s = share[:, None]
    points: FloatArray = (
        (2 * s**3 - 3 * s**2 + 1) * start
        + (s**3 - 2 * s**2 + s) * at_start
        + (-2 * s**3 + 3 * s**2) * end
        + (s**3 - s**2) * at_end
    )
    return points
