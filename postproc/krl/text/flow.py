"""Where the lines of a block lead: partners of IF, FOR, LOOP, SWITCH, SPLINE, labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field

from postproc.krl.text.program import (
    BRANCHES,
    CLOSERS,
    LOOPS,
    OPENERS,
    Control,
    Routine,
    SplineBegin,
    SplineEnd,
    Statement,
)
from postproc.records import dataclass


@dataclass(slots=True)
class Flow:
    """Partners by statement index.

    ``end``: opener to closer; ``start``: closer to opener; ``branches``: IF and SWITCH to the
    indices of their ELSE, CASE and DEFAULT; ``owner``: ELSE, CASE, DEFAULT to their opener;
    ``loop``: EXIT to the loop around it; ``exits``: loops that have an EXIT; ``labels``: by name;
    ``broken``: lines without their partner, and what is wrong there.
    """

    end: dict[int, int] = field(default_factory=dict)
    start: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[int]] = field(default_factory=dict)
    owner: dict[int, int] = field(default_factory=dict)
    loop: dict[int, int] = field(default_factory=dict)
    exits: set[int] = field(default_factory=set)
    labels: dict[str, int] = field(default_factory=dict)
    broken: list[tuple[int, str]] = field(default_factory=list)


_BLOCKS = frozenset({Control, SplineBegin, SplineEnd})


def flow_of(routine: Routine) -> Flow:
    """Return where the control lines of a routine lead."""
    flow = Flow()
    stack: list[tuple[int, str]] = []
    statements = routine.statements
    for index in [i for i, s in enumerate(statements) if type(s) in _BLOCKS]:
        wrong = _place(flow, stack, index, statements)
        if wrong:
            flow.broken.append((statements[index].line, wrong))
    flow.broken += [(statements[i].line, f"{word} is never closed") for i, word in stack]
    return flow


def _place(
    flow: Flow, stack: list[tuple[int, str]], index: int, statements: Sequence[Statement]
) -> str:
    """Find the partner of a line; return what is wrong if it has none."""
    statement = statements[index]
    word = _word(statement)
    around, opener = stack[-1] if stack else (-1, "")
    if word in CLOSERS or word == "SPLINE":
        stack.append((index, word))
    elif word in OPENERS or word == "ENDSPLINE":
        wanted = OPENERS.get(word, "SPLINE")
        if opener != wanted:
            is_open = f"{opener} of line {statements[around].line} is open" if stack else ""
            return f"{word} without {wanted}: {is_open or 'nothing is open'}"
        stack.pop()
        flow.end[around], flow.start[index] = index, around
    elif word in BRANCHES:
        if opener != BRANCHES[word]:
            return f"{word} outside {BRANCHES[word]}"
        flow.owner[index] = around
        flow.branches.setdefault(around, []).append(index)
    elif word == "EXIT":
        loops = [place for place, name in stack if name in LOOPS]
        if not loops:
            return "EXIT outside a loop"
        flow.loop[index] = loops[-1]
        flow.exits.add(loops[-1])
    elif word == "LABEL" and isinstance(statement, Control):
        flow.labels[statement.text.upper()] = index
    return ""


def _word(statement: Statement) -> str:
    """Return the word of a line of control; of a block of both kinds it is SPLINE."""
    if isinstance(statement, Control):
        return statement.word
    return "SPLINE" if isinstance(statement, SplineBegin) else "ENDSPLINE"
