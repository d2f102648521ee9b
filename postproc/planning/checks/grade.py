"""Criteria classes of a plan: the margin of every tag to what would stop it.

Judged are the joints of every move that serves a tag: the way to the nearest joint limit beyond
the cell's margin, and the way of the wrist to the straight pose beyond the cell's distance; and how
near solids are where the tool works, beyond the cell's clearance.
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, least_by
from postproc.cell import Cell
from postproc.kinematics import build, wrist_distance
from postproc.model import Plan
from postproc.process import repeated_tags
from postproc.units import DEG

NEAR = 5.0 * DEG
"""A tag with a smaller margin [rad] is acceptable only."""
CLOSE = 1.0 * DEG
"""A tag with a smaller margin [rad] is critical."""


NEAR_BY = 3e-3
"""A tag with less clearance beyond that of the cell [m] is acceptable only."""
CLOSE_BY = 0.5e-3
"""A tag with less clearance beyond that of the cell [m] is critical."""


class Grade(IntEnum):
    """Criteria classes, best first."""

    GOOD = 0
    ACCEPTABLE = 1
    CRITICAL = 2
    INVALID = 3


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
