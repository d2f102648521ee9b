"""How far bodies can move while the joints turn: the bound that no collision slips through.

Let a body hang on link i and look at it from link a < i. Turning joint j by an angle moves every
point x by no more than that angle times its distance from axis j, measured in the configuration
the motion starts from; by the triangle inequality over the product of the turns,

    |x(q + dq) - x(q)| <= sum over j = a+1 .. i of |dq_j| * distance of x from axis j at q.

The distance of two bodies changes by no more than that. Adaptive checks with such bounds are due
to Schwarzer, Saha and Latombe 2005.
"""

from __future__ import annotations

import numpy as np

from postproc.collision.arm import Arm, joint_axes
from postproc.collision.bodies import LAST_LINK
from postproc.collision.cull import Placed
from postproc.collision.external import JOINTS, PART_LINK, WORLD_LINK, ExternalAxes
from postproc.collision.shape import Shape
from postproc.model.arrays import FloatArray


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
        self._reach = np.array([shape.reach for shape in shapes])
        self._own_radius = np.array(
            [self._radius(shape, int(link)) for shape, link in zip(shapes, links, strict=True)]
        )
        is_second = links[second] > links[first]
        self._body = np.where(is_second, second, first)
        self._base = np.where(is_second, links[first], links[second])

    def _radius(self, shape: Shape, link: int) -> float:
        """Return the largest distance [m] of a body's vertices from the axis of its own link."""
        if link == 0:
            return 0.0
        offset = shape.mesh.vertices - self._point[link - 1]
        return float(np.linalg.norm(np.cross(offset, self._direction[link - 1]), axis=1).max())

    def radii(self, placed: Placed) -> FloatArray:
        """Return (b, 6, n) [m]: the farthest any point of a body is from each axis.

        0 for axes that do not move the body.
        """
        radii = np.zeros((len(self._links), 6, len(placed)))
        for joint in range(6):
            R, p = placed.link[joint + 1, :, :3], placed.link[joint + 1, :, 3]
            axis = np.einsum("ijn,j->in", R, self._direction[joint])
            point = np.einsum("ijn,j->in", R, self._point[joint]) + p
            moved = np.flatnonzero(self._links > joint)
            offset = placed.centre[moved] - point
            cross = [
                offset[:, 1] * axis[2] - offset[:, 2] * axis[1],
                offset[:, 2] * axis[0] - offset[:, 0] * axis[2],
                offset[:, 0] * axis[1] - offset[:, 1] * axis[0],
            ]
            square = cross[0] ** 2 + cross[1] ** 2 + cross[2] ** 2
            radii[moved, joint] = np.sqrt(square) + self._reach[moved, None]
            own = np.flatnonzero(self._links == joint + 1)
            radii[own, joint] = np.minimum(radii[own, joint], self._own_radius[own, None])
        return radii

    def of_pairs(self, placed: Placed, turn: FloatArray) -> FloatArray:
        """Return (p, n) [m]: how much the distance of a pair can change while joints turn.

        Args:
            placed: the bodies in the configuration that the turns are counted from.
            turn: (n, 6 + k) largest way of each axis from there [rad or m], not negative.
        """
        steps = self.radii(placed) * turn[:, :JOINTS].T
        # from base link a count joints a+1 .. 6; joints behind the body's own link add nothing
        total = np.cumsum(steps[:, ::-1], axis=1)[:, ::-1]
        total = np.concatenate([total, np.zeros_like(total[:, :1])], axis=1)
        moved: FloatArray = total[self._body, self._base]
        if len(self._external):
            outside = self._outside(placed, turn[:, JOINTS:])
            moved += outside[self._first] + outside[self._second]
        return moved

    def _outside(self, placed: Placed, turn: FloatArray) -> FloatArray:
        """Return (b, n) [m]: how far bodies can move against robroot by external axes."""
        outside = np.zeros((len(self._links), len(placed)))
        outside[self._in_world], outside[self._parts] = self._external.moves(
            placed.q[:, JOINTS:], turn, placed.centre[self._parts], self._reach[self._parts]
        )
        return outside
