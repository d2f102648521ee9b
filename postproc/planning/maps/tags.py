"""Where a plan serves each tag: the move that works there, and where the external axes stand."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell
from postproc.model import Plan
from postproc.planning.route import cell_at


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
