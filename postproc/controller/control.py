"""Program control while a routine runs: which line comes next."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import field
from typing import Any

from postproc.controller.runtime import UNKNOWN, Evaluator, Variables
from postproc.errors import RunKind, Severity
from postproc.krl import LOOPS, Control, Flow, KrlModule, Node, Routine, Statement, parse_expression
from postproc.records import dataclass


@dataclass(slots=True)
class Activation:
    """A routine while it runs."""

    routine: Routine
    module: KrlModule
    flow: Flow
    file: int
    local: Variables = field(default_factory=Variables)
    result: Any = UNKNOWN
    limits: dict[int, tuple[float, float]] = field(default_factory=dict)
    """FOR line to end value and step."""
    unknown_before: dict[int, int] = field(default_factory=dict)
    """LOOP line to the number of unknown conditions when its pass began."""
    doubtful: dict[int, tuple[Statement, ...]] = field(default_factory=dict)
    """Last line of a block to what may have run in it, or not."""
    line: int = 0
    """Line of the call that it waits for."""

    @property
    def ends(self) -> bool:
        """Whether only counted loops lead back to the line."""
        texts = self.routine.statements
        around = {
            getattr(texts[opener], "word", "")
            for opener, closer in self.flow.end.items()
            if texts[opener].line <= self.line <= texts[closer].line
        }
        jumps = any(isinstance(s, Control) and s.word == "GOTO" for s in texts)
        return not jumps and not around & (LOOPS - {"FOR"})


class ControlFlow:
    """Executes ``Control`` statements.

    Args:
        evaluator: computes conditions.
        assign: sets a variable by reference.
        finding: reports (kind, message, severity) at the line that runs.
        is_idle: whether a statement neither moves the arm nor changes how it moves.
        is_accepted: whether a condition that is not known is taken on trust.
        forget: takes what statements assign as not known.
    """

    def __init__(
        self,
        evaluator: Evaluator,
        assign: Callable[[Node, Any], None],
        finding: Callable[[RunKind, str, Severity], None],
        is_idle: Callable[[Statement], bool],
        is_accepted: Callable[[str], bool],
        forget: Callable[[Sequence[Statement]], None],
    ) -> None:
        self._evaluator = evaluator
        self._assign = assign
        self._finding = finding
        self._is_idle, self._is_accepted, self._forget = is_idle, is_accepted, forget
        self._unknown = 0
        self._steps: dict[str, Callable[[Activation, int, Control], int | None]] = {
            "IF": self._if,
            "ELSE": self._leave,
            "CASE": self._leave,
            "DEFAULT": self._leave,
            "FOR": self._for,
            "ENDFOR": self._end_for,
            "LOOP": self._loop,
            "ENDLOOP": self._end_loop,
            "WHILE": self._while,
            "ENDWHILE": self._end_while,
            "UNTIL": self._until,
            "SWITCH": self._switch,
            "EXIT": self._exit,
            "GOTO": self._goto,
            "RETURN": self._return,
            "BRAKE": self._interrupted,
            "RESUME": self._interrupted,
        }

    def step(self, run: Activation, index: int, statement: Control) -> int | None:
        """Return the index of the line to go to, None for the next one."""
        self._leave_doubtful(run, index)
        handler = self._steps.get(statement.word)
        return handler(run, index, statement) if handler is not None else None

    def _condition(self, text: str, run: Activation, start: int, stop: int) -> Any:  # noqa: ANN401
        """Return True, False or UNKNOWN; the condition decides about the lines start to stop."""
        value = self._evaluator.node(parse_expression(text.strip()))
        if value is UNKNOWN:
            self._unknown += 1
            self._unsure(
                f"{text.strip()} is not known here, taken as FALSE", text, run, start, stop
            )
        return value

    def _unsure(self, message: str, text: str, run: Activation, start: int, stop: int) -> None:
        """Report a way that is not known: an error where it decides about motions."""
        between = run.routine.statements[start + 1 : stop]
        run.doubtful[stop] = between
        self._forget(between)
        trusted = self._is_accepted(text) or all(map(self._is_idle, between))
        severity = Severity.WARNING if trusted else Severity.ERROR
        self._finding(RunKind.CONDITION, message, severity)

    def _leave_doubtful(self, run: Activation, stop: int) -> None:
        """Forget what a block assigns at its end: another branch may have run."""
        between = run.doubtful.pop(stop, None)
        if between is not None:
            self._forget(between)

    def _endless(self, message: str, text: str) -> None:
        severity = Severity.WARNING if self._is_accepted(text) else Severity.ERROR
        self._finding(RunKind.ENDLESS, f"{message}: run once", severity)

    def _if(self, run: Activation, index: int, statement: Control) -> int | None:
        if self._condition(statement.expressions[0], run, index, run.flow.end[index]):
            return None
        branches = run.flow.branches.get(index)
        return (branches[0] if branches else run.flow.end[index]) + 1

    def _leave(self, run: Activation, index: int, _statement: Control) -> int | None:
        stop = run.flow.end[run.flow.owner[index]]
        self._leave_doubtful(run, stop)
        return stop + 1

    def _for(self, run: Activation, index: int, statement: Control) -> int | None:
        if not statement.expressions:
            return None
        variable, *texts = statement.expressions
        values = (self._evaluator.node(parse_expression(text.strip())) for text in texts)
        first, last, step = (*values, 1)[:3]
        if UNKNOWN in (first, last, step) or not step:
            text = "the range of FOR is not known: run once"
            self._unsure(text, f"FOR {statement.text}", run, index, run.flow.end[index])
            run.limits[index] = (float("-inf"), 1.0)
            return None
        self._assign(parse_expression(variable.strip()), first)
        run.limits[index] = (last, step)
        inside = first <= last if step > 0 else first >= last
        return None if inside else run.flow.end[index] + 1

    def _end_for(self, run: Activation, index: int, _statement: Control) -> int | None:
        start = run.flow.start[index]
        last, step = run.limits[start]
        head = run.routine.statements[start]
        if not (isinstance(head, Control) and head.expressions):
            return None
        variable = parse_expression(head.expressions[0].strip())
        value = self._evaluator.node(variable)
        if value is UNKNOWN:
            return None
        self._assign(variable, value + step)
        inside = value + step <= last if step > 0 else value + step >= last
        return start + 1 if inside else None

    def _loop(self, run: Activation, index: int, _statement: Control) -> int | None:
        run.unknown_before[index] = self._unknown
        return None

    def _end_loop(self, run: Activation, index: int, statement: Control) -> int | None:
        start = run.flow.start[index]
        known = run.unknown_before.get(start, self._unknown) == self._unknown
        if start in run.flow.exits and known:
            return start
        self._endless("a LOOP without a known way out", "LOOP")
        return None

    def _while(self, run: Activation, index: int, statement: Control) -> int | None:
        if self._condition(statement.text, run, index, run.flow.end[index]):
            return None
        return run.flow.end[index] + 1

    def _end_while(self, run: Activation, index: int, statement: Control) -> int | None:
        start = run.flow.start[index]
        head = run.routine.statements[start]
        endless = isinstance(head, Control) and head.text.strip().upper() == "TRUE"
        if endless and start not in run.flow.exits:
            self._endless("an endless WHILE", "WHILE TRUE")
            return None
        return start

    def _until(self, run: Activation, index: int, statement: Control) -> int | None:
        value = self._condition(statement.text, run, run.flow.start[index], index)
        return None if value is UNKNOWN or value else run.flow.start[index] + 1

    def _switch(self, run: Activation, index: int, statement: Control) -> int | None:
        value = self._condition(statement.text, run, index, run.flow.end[index])
        for place in run.flow.branches.get(index, ()):
            case = run.routine.statements[place]
            if isinstance(case, Control) and self._is_case(case, value):
                return place + 1
        return run.flow.end[index] + 1

    def _is_case(self, case: Control, value: Any) -> bool:  # noqa: ANN401
        if case.word == "DEFAULT":
            return True
        choices = [self._evaluator.node(parse_expression(t.strip())) for t in case.text.split(",")]
        return value is not UNKNOWN and value in choices

    def _exit(self, run: Activation, index: int, _statement: Control) -> int | None:
        return run.flow.end[run.flow.loop[index]] + 1

    def _goto(self, run: Activation, _index: int, statement: Control) -> int | None:
        target = run.flow.labels.get(statement.text.strip().upper())
        if target is None:
            self._finding(RunKind.STRUCTURE, f"no label {statement.text}", Severity.ERROR)
        return target

    def _interrupted(self, _run: Activation, _index: int, statement: Control) -> None:
        text = f"{statement.word} outside an interrupt: the controller stops with an error"
        self._finding(RunKind.STRUCTURE, text, Severity.ERROR)

    def _return(self, run: Activation, _index: int, statement: Control) -> int | None:
        if statement.text.strip():
            run.result = self._evaluator.node(parse_expression(statement.text.strip()))
        return len(run.routine.statements)
