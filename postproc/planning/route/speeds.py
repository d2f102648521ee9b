"""Speeds, blends and estimated times of moves in order."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.errors import Finding, Severity
from postproc.model import MoveKind, MoveRole
from postproc.planning.checks import Checker, Lines, Reason, Verdict, failure
from postproc.planning.states import Moves, Problem
from postproc.timing import (
    ORIENTATION_SPEED,
    PATH_ACCELERATION,
    axis_speed_cap,
    chain_profile,
    joint_move_time,
    line_time,
)
from postproc.units import MM_PER_MIN

SLOWEST = 1e-5
"""Path speed [m/s] below which a cut is not possible: 0.6 mm/min."""
USABLE = 0.95
"""Share of an axis' speed that cuts may use: between samples it may be a little faster."""
BLEND_SHARE = 0.45
"""Largest share of a neighbouring move that blending may take."""
AXIS_SHARE = 0.98
"""Share of an axis's speed that a path may need: between samples it may need a little more."""
_EXACT = frozenset({MoveRole.ENTRY, MoveRole.PLUNGE, MoveRole.LIFT})
_SHORT = 1e-9


@dataclass(slots=True)
class Timed:
    """Columns (m,) of moves: path speed [m/s], share of axis speed, blend [m], time [s], feed kept.

    ``cap``: the largest path speed that the axes allow on the move [m/s].
    """

    speed: FloatArray
    fraction: FloatArray
    blend: FloatArray
    duration: FloatArray
    cap: FloatArray


def timed(
    checker: Checker, table: Moves, stops_before: BoolArray, findings: list[Finding]
) -> Timed:
    """Return speeds that the axes can follow, blends, and times.

    A cut without a feed, and a motion too fast for an axis at any speed, are findings.
    """
    problem = checker.problem
    is_path = table.kind != MoveKind.PTP
    is_path[:1] = False
    rows = np.nonzero(is_path)[0]
    lines = _lines(table, rows, _branches(problem, table))
    length = np.zeros(len(table))
    length[rows] = lines.length
    cap = np.full(len(table), np.inf)
    cap[rows] = _caps(checker, lines)
    speed = _capped(problem, table, rows, cap, findings)
    blend = _blends(problem, table, length, stops_before)
    fraction = np.where(is_path, np.nan, problem.cell.motion.rapid)
    duration = _durations(problem, table, length, np.minimum(speed, cap), blend)
    return Timed(np.where(is_path, speed, np.nan), fraction, blend, duration, cap)


def _lines(table: Moves, rows: IndexArray, branch: IndexArray) -> Lines:
    return Lines(
        T_from=table.T_base_tcp[rows - 1],
        T_to=table.T_base_tcp[rows],
        q_from=table.q[rows - 1],
        q_to=table.q[rows],
        branch=branch[rows],
        contact=np.ones(len(rows), dtype=np.bool_),
        centre=table.centre[rows],
        normal=table.normal[rows],
        radius=np.linalg.norm(table.T_base_tcp[rows, :3, 3] - table.centre[rows], axis=1),
        sweep=table.sweep[rows],
    )


def _branches(problem: Problem, table: Moves) -> IndexArray:
    return np.asarray(problem.kinematics.slot(table.q), dtype=np.int64)


def _caps(checker: Checker, lines: Lines) -> FloatArray:
    """Return the largest path speed (m,) at which no axis exceeds its speed on the way."""
    cap = np.full(len(lines), np.inf)
    if not len(lines):
        return cap
    track = checker.track(lines, Verdict.clean(len(lines)))
    same = track.row[1:] == track.row[:-1]
    row = track.row[1:][same]
    piece = (np.diff(track.share)[same]) * lines.length[row]
    dq = np.diff(track.q, axis=0)[same]
    speed = np.asarray(checker.problem.cell.robot.qd_max)
    cap_of_piece = axis_speed_cap(dq, np.maximum(piece, _SHORT), speed * USABLE)
    np.minimum.at(cap, row, cap_of_piece)
    return np.where(lines.length > _SHORT, AXIS_SHARE * cap, np.inf)


def _capped(
    problem: Problem, table: Moves, rows: IndexArray, cap: FloatArray, findings: list[Finding]
) -> FloatArray:
    """Return the speeds with those lowered that an axis cannot follow, with a finding each."""
    speed = table.speed.copy()
    missing = rows[~np.isfinite(speed[rows])]
    for tag in np.unique(table.tag[missing]).tolist():
        findings.append(
            Finding(
                Severity.ERROR,
                "PLN205",
                "this cut has no feed: neither the input nor the cell gives one",
                tag,
                problem.toolpath.source(tag),
                hint="give [motion] feed_mm_min in the cell file",
            )
        )
    speed[missing] = np.inf
    fast = rows[np.isfinite(speed[rows]) & (speed[rows] > cap[rows] * (1.0 + 1e-9))]
    for row in fast.tolist():
        tag = int(table.tag[row])
        if cap[row] < SLOWEST:
            findings.append(failure(problem, tag, Reason.SPEED, _too_slow(problem, table, row)))
        elif table.role[row] in (MoveRole.CUT, MoveRole.PLUNGE):
            findings.append(_slower(problem, tag, speed[row], cap[row]))
    speed[fast] = cap[fast]
    return np.where(np.isfinite(speed), speed, SLOWEST)


def _too_slow(problem: Problem, table: Moves, row: int) -> str:
    change = np.abs(table.q[row] - table.q[row - 1]) / np.asarray(problem.cell.robot.qd_max)
    return f"A{int(np.argmax(change)) + 1} cannot follow the path at any useful speed"


def _slower(problem: Problem, tag: int, asked: float, allowed: float) -> Finding:
    return Finding(
        Severity.WARNING,
        "PLN301",
        f"feed lowered from {asked / MM_PER_MIN:.0f} to {allowed / MM_PER_MIN:.0f} mm/min: "
        "an axis is at its largest speed",
        tag,
        problem.toolpath.source(tag),
    )


def _blends(
    problem: Problem, table: Moves, length: FloatArray, stops_before: BoolArray
) -> FloatArray:
    """Return the approximation distance (m,) [m] at the end of each move."""
    m = len(table)
    blend = np.full(m, problem.cell.motion.approximation)
    reach = length.copy()
    joint = table.kind == MoveKind.PTP
    step = np.zeros(m)
    step[1:] = np.linalg.norm(np.diff(table.T_base_tcp[:, :3, 3], axis=0), axis=1)
    reach[joint] = step[joint]
    blend = np.minimum(blend, BLEND_SHARE * reach)
    blend[:-1] = np.minimum(blend[:-1], BLEND_SHARE * reach[1:])
    exact = np.isin(table.role, list(_EXACT)) | (table.dwell > 0.0)
    exact[:-1] |= np.isin(table.role[1:], list(_EXACT)) | stops_before[1:]
    touching = np.isin(table.role, (MoveRole.CUT, MoveRole.PLUNGE, MoveRole.LIFT))
    exact[:-1] |= touching[:-1] != touching[1:]
    exact[:-1] |= _turns_back(table)
    exact[-1:] = True
    blend[exact] = 0.0
    return np.where(blend < 1e-6, 0.0, blend)


def _turns_back(table: Moves) -> BoolArray:
    """Return (m-1,) whether the path turns back at the end of a move: its depth must be met."""
    way = np.zeros((len(table), 3))
    way[1:] = np.diff(table.T_base_tcp[:, :3, 3], axis=0)
    straight = table.kind == MoveKind.LIN
    size = np.linalg.norm(way, axis=1)
    cosine = np.einsum("ij,ij->i", way[:-1], way[1:])
    back = cosine < -0.5 * size[:-1] * size[1:]
    return np.asarray(back & straight[:-1] & straight[1:] & (size[:-1] > _SHORT))


def _durations(
    problem: Problem, table: Moves, length: FloatArray, speed: FloatArray, blend: FloatArray
) -> FloatArray:
    """Return the estimated time (m,) [s] of each move, without its dwell."""
    robot = problem.cell.robot
    duration = np.zeros(len(table))
    joint = np.nonzero(table.kind == MoveKind.PTP)[0]
    later = joint[joint > 0]
    duration[later] = joint_move_time(
        table.q[later - 1],
        table.q[later],
        np.asarray(robot.qd_max) * problem.cell.motion.rapid,
        robot.qdd_max,
    )
    path = (table.kind != MoveKind.PTP) & (np.arange(len(table)) > 0)
    stop = (blend == 0.0) | ~path
    stop[:-1] |= ~path[1:]
    starts = path & np.concatenate([[True], stop[:-1]])
    alone = np.nonzero(starts & stop)[0]
    duration[alone] = line_time(length[alone], np.maximum(speed[alone], SLOWEST))
    group = np.cumsum(starts)
    chained = np.nonzero(path & ~(starts & stop))[0]
    for low, high in _runs(group[chained]):
        rows = chained[low:high]
        way = np.concatenate([[0.0], np.cumsum(length[rows])])
        cap = np.maximum(speed[rows], SLOWEST)
        duration[rows] = chain_profile(way, cap, PATH_ACCELERATION).duration
    turned = np.zeros(len(table))
    turned[1:] = np.abs(np.diff(table.q[:, :], axis=0)).max(axis=1) / ORIENTATION_SPEED
    return np.where(path & (length <= _SHORT), np.maximum(duration, turned), duration)


def _runs(labels: IndexArray) -> list[tuple[int, int]]:
    """Return the stretches [low, high) of equal labels."""
    if not len(labels):
        return []
    edges = np.nonzero(np.diff(labels))[0] + 1
    bounds = [0, *edges.tolist(), len(labels)]
    return list(itertools.pairwise(bounds))
