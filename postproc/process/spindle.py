"""The spindle as a CAM file drives it: when it turns, which way, and what switches it off.

These are the rules; what a program does with the spindle is read from its text by ``verification``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from postproc.cell import Cell
from postproc.errors import Finding, Severity, SourceRef
from postproc.model import Event, EventKind, MotionKind, ToolPath
from postproc.units import RPM

CUTTING = (MotionKind.LINEAR, MotionKind.ARC, MotionKind.HOLE)
"""Motions that may touch the part."""
_ADDED = "added: the file leaves it on"
_SWITCHES = {
    EventKind.SPINDLE_ON: EventKind.SPINDLE_OFF,
    EventKind.COOLANT_ON: EventKind.COOLANT_OFF,
}


@dataclass(frozen=True, slots=True)
class Stretch:
    """Tags [first, stop) over which the spindle is as ``event`` has left it.

    ``event``: what set it, None before the first one; ``turns``: speed [turns/s], negative
    counterclockwise, 0 at a standstill, NaN where the spindle was never named or its speed is not
    known; ``is_on``: whether it turns, None before it is named.
    """

    first: int
    stop: int
    event: Event | None = None
    is_on: bool | None = None
    turns: float = float("nan")


def stretches(events: Sequence[Event], count: int) -> Iterator[Stretch]:
    """Yield the stretches of ``count`` tags in their order, those without a tag too.

    A tool change stops the spindle.
    """
    now = Stretch(0, count)
    for event in events:
        change = _changed(now, event)
        if change is not None:
            yield replace(now, stop=event.index)
            now = replace(change, first=event.index, stop=count)
    yield now


def _changed(now: Stretch, event: Event) -> Stretch | None:
    if event.kind is EventKind.SPINDLE_ON:
        return Stretch(0, 0, event, True, event.value or float("nan"))
    stops = event.kind is EventKind.SPINDLE_OFF or (
        event.kind is EventKind.TOOL_CHANGE and bool(now.is_on)
    )
    return Stretch(0, 0, event, False, 0.0) if stops else None


def switched_off(toolpath: ToolPath) -> ToolPath:
    """Return the toolpath with the switching off that the file leaves to its machine.

    Spindle and coolant stop at the end, the spindle before each tool change, too.
    """
    events: list[Event] = []
    on: dict[EventKind, bool] = dict.fromkeys(_SWITCHES, False)
    for event in toolpath.events:
        if event.kind is EventKind.TOOL_CHANGE and on[EventKind.SPINDLE_ON]:
            events.append(replace(event, kind=EventKind.SPINDLE_OFF, value=0.0, text=_ADDED))
            on[EventKind.SPINDLE_ON] = False
        for start, stop in _SWITCHES.items():
            on[start] = event.kind is start or (on[start] and event.kind is not stop)
        events.append(event)
    n = len(toolpath)
    line = max([*toolpath.line[-1:].tolist(), *(event.line for event in events[-1:])], default=1)
    events += [
        Event(n, _SWITCHES[start], 0.0, _ADDED, line) for start, is_on in on.items() if is_on
    ]
    added = len(events) > len(toolpath.events)
    return replace(toolpath, events=tuple(events)) if added else toolpath


def direction_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return an error for each stretch of cuts in which the spindle turns against the tool."""
    found = []
    tool, cuts = cell.tool, np.isin(toolpath.kind, CUTTING)
    for part in stretches(toolpath.events, len(toolpath)):
        against = part.turns < 0.0 if tool.cuts_clockwise else part.turns > 0.0
        if part.event is None or not against or not cuts[part.first : part.stop].any():
            continue
        way, own = ("counterclockwise", "cw") if part.turns < 0.0 else ("clockwise", "ccw")
        found.append(
            Finding(
                Severity.ERROR,
                "PRC001",
                f"the spindle turns {way} at {abs(part.turns) / RPM:g} 1/min, but tool "
                f'{tool.number} cuts the other way: spindle = "{own}"',
                source=SourceRef(toolpath.path, part.event.line),
                hint=f'spindle = "{"ccw" if own == "cw" else "cw"}" in the tool of the cell, if '
                "this tool cuts that way",
            )
        )
    return found
