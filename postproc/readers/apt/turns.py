"""What the spindle means at each tag: feeds and dwells by turns, hands of taps, cuts at a stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import isnan, nan
from typing import Protocol

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.model import WORKING, Event, EventKind, MotionKind, WordClass
from postproc.process import Stretch, stretches
from postproc.readers.apt.byturns import ByTurns
from postproc.readers.apt.state import AptState

_SWAPPED = "Fusion's post of 2021 writes stop and start of the spindle by hand the wrong way round"


class HoleTable(Protocol):
    """Tags in columns of length n, as in ``ToolPath``."""

    kind: IntArray
    cycle: IntArray


def settle_turns(state: AptState, table: HoleTable) -> None:
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
            state.uses.refuse(
                "FEDRAT", WordClass.PROCESS, line,
                "the cycle has a feed per turn, and no spindle speed is known at its holes",
            )  # fmt: skip
        if not isnan(said.dwell):
            state.uses.refuse(
                "CYCLE/DWELL", WordClass.PROCESS, line, "a dwell in turns without a spindle speed"
            )


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
    """Refuse cuts while the spindle stands; a file that never names it leaves it to others.

    Args:
        state: takes the words.
        events: of the whole file, in order.
        kind: (n,) of the tags.
        line: (n,) of the tags.
    """
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
        state.uses.refuse(
            "SPINDL", WordClass.PROCESS, where,
            f"the spindle is started only here, a cut comes before it in line {cut}",
        )  # fmt: skip
        return
    hint = _SWAPPED if state.dialect.name == "fusion" else ""
    state.uses.refuse(
        "SPINDL/OFF", WordClass.PROCESS, part.event.line,
        f"a cut follows in line {cut}, and the spindle stands", hint,
    )  # fmt: skip


def check_resumed(state: AptState, table: HoleTable) -> None:
    """Refuse CYCLE/ON that brings no cycle back although points follow."""
    drives = np.flatnonzero(table.kind != MotionKind.RAPID)
    for tag, line in state.drill.void:
        later = drives[drives >= tag]
        if len(later) and table.cycle[later[0]] < 0:
            state.uses.refuse(
                "CYCLE/ON", WordClass.GEOMETRY, line,
                "brings back the last cycle, and there is none; its points are read as plain moves",
            )  # fmt: skip
