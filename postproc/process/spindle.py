"""Spindle and coolant as a CAM file drives them: when, which way, and what switches them off.

These are the rules; what a program does with the spindle is read from its text by ``verification``.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell, SpindleStart, Tool
from postproc.errors import Finding, Severity, SourceRef
from postproc.model import CUTS, WORKING, Event, EventKind, MotionKind, ToolPath
from postproc.process.assignment import assign
from postproc.records import dataclass
from postproc.units import RPM

COOLANTS = {
    "ON": 1, "FLOOD": 1, "MIST": 2, "THRU": 3, "THROUGH": 3, "TAPKUL": 3, "HIGH": 3, "AIR": 4,
    "TAP": 5, "CUSTOM1": 6, "CUSTOM2": 7, "CUSTOM3": 8,
}  # fmt: skip
"""A kind stands before ON: ``COOLNT/ON,MIST`` is mist."""
_DEFAULT = "added: the file names no speed, the cell does"
_ADDED = "added: the file leaves it on"
_AGAIN = "added: the file does not stop it"
START_HINT = (
    "give a speed in the CAM file or as [process] spindle_rpm, or say who starts it: "
    'spindle = "unit" or "hand"'
)
"""What helps where nothing is known to start the spindle."""
CLOCKWISE, COUNTERCLOCKWISE = frozenset({"CLW", "CW"}), frozenset({"CCLW", "CCW"})
"""Words of SPINDL that say which way round."""
OTHERS = (SpindleStart.UNIT, SpindleStart.HAND)
_SWITCHED = (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF)
"""What a program does not call where others drive the spindle."""
_COLUMN = "spindle_turns"
"""Column of a toolpath: the speed [turns/s] of the spindle at each tag, as ``turns_at`` says."""
_STANDING = frozenset({"SPINDL", "SPINDL/OFF"})
"""Words by which cuts at a standstill are accepted."""
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
    """Yield the stretches of ``count`` tags in their order, those without a tag too."""
    now = Stretch(0, count)
    for event in events:
        if event.kind in (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF):
            yield replace(now, stop=event.index)
            is_on = event.kind is EventKind.SPINDLE_ON
            turns = (event.value or float("nan")) if is_on else 0.0
            now = Stretch(event.index, count, event, is_on, turns)
    yield now


def with_turns(toolpath: ToolPath) -> ToolPath:
    """Return the toolpath with the speed of the spindle at each tag as a column.

    So a part of it that begins behind the word that starts the spindle still knows it.
    """
    return replace(toolpath, extra={**toolpath.extra, _COLUMN: turns_at(toolpath)})


def turns_at(toolpath: ToolPath) -> FloatArray:
    """Return the speed (n,) [turns/s] of the spindle at each tag, as ``Stretch`` has it."""
    if _COLUMN in toolpath.extra:
        return np.asarray(toolpath.extra[_COLUMN], dtype=np.float64)
    turns = np.full(len(toolpath), np.nan)
    for part in stretches(toolpath.events, len(toolpath)):
        turns[part.first : part.stop] = part.turns
    return turns


def started_by_none(toolpath: ToolPath) -> IndexArray:
    """Return the tags (k,) that are drilled or milled before the file names the spindle at all.

    Points that are only touched need none.
    """
    kind = np.asarray(toolpath.kind)
    works = np.isin(kind, CUTS)
    works |= (kind == MotionKind.HOLE) & (np.asarray(toolpath.cycle) >= 0)
    named = next((part.stop for part in stretches(toolpath.events, len(kind))), 0)
    return np.flatnonzero(works[:named])


def driven(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath with all switching of the spindle that the file leaves to others.

    An end effector or a person that drives the spindle is not called. Where the file names no speed
    before it cuts, or starts without one, it is the cell's, the way round that the tool cuts;
    ``switched_off`` adds the rest.
    """
    if cell.process.spindle in OTHERS:
        own = tuple(event for event in toolpath.events if event.kind not in _SWITCHED)
        return switched_off(replace(with_turns(toolpath), events=own))
    speed = cell.process.spindle_turns
    toolpath = _named(toolpath, cell, speed)
    tags = started_by_none(toolpath)
    if not speed or not len(tags) or may_stand(toolpath, cell):
        return switched_off(toolpath)
    tool = assign(toolpath, cell).tool[tags]
    first = np.flatnonzero(np.diff(tool, prepend=-2))
    starts = [
        Event(
            tag, EventKind.SPINDLE_ON, speed * _way(cell, index), _DEFAULT, int(toolpath.line[tag])
        )
        for tag, index in zip(tags[first].tolist(), tool[first].tolist(), strict=True)
    ]
    events = sorted((*toolpath.events, *starts), key=lambda event: event.index)
    return switched_off(replace(toolpath, events=tuple(events)))


def _speedless(toolpath: ToolPath) -> list[Event]:
    """Return what starts the spindle and says no number at all."""
    return [
        event
        for event in toolpath.events
        if event.kind is EventKind.SPINDLE_ON
        and not event.value
        and not any(letter.isdigit() for letter in event.text)
    ]


def _named(toolpath: ToolPath, cell: Cell, speed: float) -> ToolPath:
    """Return the toolpath with the cell's speed where the file starts the spindle without one."""
    bare = _speedless(toolpath)
    if not speed or not bare or not len(toolpath):
        return toolpath
    tool = assign(toolpath, cell).tool
    starts = {}
    for event in bare:
        words = set(event.text.split(","))
        way = _way(cell, int(tool[min(event.index, len(tool) - 1)]))
        way = 1.0 if CLOCKWISE & words else -1.0 if COUNTERCLOCKWISE & words else way
        starts[id(event)] = replace(event, value=way * speed)
    return replace(toolpath, events=tuple(starts.get(id(e), e) for e in toolpath.events))


def _way(cell: Cell, tool: int) -> float:
    """Return 1 where a tool cuts clockwise, else -1."""
    return 1.0 if tool < 0 or cell.tools[tool].cuts_clockwise else -1.0


def start_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return PRC004 where nothing is known to start the spindle that a toolpath needs.

    An error where the cell wants the program to do it, else a warning that stands first.
    """
    tags, who = started_by_none(toolpath), cell.process.spindle
    if who in OTHERS or cell.process.spindle_turns:
        return []
    for event in _speedless(toolpath)[:1]:
        text = "the spindle is started without a speed, and neither file nor cell gives one"
        source = SourceRef(toolpath.path, event.line)
        return [Finding(Severity.ERROR, "PRC005", text, source=source, hint=START_HINT)]
    if not len(tags) or may_stand(toolpath, cell):
        return []
    holes = int((np.asarray(toolpath.kind)[tags] == MotionKind.HOLE).sum())
    counts = ((holes, "holes are drilled"), (len(tags) - holes, "points are milled"))
    work = " and ".join(f"{count} {what}" for count, what in counts if count)
    first = int(tags[0])
    must = who is SpindleStart.PROGRAM
    return [
        Finding(
            Severity.ERROR if must else Severity.WARNING,
            "PRC004",
            f"the program does not start the spindle: {work}, no speed is given",
            first if must else None,
            toolpath.source(first),
            hint=START_HINT,
            headline=True,
        )
    ]


def switched_off(toolpath: ToolPath) -> ToolPath:
    """Return the toolpath with the switching that the file leaves to its machine.

    Spindle and coolant stop at the end. A tool change stops the spindle; where cuts follow and the
    file has not said anything else by then, it starts again as before: SPINDL is modal.
    """
    events: list[Event] = []
    on: dict[EventKind, Event | None] = dict.fromkeys(_SWITCHES)
    for place, event in enumerate(toolpath.events):
        running = on[EventKind.SPINDLE_ON]
        if event.kind is EventKind.TOOL_CHANGE and running is not None:
            stop = replace(event, kind=EventKind.SPINDLE_OFF, value=0.0, text=_ADDED)
            starts = _cuts_before_spindle(toolpath, place)
            again = [replace(running, index=event.index, line=event.line, text=_AGAIN)] * starts
            events += [stop, event, *again]
            on[EventKind.SPINDLE_ON] = running if starts else None
            continue
        for start, off in _SWITCHES.items():
            on[start] = event if event.kind is start else None if event.kind is off else on[start]
        events.append(event)
    n = len(toolpath)
    line = max([*toolpath.line[-1:].tolist(), *(event.line for event in events[-1:])], default=1)
    events += [
        Event(n, _SWITCHES[start], 0.0, _ADDED, line)
        for start, event in on.items()
        if event is not None
    ]
    added = len(events) > len(toolpath.events)
    return replace(toolpath, events=tuple(events)) if added else toolpath


def _cuts_before_spindle(toolpath: ToolPath, place: int) -> bool:
    """Return whether a cut comes behind event ``place`` before the spindle is named again."""
    first = toolpath.events[place].index
    named = (EventKind.SPINDLE_ON, EventKind.SPINDLE_OFF)
    later = (event.index for event in toolpath.events[place + 1 :] if event.kind in named)
    kinds = toolpath.kind[first : next(later, len(toolpath))]
    return bool(np.isin(kinds, WORKING).any())


def direction_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return an error for each stretch of cuts in which the spindle turns against a tool."""
    found = []
    serving = np.where(np.isin(toolpath.kind, WORKING), assign(toolpath, cell).tool, -1)
    for part in stretches(toolpath.events, len(toolpath)):
        for index in np.unique(serving[part.first : part.stop]).tolist():
            tool = cell.tools[index]
            against = part.turns < 0.0 if tool.cuts_clockwise else part.turns > 0.0
            if part.event is not None and index >= 0 and against:
                found.append(_against(toolpath, part.event, part.turns, tool))
    return found


def _against(toolpath: ToolPath, event: Event, turns: float, tool: Tool) -> Finding:
    way, own = ("counterclockwise", "cw") if turns < 0.0 else ("clockwise", "ccw")
    return Finding(
        Severity.ERROR,
        "PRC001",
        f"the spindle turns {way} at {abs(turns) / RPM:g} 1/min, but tool "
        f'{tool.number} cuts the other way: spindle = "{own}"',
        source=SourceRef(toolpath.path, event.line),
        hint=f'spindle = "{"ccw" if own == "cw" else "cw"}" in the tool of the cell, if '
        "this tool cuts that way",
    )


def may_stand(toolpath: ToolPath | None, cell: Cell) -> bool:
    """Return whether the user has accepted that cuts at a standstill of the spindle are meant."""
    if toolpath is None:
        return bool(_STANDING & {word.upper() for word in cell.reading.accept_words})
    return any(use.word in _STANDING and not use.refused for use in toolpath.word_uses)


def coolant_mode(text: str) -> int:
    """Return the number of the words behind COOLNT: that of the kind named, else flood."""
    words = [word.strip() for word in text.upper().split(",")]
    kinds = [COOLANTS[word] for word in words if word in COOLANTS and word != "ON"]
    return kinds[0] if kinds else COOLANTS["ON"]
