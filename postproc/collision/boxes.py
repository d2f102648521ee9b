"""Oriented bounding boxes: fitting, and a lower bound of the distance between two of them.

All kernels work on many boxes at once with the box index last, so that every numpy operation
runs over contiguous memory.
"""

from __future__ import annotations

import math

import numpy as np

from postproc.arrays import FloatArray

AXIS_FLOOR = 1e-6
"""Cross products of nearly parallel edges shorter than this say nothing and are left out."""

_NEXT, _LAST = np.array([1, 2, 0]), np.array([2, 0, 1])
"""The axis, corner or edge after each of three, and the one before it."""


def fit_box(points: FloatArray, faces: FloatArray | None = None) -> tuple[FloatArray, ...]:
    """Return centre (3,), axes (3, 3) as columns and half sizes (3,) of a tight box.

    The smallest surface of three candidates: the axes of the frame, the principal axes of the
    points, and the plane of the largest triangle with an edge of it (exact for boxes and prisms).

    Args:
        points: (v, 3) [m], at least one.
        faces: (f, 3, 3) corners of triangles for the third candidate.
    """
    best: tuple[FloatArray, ...] = ()
    smallest = np.inf
    for axes in _candidates(points, faces):
        local = np.ascontiguousarray((points @ axes).T)  # numpy is slow along short rows
        low, high = local.min(axis=1), local.max(axis=1)
        half = 0.5 * (high - low)
        x, y, z = half.tolist()
        surface = x * y + y * z + z * x
        if surface < smallest * (1.0 - 1e-9):
            smallest = surface
            best = (axes @ (0.5 * (high + low)), axes, half)
    return best


def _candidates(points: FloatArray, faces: FloatArray | None) -> list[FloatArray]:
    axes = [np.eye(3)]
    if len(points) > 3:
        spread = points - points.mean(axis=0)
        _, principal = np.linalg.eigh(spread.T @ spread)
        axes.append(principal)
    if faces is not None and len(faces):
        edges = faces[:, _NEXT] - faces
        normals = _cross(edges[:, 0], edges[:, 1])
        largest = int(np.argmax(np.einsum("fi,fi->f", normals, normals)))
        edge, normal = edges[largest], normals[largest]
        lengths = np.sqrt(np.add.reduce(edge * edge, axis=1))
        area = math.sqrt(normal.dot(normal))
        if area > 0.0:
            # the edge that stands most nearly square on another one: a leg of a right triangle
            unit = edge / lengths[:, None]
            square = np.abs(np.einsum("ij,ij->i", unit, unit[_NEXT]))
            plane = np.empty((3, 3))
            plane[:, 0] = x = unit[int(np.argmin(square))]
            plane[:, 2] = z = normal / area
            plane[:, 1] = _cross(z, x)
            axes.append(plane)
    return axes


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return ``np.cross`` of (..., 3), which takes longer to look at few vectors than to turn."""
    product: FloatArray = a[..., _NEXT] * b[..., _LAST] - a[..., _LAST] * b[..., _NEXT]
    return product


def seen_from(
    one: tuple[FloatArray, FloatArray],
    two: tuple[FloatArray, FloatArray],
    R_a_b: FloatArray,
    p_a_b: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return axes (k, 3, 3) and centre (k, 3) [m] of boxes in the frames of others.

    Args:
        one: centre (k, 3), axes (k, 3, 3) as columns of the others, in frames a.
        two: the same of the boxes, in frames b.
        R_a_b: (k, 3, 3).
        p_a_b: (k, 3) [m].
    """
    back = np.swapaxes(one[1], 1, 2)
    centre = np.einsum("kij,kj->ki", R_a_b, two[0]) + p_a_b - one[0]
    return back @ (R_a_b @ two[1]), np.einsum("kij,kj->ki", back, centre)


def box_gap(
    R_a_b: FloatArray, p_a_b: FloatArray, half_a: FloatArray, half_b: FloatArray
) -> FloatArray:
    """Return lower bounds (k,) [m] of the distance between boxes; <= 0 where they may touch.

    Separating axes of two boxes (Gottschalk, Lin and Manocha 1996). The gap along any axis is a
    lower bound of the distance; so is the length of the vector of the gaps along the three axes of
    one box. The largest of all is returned.

    Args:
        R_a_b: (3, 3, k) axes of box b in box a.
        p_a_b: (3, k) centre of b in a [m].
        half_a: (3, k) half sizes [m].
        half_b: (3, k) half sizes [m].
    """
    size = np.abs(R_a_b)
    gap_a = np.abs(p_a_b) - half_a
    for j in range(3):
        gap_a -= size[:, j] * half_b[j]
    gap_b = np.abs(R_a_b[0] * p_a_b[0] + R_a_b[1] * p_a_b[1] + R_a_b[2] * p_a_b[2]) - half_b
    for i in range(3):
        gap_b -= size[i] * half_a[i]
    best = np.maximum(outside(gap_a), outside(gap_b))
    undecided = np.flatnonzero(best <= 0.0)
    if len(undecided):
        best[undecided] = _edge_gap(
            R_a_b[:, :, undecided],
            p_a_b[:, undecided],
            half_a[:, undecided],
            half_b[:, undecided],
        )
    return best


def outside(gap: FloatArray) -> FloatArray:
    """Return the length of the positive gaps (3, k), or the largest gap where none is positive."""
    x, y, z = gap  # one by one: numpy is slow along short rows
    positive = np.maximum(gap, 0.0)
    length = np.sqrt(positive[0] ** 2 + positive[1] ** 2 + positive[2] ** 2)
    return np.asarray(np.where(length > 0.0, length, np.maximum(np.maximum(x, y), z)))


def _edge_gap(
    R_a_b: FloatArray, p_a_b: FloatArray, half_a: FloatArray, half_b: FloatArray
) -> FloatArray:
    """Return the largest gap (k,) along the nine cross products of edges."""
    size = np.abs(R_a_b)
    best = np.full(p_a_b.shape[-1], -np.inf)
    for i in range(3):
        i1, i2 = (i + 1) % 3, (i + 2) % 3
        along = np.abs(p_a_b[i2] * R_a_b[i1] - p_a_b[i1] * R_a_b[i2])
        along -= half_a[i1] * size[i2] + half_a[i2] * size[i1]
        along -= half_b[_NEXT] * size[i][_LAST] + half_b[_LAST] * size[i][_NEXT]
        length = np.sqrt(np.maximum(1.0 - R_a_b[i] ** 2, 0.0))
        usable = length > AXIS_FLOOR
        gap = np.where(usable, along / np.where(usable, length, 1.0), -np.inf)
        np.maximum(best, gap.max(axis=0), out=best)
    return best
