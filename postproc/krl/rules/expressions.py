"""The values and expressions that a statement uses."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from itertools import chain
from typing import Any

from postproc.krl import text as krl

NAMELESS = frozenset({float, int, bool, krl.Pose, krl.Axes, type(None)})
"""Values without a name in them."""


def move_values(statement: krl.Move) -> tuple[krl.Value | None, ...]:
    """Return the points of a motion, its angle and what it sets."""
    if not statement.settings and statement.auxiliary is None:
        return (statement.target,)
    settings = tuple(item.value for item in statement.settings)
    return (statement.target, statement.auxiliary, statement.angle_deg, *settings)


_Parts = tuple[tuple[krl.Value | None, ...], tuple[str, ...]]


def values_of(statement: krl.Statement) -> _Parts:
    """Return values and expression texts of a statement."""
    found = _PARTS.get(type(statement))
    return found(statement) if found is not None else ((), ())


_PARTS: dict[type, Callable[[Any], _Parts]] = {
    krl.Assign: lambda s: ((s.value,), (s.target,)),
    krl.Call: lambda s: (s.arguments, ()),
    krl.SplineBegin: lambda s: (tuple(item.value for item in s.settings), ()),
    krl.WaitSec: lambda s: ((s.seconds,), ()),
    krl.WaitFor: lambda s: ((), (s.condition,)),
    krl.Trigger: lambda s: ((s.where, s.delay_ms, s.priority), ()),
    krl.Interrupt: lambda s: ((s.number,), (s.condition,) if s.condition else ()),
    krl.Control: lambda s: ((), s.expressions),
}


def nodes_of(statement: krl.Statement, mark: str) -> Iterable[krl.Node]:
    """Return the nodes of all expressions of a statement that hold ``mark``, and of its action."""
    marked = [text for text in _texts_of(statement) if mark in text]
    return chain.from_iterable(map(_nodes_of_text, marked)) if marked else ()


def _texts_of(statement: krl.Statement) -> list[str]:
    """Return the texts of all expressions of a statement, its action included."""
    values, texts = values_of(statement)
    if isinstance(statement, krl.Move):
        values = move_values(statement)
    if isinstance(statement, krl.Move | krl.SplineBegin):
        texts = tuple(item.target for item in statement.settings)
    found = [*texts]
    for value in values:
        if type(value) not in NAMELESS:
            found += _texts(value)
    if isinstance(statement, krl.Trigger | krl.Interrupt) and statement.action is not None:
        found += _texts_of(statement.action)
    return found


def _nodes_of_text(text: str) -> tuple[krl.Node, ...]:
    try:
        return tuple(krl.nodes_in(krl.parse_expression(text.strip())))
    except krl.KrlSyntaxError:
        return ()  # row 1 has it


def _texts(value: krl.Value | None) -> Iterator[str]:
    if isinstance(value, krl.Expr):
        yield value.text
    elif isinstance(value, krl.Aggregate):
        for _, item in value.fields:
            yield from _texts(item)


def settings_of(statement: krl.Statement) -> tuple[krl.Assign, ...]:
    """Return what a statement sets: by itself, WITH a motion or by its action."""
    if isinstance(statement, krl.Assign):
        return (statement,)
    if isinstance(statement, krl.Move | krl.SplineBegin):
        return statement.settings
    if isinstance(statement, krl.Trigger | krl.Interrupt) and statement.action is not None:
        return settings_of(statement.action)
    return ()
