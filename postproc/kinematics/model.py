"""The arm of a cell: forward and inverse kinematics, limits, turns. Vectorised over poses."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import (
    ROUNDING,
    AnyIntArray,
    BoolArray,
    FloatArray,
    IndexArray,
    IntArray,
    numbered,
)
from postproc.errors import KinematicsError
from postproc.kinematics.branches import Branches, MayStand, Solver, wrapped
from postproc.kinematics.chain import SerialChain
from postproc.kinematics.inverse import OpwSolver
from postproc.kinematics.opw import OpwArm, chain_of
from postproc.records import dataclass
from postproc.units import TURN

STRAIGHT_WRIST = 1e-7
"""|A5| [rad] below which ``split_wrist`` treats axes 4 and 6 as one."""


@dataclass(frozen=True, slots=True, eq=False)
class Kinematics:
    """One arm.

    Args:
        chain: forward kinematics.
        solver: inverse kinematics.
        branches: signs of the branch slots.
        q_min: (6,) smallest angles [rad]; q_max: (6,) largest.
        is_closed_form: inverse kinematics is exact and complete; else numeric.
        arm: the ortho-parallel arm behind it, None for any other.
    """

    chain: SerialChain
    solver: Solver
    branches: Branches
    q_min: FloatArray
    q_max: FloatArray
    is_closed_form: bool
    arm: OpwArm | None = None

    def fk(self, q: ArrayLike) -> FloatArray:
        """Return ``T_robroot_flange`` (..., 4, 4) [m] of joint angles (..., 6) [rad]."""
        return self.chain.fk(q)

    def link_frames(self, q: ArrayLike) -> FloatArray:
        """Return (..., 7, 4, 4) [m] in robroot: link 0 (robroot) and links 1..6 at their joints.

        The frames of a built-in arm are parallel to robroot at q = 0 (see ``opw.chain_of`` for
        their places); those of a URDF are the link frames of the file.
        """
        return self.chain.link_frames(q)

    def links_of(self, q: FloatArray) -> FloatArray:
        """Return ``link_frames`` of (n, 6) as (7, 3, 4, n): configurations last, row 4 left out."""
        return self.chain.links_of(q)

    def jacobian(self, q: ArrayLike, p_flange_tcp: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
        """Return (..., 6, 6) of the TCP: rows linear then angular, axes of robroot.

        At joint angles (..., 6) [rad]; ``p_flange_tcp`` (3,): TCP in the flange [m].
        """
        return self.chain.jacobian(q, p_flange_tcp)

    def rates(self, q: ArrayLike, p_flange_tcp: ArrayLike, direction: ArrayLike) -> FloatArray:
        """Return how fast (n, 6) [m/rad] joints move the TCP along directions (n, 3), robroot."""
        return self.chain.rates(q, p_flange_tcp, direction)

    def ik(self, T_robroot_flange: ArrayLike) -> tuple[FloatArray, BoolArray]:
        """Return all branches of each pose (n, 4, 4) or (4, 4) [m]; rotations are orthonormal.

        q (n, 8, 6) [rad]: principal values in [-pi, pi], NaN where not reachable; valid (n, 8):
        reachable, limits not asked. Slot = overhead + 2 elbow + 4 wrist. A pose that holds nan or
        inf is not reachable.
        """
        T = np.asarray(T_robroot_flange, dtype=np.float64).reshape(-1, 4, 4)
        if np.isfinite(T).all():
            return self.solver.solve(T)
        is_number = np.isfinite(T).all(axis=(1, 2))
        q, valid = np.full((len(T), 8, 6), np.nan), np.zeros((len(T), 8), dtype=np.bool_)
        q[is_number], valid[is_number] = self.solver.solve(T[is_number])
        return q, valid

    def ik_in(
        self, T_robroot_flange: FloatArray, slot: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return one branch ``slot`` (n,) of each pose: q (n, 6), valid (n,), as of ``ik``."""
        T = np.asarray(T_robroot_flange, dtype=np.float64)
        if np.isfinite(T).all():
            return self.solver.solve_in(T, slot)
        is_number = np.isfinite(T).all(axis=(1, 2))
        q, valid = np.full((len(T), 6), np.nan), np.zeros(len(T), dtype=np.bool_)
        q[is_number], valid[is_number] = self.solver.solve_in(T[is_number], slot[is_number])
        return q, valid

    def ik_wrists(
        self, T_robroot_flange: FloatArray, arm: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return both wrists of one arm branch of each pose, as ``ik`` gives them.

        ``arm`` (n,) 0..3: branches without their wrist; q (n, 2, 6) and valid (n, 2) in slots
        ``arm`` and ``arm + 4``.
        """
        is_number = np.isfinite(T_robroot_flange).all(axis=(1, 2))
        if is_number.all():
            return self.solver.solve_wrists(T_robroot_flange, arm)
        q, valid = np.full((len(arm), 2, 6), np.nan), np.zeros((len(arm), 2), dtype=np.bool_)
        some = self.solver.solve_wrists(T_robroot_flange[is_number], arm[is_number])
        q[is_number], valid[is_number] = some
        return q, valid

    def ik_where(
        self, T_robroot_flange: FloatArray, may: MayStand
    ) -> tuple[IndexArray, IndexArray, FloatArray, BoolArray]:
        """Return the branches of poses (n, 4, 4) [m] of which every joint may stand where it does.

        ``may``: joint 0..5, its principal values (m,) [rad] -> (m,). Pose (k,), rising, slot (k,),
        rising within a pose, and q (k, 6) [rad] of each; valid (n, 8) as of ``ik``, whether or not
        the joints may stand there.
        """
        is_number = np.isfinite(T_robroot_flange).all(axis=(1, 2))
        if is_number.all():
            return self.solver.solve_where(T_robroot_flange, may)
        valid = np.zeros((len(T_robroot_flange), 8), dtype=np.bool_)
        some = self.solver.solve_where(T_robroot_flange[is_number], may)
        pose, slot, q, valid[is_number] = some
        return np.flatnonzero(is_number)[pose], slot, q, valid

    def slot(self, q: ArrayLike) -> IntArray:
        """Return the branch slot (...,) 0..7 of joint angles (..., 6)."""
        return self.branches.slot(q)

    def nearest(self, q: ArrayLike, q_ref: ArrayLike) -> FloatArray:
        """Return q (..., 6) turned by whole turns to the values nearest to ``q_ref``.

        Among the values inside the limits where there is one, else among all.
        """
        angles = np.asarray(q, dtype=np.float64)
        with np.errstate(invalid="ignore"):
            wanted = np.rint((np.asarray(q_ref, dtype=np.float64) - angles) / TURN)
            low, high = self._turn_range(angles)
            inside = np.minimum(np.maximum(wanted, low), high)
            return np.asarray(angles + TURN * np.where(low <= high, inside, wanted))

    def turns(self, q: ArrayLike) -> tuple[FloatArray, IntArray]:
        """Return every variant of angles (m, 6) [rad] by whole turns that is inside the limits.

        Variants (k, 6), ordered by row, then by turns of A1..A6 upwards; and (k,) the row of ``q``
        each belongs to. A row with a joint that no turn brings inside has none.
        """
        angles = np.asarray(q, dtype=np.float64).reshape(-1, 6)
        rows = np.flatnonzero(np.isfinite(angles).all(axis=1))
        variants = angles[rows]
        for joint in range(6):
            low, high = self._turn_range(variants)
            count = np.maximum(high[:, joint] - low[:, joint] + 1.0, 0.0).astype(np.int64)
            row, step = numbered(count)
            variants, rows = variants[row], rows[row]
            variants[:, joint] += TURN * (low[row, joint] + step)
        return variants, rows.astype(np.int32)

    def within_limits(self, q: ArrayLike, margin: float = 0.0) -> BoolArray:
        """Return (...,) whether all six angles keep ``margin`` [rad] to their limits."""
        angles = np.asarray(q, dtype=np.float64)
        by_joint = np.ascontiguousarray(angles.reshape(-1, 6).T)
        low = (self.q_min + (margin - ROUNDING))[:, None]
        high = (self.q_max - (margin - ROUNDING))[:, None]
        inside = ((by_joint >= low) & (by_joint <= high)).all(axis=0)
        return np.asarray(inside.reshape(angles.shape[:-1]))

    def split_wrist(self, q: ArrayLike, q_ref: ArrayLike) -> FloatArray:
        """Return q (..., 6) with A4 of ``q_ref`` wherever the wrist is straight.

        At A5 = 0 only one combination of A4 and A6 is defined by the pose. There A4 is taken from
        the reference and A6 keeps the pose; A6 takes the turn nearest to the reference. Elsewhere,
        and for an arm without a spherical wrist, q comes back unchanged.
        """
        angles = np.array(q, dtype=np.float64)
        if self.arm is None:
            return angles
        wrist = self.arm.wrist_angle(angles)
        folded = np.abs(wrist) > np.pi / 2.0
        straight = np.abs(np.where(folded, np.abs(wrist) - np.pi, wrist)) < STRAIGHT_WRIST
        if not straight.any():
            return angles
        signs = self.arm.geometry.signs
        reference = np.broadcast_to(np.asarray(q_ref, dtype=np.float64), angles.shape)
        moved = (reference[..., 3] - angles[..., 3]) * signs[3] * signs[5]
        split = angles.copy()
        split[..., 3] = reference[..., 3]
        split[..., 5] += np.where(folded, moved, -moved)
        split[..., 5] = wrapped(split[..., 5])
        split = np.where(straight[..., None], split, angles)
        return np.where(straight[..., None], self.nearest(split, reference), angles)

    def _turn_range(self, q: FloatArray) -> tuple[FloatArray, FloatArray]:
        low = np.ceil((self.q_min - ROUNDING - q) / TURN)
        high = np.floor((self.q_max + ROUNDING - q) / TURN)
        return low, high


def closed_form(arm: OpwArm, q_min: FloatArray, q_max: FloatArray) -> Kinematics:
    """Return the kinematics of an ortho-parallel arm; KIN001 without an upper arm or forearm."""
    if not (arm.geometry.c2 > 0.0 and arm.forearm > 0.0):
        raise KinematicsError("KIN001", "upper arm and forearm need a length above 0")
    return Kinematics(
        chain=chain_of(arm),
        solver=OpwSolver(arm),
        branches=arm,
        q_min=q_min,
        q_max=q_max,
        is_closed_form=True,
        arm=arm,
    )
