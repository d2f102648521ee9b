"""Rows 21, 22: the spindle runs when it must, triggers and interrupts."""

from __future__ import annotations

import re
from collections.abc import Iterator, Set
from itertools import islice

from postproc.krl import text as krl
from postproc.krl.rules.blending import FEED
from postproc.krl.rules.part import Part, RoutineKey, bas, key_of, number
from postproc.krl.rules.subject import ERROR, WARNING, Subject
from postproc.records import dataclass

_ON = re.compile(r"SPINDLE.*(ON|RUN|START)\Z|SPINDLERUN\Z")
_OFF = re.compile(r"SPINDLE.*(OFF|STOP)\Z")
MOST_PRIORITY = 128
OWN_PRIORITIES = range(40, 81)
"""Interrupts and triggers have priorities from 1; those in between the controller gives itself."""
_BLOCKING = (krl.Halt, krl.WaitFor, krl.WaitSec, krl.SplineEnd)


def spindle(subject: Subject) -> None:
    """Row 21: on before the first cut, off behind the last."""
    for module, routine in subject.entries():
        _spindle(subject, module, routine)


@dataclass(slots=True)
class _Spindle:
    """Where the spindle was switched on, and the first cut while it stood.

    ``may_leave``: it has just been switched off, and the tool may leave a bore at feed.
    """

    on: tuple[str, int] | None = None
    used: bool = False
    speed: float | None = None
    cut: tuple[str, int] | None = None
    may_leave: bool = False


def _spindle(subject: Subject, module: krl.KrlModule, routine: krl.Routine) -> None:
    names = {
        _called(statement) for _, statement in subject.walk(module, routine, krl.Call, krl.Trigger)
    }
    if not any(_ON.search(name) or _OFF.search(name) for name in names):
        return  # no spindle of which the text knows
    state = _Spindle()
    for here, statement in subject.walk(
        module, routine, krl.Assign, krl.Move, krl.Call, krl.Trigger
    ):
        if isinstance(statement, krl.Assign | krl.Move):
            _follow(state, statement, here)
            continue
        place, name = (here.src_path, statement.line), _called(statement)
        if not name:
            continue
        if _ON.search(name):
            if state.cut is not None:
                subject.add(21, WARNING, *state.cut, "a cut at feed speed while the spindle stands")
            state.on, state.used, state.cut = place, True, None
        elif _OFF.search(name):
            if not state.used:
                subject.add(21, WARNING, *place, "the spindle is switched off and was never on")
            state.may_leave = state.on is not None
            state.on, state.used, state.cut = None, True, None
    if state.on is not None:
        message = "the spindle is switched on and never off"
        subject.add(21, WARNING, *state.on, message, hint="call what stops it at the end")


def _follow(state: _Spindle, statement: krl.Assign | krl.Move, here: krl.KrlModule) -> None:
    if isinstance(statement, krl.Assign):
        if statement.target == "$VEL.CP":
            state.speed = number(statement.value)
    elif not statement.word.is_axis_motion:
        is_cut = state.speed is not None and state.speed <= FEED
        if is_cut and state.on is None and state.cut is None and not state.may_leave:
            state.cut = here.src_path, statement.line
        state.may_leave = False


def _called(statement: krl.Statement) -> str:
    if isinstance(statement, krl.Trigger):
        statement = statement.action
    return statement.name.upper() if isinstance(statement, krl.Call) else ""


# --------------------------------------------------------------------------------------- triggers


def triggers(subject: Subject) -> None:
    """Row 22: a trigger belongs to the motion behind it; interrupt numbers are not shared."""
    decls = [s for part in subject.parts for s in part.of(krl.Interrupt) if s.word == "DECL"]
    declared = {number(s.number) for s in decls} - {None}
    if any(number(s.number) is None for s in decls):
        declared |= set(range(1, MOST_PRIORITY + 1))  # which one is not known
    programs = _programs(subject)
    for part in subject.parts:
        statements = part.routine.statements
        for index in part.places(krl.Trigger):
            _trigger(part, statements[index], islice(statements, index + 1, None))  # type: ignore[arg-type]
        _interrupts(part, declared, part.key in programs)
        _brakes(part, part.key in programs)


def _trigger(part: Part, trigger: krl.Trigger, behind: Iterator[krl.Statement]) -> None:
    stop = next((s for s in behind if _ends_search(part, s)), None)
    following = stop if isinstance(stop, krl.Move) else None
    line = trigger.line
    if isinstance(stop, _BLOCKING) or (
        stop is None and part.key not in part.subject.called_routines
    ):
        part.warn(22, line, "a TRIGGER without a motion behind it")
    elif following is None:
        pass  # the motion stands in another routine or on one of several ways
    elif trigger.word == "PATH" and following.word.is_axis_motion and not following.word.is_spline:
        message = f"TRIGGER WHEN PATH before a {following.word.value}: it needs a path motion"
        part.warn(22, line, message)
    if trigger.word == "DISTANCE" and number(trigger.where) not in (0.0, 1.0, None):
        part.warn(22, line, "TRIGGER WHEN DISTANCE: 0 is the start of the motion, 1 its end")
    if isinstance(trigger.action, krl.Call) and trigger.priority is None:
        message = "a TRIGGER that calls a routine needs PRIO"
        part.error(22, line, message, hint="PRIO=-1: the controller chooses")
    _priority(part, line, "PRIO", number(trigger.priority), lowest=-1)


def _ends_search(part: Part, statement: krl.Statement) -> bool:
    """Whether a statement behind a trigger decides about it, or lets nobody tell."""
    if isinstance(statement, krl.Call):
        target = part.subject.called(statement.name, part.module)
        return target is not None and key_of(*target) in part.subject.moving
    return isinstance(statement, (krl.Move, krl.SplineBegin, krl.Control, *_BLOCKING))


def _priority(part: Part, line: int, what: str, value: float | None, lowest: int = 1) -> None:
    """Report a priority that there is not, or that the controller gives itself."""
    if value is None or value == lowest:
        return
    if not 1 <= value <= MOST_PRIORITY or value % 1:
        part.error(22, line, f"{what} {value:g}, expected a whole number from 1 to {MOST_PRIORITY}")
    elif value in OWN_PRIORITIES:
        first, last = OWN_PRIORITIES[0], OWN_PRIORITIES[-1]
        message = f"{what} {value:g}: {first} to {last} are those that the controller gives itself"
        part.warn(22, line, message)


def _interrupts(part: Part, declared: Set[float | None], is_program: bool) -> None:
    seen: dict[float, int] = {}
    for statement in part.of(krl.Interrupt):
        value = number(statement.number)
        if value is None:
            continue
        if statement.word != "DECL":
            is_on = statement.word in ("ON", "ENABLE")
            if is_on and value not in declared and value != 3:
                message = f"INTERRUPT {statement.word} {value:g}: none of that number is declared"
                severity = ERROR if is_program else WARNING
                part.subject.add(22, severity, part.path, statement.line, message)
            continue
        _priority(part, statement.line, "INTERRUPT DECL", value)
        action = statement.action
        stop = isinstance(action, krl.Call) and action.name.upper() == "IR_STOPM"
        if value == 3 and not stop:
            part.warn(22, statement.line, "interrupt 3 belongs to the stop message of the INI")
        if value in seen:
            part.warn(22, statement.line, f"interrupt {value:g} was declared in line {seen[value]}")
        seen[value] = statement.line


def _brakes(part: Part, is_program: bool) -> None:
    """BRAKE and RESUME stand in the routine of an interrupt: a program that has them stops."""
    for statement in part.of(krl.Control) if is_program else ():
        if statement.word in ("BRAKE", "RESUME"):
            message = f"{statement.word} in a program: it stands in the routine of an interrupt"
            part.error(22, statement.line, message)


def _programs(subject: Subject) -> Set[RoutineKey]:
    """Return what is selected on the pad: it moves and initialises, and nothing here calls it."""
    keys = {key_of(*entry) for entry in subject.entries()}
    return {
        part.key
        for part in subject.parts
        if part.key in keys and any(bas(call)[0] == "INITMOV" for call in part.calls)
    }
