"""Inverse kinematics by damped Newton steps, for arms without a closed form.

A fixed random set of configurations (the atlas) is sorted into the eight branch slots once. For
each pose and slot the entries whose flange lies nearest serve as starts; all starts of all poses
are iterated together. A slot that no start reaches counts as unreachable: unlike the closed form
this is very likely but not certain. Of several solutions with the same three signs (arms with more
than eight) the one found first, a fixed order, is kept.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IntArray, blocks
from postproc.geometry import vee
from postproc.kinematics.branches import Branches, Solver, wrapped
from postproc.kinematics.chain import SerialChain
from postproc.records import dataclass

CHUNK = 512
"""Poses whose starts are chosen at once."""
ATLAS_SIZE = 24_000
"""Configurations in the atlas."""
ROUNDS = (1, 4, 16)
"""Starts tried per slot in each round; later rounds only where nothing was found yet."""
FOUND = 1e-9
"""Largest error [m or rad] of a solution."""
_CONVERGED = 1e-12
_ITERATIONS = 40
_LARGEST_STEP = 0.6
"""Largest change of a joint in one iteration [rad]."""


@dataclass(frozen=True, slots=True)
class DeterminantBranches(Branches):
    """Branch signs of any six-joint arm.

    The wrist's border is where axis 6 is parallel to axis 4, the elbow's where axis 2, axis 3 and
    the origin of joint 5 lie in one plane; what is left of the Jacobian's determinant gives the
    third sign. For arms whose determinant is a product of these three factors (spherical wrists,
    three parallel axes as in UR arms) the signs single out one solution each.
    """

    chain: SerialChain
    elbow_threshold: float = field(init=False)
    wrist_threshold: float = field(init=False)
    size: float = field(init=False)

    def __post_init__(self) -> None:
        """Find the borders from the arm at q = 0."""
        frames = self.chain.link_frames(np.zeros(6))[1:]
        axes = np.einsum("nij,nj->ni", frames[:, :3, :3], self.chain.axes)
        points = frames[:, :3, 3]
        upper = _across(points[2] - points[1], axes[2])
        lower = _across(points[4] - points[2], axes[2])
        stretched = -_signed_angle(upper, lower, axes[2])
        straight = -_signed_angle(_across(axes[3], axes[4]), _across(axes[5], axes[4]), axes[4])
        straight -= np.pi * np.rint(straight / np.pi)
        object.__setattr__(self, "elbow_threshold", float(wrapped(stretched)))
        object.__setattr__(self, "wrist_threshold", float(straight))
        steps = np.linalg.norm(self.chain.placements[:, :3, 3], axis=1)
        object.__setattr__(self, "size", float(steps.sum()))

    def reach(self, q: ArrayLike) -> FloatArray:
        """Return the shoulder's factor (...,) of the Jacobian's determinant, dimensionless."""
        J = self.chain.jacobian(q)
        J[..., :3, :] /= self.size
        bend = np.sin(self.elbow_angle(q)) * np.sin(self.wrist_angle(q))
        bend = np.where(np.abs(bend) < 1e-9, np.copysign(1e-9, bend), bend)
        return np.asarray(np.linalg.det(J) / bend)


@dataclass(frozen=True, slots=True)
class NumericSolver(Solver):
    """Inverse kinematics of any six-joint arm."""

    chain: SerialChain
    branches: DeterminantBranches
    _atlas: list[tuple[FloatArray, FloatArray]] = field(init=False)

    def __post_init__(self) -> None:
        """Fill the atlas: for each slot configurations (k, 6) and features (13, k) of the flange.

        The last feature is minus half the square of the others, so that the product with the
        features of a pose, 1 at the end, is largest where the distance is smallest.
        """
        q = np.random.default_rng(1).uniform(-np.pi, np.pi, (ATLAS_SIZE, 6))
        slot = self.branches.slot(q)
        features = self._features(self.chain.fk(q))
        features[:, 12] = -0.5 * (features[:, :12] ** 2).sum(axis=1)
        atlas = [(q[slot == s], np.ascontiguousarray(features[slot == s].T)) for s in range(8)]
        object.__setattr__(self, "_atlas", atlas)

    def solve(self, T_robroot_flange: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 8, 6) principal values, NaN where not found, and found (n, 8)."""
        count = len(T_robroot_flange)
        q = np.full((count, 8, 6), np.nan)
        for block in blocks(count, CHUNK):
            self._solve_block(T_robroot_flange[block], q[block])
        return q, np.isfinite(q[:, :, 0])

    def solve_in(
        self, T_robroot_flange: FloatArray, slot: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 6) and found (n,) in the branches (n,), as ``solve`` has in the slots."""
        q, valid = self.solve(T_robroot_flange)
        rows = np.arange(len(slot))
        return q[rows, slot], valid[rows, slot]

    def _features(self, T: FloatArray) -> FloatArray:
        """Return position, rotation and 1 (n, 13), the first two scaled to count alike."""
        p = 2.0 * T[:, :3, 3] / self.branches.size
        R = 0.5 * T[:, :3, :3].reshape(-1, 9)
        return np.concatenate([p, R, np.ones((len(T), 1))], axis=1)

    def _solve_block(self, T: FloatArray, q: FloatArray) -> None:
        wanted = self._features(T)
        done = 0
        for starts in ROUNDS:
            missing = ~np.isfinite(q[:, :, 0])
            rows, begin = [], []
            for slot, (known, features) in enumerate(self._atlas):
                which = np.flatnonzero(missing[:, slot])
                if not len(which) or not len(known):
                    continue
                order = _best(wanted[which] @ features, starts)[:, done:]
                rows.append(np.repeat(which, order.shape[1]))
                begin.append(known[order.ravel()])
            if not rows:
                return
            row = np.concatenate(rows).astype(np.int32)
            solution, is_found = newton(self.chain, T[row], np.concatenate(begin))
            self._sort_in(q, row[is_found], solution[is_found])
            done = starts

    def _sort_in(self, q: FloatArray, row: IntArray, solution: FloatArray) -> None:
        """Put solutions into the free slots that their signs name, first come first served."""
        slot = self.branches.slot(solution)
        free = ~np.isfinite(q[row, slot, 0])
        row, slot, solution = row[free], slot[free], solution[free]
        _, first = np.unique(row.astype(np.int64) * 8 + slot, return_index=True)
        q[row[first], slot[first]] = wrapped(solution[first])


@dataclass(frozen=True, slots=True)
class PolishedSolver(Solver):
    """Closed form of the nearest exact arm, brought onto the true one by Newton steps."""

    chain: SerialChain
    nominal: Solver

    def solve(self, T_robroot_flange: FloatArray) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 8, 6) principal values, NaN where not reachable, and valid (n, 8)."""
        q, valid = self.nominal.solve(T_robroot_flange)
        row, slot = np.nonzero(valid)
        for block in blocks(len(row), 4 * CHUNK):
            r, s = row[block], slot[block]
            solution, is_found = newton(self.chain, T_robroot_flange[r], q[r, s])
            q[r, s] = np.where(is_found[:, None], wrapped(solution), np.nan)
            valid[r, s] = is_found
        return q, valid

    def solve_in(
        self, T_robroot_flange: FloatArray, slot: AnyIntArray
    ) -> tuple[FloatArray, BoolArray]:
        """Return q (n, 6) and valid (n,) in the branches (n,), as ``solve`` has in the slots."""
        q, valid = self.nominal.solve_in(T_robroot_flange, slot)
        rows = np.flatnonzero(valid)
        for block in blocks(len(rows), 4 * CHUNK):
            r = rows[block]
            solution, is_found = newton(self.chain, T_robroot_flange[r], q[r])
            q[r] = np.where(is_found[:, None], wrapped(solution), np.nan)
            valid[r] = is_found
        return q, valid


def newton(chain: SerialChain, T: FloatArray, start: FloatArray) -> tuple[FloatArray, BoolArray]:
    """Iterate configurations (m, 6) [rad] towards poses (m, 4, 4) [m]; (m,) met within ``FOUND``.

    Sugihara, Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method, 2011:
    damping by the squared error.
    """
    q = start.copy()
    error = np.full(len(q), np.inf)
    active = np.arange(len(q))
    for iteration in range(_ITERATIONS):
        residual = _residual(chain.fk(q[active]), T[active])
        squared = np.einsum("ni,ni->n", residual, residual)
        error[active] = np.sqrt(squared)
        hopeless = (iteration >= 15) & (squared > 0.05)
        going = (squared > _CONVERGED**2) & ~hopeless
        active, residual, squared = active[going], residual[going], squared[going]
        if not len(active):
            break
        J = chain.jacobian(q[active])
        normal = np.einsum("nki,nkj->nij", J, J)
        normal[:, np.arange(6), np.arange(6)] += (0.5 * squared + 1e-12)[:, None]
        step = np.linalg.solve(normal, np.einsum("nki,nk->ni", J, residual)[..., None])[..., 0]
        largest = np.abs(step).max(axis=1, keepdims=True)
        q[active] += step * np.minimum(1.0, _LARGEST_STEP / np.maximum(largest, 1e-300))
    return q, error < FOUND


def _residual(T: FloatArray, wanted: FloatArray) -> FloatArray:
    """Return what is missing (m, 6): shift [m], then turn as axis times angle [rad]."""
    D = wanted[:, :3, :3] @ np.swapaxes(T[:, :3, :3], 1, 2)
    turn = 0.5 * vee(D)
    sine = np.linalg.norm(turn, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(D, axis1=1, axis2=2) - 1.0))
    factor = np.where(sine > 1e-9, angle / np.maximum(sine, 1e-300), 1.0)
    return np.concatenate([wanted[:, :3, 3] - T[:, :3, 3], turn * factor[:, None]], axis=1)


def _best(score: FloatArray, count: int) -> IntArray:
    """Return the columns (n, count) of the highest scores, best first."""
    count = min(count, score.shape[1])
    if count == 1:
        return np.asarray(np.argmax(score, axis=1)[:, None], dtype=np.int32)
    part = np.argpartition(-score, count - 1, axis=1)[:, :count]
    order = np.argsort(-np.take_along_axis(score, part, axis=1), axis=1, kind="stable")
    return np.asarray(np.take_along_axis(part, order, axis=1), dtype=np.int32)


def _across(vector: FloatArray, axis: FloatArray) -> FloatArray:
    return np.asarray(vector - (vector @ axis) * axis)


def _signed_angle(a: FloatArray, b: FloatArray, axis: FloatArray) -> float:
    """Return the angle [rad] from ``a`` to ``b`` about ``axis``."""
    return float(np.arctan2(np.cross(a, b) @ axis, a @ b))
