"""What happens between the motions: spindle, coolant, stops, dwells of the CAM file, all present?

What must be there, and where, is found by ``calls``. Of different kinds the order counts as far as
one finds what the other has made of tool, spindle and coolant (``States``): a question once
everything is there, where the file has it.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.controller import EventWord, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.model import Event
from postproc.verification.cam.match import Match
from postproc.verification.cam.signals import Span
from postproc.verification.cam.states import States
from postproc.verification.report import Remark, Said
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
