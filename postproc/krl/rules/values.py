"""The values that stand in the text, for the checks of every literal; slips of the pen."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Any, TypeAlias

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.krl import text as krl
from postproc.records import record

PLAIN = frozenset({float, int, bool})
"""Kinds of plain numbers and truths."""
POINTS = frozenset({krl.Pose, krl.Axes})


Written: TypeAlias = tuple[str, int, krl.Value, str]
"""File, line, value and the type that it must have, empty where any will do."""


@record(frozen=True, slots=True)
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
    place = [row for row, item in enumerate(written) if type(item[2]) in POINTS]
    points: list[Any] = [written[row][2] for row in place]
    more = [
        bool(p.external) or (type(p) is krl.Pose and (p.status is not None or p.turn is not None))
        for p in points
    ]
    return Points(
        np.array(place, dtype=np.int64), krl.table_of(points), np.array(more, dtype=np.bool_)
    )


def written_in(files: Iterable[tuple[str, Iterable[krl.Statement]]]) -> list[Written]:
    """Return the values of statements, each with its file, but plain numbers of assignments."""
    found: list[Written] = []
    for path, statements in files:
        for statement in statements:
            if type(statement) is krl.Move:
                found.append((path, statement.line, statement.target, "?"))
                if statement.auxiliary is not None or statement.settings:
                    found += _beside_target(path, statement)
            elif type(statement) is krl.Assign:
                value = statement.value
                if type(value) not in PLAIN:
                    found.append((path, statement.line, value, type_of(statement.target)))
            else:
                found += _given(path, statement)
    return found


def _beside_target(path: str, move: krl.Move) -> Iterator[Written]:
    if move.auxiliary is not None:
        yield path, move.line, move.auxiliary, "FRAME"
    for setting in move.settings:
        yield path, move.line, setting.value, ""


def _given(path: str, statement: krl.Statement) -> Iterable[Written]:
    """Return what a declaration or a call gives."""
    line = statement.line
    if type(statement) is krl.Declaration:
        name = statement.type_name.upper()
        return [(path, line, v.value, name) for v in statement.variables if v.value is not None]
    if type(statement) is krl.Call:
        return [(path, line, value, "") for value in statement.arguments if value is not None]
    return ()


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


_SHORTEST = 3


def nearest(name: str, known: Collection[str], *, counts_digits: bool = True) -> str:
    """Return the known name that a name differs from by one slip, empty if there is none.

    A slip is one wrong or missing character, a letter written twice, or two that are swapped. A
    name with something before or behind it is another name, not a slip. All are in upper case.
    ``counts_digits``: another digit is a slip, too; in families of names it is not.
    """
    length = len(name.lstrip("$"))
    if length < _SHORTEST:
        return ""
    near = (other for other in known if len(other.lstrip("$")) >= _SHORTEST)
    return min((other for other in near if _is_slip(name, other, counts_digits)), default="")


def _is_slip(name: str, other: str, counts_digits: bool) -> bool:
    if abs(len(name) - len(other)) > 1:
        return False
    at = next((i for i, (a, b) in enumerate(zip(name, other, strict=False)) if a != b), None)
    if at is None:  # one is the beginning of the other
        longer = max(name, other, key=len)
        return len(name) < len(other) or longer[-1] == longer[-2]
    if len(name) < len(other):
        return name[at:] == other[at + 1 :]
    if len(name) > len(other):
        return name[at + 1 :] == other[at:] and name[at] == name[at - 1]
    is_swap = name[at : at + 2] == other[at : at + 2][::-1] and name[at + 2 :] == other[at + 2 :]
    is_digit = name[at].isdigit() or other[at].isdigit()
    return is_swap or (name[at + 1 :] == other[at + 1 :] and (counts_digits or not is_digit))
