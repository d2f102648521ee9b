"""Long straight cuts in pieces, so that a compensated path is right between its ends as well.

The arm gives way by another amount in the middle of a long line than at its ends; a line that is
right at both ends is bent in between. It gets as many points as keep the bend within tolerance.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, IntArray, numbered
from postproc.cell import Cell
from postproc.geometry import inverse, line_poses, rotation_angle
from postproc.kinematics import Kinematics
from postproc.model import MoveKind, MoveRole, Plan
from postproc.units import DEG, MM

SAMPLE_STEP = 20.0 * MM
SAMPLE_ANGLE = 1.0 * DEG
"""A line is sampled in steps no longer than ``SAMPLE_STEP`` [m], in which the tool turns by no more
than ``SAMPLE_ANGLE`` [rad]; lines below both stay whole."""
SHORTEST = 1.0 * MM
"""No piece [m] is much shorter."""
MOST = 256
"""Pieces of one line at most."""
BLEND_SHARE = 0.4
"""Share of a piece that a blend may take at one end."""

DisplacementOf = Callable[[FloatArray, IntArray, FloatArray], FloatArray]
"""Joint angles (n, 6), moves (n,) and places on them 0..1 (n,) to the displacement (n, 3) [m] of
the real tool."""


def in_pieces(
    plan: Plan,
    cell: Cell,
    kinematics: Kinematics,
    displacement: DisplacementOf,
    tolerance: float,
    step: float = SAMPLE_STEP,
) -> Plan:
    """Return a plan with straight cuts divided where the real tool would leave the line.

    ``tolerance``: largest bend [m] of a piece; ``step``: way [m] between samples of a line.
    """
    way = np.zeros(len(plan))
    way[1:] = np.linalg.norm(np.diff(plan.T_base_tcp[:, :3, 3], axis=0), axis=1)
    turn = np.zeros(len(plan))
    R = plan.T_base_tcp[:, :3, :3]
    turn[1:] = rotation_angle(R[:-1], R[1:])
    steps = np.maximum(way / step, turn / SAMPLE_ANGLE)
    is_cut = (np.asarray(plan.kind) == MoveKind.LIN) & (np.asarray(plan.role) == MoveRole.CUT)
    long = np.flatnonzero(is_cut & (steps > 1.0) & (way > SHORTEST))
    if not len(long):
        return plan
    samples = np.minimum(steps[long], np.maximum(way[long] / SHORTEST, 2.0))
    samples = np.minimum(2 ** np.ceil(np.log2(samples)).astype(np.int64), MOST)
    _, q, reached = _between(plan, cell, kinematics, long, samples)
    which, number = numbered(samples)
    share = (number + 1.0) / samples[which]
    moved = displacement(q, np.repeat(long, samples).astype(np.int32), share)
    pieces = np.ones(len(plan), dtype=np.int64)
    first = np.cumsum(samples) - samples
    start = np.zeros(len(long))
    at_start = displacement(np.asarray(plan.q)[long - 1], long.astype(np.int32), start)
    for row, move in enumerate(long.tolist()):
        own = slice(int(first[row]), int(first[row] + samples[row]))
        if reached[own].all():
            pieces[move] = _needed(np.vstack([at_start[row], moved[own]]), tolerance)
    if not bool((pieces > 1).any()):
        return plan
    return _divided(plan, cell, kinematics, pieces)


def _needed(moved: FloatArray, tolerance: float) -> int:
    """Return the least pieces, a power of two, between which ``moved`` (k + 1, 3) is straight."""
    samples = len(moved) - 1
    at = np.arange(samples + 1)
    pieces = 1
    while pieces < samples:
        knots = at[:: samples // pieces]
        straight = np.stack([np.interp(at, knots, column[knots]) for column in moved.T], axis=1)
        if float(np.linalg.norm(moved - straight, axis=1).max()) <= tolerance:
            break
        pieces *= 2
    return pieces


def _between(
    plan: Plan, cell: Cell, kinematics: Kinematics, moves: AnyIntArray, pieces: AnyIntArray
) -> tuple[FloatArray, FloatArray, np.ndarray]:
    """Return T_base_tcp (n, 4, 4) and q (n, 6) at the ends of pieces of moves, and if reached."""
    which, number = numbered(pieces)
    row, share = moves[which], (number + 1.0) / pieces[which]
    T_start, T_end = plan.T_base_tcp[row - 1], plan.T_base_tcp[row]
    T = line_poses(T_start, T_end, share)
    q_end = np.asarray(plan.q)[row]
    T_flange_tcp = cell.tcp_of(plan.tool_of_moves[row])
    T_robroot_base = kinematics.fk(q_end) @ T_flange_tcp @ inverse(T_end)
    slots, valid = kinematics.ik(T_robroot_base @ T @ inverse(T_flange_tcp))
    slot = kinematics.slot(q_end)
    near = np.asarray(plan.q)[row - 1]
    near = near + share[:, None] * (q_end - near)
    rows = np.arange(len(row))
    q = kinematics.split_wrist(kinematics.nearest(slots[rows, slot], near), near)
    last = share >= 1.0
    q, T = np.where(last[:, None], q_end, q), np.where(last[:, None, None], T_end, T)
    reached = valid[rows, slot] | last
    return T, np.where(reached[:, None], q, q_end), reached


def _divided(plan: Plan, cell: Cell, kinematics: Kinematics, pieces: AnyIntArray) -> Plan:
    """Return the plan with each move in so many pieces (m,)."""
    row = np.repeat(np.arange(len(plan)), pieces)
    is_last = np.r_[row[1:] != row[:-1], True]
    split = np.flatnonzero(pieces > 1)
    new = np.flatnonzero(pieces[row] > 1)
    T, q = np.array(plan.T_base_tcp)[row], np.array(plan.q)[row]
    T[new], q[new], _ = _between(plan, cell, kinematics, split, pieces[split])
    length = np.full(len(row), np.inf)
    length[1:] = np.where(
        pieces[row[1:]] > 1, np.linalg.norm(np.diff(T[:, :3, 3], axis=0), axis=1), np.inf
    )
    most = BLEND_SHARE * np.minimum(length, np.r_[length[1:], np.inf])
    blend = np.where(is_last, np.asarray(plan.blend)[row], cell.motion.approximation)
    return replace(
        plan.rows(row),
        T_base_tcp=T,
        q=q,
        blend=np.minimum(blend, most),
        dwell=np.where(is_last, np.asarray(plan.dwell)[row], 0.0),
        duration=(np.asarray(plan.duration) / pieces)[row],
    )
