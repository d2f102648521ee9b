"""The moves of strokes: arrive above, go to the clearance height, drill by pecks, leave."""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray
from postproc.model import MoveKind, MoveRole
from postproc.planning.states import Chosen, Moves, Problem, Strokes, moves
from postproc.process import FEED_OUT, feeds_of, pecks

ARRIVE = 100
"""Order of the move that arrives at a tag; moves on the way there come before."""
DOWN = 101
"""Order of the move by which the tool comes down to a tag at which a cut begins."""
_CLEAR = 110
_FIRST_PECK = 120
_OUT = 999_999
LEAVE = 1_000_000
_STROKE = (MoveRole.PLUNGE, MoveRole.LIFT, MoveRole.RETRACT)
TOUCH_SPEED = 0.1
"""Speed [m/s] to and from a point that is only touched, where no feed is given."""
PECK_GAP = 0.5e-3
"""After a full lift the tool returns fast to this height [m] above where it stopped drilling."""


def hole_moves(problem: Problem, strokes: Strokes, chosen: Chosen) -> list[Moves]:
    """Return the moves of all tags with a stroke; the one that arrives is a joint move."""
    tags = np.nonzero(strokes.is_stroke & chosen.good)[0]
    if not len(tags):
        return []
    toolpath, rapid = problem.toolpath, problem.cell.motion.rapid_speed
    top = _at(problem, chosen, tags, strokes.top[tags])
    role = np.where(chosen.entry[tags], MoveRole.ENTRY, MoveRole.APPROACH)
    parts = [moves(tags, ARRIVE, MoveKind.PTP, role, top)]
    lower = tags[strokes.clear[tags] < strokes.top[tags] - ROUNDING]
    if len(lower):
        clear = _at(problem, chosen, lower, strokes.clear[lower])
        parts.append(moves(lower, _CLEAR, MoveKind.LIN, MoveRole.APPROACH, clear, rapid))
    feeds = _feeds(problem, tags)
    cycles = np.asarray(toolpath.cycle)[tags]
    for cycle in np.unique(cycles).tolist():
        rows = cycles == cycle
        parts += _pecks(problem, strokes, chosen, tags[rows], feeds[rows], cycle)
    slow = _leaves_with_feed(problem, tags)
    if slow.any():
        clear = _at(problem, chosen, tags[slow], strokes.clear[tags[slow]])
        parts.append(moves(tags[slow], _OUT, MoveKind.LIN, MoveRole.RETRACT, clear, feeds[slow]))
    there = slow & (strokes.clear[tags] >= strokes.top[tags] - ROUNDING)
    T_top, q_top, external = (column[~there] for column in top)
    last = (T_top, q_top, external)
    parts.append(moves(tags[~there], LEAVE, MoveKind.LIN, MoveRole.RETRACT, last, rapid))
    return parts


def step_rows(table: Moves, tag: int, *, standing: bool) -> tuple[int, int] | None:
    """Return the moves before which the steps of a hole come: ahead of it, and behind it.

    Args:
        table: all moves in order.
        tag: of the hole.
        standing: the robot does not feed: the steps ahead come where it stands.
    """
    low, high = np.searchsorted(table.tag, [tag, tag + 1])
    rows = low + np.flatnonzero(np.isin(table.role[low:high], _STROKE))
    if not len(rows):
        return None
    plunge = rows[table.role[rows] == MoveRole.PLUNGE]
    return int(plunge[-1]) + 1 if standing else int(plunge[0]), int(rows[-1]) + 1


def _leaves_with_feed(problem: Problem, tags: IndexArray) -> BoolArray:
    """Return which holes (m,) the tool leaves with the feed that it came with."""
    kinds = [cycle.kind in FEED_OUT for cycle in problem.toolpath.cycles]
    return np.array([*kinds, False])[np.asarray(problem.toolpath.cycle)[tags]]


def _pecks(
    problem: Problem,
    strokes: Strokes,
    chosen: Chosen,
    tags: IndexArray,
    feed: FloatArray,
    number: int,
) -> list[Moves]:
    """Return the plunges and lifts of the holes of one cycle."""
    cycle = problem.toolpath.cycles[number] if number >= 0 else None
    plan = pecks(cycle) if cycle is not None else [(0.0, float(strokes.clear[tags[0]]))]
    dwell = cycle.dwell if cycle is not None else 0.0
    rapid = problem.cell.motion.rapid_speed
    parts = []
    for k, (depth, lift) in enumerate(plan):
        order, last = _FIRST_PECK + 3 * k, k == len(plan) - 1
        bottom = _at(problem, chosen, tags, np.full(len(tags), -depth))
        parts.append(
            moves(tags, order, MoveKind.LIN, MoveRole.PLUNGE, bottom, feed, dwell if last else 0.0)
        )
        if last:
            break
        up = _at(problem, chosen, tags, np.full(len(tags), lift))
        parts.append(moves(tags, order + 1, MoveKind.LIN, MoveRole.LIFT, up, rapid))
        if lift > PECK_GAP - depth:
            back = _at(problem, chosen, tags, np.full(len(tags), PECK_GAP - depth))
            parts.append(moves(tags, order + 2, MoveKind.LIN, MoveRole.LIFT, back, rapid))
    return parts


def _feeds(problem: Problem, tags: IndexArray) -> FloatArray:
    """Return the feed (m,) of strokes [m/s], NaN without."""
    feed = feeds_of(problem.toolpath, problem.cell)[tags]
    touched = (np.asarray(problem.toolpath.cycle)[tags] < 0) & ~np.isfinite(feed)
    return np.where(touched, TOUCH_SPEED, feed)


def _at(
    problem: Problem, chosen: Chosen, tags: IndexArray, height: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return poses, joints and external axes of tags at a height above them."""
    T_base_tcp = problem.placement.tcp(tags, chosen.attitude[tags], height)
    external = problem.placement.external[tags]
    q, _ = problem.solve(T_base_tcp, external, chosen.branch[tags], chosen.q[tags])
    return T_base_tcp, q, external
