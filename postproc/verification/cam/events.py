"""What happens between the motions: spindle, coolant, stops, dwells of the CAM file, all present?

What must be there, and where, is found by ``calls``. Of different kinds the order counts as far as
one finds what the other has made of tool, spindle and coolant (``States``): a question once
everything is there, where the file has it.

Of calls that the file does not ask for: what do the motions behind them run with? To turn off what
is off changes nothing; one more tool, spindle speed or coolant does, as far as something cuts with
it. A file that says nothing at all of the spindle, of coolant or of tools leaves them to the
program, but for a tool that is not the one it moves. A change to the tool in hand changes nothing
either: each section of a long job begins with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from postproc.controller import EventWord, Trace, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.model import Event, EventKind
from postproc.verification.cam.calls import Made
from postproc.verification.cam.match import Match
from postproc.verification.cam.states import COOLANT, SPINDLE, Span, States, states_at
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Run


def check_events(run: Run, match: Match) -> Iterator[Said]:
    """Yield events that are missing, elsewhere, or find another state than in the CAM file."""
    yield from match.calls.step_faults
    yield from match.calls.faults
    if not match.calls.faults:
        yield from _states(run, match).faults(run.paths.trace, match.uses.is_cut)


def _states(run: Run, match: Match) -> States:
    """Return what events and dwells find; those of the file in its order, steps at their holes."""
    calls = match.calls
    call_of = {id(event): call for event, call in (*calls.pairs, *calls.steps)}
    order = [*(event for event, _ in calls.everything), *(event for event, _ in calls.steps)]
    asked = [(event, call_of.get(id(event))) for event in sorted(order, key=lambda e: e.index)]
    extra = [(kind, call) for kind, some in calls.surplus.items() for call in some]
    return States(run.paths.trace.events, asked, extra)


def check_dwells(run: Run, match: Match) -> Iterator[Said]:
    """Compare the dwells that stand between tags (those of cycles belong to the holes).

    Where the order of events is known, only a wait that finds what the dwell finds serves it.
    """
    if not len(run.paths):
        return
    states = None if match.calls.faults else _states(run, match)
    waits = [event for event in run.paths.trace.events if event.word is EventWord.DWELL]
    asked: dict[Span, list[Event]] = {}
    for event, span in match.calls.dwells:
        asked.setdefault(span, []).append(event)
    for span, dwells in asked.items():
        at = min(span.first, len(run.paths) - 1)
        inside = [wait for wait in waits if span.first <= wait.motion <= span.last]
        alike: dict[object, list[Event]] = {}
        for dwell in dwells:
            alike.setdefault(None if states is None else states.key(dwell), []).append(dwell)
        for few in alike.values():
            served = [w for w in inside if states is None or not states.difference(few[0], w)]
            if text := _dwell(few, served, Severity.ERROR):
                yield Remark(RunKind.DWELL, at, text)
                break
        else:
            if text := _dwell(dwells, inside, Severity.WARNING):
                yield Remark(RunKind.DWELL, at, text, Severity.WARNING)


def _dwell(dwells: list[Event], waits: list[TraceEvent], severity: Severity) -> str:
    """Return that waits are too short in all (errors) or too long, empty if they are right."""
    value = sum(dwell.value for dwell in dwells)
    have = float(np.nansum([wait.value for wait in waits]))
    beyond = value - have if severity is Severity.ERROR else have - value
    if beyond <= max(1e-3, 0.01 * value):
        return ""
    line = dwells[0].line
    return f"{have:g} s of dwell, line {line} of the CAM file asks for {value:g} s"


def check_surplus(run: Run, match: Match) -> Iterator[Said]:
    """Yield calls beyond those of the CAM file.

    Errors are changes of the tool, and what makes a cut run with another spindle or coolant.
    """
    trace, is_cut = run.paths.trace, match.uses.is_cut
    calls, surplus = match.calls.made, match.calls.surplus
    harmful: set[int] = set()
    for kinds in (SPINDLE, COOLANT):
        extra = _in_order(trace, surplus, kinds)
        have = _in_order(trace, calls, kinds)
        if extra and len(extra) < len(have):
            beyond = {id(event) for _, event in extra}
            asked = [(kind, event) for kind, event in have if id(event) not in beyond]
            differs = is_cut & (states_at(have, len(is_cut)) != states_at(asked, len(is_cut)))
            motions = np.array([event.motion for _, event in extra])
            causes = np.searchsorted(motions, np.flatnonzero(differs), side="right") - 1
            harmful |= {id(extra[k][1]) for k in np.unique(causes[causes >= 0]).tolist()}
    changes = surplus.get(EventKind.TOOL_CHANGE, ())
    silent = len(changes) == len(calls.get(EventKind.TOOL_CHANGE, ()))
    called = [event for _, event in _in_order(trace, calls, (EventKind.TOOL_CHANGE,))]
    in_cut = np.append(False, is_cut)  # by the motion behind; the tool stands where it cut
    again = {
        id(b) for a, b in pairwise(called) if a.value == b.value and not in_cut[b.motion]
    }  # as each section does
    harmful |= {
        id(event)
        for event in changes
        if not ((silent or id(event) in again) and _is_in_hand(run, event))
    }
    listed = [event for _, event in _in_order(trace, surplus, surplus)]
    for event in sorted(listed, key=lambda event: id(event) not in harmful)[:AT_MOST]:
        text = f"{event.name} is called, and the CAM file does not ask for it"
        severity = Severity.WARNING
        if id(event) in harmful:
            text += ": after it tool, spindle or coolant differ from the file"
            severity = Severity.ERROR
        yield Remark(RunKind.EVENT, trace.place_of(event), text, severity)


def _is_in_hand(run: Run, event: TraceEvent) -> bool:
    """Return whether a change is to the tool that the motions behind it move."""
    tools = run.paths.station.tool[event.motion :]
    tool = run.cell.tools[int(tools[0])] if len(tools) else None
    return tool is not None and event.value in (tool.number, *_numbers(tool.cam))


def _numbers(names: Sequence[str]) -> list[float]:
    """Return those names of a tool in the CAM file that are numbers."""
    return [float(name) for name in names if name.isdecimal()]


def _in_order(
    trace: Trace, calls: Made, kinds: Iterable[EventKind]
) -> list[tuple[EventKind, TraceEvent]]:
    """Return calls of several kinds in the order of the program."""
    kind_of = {id(event): kind for kind in kinds for event in calls.get(kind, ())}
    return [(kind_of[id(event)], event) for event in trace.events if id(event) in kind_of]
