"""How far corners may be blended: as far as is wished, where all that may come of it is good.

Where the arm may go at an approximated corner is bounded (``kinematics.corners``). The whole of it
must be free of collision and keep off the straight wrist, and at a corner between cuts the tool
point must stay within the tolerance of the cell. Where it does not, the distance is lowered; at
last the corner is exact.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray, stepped
from postproc.geometry import inverse, rotation_angle
from postproc.kinematics import (
    IN_STEP,
    NEARER,
    Corners,
    bound_of,
    corner_miss,
    joint_share,
    within_tolerance,
)
from postproc.model import MoveRole
from postproc.planning.checks import RESOLUTION, Checker, Lines, poses_between
from postproc.planning.route.blends import allowed_blends, evened
from postproc.planning.states import Moves
from postproc.units import MM

_LOWER = 0.25
"""What is left of a distance that was too long."""
_ROUNDS = 4
COARSE = 2.0 * MM
"""Where point and orientation of a corner are not in step, what is not proven free on ways of this
length is not free; the check of the text looks closer."""
SMALLEST = 0.001 * MM
"""A shorter approximation is none: the text cannot say it."""
NEGLIGIBLE = 0.01 * MM
"""Corners of a cut that the tool point passes by no more than this are as good as the path."""


def lowered_blends(
    checker: Checker,
    table: Moves,
    lines: Lines,
    rows: IndexArray,
    blend: FloatArray,
    tolerance: FloatArray,
) -> FloatArray:
    """Return the approximation distances (m,) [m] that are kept.

    Args:
        checker: what collides.
        table: all moves.
        lines: the path moves among them.
        rows: their rows in the table.
        blend: (m,) [m] as far as wished, 0 for an exact stop.
        tolerance: (m,) [m] how far the tool point may pass corners between cuts.
    """
    kept = blend.copy()
    legs = _Legs(checker, table, lines, rows)
    at = np.flatnonzero(kept[:-1] > 0.0)
    cut = table.role == MoveRole.CUT
    at_feed = cut[at] & cut[at + 1]
    feed = at[at_feed]
    kept[feed] = within_tolerance(
        kept[feed], lambda rows, far: legs.miss(feed[rows], far), tolerance[feed]
    )
    kept = evened(kept, allowed_blends(checker.problem, table))
    if checker.scene is not None:
        plain = (legs.miss(feed, kept[feed]) < NEGLIGIBLE) & (legs.turn(feed, kept[feed]) < IN_STEP)
        at = np.setdiff1d(at, feed[plain])
        _free(checker, legs, kept, at, cut)
    return np.where(kept < SMALLEST, 0.0, kept)


def _free(checker: Checker, legs: _Legs, kept: FloatArray, at: IndexArray, cut: np.ndarray) -> None:
    """Lower the distances at moves ``at`` (k,) until the corners are free, in place."""
    assert checker.scene is not None  # noqa: S101 - the caller has asked
    for again in range(_ROUNDS + 1):
        at = at[kept[at] >= SMALLEST]
        if not len(at):
            return
        bound = bound_of(checker.problem.kinematics, legs.corners(at, kept[at]))
        contact = cut[at] & cut[at + 1]
        hits = checker.scene.check_corners(bound, contact, RESOLUTION, COARSE)
        straight = bound.wrist < NEARER * checker.problem.cell.limits.singularity
        bad = bound.lost | straight | hits.hit
        at = at[bad]
        kept[at] = stepped(_LOWER * kept[at]) if again < _ROUNDS else 0.0


class _Legs:
    """The motions before and behind corners of a route."""

    def __init__(self, checker: Checker, table: Moves, lines: Lines, rows: IndexArray) -> None:
        self._problem, self._table, self._lines = checker.problem, table, lines
        self._line = np.full(len(table), -1)
        self._line[rows] = np.arange(len(rows))
        self._length = np.zeros(len(table))
        self._length[rows] = lines.length
        self._tool = np.asarray(checker.problem.cell.tool.T_flange_tcp)

    def miss(self, at: IndexArray, distance: FloatArray) -> FloatArray:
        """Return how far (k,) [m] corners of path moves may be passed, blended by distances."""
        ends = [
            poses_between(self._lines, self._line[move], np.abs(end - self._way(move, distance)))
            for move, end in ((at, 1.0), (at + 1, 0.0))
        ]
        corner = self._table.T_base_tcp[at, :3, 3]
        return corner_miss(ends[0][:, :3, 3], corner, ends[1][:, :3, 3])

    def turn(self, at: IndexArray, distance: FloatArray) -> FloatArray:
        """Return how far (k,) [rad] the tool turns where a corner is blended by distances (k,)."""
        R = self._table.T_base_tcp[:, :3, :3]
        turns = [
            rotation_angle(R[move - 1], R[move]) * self._way(move, distance)
            for move in (at, at + 1)
        ]
        return np.asarray(np.maximum(*turns))

    def _way(self, move: IndexArray, distance: FloatArray) -> FloatArray:
        """Return the share (k,) of path moves on which they may be approximated."""
        return np.asarray(np.minimum(distance / np.maximum(self._length[move], 1e-12), 0.5))

    def corners(self, at: IndexArray, distance: FloatArray) -> Corners:
        """Return the corners at the ends of moves (k,), blended by distances (k,) [m]."""
        table = self._table
        q_corner, T_corner = table.q[at], table.T_base_tcp[at]
        is_path = np.stack([self._line[at] >= 0, self._line[at + 1] >= 0], axis=1)
        ends = [self._end(at, at - 1, distance, 1.0), self._end(at + 1, at + 1, distance, 0.0)]
        T_base = np.stack([ends[0][1], T_corner, ends[1][1]], axis=1)
        middle = np.stack([ends[0][2], ends[1][2]], axis=1)
        external = np.stack([ends[0][3], table.external[at], ends[1][3]], axis=1)
        return Corners(
            np.stack([ends[0][0], q_corner, ends[1][0]], axis=1),
            self._problem.placement.base(external) @ T_base,
            is_path,
            self._tool,
            external,
            middle,
        )

    def _end(
        self, move: IndexArray, far: IndexArray, distance: FloatArray, corner: float
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return where approximation begins or ends on moves.

        Joints, pose, joints half way, external axes.
        """
        table = self._table
        at = move if corner else move - 1
        q, T = table.q[at].copy(), table.T_base_tcp[at].copy()
        middle, external = np.full_like(q, np.nan), table.external[at].copy()
        line = self._line[move]
        joint, path = np.flatnonzero(line < 0), np.flatnonzero(line >= 0)
        kinematics = self._problem.kinematics
        if len(joint):
            q_far, q_corner = table.q[far[joint]], table.q[at[joint]]
            share = joint_share(kinematics, q_far, q_corner, self._tool, distance[joint])
            q[joint] = q_corner + share[:, None] * (q_far - q_corner)
            T_robroot_tcp = kinematics.fk(q[joint]) @ self._tool
            T[joint] = inverse(self._problem.placement.base(external[joint])) @ T_robroot_tcp
        if len(path):
            way = self._way(move[path], distance[path])
            share = np.abs(corner - way)
            T[path] = poses_between(self._lines, line[path], share)
            external[path] = self._lines.external_at(line[path], share)
            q[path] = self._solved(T[path], external[path], at[path])
            bent = np.flatnonzero(table.sweep[move[path]] > 0.0)
            if len(bent):
                half = np.abs(corner - 0.5 * way[bent])
                T_half = poses_between(self._lines, line[path[bent]], half)
                there = self._lines.external_at(line[path[bent]], half)
                middle[path[bent]] = self._solved(T_half, there, at[path[bent]])
        return q, T, middle, external

    def _solved(self, T_base_tcp: FloatArray, external: FloatArray, at: IndexArray) -> FloatArray:
        """Return joints (k, 6) near those of moves ``at``, NaN out of reach."""
        table = self._table
        branch = np.asarray(self._problem.kinematics.slot(table.q[at]), dtype=np.int64)
        q, reached = self._problem.solve(T_base_tcp, external, branch, table.q[at])
        return np.where(reached[:, None], q, np.nan)
