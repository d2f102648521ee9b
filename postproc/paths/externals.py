"""External axes: a rail carries the robot, a positioner turns the workpiece."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, forward_filled
from postproc.cell import Cell, ExternalAxis
from postproc.geometry import inverse, rotation_about, transform
from postproc.records import dataclass
from postproc.units import DEG, MM


@dataclass(frozen=True, slots=True)
class Externals:
    """The external axes of a cell in its order: a positioner carries those that come behind it.

    Bases are fixed to the world or, with a positioner, to its table (a mathematically coupled
    base), so a base in robroot moves with the axes.
    """

    axes: tuple[ExternalAxis, ...]
    T_world_robroot: FloatArray

    @classmethod
    def of(cls, cell: Cell) -> Externals:
        """Return the external axes of a cell."""
        return cls(cell.external_axes, np.asarray(cell.robot.T_world_robroot))

    def __bool__(self) -> bool:
        """Whether there is any."""
        return bool(self.axes)

    def values(self, written: FloatArray) -> FloatArray:
        """Return positions (m, k) [m or rad] from E1..E6 as written (m, 6) [mm or deg].

        An axis that a motion does not name keeps its last position; before the first it is 0.
        """
        columns = []
        for axis in self.axes:
            unit = MM if axis.kind == "rail" else DEG
            columns.append(forward_filled(written[:, int(axis.name[1]) - 1] * unit))
        return np.stack(columns, axis=1) if columns else np.zeros((len(written), 0))

    def shift(self, values: FloatArray) -> FloatArray:
        """Return (n, 4, 4) so that T_robroot_base(values) = shift @ T_robroot_base(0)."""
        turned = np.broadcast_to(np.eye(4), (len(values), 4, 4))
        for column, axis in enumerate(self.axes):
            if axis.kind != "rail":
                origin = axis.T_world_axis[:3, 3]
                R = rotation_about(axis.axis, values[:, column])
                turned = turned @ transform(R, origin - R @ origin)
        T: FloatArray = inverse(self.robroot(values)) @ turned @ self.T_world_robroot
        return T

    def robroot(self, values: FloatArray) -> FloatArray:
        """Return where the rails carry the robot: T_world_robroot (n, 4, 4)."""
        T = np.broadcast_to(self.T_world_robroot, (len(values), 4, 4))
        for column, axis in enumerate(self.axes):
            if axis.kind == "rail":
                T = transform(np.eye(3), values[:, column, None] * axis.axis) @ T
        return T

    def at(self, cell: Cell, values: FloatArray) -> Cell:
        """Return the cell as it stands with the axes at ``values`` (k,)."""
        shift = self.shift(values[None])[0]
        robot = replace(cell.robot, T_world_robroot=self.robroot(values[None])[0])
        return replace(cell.rebased(lambda T: shift @ T), robot=robot)
