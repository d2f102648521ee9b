"""Is a point inside a closed mesh? Connected parts, which of them are closed, and the test.

A mesh is a surface: a solid wholly inside another touches nothing and counts as free. When
two surfaces do not touch, each connected part of one lies wholly inside or wholly outside the
other, so one point of every part decides.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, numbered, taken
from postproc.collision.mesh import Mesh, normals_of
from postproc.records import dataclass

MOST_PROBES = 64
"""Parts of one body that are tested; of a body in more pieces, the largest ones."""
_FACES_PER_CELL = 4
_CROWD = 32
_BATCH = 1_000_000
# A fixed turn that no edge of a drawing is likely to be parallel to: rays along z of this frame.
_TURN: FloatArray = np.linalg.qr(
    np.array([[0.83, 0.41, -0.37], [-0.29, 0.91, 0.23], [0.47, -0.17, 0.86]])
)[0]


@dataclass(frozen=True, slots=True)
class Parts:
    """Connected parts of a mesh: ``label`` (f,) part of each face, ``closed`` (k,) by part.

    ``oriented`` (k,): the faces of a closed part agree on which side is out.
    """

    label: IntArray
    closed: BoolArray
    oriented: BoolArray


def parts_of(mesh: Mesh) -> Parts:
    """Return the parts of a mesh that hang together by shared vertices."""
    smallest = _component_of_vertex(mesh)[mesh.faces[:, 0]]
    label = np.unique(smallest, return_inverse=True)[1].ravel().astype(np.int32)
    count = int(label.max()) + 1
    start, end = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    n = len(mesh.vertices)
    key = np.minimum(start, end).astype(np.int64) * n + np.maximum(start, end)
    edge, number = np.unique(key, return_inverse=True)
    number = number.ravel()
    uses = np.bincount(number, minlength=len(edge))
    turns = np.bincount(number, np.where(start < end, 1.0, -1.0), minlength=len(edge))
    face_of_edge = np.repeat(label, 3)
    odd = np.bincount(face_of_edge, uses[number] % 2, minlength=count)
    one_sided = np.bincount(face_of_edge, np.abs(turns[number]), minlength=count)
    return Parts(label, odd == 0, (odd == 0) & (one_sided == 0))


def _component_of_vertex(mesh: Mesh) -> IntArray:
    """Return the smallest vertex index of each vertex's part (v,)."""
    label, columns = np.arange(len(mesh.vertices)), np.ascontiguousarray(mesh.faces.T)
    while True:
        smallest = label[columns].min(axis=0)
        before = label.copy()
        for column in columns:
            np.minimum.at(label, before[column], smallest)
        label = label[label]
        label = np.minimum(label, before)
        if np.array_equal(label, before):
            return label.astype(np.int32)


def probes_of(mesh: Mesh, parts: Parts) -> FloatArray:
    """Return one vertex (k, 3) [m] of each part, of the ``MOST_PROBES`` largest at most."""
    first = np.unique(parts.label, return_index=True)[1]
    if len(first) > MOST_PROBES:
        area = np.bincount(parts.label, np.linalg.norm(normals_of(mesh.corners), axis=1))
        first = first[np.sort(np.argsort(-area, kind="stable")[:MOST_PROBES])]
    return np.asarray(mesh.vertices[mesh.faces[first, 0]])


class InsideTest:
    """Tells which points lie inside the closed parts of a mesh.

    Rays along one direction that no face of a drawing is parallel to; the signed count of the
    faces above a point is the winding number, so overlapping parts do not cancel. Parts whose
    faces disagree about out and in are judged by whether the count is odd.
    """

    def __init__(self, mesh: Mesh, parts: Parts) -> None:
        kept = parts.closed[parts.label]
        self._is_oriented = parts.oriented[parts.label][kept]
        self._faces = mesh.faces[kept]
        own = mesh.vertices[self._faces]
        self._box = own.min(axis=(0, 1), initial=np.inf), own.max(axis=(0, 1), initial=-np.inf)
        self._turned = mesh.vertices @ _TURN
        corners = self._turned[self._faces]
        flat = corners[..., :2]
        area = (flat[:, 1, 0] - flat[:, 0, 0]) * (flat[:, 2, 1] - flat[:, 0, 1]) - (
            flat[:, 1, 1] - flat[:, 0, 1]
        ) * (flat[:, 2, 0] - flat[:, 0, 0])
        self._side = np.sign(area)
        self._low = corners.min(axis=(0, 1), initial=np.inf)
        self._high = corners.max(axis=(0, 1), initial=-np.inf)
        grid = max(1, int(np.sqrt(len(self._faces) / _FACES_PER_CELL)))
        first, count, cell = self._cells_of(flat, grid)
        while grid > 1 and count.prod(axis=1).sum() > _CROWD * len(flat):
            # long triangles lie in many cells: fewer cells, so that the index stays small
            grid //= 2
            first, count, cell = self._cells_of(flat, grid)
        self._start, self._members = _index(first, count, grid)
        self._cell, self._grid = cell, grid

    @property
    def has_inside(self) -> bool:
        """Whether any part is closed."""
        return len(self._faces) > 0

    def _cells_of(self, flat: FloatArray, grid: int) -> tuple[IntArray, IntArray, FloatArray]:
        """Return the first cell and the number of cells along x and y (f, 2) of each face.

        And the size (2,) of a cell.
        """
        cell = np.maximum((self._high - self._low)[:2], 1e-12) / grid
        low = np.floor((flat.min(axis=1) - self._low[:2]) / cell).astype(np.int32)
        high = np.floor((flat.max(axis=1) - self._low[:2]) / cell).astype(np.int32)
        low, high = np.clip(low, 0, grid - 1), np.clip(high, 0, grid - 1)
        return low, high - low + 1, cell

    def contains(self, points: FloatArray) -> BoolArray:
        """Return (n,) whether each point (n, 3) [m] in a mesh's frame lies inside a closed part.

        Points on the surface may fall on either side.
        """
        inside = np.zeros(len(points), dtype=bool)
        if not self.has_inside or not len(points):
            return inside
        x, y, z = ((points >= self._box[0]) & (points <= self._box[1])).T
        near = np.flatnonzero(x & y & z)
        most = max(1, _BATCH // int(np.diff(self._start).max()))
        for begin in range(0, len(near), most):
            rows = near[begin : begin + most]
            inside[rows] = self._count(points[rows] @ _TURN)
        return inside

    def _count(self, points: FloatArray) -> BoolArray:
        grid = self._grid
        xy = np.floor((points[:, :2] - self._low[:2]) / self._cell).astype(np.int64)
        xy = np.clip(xy, 0, grid - 1)
        cell = xy[:, 0] * grid + xy[:, 1]
        count = self._start[cell + 1] - self._start[cell]
        row, step = numbered(count)
        face = self._members[self._start[cell][row] + step]
        above = self._is_above(taken(points, row), face)
        row, face = row[above], face[above]
        oriented = self._is_oriented[face]
        side = self._side[face[oriented]]
        winding = np.bincount(row[oriented], side, minlength=len(points))
        crossings = np.bincount(row[~oriented], minlength=len(points))
        return np.asarray((winding != 0.0) | (crossings % 2 == 1))

    def _is_above(self, points: FloatArray, face: IntArray) -> BoolArray:
        """Return (m,) whether the ray from each point meets its face.

        Each edge is evaluated from its smaller to its larger vertex, so the two faces at an edge
        get the same number and a ray through the edge meets exactly one of them.
        """
        index = taken(self._faces, face)
        left = np.empty((3, len(face)), dtype=bool)
        weight = np.empty((3, len(face)))
        for k in range(3):
            a, b = index[:, k], index[:, (k + 1) % 3]
            is_turned = a > b
            p = taken(self._turned, np.where(is_turned, b, a))
            q = taken(self._turned, np.where(is_turned, a, b))
            cross = (q[:, 0] - p[:, 0]) * (points[:, 1] - p[:, 1]) - (q[:, 1] - p[:, 1]) * (
                points[:, 0] - p[:, 0]
            )
            left[k] = (cross >= 0.0) != is_turned
            weight[(k + 2) % 3] = np.where(is_turned, -cross, cross)
        hit = (left[0] == left[1]) & (left[1] == left[2])
        total = weight.sum(axis=0)
        z = np.einsum("km,mk->m", weight, self._turned[index, 2])
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(hit & (z / total > points[:, 2]))


def _index(low: IntArray, size: IntArray, grid: int) -> tuple[IntArray, IntArray]:
    """Return for each cell of a grid where its faces begin, and the faces (rows of the index)."""
    face, step = numbered(size.prod(axis=1))
    x = low[face, 0] + step // size[face, 1]
    y = low[face, 1] + step % size[face, 1]
    cell = x * grid + y
    order = np.argsort(cell, kind="stable")
    start = np.searchsorted(cell[order], np.arange(grid**2 + 1))
    return start.astype(np.int32), face[order].astype(np.int32)
