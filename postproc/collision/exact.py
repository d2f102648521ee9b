"""The only user of fcl: exact tests of single pairs of meshes.

fcl objects belong to one thread of one process: elsewhere they give wrong answers. They are built
when first needed and again in every other thread or process.
"""

from __future__ import annotations

import os
import threading
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, members
from postproc.collision.mesh import Mesh

_CONTACTS = 1000
"""Crossings of triangles that are asked for to say where two surfaces meet."""

_UNASKED = -1.0
"""Smaller than any distance: fcl does not write down where surfaces are nearest."""

_FLAT = 1e-18
"""Volume [m^3] spanned by a triangle and an edge that lies in its plane."""


class ExactTests:
    """Collision and distance of pairs of meshes by fcl's trees of triangles.

    Args:
        meshes: (b) in the frames of their links.
    """

    def __init__(self, meshes: list[Mesh]) -> None:
        self._meshes = meshes
        self._local = threading.local()

    def __reduce__(self) -> tuple[object, ...]:
        """Pickle the meshes only."""
        return (ExactTests, (self._meshes,))

    def _objects(self, bodies: np.ndarray) -> tuple[list[Any], list[Any]]:
        """Return this thread's objects, one of each mesh that stands and one that moves.

        There are some of the given bodies at least.
        """
        if getattr(self._local, "process", None) != os.getpid():
            self._local.process = os.getpid()
            self._local.standing = [None] * len(self._meshes)
            self._local.moving = [None] * len(self._meshes)
        standing, moving = self._local.standing, self._local.moving
        for body in members(bodies, len(self._meshes)).tolist():
            if standing[body] is None:
                standing[body], moving[body] = self._build(self._meshes[body])
        return standing, moving

    def _build(self, mesh: Mesh) -> tuple[Any, Any]:
        import fcl

        model = fcl.BVHModel()
        model.beginModel(len(mesh.vertices), len(mesh.faces))
        model.addSubModel(np.array(mesh.vertices), np.array(mesh.faces))
        model.endModel()
        return fcl.CollisionObject(model), fcl.CollisionObject(model)

    def collide(
        self,
        first: np.ndarray,
        second: np.ndarray,
        R: FloatArray,
        p: FloatArray,
        group: np.ndarray,
        margin: FloatArray | None = None,
    ) -> np.ndarray:
        """Return the first entry of each group whose surfaces meet.

        Args:
            first: (k,) standing bodies.
            second: (k,) moving bodies.
            R: (k, 3, 3) axes of the second body's frame in the first's.
            p: (k, 3) [m] its origin.
            group: (k,) in growing order; once an entry meets, the rest of its group is skipped.
            margin: (k,) [m]; surfaces up to this far apart meet. None: 0 for all.

        Returns:
            Indices of entries (h,), at most one for each group.
        """
        import fcl

        request, result = fcl.CollisionRequest(num_max_contacts=1), fcl.CollisionResult()
        how, where = fcl.DistanceRequest(), fcl.DistanceResult(min_distance_=_UNASKED)
        margins = [0.0] * len(first) if margin is None else margin.tolist()
        standing, moving = self._objects(np.concatenate([first, second]))
        found, done = [], -1
        rows = zip(first.tolist(), second.tolist(), group.tolist(), margins, strict=True)
        for k, (a, b, g, m) in enumerate(rows):
            if g == done:
                continue
            one, two = standing[a], moving[b]
            two.setRotation(R[k])
            two.setTranslation(p[k])
            meets = fcl.collide(one, two, request, result) > 0
            if m > 0.0 and not meets:
                # a distance costs far more, most of all where surfaces meet
                meets = fcl.distance(one, two, how, where) <= m
            if meets:
                found.append(k)
                done = g
        return np.array(found, dtype=np.int64)

    def meeting_point(self, first: int, second: int, R: FloatArray, p: FloatArray) -> FloatArray:
        """Return the point (3,) [m] in the first body's frame about which two bodies meet.

        The middle of where their surfaces cross; where they do not, the middle of the shortest way
        between them. ``R`` (3, 3), ``p`` (3,) [m]: the second body's frame in the first's.
        """
        import fcl

        standing, moving = self._objects(np.array([first, second]))
        one, two = standing[first], moving[second]
        two.setRotation(R)
        two.setTranslation(p)
        request = fcl.CollisionRequest(num_max_contacts=_CONTACTS, enable_contact=True)
        met = fcl.CollisionResult()
        if fcl.collide(one, two, request, met):
            # fcl's own contact points may lie outside both bodies
            faces = np.array([(contact.b1, contact.b2) for contact in met.contacts])
            there = self._meshes[second].corners[faces[:, 1]] @ R.T + p
            points = _crossings(self._meshes[first].corners[faces[:, 0]], there)
            if len(points):
                return np.asarray(points.mean(axis=0))
        nearest = fcl.DistanceResult()
        fcl.distance(one, two, fcl.DistanceRequest(enable_nearest_points=True), nearest)
        return np.asarray(np.mean(nearest.nearest_points, axis=0))

    def distance(
        self, first: np.ndarray, second: np.ndarray, R: FloatArray, p: FloatArray
    ) -> FloatArray:
        """Return distances (k,) [m] of the surfaces, 0 where they meet."""
        import fcl

        distances = np.empty(len(first))
        how, where = fcl.DistanceRequest(), fcl.DistanceResult(min_distance_=_UNASKED)
        standing, moving = self._objects(np.concatenate([first, second]))
        for k, (a, b) in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
            one, two = standing[a], moving[b]
            two.setRotation(R[k])
            two.setTranslation(p[k])
            distances[k] = fcl.distance(one, two, how, where)
        return np.maximum(distances, 0.0)


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
