"""Drill cycles whose levels depend on where their holes lie, approaches below them, the spindle.

What the spindle means at each tag: feeds and dwells by turns, hands of taps, cuts at a stand.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan

import numpy as np

from postproc.arrays import ROUNDING, FloatArray, IndexArray, IntArray
from postproc.model import WORKING, Event, EventKind, MotionKind, WordClass
from postproc.process import Stretch, stretches
from postproc.readers.apt.heights import READINGS, ByTurns, doubts, reading, with_levels
from postproc.readers.apt.state import AptState, Tags
from postproc.units import MM

_ABOVE = 0.01 * MM
"""A point so near the hole's axis [m] is above the hole."""


def settle_levels(state: AptState, table: Tags) -> None:
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


def _settle(state: AptState, table: Tags, number: int, rows: IndexArray) -> None:
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


def _leave_out(state: AptState, table: Tags, numbers: list[int]) -> None:
    """Take cycles that no hole has any more out of the table."""
    kept = [i for i in range(len(state.cycles)) if i not in set(numbers)]
    place = np.full(len(state.cycles) + 1, -1, dtype=np.int32)
    place[kept] = np.arange(len(kept))
    table.cycle = place[table.cycle]
    state.cycles = [state.cycles[i] for i in kept]


def check_approaches(state: AptState, table: Tags) -> None:
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


_SWAPPED = "Fusion's post of 2021 writes stop and start of the spindle by hand the wrong way round"


def settle_turns(state: AptState, table: Tags) -> None:
    """Give the holes of every cycle that depends on the spindle the cycle at its speed there."""
    drill = state.drill
    if not drill.turned:
        return
    turns = _last_turns(state, len(table.kind))
    for number, said in sorted(drill.turned.items()):
        rows = np.flatnonzero((table.cycle == number) & (table.kind == MotionKind.HOLE))
        raw, first = state.cycles[number], True
        for speed in np.unique(turns[rows]).tolist():
            here = rows[np.isclose(turns[rows], speed, rtol=0.0, atol=0.0, equal_nan=True)]
            known = abs(speed) > 0.0
            if not known:
                _refuse_unknown(state, number, said)
            cycle = said.at(raw, speed if known else nan)
            cycle = replace(cycle, dwell=0.0 if isnan(cycle.dwell) else cycle.dwell)
            if first:
                state.cycles[number], first = cycle, False
                continue
            drill.heights[len(state.cycles)] = drill.heights[number]
            table.cycle[here] = len(state.cycles)
            state.cycles.append(cycle)


def _refuse_unknown(state: AptState, number: int, said: ByTurns) -> None:
    lines = state.drill.heights[number][2]
    for line in lines:
        if not (isnan(said.feed) and isnan(said.pitch)) and isnan(state.cycles[number].feed):
            reason = "the cycle has a feed per turn, and no spindle speed is known at its holes"
            state.uses.refuse("FEDRAT", WordClass.PROCESS, line, reason)
        if not isnan(said.dwell):
            text = "a dwell in turns without a spindle speed"
            state.uses.refuse("CYCLE/DWELL", WordClass.PROCESS, line, text)


def _last_turns(state: AptState, count: int) -> FloatArray:
    """Return the last speed (n,) [turns/s] that was given before each tag, NaN before any."""
    turns = np.full(count, nan)
    for record in state.events:
        if record.event.kind is EventKind.SPINDLE_ON:
            turns[record.event.index :] = record.event.value
    return turns


def check_standing(
    state: AptState, events: Sequence[Event], kind: IntArray, line: IntArray
) -> None:
    """Refuse cuts while the spindle stands; a file that never names it leaves it to others."""
    starts = [event for event in events if event.kind is EventKind.SPINDLE_ON]
    if not any(event.kind in (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF) for event in events):
        return
    cuts = np.flatnonzero(np.isin(kind, WORKING))
    for part in stretches(events, len(kind)):
        inside = cuts[(cuts >= part.first) & (cuts < part.stop)]
        if not part.is_on and len(inside):
            _refuse_cut(state, part, starts, int(line[inside[0]]))


def _refuse_cut(state: AptState, part: Stretch, starts: Sequence[Event], cut: int) -> None:
    if part.event is None:
        where = starts[0].line if starts else cut
        text = f"the spindle is started only here, a cut comes before it in line {cut}"
        state.uses.refuse("SPINDL", WordClass.PROCESS, where, text)
        return
    hint = _SWAPPED if state.dialect.name == "fusion" else ""
    reason = f"a cut follows in line {cut}, and the spindle stands"
    state.uses.refuse("SPINDL/OFF", WordClass.PROCESS, part.event.line, reason, hint)


def check_resumed(state: AptState, table: Tags) -> None:
    """Refuse CYCLE/ON that brings no cycle back although points follow."""
    drives = np.flatnonzero(table.kind != MotionKind.RAPID)
    for tag, line in state.drill.void:
        later = drives[drives >= tag]
        if len(later) and table.cycle[later[0]] < 0:
            state.uses.refuse(
                "CYCLE/ON", WordClass.GEOMETRY, line,
                "brings back the last cycle, and there is none; its points are read as plain moves",
            )  # fmt: skip
