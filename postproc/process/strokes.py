"""How holes are made: pecks, the way out, and what the spindle does at the bottom."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.cell import Cell
from postproc.model import ORIENT, Cycle, CycleKind, Event, EventKind, MotionKind, ToolPath
from postproc.process.spindle import OTHERS, turns_at

TAPS = frozenset({CycleKind.TAP, CycleKind.TAP_LEFT, CycleKind.RIGID_TAP, CycleKind.RIGID_TAP_LEFT})
FEED_OUT = TAPS | {CycleKind.REAM, CycleKind.BORE}
"""What leaves the hole with the feed, up to the height where the feed began."""
_STANDS_OUT = frozenset({CycleKind.BORE, CycleKind.BORE_RAPID})
"""What leaves the hole with a spindle that stands."""
_ORIENTS = str(EventKind.SPINDLE_ORIENT)
CHIP_LIFT = 1e-3
"""How far [m] the tool lifts to break the chip."""
LEAST_PECK = 1e-6
"""A peck as small as this [m] is lost in the digits of a program: it is none."""
MOST_PECKS = 1000
"""More pecks in one hole are a slip of the digits."""


def peck_count(cycle: Cycle) -> int:
    """Return how often a cycle drills to make one hole."""
    first, step = cycle.peck_first or cycle.peck, cycle.peck or cycle.peck_first
    if step <= 0.0 or cycle.depth <= 0.0:
        return 1
    return 1 + math.ceil(max(cycle.depth - first - LEAST_PECK, 0.0) / step)


def pecks(cycle: Cycle, chip: float = CHIP_LIFT) -> list[tuple[float, float]]:
    """Return the pecks of a cycle: (depth to drill to, height to lift to) [m, m].

    Depths count below the tag, heights above it (a height may be negative: chip breaking lifts by
    ``chip`` only). The last peck drills to the cycle's depth; its height is the clearance.
    """
    first = cycle.peck_first or cycle.peck
    step = cycle.peck or first
    if step <= 0.0 or cycle.depth <= 0.0:
        return [(cycle.depth, cycle.clearance)]
    if peck_count(cycle) > MOST_PECKS:
        raise ValueError(f"{peck_count(cycle)} pecks in one hole: not refused beforehand")
    depths = []
    depth = first
    while depth < cycle.depth - LEAST_PECK:
        depths.append(depth)
        depth += step
    depths.append(cycle.depth)
    lifts = [chip - d if cycle.break_chip else cycle.clearance for d in depths[:-1]]
    return list(zip(depths, [*lifts, cycle.clearance], strict=True))


def with_orientation(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath without the refusal of what a routine of the cell does.

    That is a spindle that stands at an angle at the bottom of a bore, where its speed is known.
    """
    asked = [i for i, cycle in enumerate(toolpath.cycles) if math.isfinite(cycle.orient)]
    if not asked or _ORIENTS not in cell.krl.hooks or cell.process.unit_feeds:
        return toolpath
    rows = np.flatnonzero((toolpath.kind == MotionKind.HOLE) & np.isin(toolpath.cycle, asked))
    kinds = {toolpath.cycles[i].kind for i in toolpath.cycle[rows].tolist()}
    if not kinds <= _STANDS_OUT or not (np.abs(turns_at(toolpath)[rows]) > 0.0).all():
        return toolpath
    uses = tuple(
        replace(use, refused=False, reason=f"{use.reason}: {cell.krl.hooks[_ORIENTS]} does it")
        if use.word == ORIENT
        else use
        for use in toolpath.word_uses
    )
    return replace(toolpath, word_uses=uses)


def hole_calls(toolpath: ToolPath, cell: Cell) -> Iterator[tuple[int, Event, Event]]:
    """Yield (tag, call at the bottom, call behind the way out) of holes that need the spindle.

    A bore is left by a spindle that stands, at an angle where the file gives one and the cell has a
    routine for that; a tap by one that turns back. Where the file never names the spindle, or it
    stands, there is nothing to call.
    """
    orients = _ORIENTS in cell.krl.hooks
    kinds = [cycle.kind for cycle in toolpath.cycles]
    wanted = [i for i, kind in enumerate(kinds) if kind in TAPS or kind in _STANDS_OUT]
    holes = np.asarray(toolpath.kind) == MotionKind.HOLE
    rows = np.flatnonzero(holes & np.isin(toolpath.cycle, wanted))
    turns = turns_at(toolpath) if len(rows) else np.zeros(0)
    for row in rows.tolist() if cell.process.spindle not in OTHERS else ():
        speed, line = float(turns[row]), int(toolpath.line[row])
        if not abs(speed) > 0.0:
            continue
        cycle = toolpath.cycles[int(toolpath.cycle[row])]
        kind = cycle.kind
        below = Event(row, EventKind.SPINDLE_OFF, 0.0, "bore: stop", line)
        if kind in TAPS:
            below = Event(row, EventKind.TAP_REVERSE, -speed, "tap: reverse", line)
        elif orients and math.isfinite(cycle.orient):
            below = Event(row, EventKind.SPINDLE_ORIENT, cycle.orient, "bore: orient", line)
        yield row, below, Event(row, EventKind.SPINDLE_ON, speed, f"{kind}: as before", line)
