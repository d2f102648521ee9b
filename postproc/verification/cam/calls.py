"""The process of a program beside that of its CAM file: which call is which event of the file.

Routines are recognised by the names that the cell gives them (``krl.hooks``). Each event of the
file must be there, in the order of its kind, and behind the motion to the tag before it and not
later than the motion to the tag it stands before.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.cell import Cell
from postproc.controller import EventWord, Trace, TraceEvent
from postproc.model import CUTS, Event, EventKind, ToolPath
from postproc.paths import Paths
from postproc.process import NUMBER, coolant_mode, hole_calls, hole_steps
from postproc.records import dataclass
from postproc.units import DEG, MM, MM_PER_MIN, RPM
from postproc.verification.cam.matching import Served
from postproc.verification.cam.states import (
    Asked,
    Pair,
    Paired,
    Span,
    count_text,
    fault,
    paired_signals,
)
from postproc.verification.report import AT_MOST, Remark

_COUNTED = (
    EventKind.SPINDLE_ON,
    EventKind.SPINDLE_OFF,
    EventKind.COOLANT_ON,
    EventKind.COOLANT_OFF,
    EventKind.STOP,
    EventKind.OPTIONAL_STOP,
    EventKind.TOOL_CHANGE,
    EventKind.TAP_REVERSE,
    EventKind.SPINDLE_ORIENT,
)
Made = Mapping[EventKind, Sequence[TraceEvent]]
"""Calls by what they stand for, in the order of the program."""


@dataclass(frozen=True, slots=True)
class Calls:
    """What a CAM file asks of the process, and the calls and waits of the program for it.

    ``everything``: the events of the file and of its holes in order; ``dwells``: those between
    tags; ``pairs``, ``steps``: (event, its call), of the steps around holes apart; ``made``: all
    calls, ``surplus``: those that the file does not ask for; ``asked``: places in ``trace.events``
    of what it does ask for; ``faults``, ``step_faults``: what is missing or elsewhere.
    """

    everything: tuple[Asked, ...]
    dwells: tuple[Asked, ...]
    pairs: tuple[Pair, ...]
    steps: tuple[Pair, ...]
    made: Made
    surplus: Made
    asked: frozenset[int]
    faults: tuple[Remark, ...]
    step_faults: tuple[Remark, ...]


def calls_of(paths: Paths, cell: Cell, tags: Served) -> Calls:
    """Return the calls of a program beside the events of its CAM file."""
    spans, trace = _Spans(paths, tags), paths.trace
    names = {kind: name.upper() for kind, name in cell.krl.hooks.items()}
    everything = _asked(tags.toolpath, cell, spans)
    steps = paired_steps(trace, cell, tags.toolpath, tags.first)
    kinds = [kind for kind in _COUNTED if names.get(str(kind))]
    made = {kind: _calls(trace, kind, names[str(kind)]) for kind in kinds}
    found = {
        kind: _paired(trace, kind, names[str(kind)], own, made[kind])
        for kind in kinds
        for own in [[(event, span) for event, span in everything if event.kind is kind]]
    }
    every = [*found.values(), paired_signals(trace, cell, everything)]
    pairs = tuple(pair for some in every for pair in some.pairs)
    dwells = [
        (event, spans.of_dwell(event))
        for event in tags.toolpath.events
        if event.kind is EventKind.DWELL
    ]
    served = {id(call) for _, call in (*pairs, *steps.pairs)} | _waits(trace, tags, dwells)
    return Calls(
        tuple(everything),
        tuple(dwells),
        pairs,
        tuple(steps.pairs),
        made,
        {kind: some.surplus for kind, some in found.items()},
        frozenset(k for k, event in enumerate(trace.events) if id(event) in served),
        tuple(remark for some in every for remark in some.faults),
        tuple(steps.faults),
    )


def _waits(trace: Trace, tags: Served, dwells: Sequence[Asked]) -> set[int]:
    """Return the ids of waits where the file has a dwell, between tags or in a hole."""
    allowed = np.zeros(len(trace) + 2, dtype=np.bool_)
    for _, span in dwells:
        allowed[span.first : span.last + 1] = True
    bottoms = (tags.wanted.dwell > 0.0) & (tags.first >= 0)
    allowed[tags.first[bottoms] + 1] = True
    return {id(e) for e in trace.events if e.word is EventWord.DWELL and allowed[e.motion]}


def _asked(toolpath: ToolPath, cell: Cell, spans: _Spans) -> list[Asked]:
    """Return the events of the file and of its holes in their order, and where each belongs."""
    found = [(event.index, 0, event, spans.of(event)) for event in toolpath.events]
    for tag, below, behind in hole_calls(toolpath, cell):
        found.append((tag, 1, below, spans.at_bottom(tag)))
        found.append((tag, 2, behind, spans.behind(tag)))
    return [item[2:] for item in sorted(found, key=lambda item: item[:2])]


def _calls(trace: Trace, kind: EventKind, name: str) -> list[TraceEvent]:
    words = {EventWord.HOOK}
    if kind is EventKind.STOP:
        words.add(EventWord.HALT)
    return [
        event
        for event in trace.events
        if event.word in words and (event.name == name or event.word is EventWord.HALT)
    ]


class _Spans:
    """Where in the program an event of the file belongs."""

    def __init__(self, paths: Paths, tags: Served) -> None:
        count, toolpath, served, latest = len(paths), tags.toolpath, tags.first, tags.last
        known = np.where(served >= 0, served, -1)
        self._before = np.r_[0, np.maximum.accumulate(known) + 1] if len(known) else np.zeros(1)
        repeated = np.r_[False, served[1:] == served[:-1]]
        later = np.where((latest >= 0) & ~repeated[: len(latest)], latest, count)
        behind = np.minimum.accumulate(later[::-1])[::-1] if len(later) else later
        self._behind = np.r_[behind, count]
        self._served, self._latest = served, latest
        self._is_cut = np.isin(np.asarray(toolpath.kind), CUTS)
        self._first = {event.index: event for event in reversed(toolpath.events)}
        moves = np.where(paths.stands, count, np.arange(count))
        self._moves = np.append(np.minimum.accumulate(moves[::-1])[::-1], count)

    def of(self, event: Event) -> Span:
        """Return the span of an event."""
        index = min(max(event.index, 0), len(self._behind) - 1)
        return Span(int(self._before[index]), int(self._behind[index]))

    def of_dwell(self, event: Event) -> Span:
        """Return the span of a dwell; one at the end of a cut is over before the tool moves on."""
        span, tag = self.of(event), event.index - 1
        is_end = tag >= 0 and bool(self._is_cut[tag]) and self._served[tag] >= 0
        if not is_end or self._first[event.index] is not event:
            return span
        behind = max(int(self._served[tag]), int(self._latest[tag])) + 1
        return Span(span.first, min(span.last, int(self._moves[behind])))

    def at_bottom(self, tag: int) -> Span:
        """Return the span between the bottom of a hole and the way out."""
        return Span(int(self._served[tag]) + 1, int(self._latest[tag]) + 1)

    def behind(self, tag: int) -> Span:
        """Return the span from the first motion out of a hole to the next tag."""
        return Span(int(self._served[tag]) + 2, int(self._behind[tag + 1]))


def _paired(
    trace: Trace, kind: EventKind, name: str, asked: list[Asked], have: list[TraceEvent]
) -> Paired:
    """Pair the calls of one kind with what is asked for, in its order."""
    words = str(kind).replace("_", " ")
    if len(have) < len(asked):
        text = count_text(f"{words}: {len(have)} calls of {name}", asked)
        return Paired([], [], [fault(trace, have[-1] if have else None, text)])
    found = Paired([], [], [])
    motions = [call.motion for call in have]
    at = 0
    for number, (event, span) in enumerate(asked):
        spare = range(
            at, min(len(have) - len(asked) + number + 1, bisect_right(motions, span.last))
        )
        fits = (k for k in spare if not _difference(kind, words, event, have[k], span))
        fit = next(fits, at)
        found.surplus.extend(have[at:fit])
        text = _difference(kind, words, event, have[fit], span)
        if text and len(found.faults) < AT_MOST:
            found.faults.append(fault(trace, have[fit], text))
        found.pairs.append((event, have[fit]))
        at = fit + 1
    found.surplus.extend(have[at:])
    return found


def _difference(kind: EventKind, words: str, event: Event, call: TraceEvent, span: Span) -> str:
    if kind is EventKind.COOLANT_ON and call.value != coolant_mode(event.text):
        asked = coolant_mode(event.text)
        return f"coolant {call.value:g}, line {event.line} asks for {asked} ({event.text})"
    if kind in (EventKind.SPINDLE_ON, EventKind.TAP_REVERSE) and event.value:
        rpm = event.value / RPM
        if not math.isclose(call.value, rpm, rel_tol=1e-6, abs_tol=1e-3):
            return f"spindle speed {call.value:g} 1/min, line {event.line} asks for {rpm:g}"
    if kind is EventKind.SPINDLE_ORIENT and not math.isclose(
        call.value, event.value / DEG, abs_tol=1e-3
    ):
        return f"spindle at {call.value:g} deg, line {event.line} asks for {event.value / DEG:g}"
    if kind is EventKind.TOOL_CHANGE and int(event.value) != call.value:
        return f"tool {call.value:g}, line {event.line} asks for {event.value:g}"
    if not span.first <= call.motion <= span.last:
        when = "early" if call.motion < span.first else "late"
        return f"{words} comes too {when}: line {event.line} of the CAM file has it elsewhere"
    return ""


_DIGITS = 1e-3
"""A number may differ by this much: the digits of a text."""


def paired_steps(trace: Trace, cell: Cell, toolpath: ToolPath, served: AnyIntArray) -> Paired:
    """Pair the calls around holes with the steps that the cell wants.

    ``served`` (n,): motion that goes to the bottom of each hole, or to where the robot stands.
    """
    found = Paired([], [], [])
    names = [cell.krl.hooks[name].upper() for name in cell.process.hole]
    if not names or NUMBER not in toolpath.extra:
        return found
    calls = [e for e in trace.events if e.word is EventWord.HOOK and e.name in names]
    wanted = _wanted(cell, toolpath, served)
    if len(calls) != len(wanted):
        text = f"{len(calls)} calls of {', '.join(names)}, the holes ask for {len(wanted)}"
        found.faults.append(fault(trace, calls[-1] if calls else None, text))
    faults = []
    for call, (name, event, first, last) in zip(calls, wanted, strict=False):
        text = _step_difference(call, name, event)
        if not text and not first <= call.motion <= last:
            text = f"{name} is called where hole {event.value:g} is not drilled"
        faults += [fault(trace, call, text)] * bool(text)
        found.pairs.append((event, call))
    found.faults.extend(faults[:AT_MOST])
    return found


def _wanted(
    cell: Cell, toolpath: ToolPath, served: AnyIntArray
) -> list[tuple[str, Event, int, int]]:
    """Return routine, step, first and last motion it may come before, in order of the program."""
    count = len(served)
    every = [item for item in hole_steps(toolpath, cell) if served[item[0]] >= 0]
    every.sort(key=lambda item: int(served[item[0]]))
    found = []
    before = np.r_[-1, np.maximum.accumulate(served)] if count else np.zeros(1)
    for number, (tag, ahead, behind) in enumerate(every, start=1):
        at = int(served[tag])
        for event in ahead:
            place = (at + 1, at + 1) if cell.process.unit_feeds else (int(before[tag]) + 1, at)
            found.append((_routine(cell, event), _numbered(event, number), *place))
        found += [(_routine(cell, e), _numbered(e, number), at + 2, _BEHIND) for e in behind]
    return found


_BEHIND = 1 << 30


def _routine(cell: Cell, event: Event) -> str:
    return cell.krl.hooks[event.text].upper()


def _numbered(event: Event, number: int) -> Event:
    """Return the step with the number that its hole has in the order of the program."""
    return Event(event.index, event.kind, float(number), event.text, event.line, event.arguments)


def _step_difference(call: TraceEvent, name: str, event: Event) -> str:
    """Return in what a call is not the wanted one, empty if in nothing."""
    hole = f"hole {event.value:g} (line {event.line})"
    if call.name != name:
        return f"{call.name} is called at {hole}, expected {name}"
    depth, feed, speed = event.arguments
    asked = (event.value, depth / MM, feed / MM_PER_MIN, speed / RPM)
    have = call.arguments
    if len(have) != len(asked):
        return f"{name} gets {len(have)} arguments at {hole}, expected {len(asked)}"
    for what, is_, should in zip(("number", "depth", "feed", "speed"), have, asked, strict=True):
        if not isinstance(is_, int | float) or not math.isclose(
            float(is_), should, rel_tol=1e-6, abs_tol=_DIGITS
        ):
            return f"{name} gets {what} {is_} at {hole}, expected {should:g}"
    return ""
