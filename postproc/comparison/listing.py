"""A program as a list of what it says, line by line, for comparing two of them.

Runs the text straight through: both branches of an IF, the body of a loop once, sub-programs where
they are called. Variables, frames by number, speeds and approximations are followed as when it is
run, so that it does not matter how a program says something. What cannot be followed is listed as
text.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.controller import (
    UNKNOWN,
    Activation,
    EventWord,
    Interpreter,
    Motions,
    Trace,
    World,
    text_of,
)
from postproc.errors import KrlError, RunKind
from postproc.krl import (
    Aggregate,
    Assign,
    Axes,
    Call,
    Control,
    Expr,
    Interrupt,
    KrlModule,
    KrlSyntaxError,
    Move,
    Pose,
    Raw,
    SplineBegin,
    SplineEnd,
    Trigger,
    components,
    render_statement,
    tokenise,
)
from postproc.records import dataclass

MAX_INLINED = 1000
"""A routine that is called more often is listed as a call from then on."""
_FRAME_DATA = ("TOOL_DATA[", "BASE_DATA[", "LOAD_DATA[")


@dataclass(frozen=True, slots=True)
class Listing:
    """What a program says: its motions, and in ``words`` (m,) the motion words as written."""

    trace: Trace
    words: tuple[str, ...]
    relative: tuple[str, ...]
    """(m,) frame of a relative motion, empty for a target."""


def listing(modules: Sequence[KrlModule], name: str, inline: bool = True) -> Listing:
    """Return the listing of a module.

    Args:
        modules: the module and, for ``inline``, those that it calls.
        name: the module.
        inline: list what is called at the place of the call; otherwise the call.

    Raises:
        KrlError: KRL009 if a block has no other half: the program would not load.
    """
    lister = _Lister(modules, inline)
    trace = lister.run(name)
    for finding in trace.findings:
        if finding.code in (RunKind.STRUCTURE, RunKind.ENDLESS):
            raise KrlError("KRL009", finding.message, finding.source)
    return Listing(trace, tuple(lister.motions.words), tuple(lister.motions.relative))


class _AnyFrame(dict[int, Pose]):
    """Frames by number: every number exists; which frame it is does not matter here."""

    def __contains__(self, key: object) -> bool:
        return True

    def __missing__(self, key: int) -> Pose:
        return Pose(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


class _NoFlow:
    """Lists lines of program control instead of following them."""

    def __init__(self, lister: _Lister) -> None:
        self._lister = lister

    def step(self, _run: Activation, _index: int, statement: Control) -> int | None:
        """List the line and go on with the next."""
        self._lister.note(EventWord.CONTROL, spaced(f"{statement.word} {statement.text}"))
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
        findings = len(self._lister.recorder.findings)
        super().move(statement)
        if len(self._lister.recorder) == before:
            del self._lister.recorder.findings[findings:]
            self._lister.note(EventWord.OTHER, render_statement(statement))
            return
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
        world = World(tools=_AnyFrame(), bases=_AnyFrame())
        super().__init__(modules, _NoKinematics(), world)  # type: ignore[arg-type]
        self.state.tool_data, self.state.base_data = _AnyFrame(), _AnyFrame()
        self._inline = inline
        self._inlined: Counter[tuple[str, str]] = Counter()
        self.motions = _ListedMotions(self)
        self._motions = self.motions
        self._control = _NoFlow(self)  # type: ignore[assignment]
        self._handlers |= {
            Move: self.motions.move,
            SplineBegin: self.motions.begin_spline,
            SplineEnd: self.motions.end_spline,
            Interrupt: self._interrupt,
            Raw: self._raw,
        }

    def run(self, name: str) -> Trace:
        """List a module; one without routines by what its data list holds."""
        module = self._modules[name.upper()]
        if module.routines:
            return super().run(name)
        file = self.recorder.file_row(module.dat_path)
        for key, value, line in module.data.values() if module.data is not None else ():
            text = f"{key.upper()}={_number_text(self.evaluator.value(value))}"
            self.recorder.event(EventWord.DATA, text, (file, line))
        return self.recorder.trace(self.state)

    def note(self, word: EventWord, text: str, value: float = math.nan) -> None:
        """List something between the motions."""
        self.recorder.event(word, text, self.place(), value)

    def _call(self, statement: Call) -> None:
        found = None if statement.name.upper() == "BAS" else self._resolve(statement.name.upper())
        if found is not None:
            key = found[0].name, found[1].name
            self._inlined[key] += 1
            if not self._inline or self._inlined[key] > MAX_INLINED:
                values = [self.evaluator.value(value) for value in statement.arguments]
                text = ",".join("?" if v is UNKNOWN else _number_text(v) for v in values)
                self.note(EventWord.HOOK, f"{statement.name.upper()}({text})")
                return
        super()._call(statement)

    def _trigger(self, statement: Trigger) -> None:
        where = self.evaluator.value(statement.where)
        delay = self.evaluator.value(statement.delay_ms)
        text = f"TRIGGER {statement.word}={_number_text(where)} DELAY={_number_text(delay)}"
        self.note(EventWord.OTHER, text)
        super()._trigger(statement)

    def _interrupt(self, statement: Interrupt) -> None:
        action = statement.action
        if isinstance(action, Call) and action.name.upper() == "IR_STOPM":
            return
        if statement.word == "ON" and statement.number == 3:
            return
        self.note(EventWord.OTHER, render_statement(statement).upper())

    def _raw(self, statement: Raw) -> None:
        words = statement.text.upper().split()
        if words and words[0] not in ("SIGNAL", "STRUC", "ENUM", "DECL", "GLOBAL", "CHANNEL"):
            self.note(EventWord.OTHER, " ".join(words))

    def assign(self, statement: Assign) -> None:
        if statement.target.upper().startswith(_FRAME_DATA):
            value = self.evaluator.value(statement.value)
            self.note(EventWord.DATA, f"{statement.target.upper()}={_number_text(value)}")
        super().assign(statement)


def spaced(text: str) -> str:
    """Return code in upper case with one blank between its tokens."""
    try:
        return " ".join(token.text.upper() for token in tokenise(text)).strip()
    except KrlSyntaxError:
        return " ".join(text.upper().split())


def _number_text(value: Any) -> str:  # noqa: ANN401 - a KRL value
    """Return a value as text in which the digits of a number do not matter."""
    if isinstance(value, Aggregate):
        return ",".join(f"{name} {{{_number_text(part)}}}" for name, part in value.fields)
    if isinstance(value, Pose | Axes):
        return ",".join(f"{name} {number:.9g}" for name, number in components(value))
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:.9g}"
    return text_of(value)
