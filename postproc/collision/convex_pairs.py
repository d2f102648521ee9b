"""Pairs of convex solids: how far apart they are at least, and a point that lies in both.

Most of what meets near a robot are boxes, cylinders and hulls. For those the exact test of two
trees of triangles often asks what a few products tell: the extent of all vertices of the one along
the axes of the other's box is tighter than box against box, and the middle of where two extents
overlap mostly lies in both solids if they meet deeply. What that leaves open is looked at along the
cross products of the axes of both boxes, which is all there is to know of two boxes (Gottschalk,
Lin and Manocha 1996). Into other solids that middle is pushed, into the one and the other in turn.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, members, taken
from postproc.collision.boxes import AXIS_FLOOR, seen_from
from postproc.collision.convex import Convex
from postproc.collision.cull import SLACK, Near
from postproc.collision.shape import Shape

_DEEP = 1e-9
"""A point lies in a solid if it is so far [m] behind all of its faces."""
_PUSHED = 1e-6
"""So far [m] behind faces a point is pushed."""
_PUSHES = 3
"""So often into each of two solids."""

_CROSS = np.array([[3 * ((-i - a) % 3) + b for i in range(3)] for a, b in np.ndindex(3, 3)])
_CROSS_SIGN = np.array([[(0, -1, 1)[(i - a) % 3] for i in range(3)] for a, _ in np.ndindex(3, 3)])
"""Cross products (9, 3) of the axes of two frames: entries of the turn between them, and signs."""


class ConvexPairs:
    """Cheap tests of pairs of convex solids.

    Args:
        shapes: of the bodies (b).
        first, second: (p,) bodies of each pair.
    """

    def __init__(self, shapes: list[Shape], first: IndexArray, second: IndexArray) -> None:
        self._solids, self._first, self._second = [s.solid for s in shapes], first, second
        self._centre = np.stack([shape.centre for shape in shapes])
        self._axes = np.stack([shape.axes for shape in shapes])
        self._half = np.stack([shape.half for shape in shapes])
        self._is_box = np.array([s is not None and s.is_box for s in self._solids])
        is_convex = np.array([solid is not None for solid in self._solids])
        self._knows = np.asarray(is_convex[first] & is_convex[second])

    def culled(
        self, near: Near, R: FloatArray, p: FloatArray, limit: FloatArray
    ) -> tuple[Near, FloatArray, FloatArray, FloatArray, BoolArray]:
        """Return the entries (k,) left of those that may be nearer than limits [m], and which meet.

        Args:
            near: the entries, whose bounds are raised.
            R: (k, 3, 3) axes of the second body's frame in the first's.
            p: (k, 3) [m] its origin.
            limit: (k,) [m].
        """
        meets = np.zeros(len(near), dtype=np.bool_)
        known = np.flatnonzero(self._knows[near.pair])
        if not len(known):
            return near, R, p, limit, meets
        bound, meets[known] = self.judge(
            near.pair[known], taken(R, known), taken(p, known), limit[known]
        )
        near.bound[known] = np.maximum(near.bound[known], bound)
        left = near.bound <= limit + SLACK
        if left.all():
            return near, R, p, limit, meets
        return near.rows(left), taken(R, left), taken(p, left), limit[left], meets[left]

    def judge(
        self, pair: IndexArray, R_a_b: FloatArray, p_a_b: FloatArray, limit: FloatArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return lower bounds (k,) [m] of distances, and which solids have a point in common (k,).

        Args:
            pair: (k,) of convex solids.
            R_a_b: (k, 3, 3) axes of the second body's frame in the first's.
            p_a_b: (k, 3) [m] its origin.
            limit: (k,) [m]: bounds beyond are good enough.
        """
        a, b = self._first[pair], self._second[pair]
        one, two = ((taken(self._centre, body), taken(self._axes, body)) for body in (a, b))
        R, p = seen_from(one, two, R_a_b, p_a_b)
        R_back = np.swapaxes(R, 1, 2)
        p_back = -np.einsum("kij,kj->ki", R_back, p)
        count = len(pair)
        own, turn, shift = map(np.concatenate, ((a, b), (R, R_back), (p, p_back)))
        bounds, middles, gaps = self._overlap(own, np.roll(own, count), turn, shift)
        bound = np.maximum(*np.split(bounds, 2))
        rows = np.flatnonzero(np.tile(bound == 0.0, 2))
        rows = rows[self._contains(own[rows], taken(middles, rows))]
        other = (rows + count) % (2 * count)
        there = np.einsum("kij,kj->ki", taken(turn, other), taken(middles, rows))
        there += taken(shift, other)
        meets = np.zeros(count, dtype=np.bool_)
        meets[rows[self._contains(own[other], there)] % count] = True
        near = np.flatnonzero(~meets & (bound <= limit + SLACK))
        across = self._across(a[near], b[near], taken(R, near), taken(p, near))
        bound[near] = np.maximum(bound[near], across)
        gap = np.maximum(np.maximum(*np.split(gaps, 2))[near], across)
        is_box = self._is_box[a[near]] & self._is_box[b[near]]
        # edges that were left out as parallel part no boxes that overlap by more along all others
        size = taken(self._half, a[near]).sum(axis=1) + taken(self._half, b[near]).sum(axis=1)
        meets[near[is_box]] = (gap < -_DEEP - 4.0 * AXIS_FLOOR * size)[is_box]
        near = near[~is_box & (bound[near] == 0.0)]
        frame = taken(R, near), taken(p, near)
        meets[near] = self._share_a_point(a[near], b[near], *frame, taken(middles, near))
        return bound, meets

    def _share_a_point(
        self, a: IndexArray, b: IndexArray, R: FloatArray, p: FloatArray, point: FloatArray
    ) -> BoolArray:
        """Return which solids (k,) and (k,) are found to have a point in common.

        The frames of the second stand in those of the first as R (k, 3, 3), p (k, 3) [m]; it is
        looked for from a point (k, 3) [m] there on.
        """
        met = np.zeros(len(a), dtype=np.bool_)
        open_ = np.arange(len(a))
        for _ in range(_PUSHES):
            if not len(open_):
                break
            turn, shift = taken(R, open_), taken(p, open_)
            there = np.einsum("kji,kj->ki", turn, self._pushed(a[open_], point) - shift)
            there = self._pushed(b[open_], there)
            point = np.einsum("kij,kj->ki", turn, there) + shift
            met[open_] = self._contains(a[open_], point) & self._contains(b[open_], there)
            point, open_ = taken(point, ~met[open_]), open_[~met[open_]]
        return met

    def _pushed(self, body: IndexArray, points: FloatArray) -> FloatArray:
        """Return points (k, 3) [m] moved into solids (k,), or nearer to those that are no boxes."""
        most = np.maximum(taken(self._half, body) - _PUSHED, 0.0)
        moved = np.clip(points, -most, most)
        for one in members(body[~self._is_box[body]], len(self._solids)).tolist():
            rows, solid = np.flatnonzero(body == one), self._solid(one)
            out = solid.normals @ points[rows].T - solid.offsets[:, None]
            worst = out.argmax(axis=0)
            far = np.maximum(out[worst, np.arange(len(rows))] + _PUSHED, 0.0)
            moved[rows] = points[rows] - far[:, None] * solid.normals[worst]
        return moved

    def _across(self, a: IndexArray, b: IndexArray, R: FloatArray, p: FloatArray) -> FloatArray:
        """Return the largest gap (k,) [m] along the cross products of the axes of their boxes.

        Negative where they overlap along all. Of solids (k,) and (k,), R (k, 3, 3) and p (k, 3) [m]
        as of ``_share_a_point``.
        """
        axis = R.reshape(-1, 9)[:, _CROSS] * _CROSS_SIGN
        length = np.linalg.norm(axis, axis=2, keepdims=True)
        is_axis = length > AXIS_FLOOR
        axis = np.where(is_axis, axis / np.where(is_axis, length, 1.0), 0.0)
        low_a, high_a = self._extent(a, axis)
        low_b, high_b = self._extent(b, axis @ R)
        middle = np.einsum("kij,kj->ki", axis, p)
        gap = np.maximum(low_b + middle - high_a, low_a - middle - high_b)
        return np.asarray(gap.max(axis=1, initial=-np.inf, where=is_axis[:, :, 0]))

    def _extent(self, body: IndexArray, axis: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return how far (k, m) [m] solids (k,) reach down and up axes (k, m, 3) of theirs."""
        high = np.einsum("kij,kj->ki", np.abs(axis), taken(self._half, body))
        low = -high
        for one in members(body[~self._is_box[body]], len(self._solids)).tolist():
            rows = np.flatnonzero(body == one)
            directions = taken(axis, rows).reshape(-1, 3).T
            along = self._solid(one).vertices @ directions  # fast along vertices
            low[rows] = along.min(axis=0).reshape(len(rows), -1)
            high[rows] = along.max(axis=0).reshape(len(rows), -1)
        return low, high

    def _overlap(
        self, own: IndexArray, body: IndexArray, R: FloatArray, p: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how far (k,) [m] solids are from boxes, and the middle (k, 3) of the overlap.

        And the largest gap (k,) [m] along one axis, negative where they overlap along all. Along
        the axes of the boxes of solids ``own`` (k,), in which the frames of solids ``body`` (k,)
        stand as R (k, 3, 3), p (k, 3).
        """
        half = taken(self._half, own)
        low, high = (p + end for end in self._extent(body, R))
        gap = np.maximum(low - half, -half - high)
        middle = 0.5 * (np.maximum(low, -half) + np.minimum(high, half))
        apart = np.maximum(gap, 0.0)
        return np.sqrt(np.einsum("ki,ki->k", apart, apart)), middle, gap.max(axis=1)

    def _contains(self, body: IndexArray, points: FloatArray) -> BoolArray:
        """Return which points (k, 3) [m] lie well inside solids (k,), in the frame of its box."""
        inside = np.asarray((np.abs(points) < taken(self._half, body) - _DEEP).all(axis=1))
        for one in members(body[inside & ~self._is_box[body]], len(self._solids)).tolist():
            rows, solid = np.flatnonzero(inside & (body == one)), self._solid(one)
            deep = solid.normals @ taken(points, rows).T < (solid.offsets - _DEEP)[:, None]
            inside[rows] = deep.all(axis=0)
        return inside

    def _solid(self, body: int) -> Convex:
        solid = self._solids[body]
        if solid is None:
            raise ValueError(f"body {body} is not convex")
        return solid
