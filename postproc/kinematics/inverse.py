"""Closed-form inverse kinematics of the ortho-parallel arm, all eight branches in fixed slots.

The formulas follow from the same geometry as Brandstoetter et al. 2014 but are arranged so that
each branch is a sign (overhead, elbow, wrist: KUKA's status bits 0, 1, 2), that nothing loses
digits near the straight wrist or the stretched arm, and that sines and cosines are carried
algebraically: 20 arc tangents for all eight branches of a pose.

Degenerate poses keep all their branches:

- wrist centre on axis 1: axis 1 is free, A1 = 0 is returned (180 degrees overhead);
- stretched or folded arm: both elbow slots hold the same angles; poses out of reach by no more
  than rounding (``REACH_TOLERANCE``) count as stretched;
- straight wrist (A5 = 0): only A4 + A6 matters, A4 = 0 is returned (A4 = 180 degrees in the other
  wrist slot) and A6 takes the rest. ``Kinematics.split_wrist`` moves the split to a reference.
"""

from __future__ import annotations

from dataclasses import field
from typing import NamedTuple

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray, blocks
from postproc.kinematics.branches import MayStand, Solver, wrapped
from postproc.kinematics.chain import Columns
from postproc.kinematics.opw import OpwArm
from postproc.records import dataclass

CHUNK = 2048
"""Poses handled at once; (2, 2, CHUNK) intermediates stay in the second-level cache."""
REACH_TOLERANCE = 1e-9
"""Excess of the elbow's cosine over 1 that still counts as the stretched arm."""
ON_AXIS = 1e-9
"""Distance [m] of the wrist centre from axis 1 below which axis 1 counts as free."""
STRAIGHT = 1e-9
"""Sine of the wrist angle below which axes 4 and 6 count as one."""

_ALL = np.array([[1.0], [-1.0]]), np.array([[[-1.0]], [[1.0]]])
"""The signs of all branches as ``OpwSolver._first_three`` takes them."""


class _Pose(NamedTuple):
    """Flange pose in the foot frame by components, each (n,)."""

    r11: FloatArray
    r12: FloatArray
    r13: FloatArray
    r21: FloatArray
    r22: FloatArray
    r23: FloatArray
    r31: FloatArray
    r32: FloatArray
    r33: FloatArray
    x: FloatArray
    y: FloatArray
    z: FloatArray

    @property
    def row_1(self) -> Columns:
        """First row of the rotation."""
        return self.r11, self.r12, self.r13

    @property
    def row_2(self) -> Columns:
        """Second row of the rotation."""
        return self.r21, self.r22, self.r23


class _Arm(NamedTuple):
    """Solution of the first three joints: axis 1 (2, n), the others (2, 2, n) elbow, overhead.

    For one branch of each pose all are (n,).
    """

    cos_1: FloatArray
    sin_1: FloatArray
    theta_2: FloatArray
    theta_3: FloatArray
    cos_23: FloatArray
    sin_23: FloatArray
    reached: BoolArray

    def at(self, first: IndexArray, place: IndexArray) -> _Arm:
        """Return solutions (m,): places in axis 1's entries flattened, and in those of the rest."""
        return _Arm(
            self.cos_1.take(first),
            self.sin_1.take(first),
            self.theta_2.take(place),
            self.theta_3.take(place),
            self.cos_23.take(place),
            self.sin_23.take(place),
            self.reached.take(place),
        )


@dataclass(frozen=True, slots=True)
class OpwSolver(Solver):
    """Inverse kinematics of one arm."""

    arm: OpwArm
    _T_flange_end: FloatArray | None = field(init=False)
    _R_foot_robroot: FloatArray | None = field(init=False)

    def __post_init__(self) -> None:
        """Work out what leads from the flange to the arm as the source draws it; None: nothing."""
        T_flange_end = np.linalg.inv(self.arm.T_end_flange)
        R_foot_robroot = self.arm.T_robroot_foot[:3, :3].T
        for name, turn in (("_T_flange_end", T_flange_end), ("_R_foot_robroot", R_foot_robroot)):
            is_nothing = np.array_equal(turn, np.eye(len(turn)))
            object.__setattr__(self, name, None if is_nothing else turn)

    def solve(self, T_robroot_flange: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return all branches of each pose (n, 4, 4) [m].

        q (n, 8, 6) [rad], principal values in [-pi, pi], NaN where not reachable, and valid (n, 8):
        geometrically reachable, limits not asked.
        """
        count = len(T_robroot_flange)
        q = np.empty((count, 8, 6))
        valid = np.empty((count, 8), dtype=np.bool_)
        for block in blocks(count, CHUNK):
            self._solve_block(self._pose(T_robroot_flange[block]), q[block], valid[block])
        return q, valid

    def solve_in(
        self, T_robroot_flange: FloatArray, slot: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return one branch ``slot`` (n,) of each pose: q (n, 6), valid (n,), as of ``solve``."""
        count = len(T_robroot_flange)
        q = np.empty((count, 6))
        valid = np.empty(count, dtype=np.bool_)
        for block in blocks(count, CHUNK):
            pose, s = self._pose(T_robroot_flange[block]), slot[block]
            arm = self._first_three(pose, *_signs(s))
            wrist = self._wrist(pose, arm)
            is_upper = (s >= 4) != (self.arm.geometry.signs[4] > 0)
            last = (np.where(is_upper, *p) for p in zip(wrist, _flipped(*wrist), strict=True))
            for joint, theta in enumerate(self._arm_joints(arm)):
                q[block, joint] = theta
            for joint, theta in enumerate(last, start=3):
                q[block, joint] = self._signed(joint, theta)
            valid[block] = arm.reached
            q[block][~arm.reached] = np.nan
        return q, valid

    def solve_wrists(
        self, T_robroot_flange: FloatArray, arm: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return both wrists of one arm branch of each pose, as ``solve`` has in its slots.

        ``arm`` (n,) 0..3: the lower bits of the branch; q (n, 2, 6) in slots ``arm`` and
        ``arm + 4``, and valid (n, 2).
        """
        count = len(T_robroot_flange)
        q = np.empty((count, 2, 6))
        valid = np.empty((count, 2), dtype=np.bool_)
        for block in blocks(count, CHUNK):
            pose = self._pose(T_robroot_flange[block])
            solved = self._first_three(pose, *_signs(arm[block]))
            for joint, theta in enumerate(self._arm_joints(solved)):
                q[block, :, joint] = theta[:, None]
            self._write_wrists(pose, solved, q[block].T)
            valid[block] = solved.reached[:, None]
            q[block][~solved.reached] = np.nan
        return q, valid

    def solve_where(
        self, T_robroot_flange: FloatArray, may: MayStand
    ) -> tuple[IndexArray, IndexArray, FloatArray, BoolArray]:
        """Return the branches of poses (n, 4, 4) of which every joint may stand where it does.

        As of ``Solver``; the wrist is solved only where the first three joints may stand.
        """
        valid = np.empty((len(T_robroot_flange), 8), dtype=np.bool_)
        places, found = [np.zeros(0, dtype=np.int64)], [np.zeros((0, 6))]
        for block in blocks(len(valid), CHUNK):
            place, q = self._where(self._pose(T_robroot_flange[block]), may, valid[block])
            places.append(place + 8 * block.start)
            found.append(q)
        pose, slot = np.divmod(np.concatenate(places), 8)
        return pose, slot, np.ascontiguousarray(np.concatenate(found)), valid

    def _where(self, pose: _Pose, may: MayStand, valid: BoolArray) -> tuple[IndexArray, FloatArray]:
        """Return pose times 8 plus slot (k,), rising, and q (k, 6); ``valid`` (n, 8) in place."""
        count = len(pose.x)
        arm = self._first_three(pose, *_ALL)
        valid[:, :4] = valid[:, 4:] = arm.reached.reshape(4, count).T
        joints = self._arm_joints(arm)
        good = arm.reached
        for joint, values in enumerate(joints):
            good = good & may(joint, values)
        row, branch = np.divmod(np.flatnonzero(good.reshape(4, count).T), 4)
        at, side = branch * count + row, (branch & 1) * count + row
        theta = np.empty((6, 2, len(row)))
        for joint, values in enumerate(joints):
            theta[joint] = values.take(at if joint else side)
        self._write_wrists(_Pose(*(entry[row] for entry in pose)), arm.at(side, at), theta)
        may_stand = np.ones(theta.shape[1:], dtype=np.bool_)
        for joint in (3, 4, 5):
            may_stand &= may(joint, theta[joint])
        kept = np.flatnonzero(may_stand)
        place = (row * 8 + branch + np.array([[0], [4]])).ravel()[kept]
        order = np.argsort(place, kind="stable")
        return place[order], theta.reshape(6, -1).take(kept[order], axis=1).T

    def _pose(self, T: FloatArray) -> _Pose:
        """Return the pose of the end in the foot frame by components."""
        if self._T_flange_end is not None:
            T = T @ self._T_flange_end
        entries = np.moveaxis(T[:, :3, :], 0, -1)
        p_foot = self.arm.T_robroot_foot[:3, 3]
        if p_foot.any():
            entries = np.concatenate(
                [entries[:, :3], (entries[:, 3] - p_foot[:, None])[:, None]], 1
            )
        if self._R_foot_robroot is not None:
            entries = np.einsum("ij,jkn->ikn", self._R_foot_robroot, entries)
        e = np.ascontiguousarray(entries)
        return _Pose(*e[0, :3], *e[1, :3], *e[2, :3], *e[:, 3])

    def _solve_block(self, pose: _Pose, q: FloatArray, valid: BoolArray) -> None:
        """Work out all branches of poses, q (n, 8, 6) and valid (n, 8), in place."""
        count = len(pose.x)
        arm = self._first_three(pose, *_ALL)
        theta = np.empty((6, 2, 2, 2, count))  # joint, wrist, elbow, overhead, pose
        for joint, values in enumerate(self._arm_joints(arm)):
            theta[joint] = values
        self._write_wrists(pose, arm, theta)
        for joint in range(6):
            q[:, :, joint] = theta[joint].reshape(8, count).T
        valid[:, :4] = valid[:, 4:] = arm.reached.reshape(4, count).T
        if not valid.all():
            q[~valid] = np.nan

    def _arm_joints(self, arm: _Arm) -> Columns:
        """Return the angles of the first three joints as their axes count them."""
        theta_1 = self._signed(0, np.arctan2(arm.sin_1, arm.cos_1))
        return theta_1, self._signed(1, arm.theta_2), self._signed(2, arm.theta_3)

    def _write_wrists(self, pose: _Pose, arm: _Arm, theta: FloatArray) -> None:
        """Write the angles of the last three joints into theta (6, 2, ...), by wrist slot."""
        upper = self._wrist(pose, arm)
        both = (upper, _flipped(*upper))
        if self.arm.geometry.signs[4] < 0:  # wrist slot 1: A5 below straight
            both = both[::-1]
        for slot, wrist in enumerate(both):
            for joint, values in enumerate(wrist, start=3):
                theta[joint, slot] = self._signed(joint, values)

    def _signed(self, joint: int, theta: FloatArray) -> FloatArray:
        """Return the angles of a joint as its axis counts them."""
        g = self.arm.geometry
        if g.offsets[joint] != 0.0:
            theta = wrapped(theta + g.offsets[joint])
        return theta if g.signs[joint] > 0 else -theta

    def _first_three(self, pose: _Pose, forward: FloatArray, elbow: FloatArray) -> _Arm:
        """Solve the first three joints.

        ``forward``: 1 or -1 overhead; ``elbow``: 1 where A3 stands above the stretched arm, else
        -1; (2, 1) and (2, 1, 1) for all branches, (n,) for one of each pose.
        """
        g, forearm, stretch = self.arm.geometry, self.arm.forearm, self.arm.stretch
        x, y, z = (
            p - g.c4 * r for p, r in zip(pose[9:], (pose.r13, pose.r23, pose.r33), strict=True)
        )
        square = x * x + y * y
        radius_square = square - g.b * g.b
        reach = np.sqrt(np.maximum(radius_square, 0.0))
        side = forward * reach
        free = square < ON_AXIS * ON_AXIS
        over = np.where(free, 1.0, square)
        cos_1 = np.where(free, forward * np.cos(g.offsets[0]), (side * x + g.b * y) / over)
        sin_1 = np.where(free, -forward * np.sin(g.offsets[0]), (side * y - g.b * x) / over)
        u, v = side - g.a1, z - g.c1
        cosine = (u * u + v * v - (g.c2 * g.c2 + forearm * forearm)) / (2.0 * g.c2 * forearm)
        reached = (np.abs(cosine) <= 1.0 + REACH_TOLERANCE) & (
            radius_square >= -REACH_TOLERANCE * REACH_TOLERANCE
        )
        cosine = np.clip(cosine, -1.0, 1.0)
        bend = np.sqrt(1.0 - cosine * cosine)
        sine = elbow * bend * g.signs[2]
        along, across = g.c2 + forearm * cosine, forearm * sine
        sin_2, cos_2 = u * along - v * across, v * along + u * across
        length = np.hypot(along, across)
        squared = np.maximum(length * length, 1e-30)
        turned = cosine * np.cos(stretch) + sine * np.sin(stretch)
        turned_sine = sine * np.cos(stretch) - cosine * np.sin(stretch)
        return _Arm(
            cos_1=cos_1,
            sin_1=sin_1,
            theta_2=np.arctan2(sin_2, cos_2),
            theta_3=np.arctan2(turned_sine, turned),
            cos_23=(cos_2 * turned - sin_2 * turned_sine) / squared,
            sin_23=(sin_2 * turned + cos_2 * turned_sine) / squared,
            reached=np.broadcast_to(reached, sine.shape),
        )

    def _wrist(self, pose: _Pose, arm: _Arm) -> Columns:
        """Solve the last three joints, A5 above straight; in axis 6 the error of axis 4 cancels."""
        c1, s1, c23, s23 = arm.cos_1, arm.sin_1, arm.cos_23, arm.sin_23
        a1, a2, a3 = (c1 * r + s1 * t for r, t in zip(pose.row_1, pose.row_2, strict=True))
        b1, b2, y4 = (c1 * t - s1 * r for r, t in zip(pose.row_1, pose.row_2, strict=True))
        x4 = c23 * a3 - s23 * pose.r33
        sin_5 = np.sqrt(x4 * x4 + y4 * y4)
        cos_5 = s23 * a3 + c23 * pose.r33
        straight = sin_5 < STRAIGHT
        if straight.any():
            fixed = -float(self.arm.geometry.offsets[3])
            x4 = np.where(straight, np.cos(fixed), x4)
            y4 = np.where(straight, np.sin(fixed), y4)
            length = np.where(straight, 1.0, sin_5)
            sin_5 = np.where(straight, 0.0, sin_5)
        else:
            length = sin_5
        c4, s4 = x4 / length, y4 / length
        y6 = c4 * b1 - s4 * (c23 * a1 - s23 * pose.r31)
        x6 = c4 * b2 - s4 * (c23 * a2 - s23 * pose.r32)
        return np.arctan2(s4, c4), np.arctan2(sin_5, cos_5), np.arctan2(y6, x6)


def _signs(branch: AnyIntArray) -> tuple[FloatArray, FloatArray]:
    """Return the signs of branches (n,) as ``OpwSolver._first_three`` takes them."""
    return np.where(branch & 1, -1.0, 1.0), np.where(branch & 2, 1.0, -1.0)


def _flipped(theta_4: FloatArray, theta_5: FloatArray, theta_6: FloatArray) -> Columns:
    """Return the same wrist the other way round."""
    return _half_turned(theta_4), -theta_5, _half_turned(theta_6)


def _half_turned(angle: FloatArray) -> FloatArray:
    """Return the principal angle half a turn away."""
    return np.asarray(angle - np.copysign(np.pi, angle))
