"""Drill cycles whose levels depend on where their holes lie, and approaches below them."""

from __future__ import annotations

from math import isnan
from typing import Protocol

import numpy as np

from postproc.arrays import ROUNDING, FloatArray, IndexArray, IntArray
from postproc.model import MotionKind, WordClass
from postproc.readers.apt.heights import READINGS, doubts, reading, with_levels
from postproc.readers.apt.state import AptState
from postproc.units import MM

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
    become heights above it.
    """
    open_ones = [i for i, (heights, _, _) in state.drill.heights.items() if heights.needs_level]
    for number in sorted(state.drill.heights):
        rows = np.flatnonzero((table.cycle == number) & (table.kind == MotionKind.HOLE))
        if len(rows) and number in open_ones:
            _settle(state, table, number, rows)
        elif len(rows):
            feed, ends = state.drill.heights[number][0].above(0.0)
            cycle = state.cycles[number]
            levels = (cycle.clearance, cycle.retract) if isnan(feed) else (feed, ends)
            _show(state, number, levels, float(table.points[rows[0]] @ table.axes[rows[0]]))
    check_approaches(state, table)
    _leave_out(state, table, open_ones)


def _settle(state: AptState, table: HoleTable, number: int, rows: IndexArray) -> None:
    """Settle the levels of the holes ``rows`` (m,) of one cycle."""
    heights, word, lines = state.drill.heights[number]
    if heights.rule.goto_bottom:
        table.points[rows] += heights.depth * table.axes[rows]
    top = np.einsum("ni,ni->n", table.points[rows], table.axes[rows])
    _, one, of_row = np.unique(np.round(top / ROUNDING), return_index=True, return_inverse=True)
    for i in np.argsort(one).tolist():
        level = float(top[one[i]])
        feed, ends = heights.above(level)
        if i == of_row[0] or min(feed, ends) < 0.0:
            _show(state, number, (feed, ends), level)
        cycle = with_levels(state.cycles[number], feed, ends)
        known = state.drill.index.setdefault(repr(cycle), len(state.cycles))
        if known == len(state.cycles):
            state.cycles.append(cycle)
            state.drill.heights[known] = heights, word, lines
        table.cycle[rows[of_row == i]] = known


def _show(state: AptState, number: int, levels: tuple[float, float], top: float) -> None:
    """Ask a doubtful reading of a cycle back, and note one that no real file has proven."""
    cycle = state.cycles[number]
    _, word, lines = state.drill.heights[number]
    text = reading(cycle, *levels, top)
    doubt = doubts(cycle, *levels)
    for line in lines:
        if doubt and (state.options.cycle_words is None or min(levels) < 0.0):
            what = f"{', '.join(doubt)}: {text}"
            state.uses.refuse(word, WordClass.GEOMETRY, line, what, READINGS)
        elif not state.dialect.cycle_rule.proven:
            state.uses.note(word, WordClass.PROCESS, line, text, READINGS)


def _leave_out(state: AptState, table: HoleTable, numbers: list[int]) -> None:
    """Take cycles that no hole has any more out of the table."""
    kept = [i for i in range(len(state.cycles)) if i not in set(numbers)]
    place = np.full(len(state.cycles) + 1, -1, dtype=np.int32)
    place[kept] = np.arange(len(kept))
    table.cycle = place[table.cycle]
    state.cycles = [state.cycles[i] for i in kept]


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
        _, word, lines = state.drill.heights[int(table.cycle[row])]
        state.uses.refuse(
            word, WordClass.GEOMETRY, lines[0],
            f"the tool stands {height / MM:g} mm above the hole before it, lower than the feed is "
            f"to begin, {cycle.clearance / MM:g} mm", READINGS,
        )  # fmt: skip
