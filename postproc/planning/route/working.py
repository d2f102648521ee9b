"""The moves that work: cuts with the ways into and out of them, and the strokes of holes."""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, TINY, BoolArray, FloatArray, IndexArray, numbered
from postproc.cell import ArcMotion
from postproc.errors import PlanError
from postproc.geometry import angle_between, arc_points, arc_poses
from postproc.model import CUTS, Arcs, MotionKind, MoveKind, MoveRole
from postproc.planning.states import Chosen, Moves, Problem, Strokes, moves
from postproc.process import FEED_OUT, feeds_of, pecks
from postproc.units import DEG

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
LARGEST_CIRC = 120.0 * DEG
"""A longer arc is split: the aux point fixes a circle well only when it is far from both ends."""
_CUT = 200
MOST_PIECES = 1_000_000
"""Arcs of a program are cut into no more pieces than this in all."""
_SMALLEST = 1e-4
"""Least angle [rad] of a piece of an arc: at 800 m it stays within a thousandth of a millimetre."""
TILTED_PIECE = 15.0 * DEG
"""Longest piece of an arc on which the tool is tilted: the tilt goes round with the arc, while the
controller turns the tool about one axis from the start to the end of a piece."""


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


def cut_moves(
    problem: Problem, chosen: Chosen, arrives: FloatArray, leaves: FloatArray
) -> list[Moves]:
    """Return the moves of all linear and circular cuts.

    Args:
        problem: what is asked.
        chosen: poses of the tags.
        arrives: (n, 6) joints in which the tool arrives at each tag, above where a cut begins.
        leaves: (n, 6) joints in which the tool leaves each tag.
    """
    kind = np.asarray(problem.toolpath.kind)
    feed = feeds_of(problem.toolpath, problem.cell)
    cuts = np.isin(kind, CUTS) & chosen.good
    entered = np.nonzero(cuts & chosen.entry)[0]
    height = problem.ways_in[entered]
    top = problem.placement.tcp(entered, chosen.attitude[entered], height)
    T = problem.placement.tcp(np.arange(len(chosen.q)), chosen.attitude)
    q, external = chosen.q, problem.placement.external
    there = (top, arrives[entered], external[entered])
    parts = [moves(entered, ARRIVE, MoveKind.PTP, MoveRole.ENTRY, there)]
    down = entered[height > 0.0]
    there = (T[down], q[down], external[down])
    parts.append(moves(down, DOWN, MoveKind.LIN, MoveRole.CUT, there, feed[down]))
    lines = np.nonzero(cuts & ~chosen.entry & (kind == MotionKind.LINEAR))[0]
    there = (T[lines], q[lines], external[lines])
    parts.append(moves(lines, _CUT, MoveKind.LIN, MoveRole.CUT, there, feed[lines]))
    arcs = np.nonzero(cuts & ~chosen.entry & (kind == MotionKind.ARC))[0]
    if len(arcs):
        parts += _arcs(problem, chosen, arcs, T, leaves, feed)
    return parts


def _arcs(
    problem: Problem,
    chosen: Chosen,
    tags: IndexArray,
    T: FloatArray,
    leaves: FloatArray,
    feed: FloatArray,
) -> list[Moves]:
    toolpath = problem.toolpath
    numbers = np.asarray(toolpath.arc)[tags]
    centre, normal = toolpath.arcs.centre[numbers], toolpath.arcs.normal[numbers]
    sweep, radius = toolpath.arcs.sweep[numbers], toolpath.arcs.radius[numbers]
    start, end = T[tags - 1], T[tags]
    rise = np.abs(np.einsum("ij,ij->i", end[:, :3, 3] - start[:, :3, 3], normal))
    axis = problem.placement.axis_base
    turned = angle_between(axis(tags - 1), axis(tags))
    circular = (rise < TINY) & (turned < TINY) & (problem.cell.motion.arcs is ArcMotion.CIRC)
    chord = 2.0 * np.arccos(np.clip(1.0 - problem.cell.motion.chord / radius, -1.0, 1.0))
    widest = np.where(circular, LARGEST_CIRC, np.clip(chord, _SMALLEST, LARGEST_CIRC))
    tilts = tuple(problem.placement.tilts(at, chosen.attitude[at]) for at in (tags - 1, tags))
    tilted = (tilts[0] != 0.0).any(axis=1) | (tilts[1] != 0.0).any(axis=1)
    widest = np.where(tilted, np.minimum(widest, TILTED_PIECE), widest)
    pieces = np.maximum(1, np.ceil(sweep / widest - ROUNDING)).astype(np.int64)
    if pieces.sum() > MOST_PIECES:
        text = f"arcs make {pieces.sum()} pieces, expected at most {MOST_PIECES}"
        raise PlanError("PLN211", text, toolpath.source(int(tags[pieces.argmax()])))
    row, piece = numbered(pieces)
    share = (piece + 1) / pieces[row]
    last = piece == pieces[row] - 1
    poses = arc_poses(
        *(start[row], end[row], centre[row], normal[row], sweep[row], share),
        (tilts[0][row], tilts[1][row]),
    )
    poses[last] = end[row[last]]
    q_from, q_to = leaves[tags - 1][row], chosen.q[tags][row]
    q = q_from + share[:, None] * (q_to - q_from)
    external = problem.placement.external
    external = external[tags - 1][row] + share[:, None] * (external[tags] - external[tags - 1])[row]
    q, _ = problem.solve(poses, external, chosen.branch[tags][row], q)
    q[last] = q_to[last]
    bent = np.where(circular, 1.0, np.nan)[row, None]
    middle = bent * centre[row]
    part = moves(
        tags[row],
        _CUT + piece,
        np.where(circular[row], MoveKind.CIRC, MoveKind.LIN),
        MoveRole.CUT,
        (poses, q, external),
        feed[tags][row],
        arcs=Arcs(
            middle,
            bent * normal[row],
            np.linalg.norm(poses[:, :3, 3] - middle, axis=1),
            np.where(circular, sweep / pieces, 0.0)[row],
        ),
    )
    round_ = np.nonzero(circular[row])[0]
    which = row[round_]
    part.aux[round_] = arc_points(
        start[which][:, :3, 3],
        end[which][:, :3, 3],
        centre[which],
        normal[which],
        sweep[which],
        share[round_] - 0.5 / pieces[which],
    )
    return [part]
