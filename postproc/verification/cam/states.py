"""Tool, spindle and coolant while the program runs: what each event and each motion finds.

Two events of different kinds are in the wrong order where one finds another state than the CAM
file has there: a tool that is changed while the spindle turns. Coolant and spindle do not find
each other: which of them comes first makes no difference.

Signals are set and waited for with their value, where the file has them. One that the cell maps is
an output or input of the controller, any other one a call of the integrator's routine with its
name, its port and its value.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.controller import EventWord, Trace, TraceEvent
from postproc.errors import RunKind
from postproc.model import Event, EventKind
from postproc.verification.report import AT_MOST, Remark

SPINDLE = (
    EventKind.SPINDLE_ON,
    EventKind.SPINDLE_OFF,
    EventKind.TAP_REVERSE,
    EventKind.SPINDLE_ORIENT,
)
COOLANT = (EventKind.COOLANT_ON, EventKind.COOLANT_OFF)
_TOOL = (EventKind.TOOL_CHANGE,)
_SIGNALS = (EventKind.SIGNAL, EventKind.WAIT_SIGNAL)
_GROUPS = {"tool": _TOOL, "spindle": SPINDLE, "coolant": COOLANT, "signals": _SIGNALS}
_GROUP_OF = {kind: name for name, kinds in _GROUPS.items() for kind in kinds}
_OFF = (EventKind.SPINDLE_OFF, EventKind.SPINDLE_ORIENT, EventKind.COOLANT_OFF)
_FINDING = (
    EventKind.TOOL_CHANGE,
    EventKind.STOP,
    EventKind.OPTIONAL_STOP,
    EventKind.HOLE,
    *_SIGNALS,
)
"""Events for which it matters what they find."""
_ADDED = "off, by a call that the file does not ask for"

State = Mapping[str, object]
"""What each group is; a group without an entry is off, or not yet named."""


class States:
    """What the events of a program find, and what the CAM file says that they find.

    ``asked``: (event of the file, its call, None for a dwell) in the file's order; ``extra``:
    (kind, call) of those calls that the file does not ask for.
    """

    def __init__(
        self,
        events: Iterable[TraceEvent],
        asked: Sequence[tuple[Event, TraceEvent | None]],
        extra: Iterable[tuple[EventKind, TraceEvent]],
    ) -> None:
        self._asked = [(event, call) for event, call in asked if call is not None]
        self._groups = {_GROUP_OF[e.kind] for e, _ in self._asked if e.kind in _GROUP_OF}
        kinds = {id(call): event.kind for event, call in self._asked}
        added = {id(call): kind for kind, call in extra}
        self._expected: dict[int, State] = {}  # by the id of an event of the file
        state: State = {}
        for event, call in asked:
            self._expected[id(event)] = state
            if call is not None:
                state = self._after(state, event.kind, call)
        self._found: dict[int, State] = {}  # by the id of an event of the program
        state = {}
        # A trigger fires on the motion behind it: whatever stands between them comes first.
        for call in sorted(events, key=lambda call: (call.motion, call.on_the_way)):
            self._found[id(call)] = state
            kind = kinds.get(id(call), added.get(id(call)))
            if kind is not None:
                state = self._after(state, kind, call, id(call) in added)

    def _after(
        self, state: State, kind: EventKind, call: TraceEvent, is_added: bool = False
    ) -> State:
        group = _GROUP_OF.get(kind)
        if group not in self._groups:
            return state
        if kind in _SIGNALS:
            return {**state, group: (state.get(group) or 0) + 1}  # type: ignore[operator]
        value = label(kind, call)
        if value is None and is_added and state.get(group) is not None:
            value = _ADDED
        return {**state, group: value}

    def key(self, event: Event) -> object:
        """Return what is equal for two events of the file that find the same."""
        state = self._expected[id(event)]
        return tuple(state.get(group) for group in _GROUPS)

    def difference(self, event: Event, call: TraceEvent) -> str:
        """Return in what a call of the program finds other than the file says; empty: in nothing.

        That something is off that may be on harms nobody who stands or changes a tool.
        """
        asked, found = self._expected[id(event)], self._found[id(call)]
        for group in _GROUPS:
            want, have = asked.get(group), found.get(group)
            if want != have and have != _ADDED:
                where = f"line {event.line} of the CAM file has it"
                return f"{group}: {_words(have)}, {where}: {_words(want)}"
        return ""

    def faults(self, trace: Trace, is_cut: BoolArray) -> Iterator[Remark]:
        """Yield events that find, and cuts (m,) that run with, other than the file says."""
        wrong = [
            (call, text)
            for event, call in self._asked
            if event.kind in _FINDING and (text := self.difference(event, call))
        ]
        for call, text in wrong[:AT_MOST]:
            yield Remark(RunKind.EVENT, trace.place_of(call), f"{call.name} comes with {text}")
        order = {id(call): place for place, call in enumerate(trace.events)}
        for kinds in (SPINDLE, COOLANT):
            asked = [(e.kind, call) for e, call in self._asked if e.kind in kinds]
            have = sorted(asked, key=lambda item: order[id(item[1])])
            count = len(is_cut)
            swapped = is_cut & (states_at(have, count) != states_at(asked, count))
            for motion in np.flatnonzero(swapped)[:1].tolist():
                text = f"a cut with the {_GROUP_OF[kinds[0]]} not as in the file: calls are swapped"
                yield Remark(RunKind.EVENT, motion, text)


def label(kind: EventKind, call: TraceEvent) -> str | None:
    """Return what a call makes of its group, None for off."""
    value = "" if math.isnan(call.value) else f" {call.value:g}"
    return None if kind in _OFF else f"{kind}{value}".replace("_", " ")


def states_at(calls: Sequence[tuple[EventKind, TraceEvent]], count: int) -> NDArray[np.object_]:
    """Return what calls of one group have made of it at each of so many motions."""
    states = np.array([None, *(label(kind, event) for kind, event in calls)], dtype=np.object_)
    motions = np.maximum.accumulate([0, *(event.motion for _, event in calls)])[1:]
    return states[np.searchsorted(motions, np.arange(count), side="right")]


def _words(value: object) -> str:
    return "off" if value is None else str(value)


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

    Returns those that are there; none of a group with too many or too few.
    """
    ports: Mapping[EventKind, Mapping[str, int]] = {
        EventKind.SIGNAL: cell.krl.outputs,
        EventKind.WAIT_SIGNAL: cell.krl.inputs,
    }
    asked = [(event, span) for event, span in everything if event.kind in _SIGNALS]
    mapped = [ports[event.kind].get(event.text, 0) for event, _ in asked]
    routines = {cell.krl.hooks[str(kind)].upper() for kind in _SIGNALS}
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
    """Return what is said where a program has too many or too few events of some kind."""
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
        return f"{call.name} is at another place than {event.text} in line {event.line}"
    return ""


def _condition(port: int, value: bool) -> str:
    return f"$IN[{port}]=={value}".upper()


def _plain(condition: str) -> str:
    return "".join(condition.upper().split())


def _letters(name: str) -> str:
    """Return a name without the characters that no KRL text can hold."""
    return "".join(c for c in name if c.isascii() and c.isalnum())
