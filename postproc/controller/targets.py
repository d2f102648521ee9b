"""Where a motion goes: complete, partial and relative targets, and where the robot stands now."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.controller.recorder import Numbers
from postproc.controller.runtime import UNKNOWN, Point, matrix_of, point_with, pose_of
from postproc.controller.state import MotionState
from postproc.geometry import inverse
from postproc.kinematics import Kinematics
from postproc.krl import Axes, Pose
from postproc.units import DEG


class Targets:
    """Turns literals into targets and remembers the last one.

    ``joints_now`` returns the joints (6,) [rad] where the last motion ends, for relative joint
    motions behind a Cartesian one; None if they cannot be found.
    """

    def __init__(
        self,
        state: MotionState,
        kinematics: Kinematics,
        joints_now: Callable[[], FloatArray | None],
    ) -> None:
        self._state = state
        self._kinematics = kinematics
        self._joints_now = joints_now
        self._last: Pose | Axes | None = None
        self._then = state.values

    def remember(self, target: Pose | Axes) -> None:
        """Note a target that the robot has been sent to, with the frames in force."""
        self._last, self._then = target, self._state.values

    @property
    def _T_robroot_base(self) -> FloatArray:
        """(4, 4) base of the last target [m]."""
        return self._state.base_frames.rows[self._then.base]

    @property
    def _T_flange_tcp(self) -> FloatArray:
        """(4, 4) tool of the last target [m]."""
        return self._state.tool_frames.rows[self._then.tool]

    def complete(self, target: Any) -> Pose | Axes | None:  # noqa: ANN401 - a KRL value
        """Return a target with its missing components filled from the last; None if unknown."""
        if isinstance(target, Pose):
            return target if target.is_complete else self._filled_pose(target)
        if isinstance(target, Axes):
            return target if target.is_complete else self._filled_axes(target)
        return None

    def shifted(self, shift: Any, frame: str) -> Pose | Axes | None:  # noqa: ANN401
        """Return the target of a relative motion; None if it cannot be known."""
        if isinstance(shift, Axes):
            now = self.axes_now()
            if now is None:
                return None
            moved = [a + (b or 0.0) for a, b in zip(now, shift.six, strict=True)]
            return point_with(moved, shift)
        if not isinstance(shift, Pose):
            return None
        T_base_tcp = self.pose_now()
        if T_base_tcp is None:
            return None
        T = matrix_of(shift)
        if frame == "TOOL":
            return pose_of(T_base_tcp @ T)
        moved_T = T_base_tcp.copy()
        moved_T[:3, 3] += T[:3, 3]
        moved_T[:3, :3] = T[:3, :3] @ T_base_tcp[:3, :3]
        return pose_of(moved_T)

    def pose_now(self) -> FloatArray | None:
        """Return T_base_tcp (4, 4) [m] where the robot stands, in the frames in force."""
        if self._last is None:
            return None
        if isinstance(self._last, Axes):
            q = np.array(self._last.six, dtype=np.float64) * DEG
            T_robroot_flange = self._kinematics.fk(q)
        else:
            same = (
                self._T_robroot_base is self._state.T_robroot_base
                and self._T_flange_tcp is self._state.T_flange_tcp
            )
            if same:
                return matrix_of(self._last)
            T_robroot_tcp = self._T_robroot_base @ matrix_of(self._last)
            T_robroot_flange = T_robroot_tcp @ inverse(self._T_flange_tcp)
        T: FloatArray = (
            inverse(self._state.T_robroot_base) @ T_robroot_flange @ self._state.T_flange_tcp
        )
        return T

    def axes_now(self) -> tuple[float, ...] | None:
        """Return A1..A6 [deg] where the robot stands, None if not known."""
        if isinstance(self._last, Axes):
            return tuple(float(a or 0.0) for a in self._last.six)
        q = self._joints_now() if self._last is not None else None
        return None if q is None else tuple((q / DEG).tolist())

    def position(self, name: str) -> Any:  # noqa: ANN401 - Pose, Axes or UNKNOWN
        """Return ``$POS_ACT`` or ``$AXIS_ACT``."""
        if name.startswith("$POS"):
            T = self.pose_now()
            return UNKNOWN if T is None else pose_of(T)
        axes = self.axes_now()
        return UNKNOWN if axes is None else point_with(axes, Axes())

    def _filled_pose(self, target: Pose) -> Pose | None:
        T = self.pose_now()
        if T is None:
            return None
        here = pose_of(T)
        if isinstance(self._last, Pose) and self._T_robroot_base is self._state.T_robroot_base:
            here = self._last  # the numbers as written, without a round trip
        return _filled(target, here.six)

    def _filled_axes(self, target: Axes) -> Axes | None:
        now = self.axes_now()
        return None if now is None else _filled(target, now)


def numbers_of(target: Pose | Axes) -> Numbers:
    """Return the six numbers of a complete target, NaN for what is missing."""
    return tuple(math.nan if v is None else v for v in target.six)  # type: ignore[return-value]


def _filled(target: Point, here: Sequence[float | None]) -> Point:
    """Return a target whose missing numbers are those of where the robot stands."""
    values = [b if a is None else a for a, b in zip(target.six, here, strict=True)]
    return point_with(values, target)
