"""Signals of the CAM file: set and waited for with their value, where the file has them.

A signal that the cell maps is an output or input of the controller, any other one a call of the
integrator's routine with its name, its port and its value.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from postproc.cell import Cell
from postproc.controller import EventWord, Trace, TraceEvent
from postproc.errors import RunKind
from postproc.model import Event, EventKind
from postproc.verification.report import AT_MOST, Remark

_KINDS = (EventKind.SIGNAL, EventKind.WAIT_SIGNAL)


class Span(NamedTuple):
    """First and last motion before which an event of the file may happen."""

    first: int
    last: int


Asked = tuple[Event, Span]
Pair = tuple[Event, TraceEvent]


class Paired(NamedTuple):
    """(event, its call) of what is there, calls beyond that, and what is wrong with all of them."""

    pairs: list[Pair]
    surplus: list[TraceEvent]
    faults: list[Remark]


def paired_signals(trace: Trace, cell: Cell, everything: Sequence[Asked]) -> Paired:
    """Pair signals and waits for them with those of the CAM file, in their order.

    Args:
        trace: of the program.
        cell: which signals are outputs and inputs, and the names of the routines for the others.
        everything: the events of the file and where each belongs.

    Returns:
        The signals that are there; none of a group with too many or too few.
    """
    ports: Mapping[EventKind, Mapping[str, int]] = {
        EventKind.SIGNAL: cell.krl.outputs,
        EventKind.WAIT_SIGNAL: cell.krl.inputs,
    }
    asked = [(event, span) for event, span in everything if event.kind in _KINDS]
    mapped = [ports[event.kind].get(event.text, 0) for event, _ in asked]
    routines = {cell.krl.hooks[str(kind)].upper() for kind in _KINDS}
    outputs = {f"$OUT[{number}]" for number in cell.krl.outputs.values()}
    inputs = {_condition(n, value) for n in cell.krl.inputs.values() for value in (True, False)}
    groups = (
        (
            "signals of the routines",
            [item for item, port in zip(asked, mapped, strict=True) if not port],
            [e for e in trace.events if e.word is EventWord.HOOK and e.name in routines],
        ),
        (
            "outputs and inputs",
            [item for item, port in zip(asked, mapped, strict=True) if port],
            [
                e
                for e in trace.events
                if (e.word is EventWord.OUTPUT and e.name in outputs)
                or (e.word is EventWord.WAIT_FOR and _plain(e.name) in inputs)
            ],
        ),
    )
    found = Paired([], [], [])
    for words, wanted, have in groups:
        if len(wanted) != len(have):
            text = count_text(f"{words}: {len(have)}", wanted)
            found.faults.append(fault(trace, have[-1] if have else None, text))
            continue
        faults = [
            (call, text)
            for (event, span), call in zip(wanted, have, strict=True)
            if (text := _difference(cell, ports, event, span, call))
        ]
        found.faults.extend(fault(trace, call, text) for call, text in faults[:AT_MOST])
        found.pairs.extend((event, call) for (event, _), call in zip(wanted, have, strict=True))
    return found


def fault(trace: Trace, call: TraceEvent | None, text: str) -> Remark:
    """Return what is wrong with a call; None: with the program as a whole."""
    return Remark(RunKind.EVENT, trace.place_of(call) if call else None, text)


def count_text(found: str, asked: Sequence[Asked]) -> str:
    """Return what is said where a program has too many or too few events of some kind.

    Args:
        found: what it has.
        asked: what the CAM file asks for.
    """
    lines = ", ".join(str(event.line) for event, _ in asked[:5])
    where = f" (lines {lines})" if asked else ""
    return f"{found}, the CAM file asks for {len(asked)}{where}"


def _difference(
    cell: Cell,
    ports: Mapping[EventKind, Mapping[str, int]],
    event: Event,
    span: Span,
    call: TraceEvent,
) -> str:
    port = ports[event.kind].get(event.text, 0)
    value = bool(event.value)
    if not port:
        number = int(event.arguments[0]) if event.arguments else 0
        name = cell.krl.hooks[str(event.kind)].upper()
        same = (call.name, *call.arguments[1:]) == (name, number, value)
        same &= bool(call.arguments) and _letters(str(call.arguments[0])) == _letters(event.text)
    elif event.kind is EventKind.SIGNAL:
        same = (call.name, call.value) == (f"$OUT[{port}]", float(value))
    else:
        same = _plain(call.name) == _condition(port, value)
    if not same:
        values = ", ".join(str(item) for item in call.arguments) or f"{call.value:g}"
        return f"{call.name} ({values}): line {event.line} has {event.kind} {event.text} {value}"
    if not span.first <= call.motion <= span.last:
        return f"{call.name} comes elsewhere than {event.text} in line {event.line}"
    return ""


def _condition(port: int, value: bool) -> str:
    return f"$IN[{port}]=={value}".upper()


def _plain(condition: str) -> str:
    return "".join(condition.upper().split())


def _letters(name: str) -> str:
    """Return a name without the characters that no KRL text can hold."""
    return "".join(c for c in name if c.isascii() and c.isalnum())
