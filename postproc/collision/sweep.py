"""How far bodies can move while the joints turn: the bound that no collision slips through.

Let a body hang on link i and look at it from link a < i. Turning joint j by an angle moves every
point x by no more than that angle times its distance r_j from axis j, measured in the configuration
the motion starts from; by the triangle inequality over the product of the turns,

    |x(q + d) - x(q)| <= sum over j = a+1 .. i of |d_j| r_j(q).

Joints that undo each other, as on a straight line of the tool, move a point far less than that.
The velocity along s -> q + s d at the start is x' = sum of d_j (a_j x (x - p_j)), linear in d. The
second derivative is no larger than the sum over all j, k of |d_j| |d_k| r_max(j, k), with r taken
on the way, where r_j has grown to R_j = r_j(q) + sum over m > j of |d_m| r_m(q) at most. By Taylor

    |x(q + d) - x(q)| <= |x'| + 1/2 sum over j, k of |d_j| |d_k| R_max(j, k).

The smaller of the two counts. The distance of two bodies changes by no more than that. Adaptive
checks with such bounds are due to Schwarzer, Saha and Latombe 2005.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from postproc.arrays import FloatArray, taken
from postproc.collision.arm import Arm, joint_axes
from postproc.collision.bodies import LAST_LINK
from postproc.collision.cull import Frames, Placed
from postproc.collision.external import JOINTS, PART_LINK, WORLD_LINK, ExternalAxes
from postproc.collision.shape import Shape

_Turns = tuple[FloatArray, FloatArray | None, FloatArray | None]


class Sway(NamedTuple):
    """Where joints may go from a configuration: to q + s way + rest, -1 <= s <= 1.

    ``turn`` (n, 6 + k) largest way of each axis from there [rad or m], not negative, way and rest
    together; ``way`` (n, 6 + k) the part that all axes go at once, None: each as it likes;
    ``rest`` (n, 6 + k) how far axes may be beside it, None: what is left of their turn.

    Of several ways from one configuration, ``way`` (n, v, 6 + k), each with the same turn and rest,
    the largest bound holds for everything between them: the velocity is linear in the way, and the
    rest of the bound is that of the turn.
    """

    turn: FloatArray
    way: FloatArray | None = None
    rest: FloatArray | None = None

    def joints(self, spread: Callable[[FloatArray], FloatArray]) -> _Turns:
        """Return turn, way and rest of the joints, (6, n), ways (6, n, v), spread over bodies."""
        turn = spread(self.turn[:, :JOINTS].T)
        if self.way is None:
            return turn, None, None
        way = spread(np.moveaxis(self.way[..., :JOINTS], -1, 0))
        rest = turn - np.abs(way) if self.rest is None else spread(self.rest[:, :JOINTS].T)
        return turn, way, rest


class SweepBound:
    """Bounds of the relative motion of pairs of bodies.

    Args:
        arm: the kinematics.
        shapes: shapes (b) in the frames of their links.
        links: (b,) link of each.
        first, second: (p,) bodies of each pair.
        external: the external axes.
    """

    def __init__(
        self,
        arm: Arm,
        shapes: list[Shape],
        links: np.ndarray,
        first: np.ndarray,
        second: np.ndarray,
        external: ExternalAxes,
    ) -> None:
        self._direction, self._point = joint_axes(arm)
        self._external = external
        self._first, self._second = first, second
        self._in_world = np.flatnonzero(links == WORLD_LINK)
        self._parts = np.flatnonzero(links == PART_LINK)
        # for the joints, world and part stand still
        links = np.where(links > LAST_LINK, 0, links)
        self._links = links
        self._centre = np.stack([shape.centre for shape in shapes])
        self._reach = np.array([shape.reach for shape in shapes])
        self._own_radius = np.array(
            [self._radius(shape, int(link)) for shape, link in zip(shapes, links, strict=True)]
        )
        is_second = links[second] > links[first]
        self._body = np.where(is_second, second, first)
        self._base = np.where(is_second, links[first], links[second])
        self._moved = np.argsort(links, kind="stable")[int((links == 0).sum()) :]
        self._place = np.zeros(len(links), dtype=np.int64)
        self._place[self._moved] = np.arange(len(self._moved))
        self._by_base = [
            (int(base), np.flatnonzero((self._base == base) & (links[self._body] > base)))
            for base in np.unique(self._base)
        ]

    def _radius(self, shape: Shape, link: int) -> float:
        """Return the largest distance [m] of a body's vertices from the axis of its own link."""
        if link == 0:
            return 0.0
        offset = shape.mesh.vertices - self._point[link - 1]
        return float(np.linalg.norm(np.cross(offset, self._direction[link - 1]), axis=1).max())

    def of_pairs(self, placed: Placed, sway: Sway) -> FloatArray:
        """Return (p, n) [m]: how much the distance of a pair can change while joints turn.

        Args:
            placed: the bodies in the configuration that the turns are counted from.
            sway: where the joints may go.
        """
        changed = np.zeros((len(self._body), len(placed)))
        if len(self._moved):
            shape = (len(self._moved), len(placed))
            axis, point = self._axes(placed)
            by_base = self._bounds(
                self._moved,
                np.broadcast_to(axis[:, :, None], (JOINTS, 3, *shape)),
                np.broadcast_to(point[:, :, None], (JOINTS, 3, *shape)),
                np.moveaxis(placed.centre[placed.slot[self._moved]], 0, 1),
                sway.joints(lambda rows: np.broadcast_to(rows[:, None], (JOINTS, *shape))),
            )
            for base, pairs in self._by_base:
                changed[pairs] = by_base[base][self._place[self._body[pairs]]]
        if len(self._external):
            outside = self._outside(placed, sway.turn[:, JOINTS:])
            changed += outside[self._first] + outside[self._second]
        return changed

    def of_entries(
        self, frames: Frames, pair: np.ndarray, row: np.ndarray, sway: Sway
    ) -> FloatArray:
        """Return (k,) [m] as ``of_pairs``, for single pairs (k,) at configurations (k,)."""
        changed = np.zeros(len(pair))
        order = np.argsort(self._links[self._body[pair]], kind="stable")
        order = order[self._links[self._body[pair[order]]] > 0]
        if len(order):
            body, rows = self._body[pair[order]], row[order]
            axis, point = self._axes(frames)
            T = frames.link[self._links[body], :, :, rows]
            centre = np.einsum("kij,kj->ik", T[:, :, :3], taken(self._centre, body)) + T[:, :, 3].T
            by_base = self._bounds(
                body,
                axis[:, :, rows, None],
                point[:, :, rows, None],
                centre[:, :, None],
                sway.joints(lambda turn: turn[:, rows].reshape(JOINTS, len(rows), -1)),
            )
            changed[order] = by_base[self._base[pair[order]], np.arange(len(order)), 0]
        if len(self._external):
            outside = self._outside(frames, sway.turn[:, JOINTS:])
            changed += outside[self._first[pair], row] + outside[self._second[pair], row]
        return changed

    def _axes(self, frames: Frames) -> tuple[FloatArray, FloatArray]:
        """Return direction and point (6, 3, n) [m] of the joint axes in robroot."""
        R, p = frames.link[1 : JOINTS + 1, :, :3], frames.link[1 : JOINTS + 1, :, 3]
        axis = np.einsum("lijn,lj->lin", R, self._direction)
        return axis, np.einsum("lijn,lj->lin", R, self._point) + p

    def _bounds(
        self,
        body: np.ndarray,
        axis: FloatArray,
        point: FloatArray,
        centre: FloatArray,
        sway: _Turns,
    ) -> FloatArray:
        """Return (6, b, n) [m]: how far bodies can move as seen from links 0 to 5.

        Args:
            body: (b,) moved bodies in the order of their links.
            axis: (6, 3, b, n) directions of the joint axes.
            point: (6, 3, b, n) a point of each [m].
            centre: (3, b, n) [m] of the bodies' boxes.
            sway: turn, way and rest of the joints (6, b, n); several ways (6, b, v) where n is 1.
        """
        shape = centre.shape[1:]
        turns, ways, rests = sway
        starts = np.searchsorted(self._links[body], np.arange(JOINTS + 1), side="right").tolist()
        reach, own_radius = self._reach[body, None], self._own_radius[body, None]
        result = np.zeros((JOINTS, *shape))
        path = np.zeros(shape)
        course = _Course(shape, shape if ways is None else ways.shape[1:])
        for joint in range(JOINTS - 1, -1, -1):
            tail, own = slice(starts[joint], None), slice(starts[joint], starts[joint + 1])
            u = _cross(axis[joint][:, tail], centre[:, tail] - point[joint][:, tail])
            radius = np.sqrt(np.einsum("ibn,ibn->bn", u, u)) + reach[tail]
            first = radius[: own.stop - own.start]
            np.minimum(first, own_radius[own], out=first)
            turn = turns[joint][tail]
            result[joint] = path
            result[joint][tail] += turn * radius
            if ways is not None and rests is not None:
                here = (axis[joint][:, tail], u, radius)
                course.add(tail, here, turn, ways[joint][tail], rests[joint][tail], path)
                straight = course.bound(tail, reach)
                np.minimum(result[joint][tail], straight, out=result[joint][tail])
            path[tail] += turn * radius
        return result

    def _outside(self, frames: Frames, turn: FloatArray) -> FloatArray:
        """Return (b, n) [m]: how far bodies can move against robroot by external axes."""
        outside = np.zeros((len(self._links), len(frames)))
        R, p = frames.link[PART_LINK, :, :3], frames.link[PART_LINK, :, 3]
        centre = np.einsum("ijn,bj->bin", R, self._centre[self._parts]) + p
        outside[self._in_world], outside[self._parts] = self._external.moves(
            frames.q[:, JOINTS:], turn, centre, self._reach[self._parts]
        )
        return outside


class _Course:
    """Velocity and Taylor's rest of bodies of which one joint after the other turns, 6 first."""

    def __init__(self, shape: tuple[int, ...], ways: tuple[int, ...]) -> None:
        self._velocity, self._spin = np.zeros((3, *ways)), np.zeros((3, *ways))
        self._lever, self._rest = np.zeros(shape), np.zeros(shape)

    def add(
        self,
        tail: slice,
        joint: tuple[FloatArray, FloatArray, FloatArray],
        turn: FloatArray,
        way: FloatArray,
        rest: FloatArray,
        path: FloatArray,
    ) -> None:
        """Let a joint (axis, lever arm, radius) move the bodies ``tail``.

        Those behind it have moved by ``path``; what it may turn beside its way counts in full.
        """
        axis, u, radius = joint
        self._velocity[:, tail] += way * u
        self._spin[:, tail] += way * axis
        grown = turn * (radius + path[tail])
        self._rest[tail] += turn * (self._lever[tail] + 0.5 * grown) + rest * radius
        self._lever[tail] += grown

    def bound(self, tail: slice, reach: FloatArray) -> FloatArray:
        """Return how far any point of the bodies ``tail`` can have moved [m]."""
        speed = np.einsum("ibn,ibn->bn", self._velocity[:, tail], self._velocity[:, tail])
        rate = np.einsum("ibn,ibn->bn", self._spin[:, tail], self._spin[:, tail])
        course: FloatArray = np.sqrt(speed) + np.sqrt(rate) * reach[tail]
        if course.shape != self._rest[tail].shape:
            course = course.max(axis=1, keepdims=True)
        return course + self._rest[tail]


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b of vectors along the first axis."""
    cross = np.empty(np.broadcast_shapes(a.shape, b.shape))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        np.multiply(a[j], b[k], out=cross[i])
        cross[i] -= a[k] * b[j]
    return cross
