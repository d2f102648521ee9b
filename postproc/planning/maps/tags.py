"""Where a plan serves each tag: with which tool, in which base, and where the axes stand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.model import Plan, ToolPath
from postproc.planning.route import cell_at
from postproc.process import claimed
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Place:
    """Tags that one tool serves in one base while the external axes stand still.

    ``cell``: with its external axes as they stand, as one without; ``whole``: the same tool and
    base with the external axes; ``toolpath``: the stretch of all tags with this tool and base,
    ``first`` its first tag of the plan; ``tags`` (k,) indices of the plan.
    """

    cell: Cell
    whole: Cell
    toolpath: ToolPath
    first: int
    tags: IndexArray


def at_places(plan: Plan, cell: Cell, moves: IndexArray) -> Iterator[Place]:
    """Yield the places of a plan, in order; tags that no tool or base claims have none.

    A tag without a move counts to the tag before.

    Args:
        plan: the plan.
        cell: its cell.
        moves: (n,) from ``moves_of_tags``.
    """
    claims = claimed(plan.toolpath, cell)
    axes = axes_of(plan, cell, moves) if cell.external_axes else None
    for stretch in claims.stretches():
        if not stretch.is_claimed:
            continue
        tags = np.arange(stretch.low, stretch.high)
        whole, part = cell.with_tool(stretch.tool, stretch.base), plan.toolpath.rows(tags)
        if axes is None:
            yield Place(whole, whole, part, stretch.low, tags)
            continue
        for values in np.unique(axes[tags], axis=0):
            own = tags[(axes[tags] == values).all(axis=1)]
            yield Place(cell_at(whole, values), whole, part, stretch.low, own)


def axes_of(plan: Plan, cell: Cell, moves: IndexArray) -> FloatArray:
    """Return where the external axes stand (n, k) for each tag [m or rad]."""
    known = moves >= 0
    if not known.any():
        zero = np.array([np.clip(0.0, axis.q_min, axis.q_max) for axis in cell.external_axes])
        return np.tile(zero, (len(moves), 1))
    before = np.maximum.accumulate(np.where(known, np.arange(len(moves)), -1))
    source = np.where(before < 0, int(np.argmax(known)), before)
    return np.asarray(plan.external[moves[source]])
