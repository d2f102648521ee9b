"""What a solid is made of: convex pieces, and patches of neighbouring triangles of all else."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray, taken
from postproc.collision.inside import Parts
from postproc.collision.mesh import Mesh, normals_of
from postproc.records import dataclass

_MOST_FACES = 256
"""Triangles of a connected part that is tried as one convex piece."""
_FEWEST = 64
"""Patches are not split below this number of triangles: few hulls, but more triangles in one ..."""
_MOST_PATCHES = 512
"""... nor into many more: an exact test looks at all triangles of some patches."""
_FLAT = 1e-9
"""A vertex stands no farther out of a face of a convex solid than this [m]."""
_THIN = 1e-6
"""What is thinner [m] has no inside worth the name: it is a surface."""
CHILDREN = 16
"""Boxes in one box above them."""
FEW_VERTICES = 16
"""Vertices up to which all of a piece are looked at for how far it reaches."""


@dataclass(frozen=True, slots=True)
class Pieces:
    """Triangles (f,) of a mesh by piece, pieces (k,) that are neighbours near each other.

    ``faces`` (f,) in the order of the pieces, of which each begins at ``start`` (k,);
    ``is_convex`` (k,): all within is solid. ``boxes``: low and high corners [m] of the pieces, of
    ``CHILDREN`` boxes each, and so on up to all; ``few``: convex pieces (s,) of at most
    ``FEW_VERTICES``, and those (s, 3, v) [m], the last one again and again.
    """

    faces: IntArray
    start: IntArray
    is_convex: BoolArray
    boxes: tuple[tuple[FloatArray, FloatArray], ...]
    few: tuple[IndexArray, FloatArray]

    @staticmethod
    def of(mesh: Mesh, parts: Parts) -> Pieces:
        """Return the pieces of a mesh."""
        corners = mesh.corners
        by_part = _by_part(parts, corners)
        convex = [group for group in by_part if _is_convex(taken(corners, group))]
        middle = corners.mean(axis=1)
        if convex:
            first = np.array([group[0] for group in convex])
            convex = [convex[int(one[0])] for one in halved(taken(middle, first), 1)]
        rest = np.ones(len(corners), dtype=np.bool_)
        rest[np.concatenate([*convex, np.zeros(0, dtype=np.int64)])] = False
        left = np.flatnonzero(rest)
        most = max(_FEWEST, len(left) // _MOST_PATCHES)
        patches = [left[group] for group in halved(taken(middle, left), most)]
        groups = [*convex, *patches]
        count = np.array([len(group) for group in groups])
        faces, start = np.concatenate(groups).astype(np.int32), np.cumsum(count) - count
        is_convex = np.arange(len(groups)) < len(convex)
        few = _few_vertices(mesh, groups[: len(convex)])
        return Pieces(faces, start, is_convex, _boxes(taken(corners, faces), start), few)

    def faces_of(self, piece: int) -> IntArray:
        """Return the triangles of a piece."""
        end = self.start[piece + 1] if piece + 1 < len(self.start) else len(self.faces)
        return self.faces[self.start[piece] : end]


def _few_vertices(mesh: Mesh, convex: list[IndexArray]) -> tuple[IndexArray, FloatArray]:
    found: list[FloatArray] = [np.zeros((0, 3, FEW_VERTICES))]
    place = []
    for piece, faces in enumerate(convex):
        points = mesh.vertices[np.unique(mesh.faces[faces])]
        if len(points) <= FEW_VERTICES:
            place.append(piece)
            found.append(np.pad(points.T, ((0, 0), (0, FEW_VERTICES - len(points))), "edge")[None])
    return np.array(place, dtype=np.int64), np.concatenate(found)


def _boxes(corners: FloatArray, start: IntArray) -> tuple[tuple[FloatArray, FloatArray], ...]:
    low = np.minimum.reduceat(corners.min(axis=1), start)
    high = np.maximum.reduceat(corners.max(axis=1), start)
    levels = [(low, high)]
    while len(low) > 1:
        starts = np.arange(0, len(low), CHILDREN)
        low, high = np.minimum.reduceat(low, starts), np.maximum.reduceat(high, starts)
        levels.append((low, high))
    return tuple(levels)


def _by_part(parts: Parts, corners: FloatArray) -> list[IndexArray]:
    """Return the triangles of small closed parts, each for itself, if none can be a cavity."""
    volume = np.einsum("fi,fi->f", corners[:, 0], normals_of(corners))
    volume = np.bincount(parts.label, volume)
    if not parts.oriented.any() or np.ptp(np.sign(volume[parts.oriented])) > 0.0:
        return []
    count = np.bincount(parts.label)
    order = np.argsort(parts.label, kind="stable")
    groups = np.split(order, np.cumsum(count)[:-1])
    wanted = np.flatnonzero(parts.oriented & (count <= _MOST_FACES))
    return [groups[part] for part in wanted.tolist()]


def _is_convex(corners: FloatArray) -> bool:
    """Return whether the closed surface of triangles (f, 3, 3) bounds a convex solid."""
    normals = normals_of(corners)
    size = np.linalg.norm(normals, axis=1)
    normals, first = normals[size > 0.0], corners[size > 0.0, 0]
    normals /= size[size > 0.0, None]
    out = corners.reshape(-1, 3) @ normals.T - np.einsum("fi,fi->f", normals, first)
    if np.abs(out.max(axis=0, initial=0.0)).max(initial=0.0) > _FLAT:
        out = -out  # all faces may be turned inwards
    return bool(len(normals)) and bool(
        (out.max(axis=0) <= _FLAT).all() and (out.min(axis=0) < -_THIN).all()
    )


def halved(places: FloatArray, most: int, whole: int = 1) -> list[IndexArray]:
    """Return groups of at most ``most`` places (n, 3), neighbours one behind the other.

    They are halved across where they reach farthest, in multiples of ``whole``.
    """
    columns, pending, done = np.ascontiguousarray(places.T), [np.arange(len(places))], []
    while pending:
        group = pending.pop()
        if len(group) > most:
            mine = columns.take(group, axis=1)
            along = mine[int(np.argmax(np.ptp(mine, axis=1)))]
            order, half = np.argsort(along, kind="stable"), -(-(len(group) // 2) // whole) * whole
            pending += [group[order[half:]], group[order[:half]]]
        elif len(group):
            done.append(group)
    return done
