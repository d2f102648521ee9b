"""The values that stand in the text, for the checks of every literal."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.krl.text import (
    Assign,
    Axes,
    Call,
    Declaration,
    Move,
    Pose,
    Statement,
    Value,
    table_of,
)
from postproc.records import dataclass

_PLAIN = frozenset({float, int, bool})
_POINTS = frozenset({Pose, Axes})


Written: TypeAlias = tuple[str, int, Value, str]
"""File, line, value and the type that it must have, empty where any will do."""


@dataclass(frozen=True, slots=True)
class Points:
    """Poses and axes among values.

    ``place`` (n,): which of the values; ``numbers`` (n, 6): X to C or A1 to A6 [mm, deg], NaN where
    one is not written; ``more`` (n,): whether there is more to it: status, turn, external axes.
    """

    place: IndexArray
    numbers: FloatArray
    more: BoolArray


def points_among(written: Sequence[Written]) -> Points:
    """Return the points among values."""
    place = [row for row, item in enumerate(written) if type(item[2]) in _POINTS]
    points: list[Any] = [written[row][2] for row in place]
    return Points(
        np.array(place, dtype=np.int64),
        table_of(points),
        np.array([_is_more(point) for point in points], dtype=np.bool_),
    )


def _is_more(value: Pose | Axes) -> bool:
    if value.external:
        return True
    return type(value) is Pose and (value.status is not None or value.turn is not None)


def written_in(statements: Iterable[tuple[str, Statement]]) -> list[Written]:
    """Return the values of statements, each with its file, but plain numbers of assignments."""
    found: list[Written] = []
    for path, statement in statements:
        kind, line = type(statement), statement.line
        if kind is Move:
            found += _of_move(path, statement)  # type: ignore[arg-type]
        elif kind is Assign:
            value = statement.value  # type: ignore[attr-defined]
            if type(value) not in _PLAIN:
                found.append((path, line, value, type_of(statement.target)))  # type: ignore[attr-defined]
        elif isinstance(statement, Declaration):
            name = statement.type_name.upper()
            found += [
                (path, line, v.value, name) for v in statement.variables if v.value is not None
            ]
        elif isinstance(statement, Call):
            found += [(path, line, value, "") for value in statement.arguments if value is not None]
    return found


def _of_move(path: str, move: Move) -> Sequence[Written]:
    target: Written = path, move.line, move.target, "?"
    if move.auxiliary is None and not move.settings:
        return (target,)
    auxiliary = () if move.auxiliary is None else ((path, move.line, move.auxiliary, "FRAME"),)
    settings = [(path, move.line, setting.value, "") for setting in move.settings]
    return (target, *auxiliary, *settings)


@lru_cache(maxsize=1024)
def type_of(target: str) -> str:
    """Return the type that a value must have which is assigned to a target."""
    upper = target.upper()
    for name in ("FDAT", "PDAT", "LDAT", "LOAD"):
        if upper.startswith((f"{name}_ACT", f"{name}_DATA[", f"${name}")) and "." not in upper:
            return name
    if upper in ("$TOOL", "$BASE"):
        return "FRAME"
    return upper if upper.startswith("$") else ""
