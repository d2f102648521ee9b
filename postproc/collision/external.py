"""External axes: a rail carries the robot past the world, a positioner turns the workpiece.

Seen from robroot, the world and the part are two more links. Configurations carry the positions
of the external axes behind the six joints.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import ExternalAxis
from postproc.geometry import inverse, rotation_about, transform
from postproc.records import dataclass

JOINTS = 6
WORLD_LINK = 7
"""Link number of what stands in the world, where external axes move it against robroot."""
PART_LINK = 8
"""Link number of the workpiece there."""


@dataclass(frozen=True, slots=True)
class ExternalAxes:
    """The external axes of a cell in its order; none: world and part stand still.

    A positioner carries those that come behind it.

    ``T_world_robroot`` (4, 4) is where the robot stands with all axes at 0.
    """

    axes: tuple[ExternalAxis, ...]
    T_world_robroot: FloatArray

    def __len__(self) -> int:
        """Return the number of axes."""
        return len(self.axes)

    def frames(self, values: FloatArray) -> FloatArray:
        """Return (n, 2, 4, 4): world and part in robroot for positions (n, k) [m or rad].

        The part's frame is the world's with the positioners at 0.
        """
        T_robroot_world = self._world(values)
        T_world_part = np.broadcast_to(np.eye(4), T_robroot_world.shape)
        for column, axis in enumerate(self.axes):
            if axis.kind != "rail":
                T_world_part = T_world_part @ _turn(axis, values[:, column])
        return np.stack([T_robroot_world, T_robroot_world @ T_world_part], axis=1)

    def _world(self, values: FloatArray) -> FloatArray:
        p = np.broadcast_to(self.T_world_robroot[:3, 3], (len(values), 3))
        for column, axis in enumerate(self.axes):
            if axis.kind == "rail":
                p = p + values[:, column, None] * axis.axis
        return inverse(transform(self.T_world_robroot[:3, :3], p))

    def moves(
        self, values: FloatArray, turn: FloatArray, centre: FloatArray, reach: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Return how far what stands in the world (n,) and parts (b, n) can move against robroot.

        The same bound as for the joints (``sweep``), with the axes where they are at ``values``.

        Args:
            values: (n, k) positions the motion is counted from [m or rad].
            turn: (n, k) largest way of each axis from there, not negative.
            centre: (b, 3, n) centres of the parts in robroot [m].
            reach: (b,) farthest point of each from its centre [m].
        """
        slide = np.zeros(len(values))
        swing = np.zeros((len(centre), len(values)))
        T_robroot_axis = self._world(values)
        for column, axis in enumerate(self.axes):
            if axis.kind == "rail":
                slide += turn[:, column]
                continue
            direction = (T_robroot_axis[:, :3, :3] @ axis.axis).T
            origin = (T_robroot_axis @ axis.T_world_axis[:, 3])[:, :3].T
            offset = centre - origin
            along = np.einsum("bin,in->bn", offset, direction)
            off_axis = np.linalg.norm(offset - along[:, None] * direction, axis=1)
            swing += turn[:, column] * (off_axis + reach[:, None])
            T_robroot_axis = T_robroot_axis @ _turn(axis, values[:, column])
        return slide, slide + swing


def _turn(axis: ExternalAxis, angle: FloatArray) -> FloatArray:
    """Return (n, 4, 4), the turn of a positioner about its axis."""
    origin = axis.T_world_axis[:3, 3]
    R = rotation_about(axis.axis, angle)
    return transform(R, origin - R @ origin)
