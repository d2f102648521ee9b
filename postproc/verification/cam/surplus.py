"""Calls that the CAM file does not ask for: what do the motions behind them run with?

To turn off what is off changes nothing; one more tool, spindle speed or coolant does, as far as
something cuts with it. A file that says nothing at all of the spindle, of coolant or of tools
leaves them to the program, but for a tool that is not the one it moves. A change to the tool in
hand changes nothing either: each section of a long job begins with it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise

import numpy as np

from postproc.controller import Trace, TraceEvent
from postproc.errors import RunKind, Severity
from postproc.model import EventKind
from postproc.verification.cam.calls import Made
from postproc.verification.cam.match import Match
from postproc.verification.cam.states import COOLANT, SPINDLE, states_at
from postproc.verification.report import AT_MOST, Remark, Said
from postproc.verification.run import Run


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
            text += ": tool, spindle or coolant are not as in the file behind it"
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
