"""Where a plan works, how near solids are there, and the margin class of every tag.

Judged are the joints of every move that serves a tag: the way to the nearest joint limit beyond the
cell's margin, and the way of the wrist to the straight pose beyond the cell's distance; and how
near solids are where the tool works, beyond the cell's clearance.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from postproc.arrays import TINY, BoolArray, FloatArray, IndexArray, IntArray, least_by
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.kinematics import build, wrist_distance
from postproc.model import MoveRole, Plan
from postproc.process import in_the_cut, repeated_tags, repeats
from postproc.units import DEG

_WORKING = (MoveRole.CUT, MoveRole.PLUNGE)

NEAR = 5.0 * DEG
"""A tag with a smaller margin [rad] is acceptable only."""
CLOSE = 1.0 * DEG
"""A tag with a smaller margin [rad] is critical."""


NEAR_BY = 3e-3
"""A tag with less clearance beyond that of the cell [m] is acceptable only."""
CLOSE_BY = 0.5e-3
"""A tag with less clearance beyond that of the cell [m] is critical."""
_NEAR_SOLIDS = 0.01
_BEYOND = 2.0 * NEAR_BY


class Grade(IntEnum):
    """Criteria classes, best first."""

    GOOD = 0
    ACCEPTABLE = 1
    CRITICAL = 2
    INVALID = 3


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
    near = np.argsort(-np.round(np.linalg.norm(off, axis=1) / TINY), kind="stable")
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


def grades(result: Plan, cell: Cell) -> IntArray:
    """Return the ``Grade`` (n,) of every tag of a plan; invalid: fails, or is not run.

    A repeated tag stands as the one that it repeats.

    Args:
        result: the plan.
        cell: its cell; margins count from ``[limits]``.
    """
    kinematics = build(cell.robot)
    q = result.q
    margin = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min(axis=1, initial=np.inf)
    margin = np.minimum(
        margin - cell.limits.joint_margin, wrist_distance(kinematics, q) - cell.limits.singularity
    )
    served = result.tag >= 0
    least = least_by(margin[served], result.tag[served], len(result.toolpath))
    least = _passed(least, result.left_out)
    runs = np.isfinite(least)
    failing = result.failing_tags
    runs[failing[failing >= 0]] = False
    first = repeated_tags(result.toolpath)
    least, runs = least[first], runs[first]
    grade = np.full(len(least), Grade.INVALID, dtype=np.int32)
    grade[runs] = Grade.GOOD
    spare = np.where(np.isnan(result.clearance), np.inf, result.clearance) - cell.limits.clearance
    grade[runs & ((least < NEAR) | (spare < NEAR_BY))] = Grade.ACCEPTABLE
    grade[runs & ((least < CLOSE) | (spare < CLOSE_BY))] = Grade.CRITICAL
    return grade


def _passed(least: FloatArray, left_out: BoolArray) -> FloatArray:
    """Return margins (n,) in which tags left out have the smaller one of the two beside them."""
    known = np.flatnonzero(~left_out)
    tags = np.flatnonzero(left_out)
    place = np.searchsorted(known, tags)
    least = least.copy()
    least[tags] = np.minimum(least[known[place - 1]], least[known[place]])
    return least


def grade_counts(result: Plan, cell: Cell) -> dict[str, int]:
    """Return how many tags of a plan stand in each class, by its name."""
    count = np.bincount(grades(result, cell), minlength=len(Grade)).tolist()
    return {grade.name.lower(): count[grade] for grade in Grade}
