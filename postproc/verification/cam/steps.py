"""Whether the routines around every hole are called: all of them, in order, where it is drilled."""

from __future__ import annotations

import math

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.cell import Cell
from postproc.controller import EventWord, Trace, TraceEvent
from postproc.model import Event, ToolPath
from postproc.process import NUMBER, hole_steps
from postproc.units import MM, MM_PER_MIN, RPM
from postproc.verification.cam.states import Paired, fault
from postproc.verification.report import AT_MOST

_DIGITS = 1e-3
"""A number may differ by this much: the digits of a text."""


def paired_steps(trace: Trace, cell: Cell, toolpath: ToolPath, served: AnyIntArray) -> Paired:
    """Pair the calls around holes with the steps that the cell wants.

    Args:
        trace: of the program.
        cell: names of the steps and their routines.
        toolpath: what was asked for, its holes numbered.
        served: (n,) motion that goes to the bottom of each hole, or to where the robot stands.
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
        text = _difference(call, name, event)
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


def _difference(call: TraceEvent, name: str, event: Event) -> str:
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
