"""How far corners may be blended by what the moves are, and even along them.

A drill stroke, the start and the end of contact, where a cut that was left is entered again, a wait
and a cusp are exact; no distance takes more than its share of a neighbouring move.
"""

from __future__ import annotations

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from postproc.arrays import ROUNDING, BoolArray, FloatArray, stepped
from postproc.model import BLEND_SHARE, LEAST_BLEND, MoveKind, MoveRole
from postproc.planning.route.drill import ARRIVE, DOWN, LEAVE
from postproc.planning.states import Moves, Problem

_EXACT = frozenset({MoveRole.ENTRY, MoveRole.PLUNGE, MoveRole.LIFT})
_RUN = 12
"""A longer distance is worth a line of text if so many corners in a row may have it."""
_SHARE = 0.5
"""A corner is not blended less than this share of what it may be for the sake of the others."""


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
    rows = np.flatnonzero(table.sweep > 0.0)
    for tangent, at in ((begin, rows - 1), (end, rows)):
        tangent[rows] = np.cross(table.normal[rows], point[at] - table.centre[rows])
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
