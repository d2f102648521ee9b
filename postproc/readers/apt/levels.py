"""Drill cycles whose levels depend on where their holes lie, and approaches below them."""

from __future__ import annotations

from typing import Protocol

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.model import MotionKind, WordClass
from postproc.readers.apt.cycle import show
from postproc.readers.apt.heights import with_levels
from postproc.readers.apt.state import AptState
from postproc.units import MM

_ROUNDING = 1e-9
"""Holes whose tops differ by less [m] have the same cycle."""
_ABOVE = 0.01 * MM
"""A point so near the hole's axis [m] is above the hole."""


class HoleTable(Protocol):
    """Tags in columns of length n, as in ``ToolPath``."""

    points: FloatArray
    axes: FloatArray
    kind: IntArray
    cycle: IntArray


def settle_levels(state: AptState, table: HoleTable) -> None:
    """Put each hole's tag at its top, and give it a cycle with the levels of its place.

    Where a seat's GOTO is the bottom of the hole, the tag moves up by the depth; absolute levels
    become heights above it. Cycles that no hole uses keep their place in the table.
    """
    for number, (heights, word, line) in sorted(state.drill.heights.items()):
        rows = np.flatnonzero((table.cycle == number) & (table.kind == MotionKind.HOLE))
        if not heights.needs_level or len(rows) == 0:
            continue
        if heights.rule.goto_bottom:
            table.points[rows] += heights.depth * table.axes[rows]
        top = np.einsum("ni,ni->n", table.points[rows], table.axes[rows])
        _, one, of_row = np.unique(
            np.round(top / _ROUNDING), return_index=True, return_inverse=True
        )
        first = int(of_row[0])
        for i, level in enumerate(top[one].tolist()):
            feed, ends = heights.above(level)
            if i == first or min(feed, ends) < 0.0:
                show(state, state.cycles[number], feed, ends, word, line, level)
            cycle = with_levels(state.cycles[number], feed, ends)
            known = state.drill.index.setdefault(repr(cycle), len(state.cycles))
            if known == len(state.cycles):
                state.cycles.append(cycle)
            table.cycle[rows[of_row == i]] = known


def check_approaches(state: AptState, table: HoleTable) -> None:
    """Ask a cycle back whose first hole is approached from below the level where feed begins.

    Only a point right above the hole tells: where the tool comes from elsewhere it may be lower.
    """
    first = np.flatnonzero((table.cycle[1:] >= 0) & (table.cycle[:-1] < 0)) + 1
    for row in first.tolist():
        axis = table.axes[row]
        step = table.points[row - 1] - table.points[row]
        height = float(step @ axis)
        cycle = state.cycles[table.cycle[row]]
        beside = float(np.linalg.norm(step - height * axis))
        if beside > _ABOVE or not -cycle.depth - _ABOVE <= height < cycle.clearance - _ABOVE:
            continue
        if height <= _ABOVE:
            continue
        _, word, line = state.drill.heights.get(int(table.cycle[row]), (None, "CYCLE", 1))
        state.uses.refuse(
            word, WordClass.GEOMETRY, line,
            f"the tool stands {height / MM:g} mm above the hole before it, lower than the feed is "
            f"to begin, {cycle.clearance / MM:g} mm", "--dialect or --cycle-words",
        )  # fmt: skip
