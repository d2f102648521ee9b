"""The nearest place on a mesh, and the outward normal of the surface that the mesh stands for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from postproc.arrays import FloatArray, IndexArray, numbered
from postproc.collision.inside import parts_of
from postproc.collision.mesh import ByContent, Mesh, joined, normals_of
from postproc.collision.pieces import halved
from postproc.records import dataclass
from postproc.units import DEG

SMOOTH = 30.0 * DEG
"""Faces that meet at less than this angle are pieces of one curved surface."""
_LEAF = 16
_BRANCH = 32
_BATCH = 1000


@dataclass(frozen=True, slots=True)
class SurfacePoints:
    """Nearest places for n points: ``point`` (n, 3) [m], unit ``normal`` (n, 3), ``distance`` (n,).

    ``distance`` [m] of each given point from the surface, not signed.
    """

    point: FloatArray
    normal: FloatArray
    distance: FloatArray


def nearest_outside(points: FloatArray, meshes: Sequence[Mesh], enough: float) -> float:
    """Return the smallest distance of points (n, 3) from meshes [m], 0 inside one.

    Below ``enough`` it is an upper bound: no nearer point is looked for.
    """
    boxes = [(mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)) for mesh in meshes]
    beyond = [np.maximum(np.maximum(low - points, points - high), 0.0) for low, high in boxes]
    off = np.linalg.norm(beyond, axis=2).min(axis=0)
    near, least = points[off <= enough], float(off.min())
    if len(near):  # by their boxes; now by themselves
        surface, least = Surface.of(joined(list(meshes))), np.inf
        for first in range(0, len(near), _BATCH):
            found = surface.nearest(near[first : first + _BATCH])
            is_out = np.sum((near[first : first + _BATCH] - found.point) * found.normal, 1) > 0.0
            least = min(least, float((found.distance * is_out).min()))
            if least <= enough:
                break
    return least


class Surface:
    """Nearest-point queries on a mesh.

    Normals are interpolated over faces that meet at less than ``SMOOTH``, so that a tessellated
    curved skin answers as the smooth skin would; flat faces and sharp edges keep theirs. Closed
    parts are turned so that their normals point out.
    """

    def __init__(self, mesh: Mesh) -> None:
        faces = _outward(mesh)
        corners = mesh.vertices[faces]
        normal = normals_of(corners)
        size = np.linalg.norm(normal, axis=1)
        flat = size > 0.0
        faces, corners, normal = faces[flat], corners[flat], normal[flat] / size[flat, None]
        self._vertices, self._faces, self._normals = mesh.vertices, faces, normal
        # corners of faces by their vertex
        self._corner = np.argsort(faces, axis=None, kind="stable")
        self._around = np.bincount(faces.ravel(), minlength=len(mesh.vertices))
        self._first = np.cumsum(self._around) - self._around
        # leaves do not straddle two places
        self._order = np.concatenate(halved(corners.mean(axis=1), _LEAF, _LEAF))
        self._corners = corners[self._order]
        self._levels = _boxes(self._corners)

    @staticmethod
    def of(mesh: Mesh) -> Surface:
        """Return the surface of a mesh, made once."""
        return _surface(ByContent(mesh))

    def nearest(self, points: FloatArray) -> SurfacePoints:
        """Return the nearest places for points (n, 3) [m] in the mesh's frame."""
        parts = [self._nearest(points[i : i + _BATCH]) for i in range(0, len(points), _BATCH)]
        if not parts:
            none = np.zeros((0, 3))
            return SurfacePoints(none, none, np.zeros(0))
        return SurfacePoints(
            np.concatenate([part.point for part in parts]),
            np.concatenate([part.normal for part in parts]),
            np.concatenate([part.distance for part in parts]),
        )

    def _nearest(self, points: FloatArray) -> SurfacePoints:
        best = _Best(len(points))
        every = np.arange(len(points))
        self._descend(points, every, np.zeros_like(every), len(self._levels) - 1, best)
        weight = best.weight[..., None]
        normal = (self._corner_normals(self._order[best.face]) * weight).sum(axis=1)
        normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        place = (self._corners[best.face] * weight).sum(axis=1)
        return SurfacePoints(place, normal, np.sqrt(best.square))

    def _corner_normals(self, face: IndexArray) -> FloatArray:
        """Return a unit normal (n, 3, 3) at each corner of faces (n,).

        The mean, weighted by the angle at the corner, of the faces around the vertex that differ
        from this face by less than ``SMOOTH``.
        """
        vertex = self._faces[face].ravel()
        mine, step = numbered(self._around[vertex])
        other, place = np.divmod(self._corner[self._first[vertex[mine]] + step], 3)
        normal = self._normals[other]
        alike = np.einsum("ki,ki->k", self._normals[face[mine // 3]], normal) > np.cos(SMOOTH)
        mine, other, place, normal = mine[alike], other[alike], place[alike], normal[alike]
        at, ahead, back = (self._vertices[self._faces[other, (place + k) % 3]] for k in range(3))
        ahead, back = ahead - at, back - at
        cosine = np.einsum("ki,ki->k", ahead, back) / (
            np.linalg.norm(ahead, axis=1) * np.linalg.norm(back, axis=1)
        )
        weighted = normal * np.arccos(np.clip(cosine, -1.0, 1.0))[:, None]
        columns = [np.bincount(mine, weighted[:, k], len(vertex)) for k in range(3)]
        total: FloatArray = np.stack(columns, axis=1).astype(np.float64)
        total /= np.linalg.norm(total, axis=1, keepdims=True)
        return total.reshape(-1, 3, 3)

    def _descend(
        self, points: FloatArray, row: np.ndarray, node: np.ndarray, level: int, best: _Best
    ) -> None:
        """Look into the boxes below one node for each row, nearest first, while they can win."""
        if level < 0:
            self._visit(points, row, node, best)
            return
        low, high = self._levels[level]
        child = node[:, None] * _BRANCH + np.arange(_BRANCH)
        known = np.minimum(child, len(low) - 1)
        at = points[row][:, None]
        gap = np.maximum(np.maximum(low[known] - at, at - high[known]), 0.0)
        bound = np.where(child < len(low), np.einsum("nki,nki->nk", gap, gap), np.inf)
        while len(here := np.flatnonzero(bound.min(axis=1) <= best.square[row])):
            which = bound[here].argmin(axis=1)
            bound[here, which] = np.inf
            self._descend(points, row[here], child[here, which], level - 1, best)

    def _visit(self, points: FloatArray, row: np.ndarray, leaf: np.ndarray, best: _Best) -> None:
        face = leaf[:, None] * _LEAF + np.arange(_LEAF)
        face = np.minimum(face, len(self._corners) - 1)
        weight = nearest_in_triangle(points[row][:, None], self._corners[face])
        place = np.einsum("nkc,nkci->nki", weight, self._corners[face])
        square = ((place - points[row][:, None]) ** 2).sum(axis=2)
        which = square.argmin(axis=1)
        every = np.arange(len(row))
        best.offer(row, square[every, which], face[every, which], weight[every, which])


@lru_cache(maxsize=4)
def _surface(key: ByContent) -> Surface:
    return Surface(key.mesh)


class _Best:
    """The nearest place found so far for each point."""

    def __init__(self, count: int) -> None:
        self.square = np.full(count, np.inf)
        self.face = np.zeros(count, dtype=np.int64)
        self.weight = np.zeros((count, 3))

    def offer(
        self, row: np.ndarray, square: FloatArray, face: np.ndarray, weight: FloatArray
    ) -> None:
        """Take what is nearer."""
        better = square < self.square[row]
        mine = row[better]
        self.square[mine] = square[better]
        self.face[mine], self.weight[mine] = face[better], weight[better]


def nearest_in_triangle(points: FloatArray, corners: FloatArray) -> FloatArray:
    """Return barycentric weights (..., 3) of the place in a triangle nearest to a point.

    Args:
        points: (..., 3).
        corners: (..., 3, 3), triangles with an area.

    Source:
        Ericson, Real-Time Collision Detection, 2005, section 5.1.5, without branches.
    """
    a, b, c = corners[..., 0, :], corners[..., 1, :], corners[..., 2, :]
    inner = _plane_weights(points, a, b, c)
    is_inside = (inner >= 0.0).all(axis=-1)
    best = inner
    square = np.where(is_inside, -np.inf, np.inf)
    for first, second, place in ((a, b, (0, 1)), (b, c, (1, 2)), (c, a, (2, 0))):
        edge = second - first
        t = np.einsum("...i,...i->...", points - first, edge) / np.einsum(
            "...i,...i->...", edge, edge
        )
        t = np.clip(t, 0.0, 1.0)
        off = ((first + t[..., None] * edge - points) ** 2).sum(axis=-1)
        weight = np.zeros(best.shape)
        weight[..., place[0]], weight[..., place[1]] = 1.0 - t, t
        is_nearer = off < square
        best = np.where(is_nearer[..., None], weight, best)
        square = np.where(is_nearer, off, square)
    return best


def _plane_weights(points: FloatArray, a: FloatArray, b: FloatArray, c: FloatArray) -> FloatArray:
    """Return barycentric weights (..., 3) of points dropped on the plane of a triangle."""
    u, v, w = b - a, c - a, points - a
    normal = np.cross(u, v)
    area = np.einsum("...i,...i->...", normal, normal)
    second = np.einsum("...i,...i->...", np.cross(w, v), normal) / area
    third = np.einsum("...i,...i->...", np.cross(u, w), normal) / area
    return np.stack([1.0 - second - third, second, third], axis=-1)


def _outward(mesh: Mesh) -> np.ndarray:
    """Return faces (f, 3), closed parts turned so that their volume is positive."""
    parts = parts_of(mesh)
    corners = mesh.corners
    volume = np.einsum("fi,fi->f", corners[:, 0], np.cross(corners[:, 1], corners[:, 2]))
    is_inward = (np.bincount(parts.label, volume) < 0.0) & parts.oriented
    return np.where(is_inward[parts.label][:, None], mesh.faces[:, ::-1], mesh.faces)


def _boxes(corners: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Return bounding boxes of leaves (low, high), of each ``_BRANCH`` leaves, and so on up."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    levels: list[tuple[FloatArray, FloatArray]] = []
    while not levels or len(low) > _BRANCH:
        starts = np.arange(0, len(low), _BRANCH if levels else _LEAF)
        low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
        levels.append((low, high))
    return levels
