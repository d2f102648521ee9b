"""What happens between the motions: spindle, coolant, stops, dwells of the CAM file, all present?

Routines are recognised by the names that the cell gives them (``krl.hooks``). Each event of the
file must be there, in the order of its kind, and behind the motion to the tag before it and not
later than the motion to the tag it stands before. Of different kinds the order counts as far as one
finds what the other has made of tool, spindle and coolant (``States``).
"""

from __future__ import annotations

import math
from bisect import bisect_right

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.cell import Cell
from postproc.controller import EventWord, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.model import CUTS, Event, EventKind, ToolPath
from postproc.paths import Paths
from postproc.process import coolant_mode, hole_calls
from postproc.units import DEG, RPM
from postproc.verification.cam.comparison import Comparison
from postproc.verification.cam.signals import Asked, Span, check_signals, count_text
from postproc.verification.cam.states import States
from postproc.verification.cam.steps import check_steps
from postproc.verification.cam.surplus import check_surplus
from postproc.verification.report import Result

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
_LISTED = 20


def check_events(
    result: Result,
    cell: Cell,
    toolpath: ToolPath,
    found: Comparison,
) -> frozenset[int]:
    """Compare the events of a program with those of its CAM file.

    Args:
        result: the program; collects the findings.
        cell: names of the routines.
        toolpath: what was asked for.
        found: which motions go to which tags, and which of them cut.

    Returns:
        Places in ``trace.events`` of what the file asks for.
    """
    spans = _Spans(found.served, found.latest, result.paths, toolpath)
    names = {kind: name.upper() for kind, name in cell.krl.hooks.items()}
    everything = _asked(toolpath, cell, spans)
    steps = check_steps(result, cell, toolpath, found.served)
    before = len(result.findings)
    calls: dict[EventKind, list[TraceEvent]] = {}
    surplus: dict[EventKind, list[TraceEvent]] = {}
    there: list[tuple[Event, TraceEvent]] = []
    for kind in _COUNTED:
        name = names.get(str(kind), "")
        asked = [(event, span) for event, span in everything if event.kind is kind]
        if name:
            calls[kind] = _calls(result, kind, name)
            fits, surplus[kind] = _compare_kind(result, kind, name, asked, calls[kind])
            there += fits
    there += check_signals(result, cell, everything)
    served = {id(call) for _, call in (*there, *steps)} | _dwells(result, toolpath, spans, found)
    # The order is a question once everything is there, where the file has it.
    states = None
    if len(result.findings) == before:
        states = _states(result, everything, there, steps, surplus)
        states.check(result, found.is_cut)
    check_surplus(result, cell, calls, surplus, found.is_cut)
    _compare_dwells(result, toolpath, spans, states)
    return frozenset(k for k, e in enumerate(result.paths.trace.events) if id(e) in served)


def _dwells(result: Result, toolpath: ToolPath, spans: _Spans, found: Comparison) -> set[int]:
    """Return the ids of waits where the file has a dwell, between tags or in a hole."""
    allowed = np.zeros(len(result.paths) + 2, dtype=np.bool_)
    for event in toolpath.events:
        if event.kind is EventKind.DWELL:
            span = spans.of_dwell(event)
            allowed[span.first : span.last + 1] = True
    bottoms = (found.wanted.dwell > 0.0) & (found.served >= 0)
    allowed[found.served[bottoms] + 1] = True
    events = result.paths.trace.events
    return {id(e) for e in events if e.word is EventWord.DWELL and allowed[e.motion]}


def _asked(toolpath: ToolPath, cell: Cell, spans: _Spans) -> list[Asked]:
    """Return the events of the file and of its holes in their order, and where each belongs."""
    found = [(event.index, 0, event, spans.of(event)) for event in toolpath.events]
    for tag, below, behind in hole_calls(toolpath, cell):
        found.append((tag, 1, below, spans.at_bottom(tag)))
        found.append((tag, 2, behind, spans.behind(tag)))
    return [item[2:] for item in sorted(found, key=lambda item: item[:2])]


def _states(
    result: Result,
    everything: list[Asked],
    there: list[tuple[Event, TraceEvent]],
    steps: list[tuple[Event, TraceEvent]],
    surplus: dict[EventKind, list[TraceEvent]],
) -> States:
    """Return what events and dwells find; those of the file in its order, steps at their holes."""
    call_of = {id(event): call for event, call in (*there, *steps)}
    order = [*(event for event, _ in everything), *(event for event, _ in steps)]
    asked = [(event, call_of.get(id(event))) for event in sorted(order, key=lambda e: e.index)]
    extra = [(kind, call) for kind, calls in surplus.items() for call in calls]
    return States(result.paths.trace.events, asked, extra)


def _calls(result: Result, kind: EventKind, name: str) -> list[TraceEvent]:
    words = {EventWord.HOOK}
    if kind is EventKind.STOP:
        words.add(EventWord.HALT)
    return [
        event
        for event in result.paths.trace.events
        if event.word in words and (event.name == name or event.word is EventWord.HALT)
    ]


class _Spans:
    """Where in the program an event of the file belongs."""

    def __init__(
        self, served: AnyIntArray, latest: AnyIntArray, paths: Paths, toolpath: ToolPath
    ) -> None:
        count = len(paths)
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


def _compare_kind(
    result: Result, kind: EventKind, name: str, asked: list[Asked], have: list[TraceEvent]
) -> tuple[list[tuple[Event, TraceEvent]], list[TraceEvent]]:
    """Compare the calls of one kind with what is asked for, in its order.

    Returns:
        (event, its call) of what is there, and the calls beyond that.
    """
    words = str(kind).replace("_", " ")
    if len(have) < len(asked):
        text = count_text(f"{words}: {len(have)} calls of {name}", asked)
        _tell(result, have[-1] if have else None, text, Severity.ERROR)
        return [], []
    there: list[tuple[Event, TraceEvent]] = []
    surplus: list[TraceEvent] = []
    motions = [call.motion for call in have]
    faults = at = 0
    for number, (event, span) in enumerate(asked):
        spare = range(
            at, min(len(have) - len(asked) + number + 1, bisect_right(motions, span.last))
        )
        fits = (k for k in spare if not _difference(kind, words, event, have[k], span))
        fit = next(fits, at)
        surplus += have[at:fit]
        text = _difference(kind, words, event, have[fit], span)
        faults += bool(text)
        if text and faults <= _LISTED:
            _tell(result, have[fit], text, Severity.ERROR)
        there.append((event, have[fit]))
        at = fit + 1
    return there, surplus + have[at:]


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


def _compare_dwells(
    result: Result, toolpath: ToolPath, spans: _Spans, states: States | None
) -> None:
    """Compare the dwells that stand between tags (those of cycles belong to the holes).

    Where the order of events is known, only a wait that finds what the dwell finds serves it.
    """
    waits = [event for event in result.paths.trace.events if event.word is EventWord.DWELL]
    asked: dict[Span, list[Event]] = {}
    for event in toolpath.events:
        if event.kind is EventKind.DWELL:
            asked.setdefault(spans.of_dwell(event), []).append(event)
    for span, dwells in asked.items() if len(result.paths) else ():
        inside = [wait for wait in waits if span.first <= wait.motion <= span.last]
        alike: dict[object, list[Event]] = {}
        for dwell in dwells:
            alike.setdefault(None if states is None else states.key(dwell), []).append(dwell)
        for few in alike.values():
            served = [w for w in inside if states is None or not states.difference(few[0], w)]
            if _tell_dwell(result, span, few, served, Severity.ERROR):
                break
        else:
            _tell_dwell(result, span, dwells, inside, Severity.WARNING)


def _tell_dwell(
    result: Result, span: Span, dwells: list[Event], waits: list[TraceEvent], severity: Severity
) -> bool:
    """Report waits that are too short in all (errors) or too long; returns whether they are."""
    value = sum(dwell.value for dwell in dwells)
    have = float(np.nansum([wait.value for wait in waits]))
    beyond = value - have if severity is Severity.ERROR else have - value
    if beyond <= max(1e-3, 0.01 * value):
        return False
    line = dwells[0].line
    text = f"{have:g} s of dwell, line {line} of the CAM file asks for {value:g} s"
    result.finding(RunKind.DWELL, min(span.first, len(result.paths) - 1), text, severity)
    return True


def _tell(result: Result, call: TraceEvent | None, text: str, severity: Severity) -> None:
    place = result.paths.trace.place_of(call) if call else None
    result.finding_at(RunKind.EVENT, place, text, severity)
