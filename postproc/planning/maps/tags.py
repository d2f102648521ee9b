"""Where a plan serves each tag: the move that works there, and where the external axes stand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.model import MotionKind, MoveRole, Plan
from postproc.planning.route import cell_at
from postproc.process import repeats

FARTHEST = 0.1
"""Clearances beyond this [m] are given as this: near solids matter, and far ones cost time."""
_SAME_PLACE = 1e-6


def moves_of_tags(plan: Plan) -> IndexArray:
    """Return for each tag (n,) the last move that works at it, else the nearest to it, else -1.

    A tag that nothing works at is a rapid; the move home behind it counts as its move, too.
    """
    last = np.full(len(plan.toolpath), -1)
    rows = np.flatnonzero(plan.tag >= 0)
    off = plan.T_base_tcp[rows, :3, 3] - plan.toolpath.points[plan.tag[rows]]
    near = np.argsort(-np.round(np.linalg.norm(off, axis=1) / _SAME_PLACE), kind="stable")
    working = np.isin(plan.role[rows], (MoveRole.CUT, MoveRole.PLUNGE))
    for some in (rows[near], rows[working]):
        last[plan.tag[some]] = some
    for tag in np.flatnonzero(repeats(plan.toolpath)):  # planned with the tag before
        last[tag] = max(last[tag], last[tag - 1])
    return last


def at_places(plan: Plan, cell: Cell, moves: IndexArray) -> Iterator[tuple[Cell, IndexArray]]:
    """Yield the cell as its external axes stand, and the tags that are served while they do.

    A tag without a move counts to the tag before.

    Args:
        plan: the plan.
        cell: its cell.
        moves: (n,) from ``moves_of_tags``.
    """
    if not cell.external_axes:
        yield cell, np.arange(len(moves))
        return
    places = _places(plan, cell, moves)
    for place in np.unique(places, axis=0):
        yield cell_at(cell, place), np.flatnonzero((places == place).all(axis=1))


def _places(plan: Plan, cell: Cell, moves: IndexArray) -> FloatArray:
    """Return where the external axes stand (n, k) for each tag [m or rad]."""
    known = moves >= 0
    if not known.any():
        zero = np.array([np.clip(0.0, axis.q_min, axis.q_max) for axis in cell.external_axes])
        return np.tile(zero, (len(moves), 1))
    before = np.maximum.accumulate(np.where(known, np.arange(len(moves)), -1))
    source = np.where(before < 0, int(np.argmax(known)), before)
    return np.asarray(plan.external[moves[source]])


def tag_clearances(plan: Plan, moves: IndexArray, scene: Scene) -> FloatArray:
    """Return the smallest distance (n,) [m] at each tag, ``FARTHEST`` at most; NaN without a move.

    All are NaN where nothing is near anywhere. What the plan has measured is taken from it.
    """
    if np.isfinite(plan.clearance).any():
        return np.minimum(plan.clearance, FARTHEST)
    result = np.full(len(moves), np.nan)
    known = np.flatnonzero(moves >= 0)
    if len(known):
        contact = plan.toolpath.kind[known] != MotionKind.RAPID
        poses = np.hstack([plan.q, plan.external])[moves[known]]
        result[known] = scene.clearance(poses, contact, FARTHEST)
    return result if (result < FARTHEST).any() else np.full(len(moves), np.nan)
