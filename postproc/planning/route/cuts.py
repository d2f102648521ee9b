"""The moves of cuts: lines stay lines, arcs become circular moves where the controller can."""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, TINY, FloatArray, IndexArray, numbered
from postproc.cell import ArcMotion
from postproc.errors import PlanError
from postproc.geometry import angle_between, arc_points, arc_poses
from postproc.model import CUTS, MotionKind, MoveKind, MoveRole
from postproc.planning.route.drill import ARRIVE, DOWN
from postproc.planning.states import Chosen, Moves, Problem, moves
from postproc.process import feeds_of
from postproc.units import DEG

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
    part = moves(
        tags[row],
        _CUT + piece,
        np.where(circular[row], MoveKind.CIRC, MoveKind.LIN),
        MoveRole.CUT,
        (poses, q, external),
        feed[tags][row],
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
    part.sweep[round_] = sweep[which] / pieces[which]
    part.centre[round_], part.normal[round_] = centre[which], normal[which]
    return [part]
