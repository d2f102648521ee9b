"""Where a plan works: the move of each tag, and how near solids are there."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.model import MoveRole, Plan
from postproc.planning.checks.grade import NEAR_BY
from postproc.process import in_the_cut, repeats

_NEAR_SOLIDS = 0.01
_BEYOND = 2.0 * NEAR_BY
_SAME_PLACE = 1e-6
_WORKING = (MoveRole.CUT, MoveRole.PLUNGE)


def near_solids(cell: Cell) -> float:
    """Return the clearance [m] beyond which none is told: near solids matter, far ones cost time.

    More than what the margins of tags ask for beyond the clearance of the cell.
    """
    return max(_NEAR_SOLIDS, cell.limits.clearance + _BEYOND)


def moves_of_tags(plan: Plan) -> IndexArray:
    """Return for each tag (n,) the last move that works at it, else the nearest to it, else -1.

    A tag that nothing works at is a rapid; the move home behind it counts as its move, too.
    """
    last = np.full(len(plan.toolpath), -1)
    rows = np.flatnonzero(plan.tag >= 0)
    off = plan.T_base_tcp[rows, :3, 3] - plan.toolpath.points[plan.tag[rows]]
    near = np.argsort(-np.round(np.linalg.norm(off, axis=1) / _SAME_PLACE), kind="stable")
    working = np.isin(plan.role[rows], _WORKING)
    for some in (rows[near], rows[working]):
        last[plan.tag[some]] = some
    for tag in np.flatnonzero(repeats(plan.toolpath)):  # planned with the tag before
        last[tag] = max(last[tag], last[tag - 1])
    left = np.flatnonzero(plan.left_out)  # passed by the move to the next tag that has one
    own = np.flatnonzero(~plan.left_out)
    last[left] = last[own[np.searchsorted(own, left)]]
    return last


def tag_clearances(plan: Plan, scene: Scene, most: float) -> tuple[FloatArray, IndexArray]:
    """Return the smallest distance (n,) [m] where the tool works at each tag, and its pair (n,).

    ``most`` [m], as ``near_solids`` says, and -1 where nothing is that near; NaN without a move
    that ends there.
    """
    moves = moves_of_tags(plan)
    found, pair = np.full(len(moves), np.nan), np.full(len(moves), -1)
    tags = np.flatnonzero((moves >= 0) & ~plan.left_out)
    if len(tags):
        rows = moves[tags]
        contact = np.isin(plan.role[rows], _WORKING) | in_the_cut(plan.toolpath)[tags]
        poses = np.hstack([plan.q, plan.external])[rows]
        found[tags], pair[tags] = scene.nearest(poses, contact, most)
    return found, pair
