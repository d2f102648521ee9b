"""The tags around one, planned anew while all others stay: what an edit does, at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import IndexArray
from postproc.cell import Cell
from postproc.model import Plan
from postproc.planning.checks import moves_of_tags
from postproc.planning.planner import plan as plan_tags
from postproc.planning.states import HELD
from postproc.process import claimed

_FREE = 6
"""So many tags on either side may turn, ..."""
_KEPT = 2
"""... and so many beyond them stay as they are."""


def replanned(plan: Plan, cell: Cell, tag: int) -> tuple[Plan, IndexArray]:
    """Return the plan of the tags around one, and which tags (t,) they are.

    The planner itself plans them; those at both ends hold the poses that they have. The whole
    plan with the same pins may still differ: it weighs all tags together.

    Args:
        plan: of all tags.
        cell: its cell, with the pins and the places that are to count.
        tag: the one that was edited.
    """
    parts = claimed(plan.toolpath, cell).stretches()
    part = next(part for part in parts if part.low <= tag < part.high)
    tags = np.arange(max(part.low, tag - _FREE - _KEPT), min(part.high, tag + _FREE + _KEPT + 1))
    moves = moves_of_tags(plan)[tags]
    column = np.full((len(tags), 15), np.nan)
    held = np.flatnonzero((moves >= 0) & (np.abs(tags - tag) > _FREE))
    column[held, :9] = plan.T_base_tcp[moves[held], :3, :3].reshape(-1, 9)
    column[held, 9:] = plan.q[moves[held]]
    path = plan.toolpath.named().rows(tags)
    return plan_tags(replace(path, extra={**path.extra, HELD: column}), cell), tags
