"""Where the lines of program control lead: partners of IF, FOR, LOOP, SWITCH, labels."""

from __future__ import annotations

from dataclasses import field

from postproc.krl import BRANCHES, CLOSERS, LOOPS, OPENERS, Control, Routine
from postproc.records import dataclass


@dataclass(slots=True)
class Flow:
    """Partners by statement index.

    ``end``: opener to closer; ``start``: closer to opener; ``branches``: IF and SWITCH to the
    indices of their ELSE, CASE and DEFAULT; ``owner``: ELSE, CASE, DEFAULT to their opener;
    ``loop``: EXIT to the loop around it; ``exits``: loops that have an EXIT; ``labels``: by name;
    ``broken``: indices of lines without their partner.
    """

    end: dict[int, int] = field(default_factory=dict)
    start: dict[int, int] = field(default_factory=dict)
    branches: dict[int, list[int]] = field(default_factory=dict)
    owner: dict[int, int] = field(default_factory=dict)
    loop: dict[int, int] = field(default_factory=dict)
    exits: set[int] = field(default_factory=set)
    labels: dict[str, int] = field(default_factory=dict)
    broken: list[int] = field(default_factory=list)


def flow_of(routine: Routine) -> Flow:
    """Return where the control lines of a routine lead."""
    flow = Flow()
    stack: list[tuple[int, str]] = []
    controls = [(i, s) for i, s in enumerate(routine.statements) if type(s) is Control]
    for index, statement in controls:
        _place(flow, stack, index, statement)
    flow.broken += [index for index, _ in stack]
    return flow


def _place(flow: Flow, stack: list[tuple[int, str]], index: int, statement: Control) -> None:
    word = statement.word
    if word in CLOSERS:
        stack.append((index, word))
    elif word in OPENERS:
        if not stack or stack[-1][1] != OPENERS[word]:
            flow.broken.append(index)
            return
        opener, _ = stack.pop()
        flow.end[opener], flow.start[index] = index, opener
    elif word in BRANCHES:
        if not stack or stack[-1][1] != BRANCHES[word]:
            flow.broken.append(index)
            return
        flow.owner[index] = stack[-1][0]
        flow.branches.setdefault(stack[-1][0], []).append(index)
    elif word == "EXIT":
        around = [place for place, opener in stack if opener in LOOPS]
        if not around:
            flow.broken.append(index)
            return
        flow.loop[index] = around[-1]
        flow.exits.add(around[-1])
    elif word == "LABEL":
        flow.labels[statement.text.upper()] = index
