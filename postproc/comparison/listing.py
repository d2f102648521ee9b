"""A program as a list of what it says, line by line, for comparing two of them.

Runs the text straight through: both branches of an IF, the body of a loop once, sub-programs where
they are called, and at the end the routines that nothing calls here. Variables, frames by number
and the state of the controller are followed as when it is run, so that it does not matter how a
program says something. What cannot be followed is listed as text: what the interpreter has a
finding about, what gets a value that is not known, what another program can see, and whatever
stands where it may or may not be run.
"""

from __future__ import annotations

import math
import re
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.comparison.texts import bas_command, is_vague, seen_by_others, spaced, value_text
from postproc.controller import (
    UNKNOWN,
    Activation,
    EventWord,
    Interpreter,
    Motions,
    Settings,
    Trace,
    World,
    pose_of,
)
from postproc.errors import KrlError, RunKind, SourceRef
from postproc.krl import (
    Assign,
    Axes,
    Call,
    Continue,
    Control,
    Declaration,
    Effect,
    Expr,
    Interrupt,
    KrlModule,
    Move,
    Node,
    Pose,
    Raw,
    Reference,
    Routine,
    SplineBegin,
    SplineEnd,
    Statement,
    Trigger,
    Value,
    WaitFor,
    parse_expression,
    render_statement,
    system_variable,
)
from postproc.records import dataclass

MAX_INLINED = 1000
"""A routine that is called more often is listed as a call from then on."""
_OPENING = frozenset({"IF", "FOR", "LOOP", "WHILE", "REPEAT", "SWITCH"})
_CLOSING = frozenset({"ENDIF", "ENDFOR", "ENDLOOP", "ENDWHILE", "UNTIL", "ENDSWITCH"})
_FORM_DATA = frozenset({"FDAT_ACT", "PDAT_ACT", "LDAT_ACT"})
_WRONG = (RunKind.STRUCTURE, RunKind.ENDLESS)
_NAME = re.compile(r"(?<![\w$#.])[A-Z_]\w*")
_APART_MM = 1e6
"""Frames whose numbers are all that is known are taken for frames so far apart."""


@dataclass(frozen=True, slots=True)
class Listing:
    """What a program says: its motions, and in ``words`` (m,) the motion words as written."""

    trace: Trace
    words: tuple[str, ...]
    relative: tuple[str, ...]
    """(m,) frame of a relative motion, empty for a target."""
    ends: tuple[tuple[str, int, tuple[str, int]], ...]
    """Routines that were begun by themselves: name, row of the settings at its end, its place."""


def listing(modules: Sequence[KrlModule], name: str, inline: bool = True) -> Listing:
    """Return the listing of a module; ``inline``: with what is called at the place of the call."""
    lister = _Lister(modules, inline)
    trace = lister.run(name)
    for finding in trace.findings:
        if finding.code in _WRONG:
            raise KrlError("KRL009", finding.message, finding.source)
    words, relative = tuple(lister.motions.words), tuple(lister.motions.relative)
    return Listing(trace, words, relative, tuple(lister.ends))


class _AnyFrame(dict[int, Pose]):
    """Frames by number: every number exists, and is another frame than all others."""

    def __contains__(self, key: object) -> bool:
        return True

    def __missing__(self, key: int) -> Pose:
        return Pose(_APART_MM * key, 0.0, 0.0, 0.0, 0.0, 0.0)


class _AnyElement(dict[tuple[int, ...], Any]):
    """Frames of a data array, likewise."""

    def get(self, key: tuple[int, ...], default: Any = None) -> Any:  # noqa: ANN401
        known = super().get(key, UNKNOWN)
        return Pose(_APART_MM * key[0], 0, 0, 0, 0, 0) if known is UNKNOWN else known


class _AnyHook(frozenset[str]):
    """Every routine that is not here is one of the integrator's: its calls are listed."""

    def __contains__(self, name: object) -> bool:
        return True


class _NoFlow:
    """Lists lines of program control instead of following them."""

    def __init__(self, lister: _Lister) -> None:
        self._lister = lister

    def step(self, _run: Activation, _index: int, statement: Control) -> int | None:
        """List the line and go on with the next."""
        lister = self._lister
        lister.depth += (statement.word in _OPENING) - (statement.word in _CLOSING)
        lister.note(EventWord.CONTROL, lister.said(statement))
        return None


class _ListedMotions(Motions):
    """Keeps targets as written: partial and relative ones are compared, not completed."""

    def __init__(self, lister: _Lister) -> None:
        super().__init__(lister.evaluator, lister.targets, lister)
        self.words: list[str] = []
        self.relative: list[str] = []
        self._lister = lister

    def _target(self, statement: Move) -> Pose | Axes | None:
        value: Any = statement.target
        if isinstance(value, Expr):
            value = self._evaluator.value(value)
        return value if isinstance(value, Pose | Axes) else None

    def move(self, statement: Move) -> None:
        before = len(self._lister.recorder)
        super().move(statement)
        if len(self._lister.recorder) > before:
            self.words.append(statement.word.value)
            is_relative = statement.word.is_relative
            self.relative.append((statement.frame or "BASE") if is_relative else "")

    def begin_spline(self, statement: SplineBegin) -> None:
        self._lister.note(EventWord.CONTROL, statement.word)
        super().begin_spline(statement)

    def end_spline(self, statement: SplineEnd) -> None:
        super().end_spline(statement)
        self._lister.note(EventWord.CONTROL, " ".join(("ENDSPLINE", *statement.blend)))


class _NoKinematics:
    """Stands in where a robot model is asked for: listing never needs where the robot is."""

    def fk(self, _q: FloatArray) -> FloatArray:
        """Return the unit transform."""
        return np.eye(4)


class _Lister(Interpreter):
    """Goes through the text once, from top to bottom."""

    def __init__(self, modules: Sequence[KrlModule], inline: bool) -> None:
        world = World(tools=_AnyFrame(), bases=_AnyFrame(), hooks=_AnyHook())
        super().__init__(modules, _NoKinematics(), world)  # type: ignore[arg-type]
        self.state.tool_data, self.state.base_data = _AnyFrame(), _AnyFrame()
        scope = self._memory.lookup("TOOL_DATA")
        for name in ("TOOL_DATA", "BASE_DATA"):
            if scope is not None:
                scope.arrays[name] = _AnyElement(scope.arrays[name])
        self._inline = inline
        self._inlined: Counter[tuple[str, str]] = Counter()
        self._listed_routines: set[tuple[str, str, int]] = set()
        self._is_asking = False
        self._at_start = self.state.values
        self._lines_left = self._motions_left = sys.maxsize  # it never goes back
        self._unseen: dict[str, Any] = {}
        """What was in force at the last motion, of all that was set since."""
        self.ends: list[tuple[str, int, tuple[str, int]]] = []
        self.depth = 0
        """Blocks around the line that runs: what stands in one may not be run, or often."""
        self.motions = _ListedMotions(self)
        self._motions = self.motions
        self._control = _NoFlow(self)  # type: ignore[assignment]
        own: dict[type, Callable[[Any], None]] = {
            Move: self.motions.move,
            SplineBegin: self.motions.begin_spline,
            SplineEnd: self.motions.end_spline,
            Continue: self._note_statement,
            Interrupt: self._note_statement,
            Raw: self._note_statement,
            WaitFor: lambda statement: self.note(EventWord.WAIT_FOR, self.said(statement)),
        }
        self._handlers = {
            kind: handler if kind is Declaration else partial(self._listed, handler)
            for kind, handler in {**self._handlers, **own}.items()
        }

    def run(self, name: str) -> Trace:
        """List a module; one without routines by what its data list holds."""
        module = self._modules[name.upper()]
        listed = tuple(self._modules.values()) if self._inline else (module,)
        for other in listed:
            file = self.recorder.file_row(other.dat_path or other.src_path)
            for key, value, line in seen_by_others(other):
                text = f"{key.upper()}={value_text(self.evaluator.value(value))}"
                self.recorder.event(EventWord.DATA, text, (file, line))
        if module.routines:
            self._begin(module, module.main)
        for other in listed:
            for routine in other.routines:
                if _key(other, routine) not in self._listed_routines:
                    file = self.recorder.file_row(other.src_path)
                    names = ",".join(f"{p.name}:{p.mode}" for p in routine.parameters)
                    text = spaced(f"DEF {routine.name}({names})")
                    self.recorder.event(EventWord.CONTROL, text, (file, routine.line))
                    self._begin(other, routine)
        return self.recorder.trace(self.state)

    def _begin(self, module: KrlModule, routine: Routine) -> None:
        """List a routine as if it were selected on the pad."""
        self.state.values = self._at_start
        self._unseen.clear()
        self._execute(module, routine, ())
        name = "" if not self.ends else routine.name.upper()  # the program itself comes first
        self.ends.append((name, self.state.row(), (module.src_path, routine.end_line)))

    def _execute(
        self, module: KrlModule, routine: Routine, arguments: tuple[tuple[str, Any], ...]
    ) -> Activation:
        self._listed_routines.add(_key(module, routine))
        jumps = any(type(s) is Control and s.word == "GOTO" for s in routine.statements)
        depth = self.depth
        self.depth += jumps
        done = super()._execute(module, routine, arguments)
        self.depth = depth
        return done

    # ---------------------------------------------------------------------------- what is listed

    def note(self, word: EventWord, text: str, value: float = math.nan) -> None:
        """List something between the motions."""
        self.recorder.event(word, text, self.place(), value)

    def _note_statement(self, statement: Statement) -> None:
        self.note(EventWord.OTHER, self.said(statement))

    def _listed(self, handler: Callable[[Any], None], statement: Statement) -> None:
        """Run a statement, and list it unless all that it does is followed or listed by itself."""
        record = self.recorder
        findings, motions, events = len(record.findings), len(record), len(record.events)
        before = self.state.values
        handler(statement)
        if type(statement) is Assign or bas_command(statement):
            self._watch(before)
        if len(record) > motions or bas_command(statement) == "INITMOV":
            self._unseen.clear()
        fresh = record.findings[findings:]
        record.findings[findings:] = [item for item in fresh if item.code in _WRONG]
        own = record.events[events:]
        if any(event.word in (EventWord.DATA, EventWord.OTHER) for event in own):
            return
        unknown = any(is_vague(event.arguments) for event in own)
        if fresh or unknown or (self.depth and len(record) == motions and not own):
            self._note_statement(statement)

    def _watch(self, before: Settings) -> None:
        """List what was in force for no motion: set, and set again before anything moved."""
        after = self.state.values
        if after is before:
            return
        old, new = self._state_of(before), self._state_of(after)
        for name in sorted(k for k in old.keys() | new.keys() if old.get(k) != new.get(k)):
            value = old.get(name)
            if self._unseen.setdefault(name, value) != value:
                self.note(EventWord.OTHER, f"{name} {value} in force for no motion")

    def _state_of(self, values: Settings) -> dict[str, Any]:
        """Return the state by name, frames by their numbers or as poses."""
        found: dict[str, Any] = {**values.system, "load": values.load_number}
        frames = self.state.tool_frames.rows[values.tool], self.state.base_frames.rows[values.base]
        numbers = values.tool_number, values.base_number
        for name, number, T in zip(("tool", "base"), numbers, frames, strict=True):
            found[name] = number if number >= 0 else value_text(pose_of(T))
        return found

    def said(self, statement: Statement) -> str:
        """Return a statement as it is written, with the values that its names have here."""
        try:
            text = spaced(render_statement(replace(statement, comment="")))
        except KrlError as problem:  # a number too large to be written
            source = SourceRef(self._stack[-1].module.src_path, statement.line)
            raise KrlError(problem.code, problem.message, source) from None
        values = []
        for name in dict.fromkeys(_NAME.findall(text)):
            scope = self._memory.lookup(name)
            value: Any = UNKNOWN if scope is None else scope.plain.get(name, UNKNOWN)
            if value is not UNKNOWN:
                values.append(f"{name} = {value_text(value)}")
            elements = {} if scope is None else scope.arrays.get(name, {})
            values += [f"{name}{list(i)} = {value_text(v)}" for i, v in sorted(elements.items())]
        return f"{text} with {', '.join(values)}" if values else text

    def _call(self, statement: Call) -> None:
        name = statement.name.upper()
        found = None if name == "BAS" else self._resolve(name)
        if found is None:
            super()._call(statement)
            return
        key = found[0].name, found[1].name
        self._inlined[key] += 1
        if self._inline and self._inlined[key] <= MAX_INLINED:
            values = statement.arguments
            nodes = [parse_expression(v.text) if isinstance(v, Expr) else v for v in values]
            self._run_routine(*found, nodes)
            return
        given = [self._asked(value) for value in statement.arguments if value is not None]
        if None in given:
            self._note_statement(statement)
        else:
            self.note(EventWord.HOOK, f"{name}({','.join(map(str, given))})")

    def _trigger(self, statement: Trigger) -> None:
        self._note_statement(statement)
        super()._trigger(statement)

    def assign(self, statement: Assign) -> None:
        """Follow an assignment; list it where others see the variable or its value is unknown."""
        node = parse_expression(statement.target)
        name = node.name if isinstance(node, Reference) else ""
        variable = system_variable(name) if name.startswith("$") else None
        is_own = name.startswith("$") or name in _FORM_DATA or self._memory.is_own(name)
        super().assign(statement)
        if variable is not None and variable.effect is Effect.HARMLESS:
            return
        value, key = self._asked(statement.value), self._key_of(node)
        if value is None or not key:
            self.note(EventWord.DATA, self.said(statement))
        elif not is_own:
            self.note(EventWord.DATA, f"{key}={value}")

    def _assign_system(self, node: Reference, value: Any, *, by_form: bool) -> None:  # noqa: ANN401
        """Keep what is set, whatever it does: it is compared at every motion."""
        super()._assign_system(node, value, by_form=True)

    def _key_of(self, node: Node) -> str:
        return (self.evaluator.key(node) or "") if isinstance(node, Reference) else ""

    def _asked(self, value: Value) -> str | None:
        """Return the text of a value without running anything for it; None: it is not known."""
        findings = len(self.recorder.findings)
        self._is_asking = True
        text = value_text(self.evaluator.value(value))
        self._is_asking = False
        del self.recorder.findings[findings:]
        return None if "UNKNOWN" in text else text

    def _function(self, name: str, arguments: tuple[Node | None, ...]) -> Any:  # noqa: ANN401
        is_here = self._resolve(name.upper()) is not None
        return UNKNOWN if is_here and self._is_asking else super()._function(name, arguments)


def _key(module: KrlModule, routine: Routine) -> tuple[str, str, int]:
    return module.name, routine.name, routine.line
