"""The only user of coal: how far apart two solids are, as exactly as the answer matters.

A solid is convex pieces and patches of triangles (``pieces``) under a tree of boxes. What two
boxes prove far enough apart is not looked at. Of the pieces that are left, hulls are, the nearest
boxes first, each only as far as it could still lower the answer (Gilbert, Johnson and Keerthi
1988). Between convex pieces that is exact. The triangles of patches are asked where the distance
of their hulls, which theirs cannot fall below, does not answer yet.

Objects of coal belong to one thread of one process: they are built when first needed there.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray, members, numbered, taken
from postproc.collision.boxes import fit_box
from postproc.collision.inside import InsideTest
from postproc.collision.mesh import Mesh
from postproc.collision.shape import Shape
from postproc.collision.tree import SLACK, PieceTree

_TOLERANCE = 1e-10
"""GJK ends here [m]: distances are told too large by less than ``SLACK``, contact as less too."""
_LINEAR = 32
"""Vertices up to which coal looks at all of a hull; beyond, it must know which are neighbours."""
_ROUND = 1e-12
"""Boxes are so much larger [m] than what they contain: their corners are rounded."""
_CONTACTS = 1000
"""Crossings of triangles that are asked for to say where two surfaces meet."""
_FLAT = 1e-18
"""Volume [m^3] spanned by a triangle and an edge that lies in its plane."""


class Distances:
    """Distances of solids, 0 where they meet or one lies in the other.

    Args:
        shapes: (b) in the frames of their links.
    """

    def __init__(self, shapes: list[Shape]) -> None:
        self._shapes = shapes
        self._meshes = [shape.mesh for shape in shapes]
        self._solids = [shape.pieces for shape in shapes]
        self._tree = PieceTree.of(self._solids)
        self._body = np.repeat(np.arange(len(shapes)), self._tree.size)
        self._first = np.cumsum(self._tree.size) - self._tree.size
        self._is_convex = np.concatenate([solid.is_convex for solid in self._solids]).tolist()
        # what lies in a convex piece is seen by its distance
        self._is_hollow = np.array(
            [one.parts.closed.any() and not one.pieces.is_convex.all() for one in shapes]
        )
        self._inside: dict[int, InsideTest] = {}
        probes = [shape.probes for shape in shapes]
        self._probes = np.concatenate(probes)
        self._probe_count = np.array([len(own) for own in probes])
        self._probe_start = np.cumsum(self._probe_count) - self._probe_count
        self._local = threading.local()

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle what they are made of only."""
        return (Distances, (self._shapes,))

    def distance(
        self,
        first: IndexArray,
        second: IndexArray,
        R: FloatArray,
        p: FloatArray,
        enough: FloatArray,
        low: FloatArray,
        stop: FloatArray | float = 0.0,
        group: IndexArray | None = None,
    ) -> FloatArray:
        """Return distances (k,) [m], or what is known of them.

        Args:
            first: (k,) bodies.
            second: (k,) bodies.
            R: (k, 3, 3) axes of the second body's frame in the first's.
            p: (k, 3) [m] its origin.
            enough: (k,) [m]; what is farther apart is infinitely far.
            low: (k,) [m]; answers up to this are exact, beyond it lower bounds.
            stop: (k,) [m]; how much nearer than this does not matter.
            group: (k,) in growing order; once an entry is as near as ``stop``, the rest of its
                group is not looked at, and infinitely far.
        """
        result = np.full(len(first), np.inf)
        result[self._nested(first, second, R, p)] = 0.0
        open_ = np.flatnonzero(result > 0.0)
        if not len(open_):
            return result
        entry, *pieces, gap = self._tree.near(
            first[open_], second[open_], taken(R, open_), taken(p, open_), enough[open_]
        )
        order = np.lexsort((gap, entry))
        entry = open_[entry[order]]
        columns = zip(*(column[order].tolist() for column in (*pieces, gap)), strict=True)
        pairs, ends = list(columns), np.searchsorted(entry, np.arange(len(first) + 1)).tolist()
        stops = np.broadcast_to(stop, result.shape).tolist()
        found, lows = result.tolist(), low.tolist()
        groups = range(len(first)) if group is None else group.tolist()
        search, done = self._search(), -1
        for k in range(len(first)) if group is not None else members(entry, len(first)).tolist():
            if groups[k] == done:
                found[k] = np.inf
            elif found[k] > 0.0 and ends[k] < ends[k + 1]:
                mine = pairs[ends[k] : ends[k + 1]]
                found[k] = search.least(mine, R[k], p[k], enough[k] + SLACK, lows[k], stops[k])
            if group is not None and found[k] <= stops[k]:
                done = groups[k]
        return np.array(found)

    def _nested(
        self, first: IndexArray, second: IndexArray, R: FloatArray, p: FloatArray
    ) -> BoolArray:
        """Return which entries (k,) have a part of one body wholly inside the other's surface.

        Meant for surfaces that do not touch: one point of each part decides.
        """
        nested = np.zeros(len(first), dtype=np.bool_)
        R_back = np.swapaxes(R, 1, 2)
        p_back = -np.einsum("kij,kj->ki", R_back, p)
        for outer, inner, turn, shift in ((first, second, R, p), (second, first, R_back, p_back)):
            for body in members(outer[self._is_hollow[outer]], len(self._meshes)).tolist():
                rows = np.flatnonzero(outer == body)
                owner, step = numbered(self._probe_count[inner[rows]])
                rows = rows[owner]
                probes = taken(self._probes, self._probe_start[inner[rows]] + step)
                points = np.einsum("kij,kj->ki", taken(turn, rows), probes) + taken(shift, rows)
                if body not in self._inside:
                    self._inside[body] = InsideTest(self._meshes[body], self._shapes[body].parts)
                nested[rows[self._inside[body].contains(points)]] = True
        return nested

    def meeting_point(self, first: int, second: int, R: FloatArray, p: FloatArray) -> FloatArray:
        """Return the point (3,) [m] in the first body's frame about which two bodies meet.

        The middle of where their surfaces cross; where they do not, the middle of the shortest way
        between them. ``R`` (3, 3), ``p`` (3,) [m]: the second body's frame in the first's.
        """
        import coal

        one, two = (
            _surface(self._meshes[body], self._meshes[body].faces) for body in (first, second)
        )
        places = coal.Transform3s(), coal.Transform3s(R, p)
        request, met = coal.CollisionRequest(coal.CONTACT, _CONTACTS), coal.CollisionResult()
        if coal.collide(one, places[0], two, places[1], request, met):
            # contact points as such may lie outside both bodies
            faces = np.array([(contact.b1, contact.b2) for contact in met.getContacts()])
            there = self._meshes[second].corners[faces[:, 1]] @ R.T + p
            points = _crossings(self._meshes[first].corners[faces[:, 0]], there)
            if len(points):
                return np.asarray(points.mean(axis=0))
        nearest = coal.DistanceResult()
        coal.distance(one, places[0], two, places[1], coal.DistanceRequest(), nearest)
        return np.asarray(0.5 * (nearest.getNearestPoint1() + nearest.getNearestPoint2()))

    def _search(self) -> _Search:
        """Return this thread's search."""
        if getattr(self._local, "search", None) is None:
            self._local.search = _Search(self._piece, self._is_convex)
        found: _Search = self._local.search
        return found

    def _piece(self, piece: int) -> tuple[Mesh, IntArray]:
        """Return the mesh that a piece belongs to, and its triangles (f, 3)."""
        body = int(self._body[piece])
        faces = self._solids[body].faces_of(piece - int(self._first[body]))
        return self._meshes[body], self._meshes[body].faces[faces]


class _Search:
    """The objects of coal that one thread has built, and the search for the least distance.

    Args:
        piece: the mesh that a piece belongs to, and its triangles.
        is_convex: by piece.
    """

    def __init__(
        self, piece: Callable[[int], tuple[Mesh, IntArray]], is_convex: list[bool]
    ) -> None:
        import coal

        self._piece, self._is_convex = piece, is_convex
        self._hull, self._exact = cache(self._hull_of), cache(self._as_it_is)
        self._here = coal.Transform3s()
        self._place, self._distance = coal.Transform3s, coal.distance
        self._request, self._result = coal.DistanceRequest(), coal.DistanceResult()
        self._request.enable_signed_distance = False
        self._request.gjk_tolerance = _TOLERANCE

    def least(
        self,
        pairs: list[tuple[int, int, float]],
        R: FloatArray,
        p: FloatArray,
        enough: float,
        low: float,
        stop: float,
    ) -> float:
        """Return the least distance [m] of pairs of pieces, by growing gap of their boxes.

        Infinite where none is below ``enough``, exact up to ``low``, beyond it a lower bound.
        """
        here, there = self._here, self._place(R, p)
        distance, request, result = self._distance, self._request, self._result
        convex, hull, exact, least = self._is_convex, self._hull, self._exact, enough
        for a, b, gap in pairs:
            if gap >= least or least <= stop:
                break
            result.min_distance = least + SLACK
            distance(hull(a), here, hull(b), there, request, result)
            bound = result.min_distance
            if not (convex[a] and convex[b]):
                bound = max(bound - SLACK, gap)
                if bound <= low and bound < least:
                    result.min_distance = least
                    distance(exact(a), here, exact(b), there, request, result)
                    bound = result.min_distance
            if bound < least:
                least = bound
        if least >= enough:
            return np.inf
        return least if least > SLACK else 0.0

    def _hull_of(self, piece: int) -> Any:  # noqa: ANN401 - coal has no types
        """Return what contains a piece: it itself if it is convex, a box along it if not."""
        mesh, faces = self._piece(piece)
        points = mesh.vertices[members(faces, len(mesh.vertices))]
        return _hull(points if self._is_convex[piece] else _boxed(points))

    def _as_it_is(self, piece: int) -> Any:  # noqa: ANN401
        return self._hull(piece) if self._is_convex[piece] else _surface(*self._piece(piece))


def _hull(points: FloatArray) -> Any:  # noqa: ANN401
    """Return points (v, 3) [m] as a convex body of coal; they must not lie in a plane."""
    import coal

    if len(points) > _LINEAR:
        return coal.Convex.convexHull(_vectors(points), False, "")
    triangles = coal.StdVec_Triangle()
    triangles.append(coal.Triangle(0, 1, 2))
    return coal.Convex(_vectors(points), triangles)


def _boxed(points: FloatArray) -> FloatArray:
    """Return the corners (8, 3) of a box along points (v, 3) that contains them.

    Not their hull: a patch may be flat, and then that of coal ends the process.
    """
    centre, axes, half = fit_box(points)
    ends = np.stack([-half - _ROUND, half + _ROUND], axis=1)
    corners = np.stack(np.meshgrid(*ends), axis=-1).reshape(-1, 3)
    return np.asarray(centre + corners @ axes.T)


def _vectors(points: FloatArray) -> Any:  # noqa: ANN401
    import coal

    vectors = coal.StdVec_Vec3s()
    vectors.extend(points)
    return vectors


def _surface(mesh: Mesh, faces: IntArray) -> Any:  # noqa: ANN401
    """Return triangles (f, 3) of a mesh as a tree of coal."""
    import coal

    used = members(faces, len(mesh.vertices))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(faces), len(used))
    model.addVertices(mesh.vertices[used])
    model.addTriangles(np.searchsorted(used, faces))
    model.endModel()
    return model


def _crossings(one: FloatArray, two: FloatArray) -> FloatArray:
    """Return points (k, 3) where edges of triangles (m, 3, 3) pass through the other triangle."""
    found = []
    for edges, faces in ((one, two), (two, one)):
        corner, u, v = faces[:, 0], faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0]
        for begin, end in ((0, 1), (1, 2), (2, 0)):
            start = edges[:, begin]
            system = np.stack([u, v, start - edges[:, end]], axis=-1)
            crosses = np.abs(np.linalg.det(system)) > _FLAT
            away = (start - corner)[crosses, :, None]
            a, b, share = np.linalg.solve(system[crosses], away)[:, :, 0].T
            inside = (a >= 0.0) & (b >= 0.0) & (a + b <= 1.0) & (share >= 0.0) & (share <= 1.0)
            way = (edges[:, end] - start)[crosses]
            found.append((start[crosses] + share[:, None] * way)[inside])
    return np.concatenate(found)
