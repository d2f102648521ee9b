"""How wide corners between moves are rounded: as wished, as tolerances and solids allow."""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray, blocks, stepped
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
from postproc.model import BLEND_SHARE, LEAST_BLEND, MoveKind, MoveRole
from postproc.planning.checks import RESOLUTION, Checker, Lines, poses_between
from postproc.planning.route.working import ARRIVE, DOWN, LEAVE
from postproc.planning.states import Moves, Problem
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
_EXACT = frozenset({MoveRole.ENTRY, MoveRole.PLUNGE, MoveRole.LIFT})
_RUN = 12
"""A longer distance is worth a line of text if so many corners in a row may have it."""
_SHARE = 0.5
"""A corner is not blended less than this share of what it may be for the sake of the others."""


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
        for own in blocks(len(at)):
            _free(checker, legs, kept, at[own], cut)
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
            bent = np.flatnonzero(table.arcs.sweep[move[path]] > 0.0)
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


def allowed_blends(problem: Problem, table: Moves) -> FloatArray:
    """Return how far (m,) [m] the cell, and at its tags the file, let a move be approximated."""
    blend = np.full(len(table), problem.cell.motion.approximation)
    at = (table.order >= ARRIVE) & (table.order < LEAVE)
    at[:-1] &= ~(at[1:] & (table.tag[1:] == table.tag[:-1]))  # the last of them ends at the tag
    asked = np.asarray(problem.toolpath.largest_blend)
    blend[at] = np.fmin(blend[at], asked[table.tag[at]])
    return blend


def wished_blends(
    problem: Problem, table: Moves, length: FloatArray, stops_before: BoolArray
) -> FloatArray:
    """Return the approximation distance (m,) [m] at the end of each move."""
    m = len(table)
    reach = length.copy()
    joint = table.kind == MoveKind.PTP
    step = np.zeros(m)
    step[1:] = np.linalg.norm(np.diff(table.T_base_tcp[:, :3, 3], axis=0), axis=1)
    reach[joint] = step[joint]
    blend = np.minimum(allowed_blends(problem, table), BLEND_SHARE * reach)
    blend[:-1] = np.minimum(blend[:-1], BLEND_SHARE * reach[1:])
    exact = np.isin(table.role, list(_EXACT)) | (table.dwell > 0.0)
    exact[:-1] |= np.isin(table.role[1:], list(_EXACT)) | stops_before[1:]
    exact |= table.order == DOWN
    touching = np.isin(table.role, (MoveRole.CUT, MoveRole.PLUNGE, MoveRole.LIFT))
    exact[:-1] |= touching[:-1] != touching[1:]
    exact[:-1] |= (table.role[:-1] == MoveRole.RETRACT) & (table.role[1:] == MoveRole.RETRACT)
    back = _turns_back(table)
    exact[:-1] |= back
    exact[:-2] |= back[1:] & (table.speed[:-2] != table.speed[1:-1])
    exact[-1:] = True
    blend[exact] = 0.0
    return np.where(blend < LEAST_BLEND, 0.0, blend)


def _turns_back(table: Moves) -> BoolArray:
    """Return (m-1,) whether the path turns back at the end of a move: its depth must be met."""
    begin, end = headings(table)
    size = np.linalg.norm(end, axis=1)
    cosine = np.einsum("ij,ij->i", end[:-1], begin[1:])
    back = cosine < -0.5 * size[:-1] * np.linalg.norm(begin[1:], axis=1)
    path = table.kind != MoveKind.PTP
    return np.asarray(back & path[:-1] & path[1:] & (size[:-1] > ROUNDING))


def headings(table: Moves) -> tuple[FloatArray, FloatArray]:
    """Return the directions (m, 3), of any length, in which moves begin and end."""
    point = table.T_base_tcp[:, :3, 3]
    begin = np.diff(point, axis=0, prepend=point[:1])
    end = begin.copy()
    rows = np.flatnonzero(table.arcs.sweep > 0.0)
    arcs = table.arcs.rows(rows)
    for tangent, at in ((begin, rows - 1), (end, rows)):
        tangent[rows] = np.cross(arcs.normal, point[at] - arcs.centre)
    return begin, end


def evened(blend: FloatArray, wished: float | FloatArray) -> FloatArray:
    """Return distances that few lines of a text can tell: round ones, the same along many corners.

    Args:
        blend: (m,) [m] how far each corner may be blended, 0 for an exact stop.
        wished: one or (m,) [m] the distance where nothing speaks against it.

    Returns:
        (m,) [m] none longer than it may be; 0 stays 0.
    """
    even = np.zeros_like(blend)
    at = np.flatnonzero(blend > 0.0)
    if not len(at):
        return even
    wish = np.broadcast_to(wished, blend.shape)[at]
    most = np.where(blend[at] >= wish, wish, stepped(blend[at]))
    padded = np.append(most, np.full(_RUN - 1, np.inf))
    ahead = sliding_window_view(padded, _RUN).min(axis=1)
    kept, known = [], 0.0
    for own, least in zip(most.tolist(), ahead.tolist(), strict=True):
        if not _SHARE * own <= known <= own:
            known = own
        known = max(known, least)
        kept.append(known)
    even[at] = kept
    return even
