"""Number, pose and joint literals: from text, and their components.

A hundred thousand poses are read by splitting at commas; what that cannot read with certainty is
left to the expression parser.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from itertools import chain

import numpy as np

from postproc.arrays import FloatArray
from postproc.krl.text.lexer import KrlSyntaxError
from postproc.krl.text.program import FIELDS, Axes, Pose

_EXTERNAL = [f"E{i}" for i in range(1, 7)]
_POSE_SLOTS, _AXIS_SLOTS = (
    {name: slot for slot, name in enumerate([*FIELDS[kind], *_EXTERNAL])} for kind in (Pose, Axes)
)
_N = r"([-+]?\d{1,9}+(?:\.\d{0,9}+)?+)"
PLAIN_LITERALS: tuple[tuple[str, type[Pose] | type[Axes]], ...] = (
    (rf"\{{X {_N},Y {_N},Z {_N},A {_N},B {_N},C {_N}\}}", Pose),
    (rf"\{{A1 {_N},A2 {_N},A3 {_N},A4 {_N},A5 {_N},A6 {_N}\}}", Axes),
)
"""Patterns, in ASCII, of literals as nearly all are written: six decimal numbers in order, which
are its groups."""
_PLAIN = tuple((re.compile(pattern, re.ASCII), kind) for pattern, kind in PLAIN_LITERALS)
_POSE_TYPES = frozenset({"FRAME", "POS", "E6POS", ""})
_AXIS_TYPES = frozenset({"AXIS", "E6AXIS", ""})


def pose_or_axes(type_name: str, fields: list[tuple[str, float]]) -> Pose | Axes | None:
    """Return the pose or the axes that these components are; None if they are neither.

    Repeated, mixed or unknown components, external axes with gaps and a status or turn that is no
    INT are neither: the aggregate keeps them for lint.
    """
    upper = type_name.upper()
    if upper in _POSE_TYPES:
        pose = _pose(type_name, fields)
        if pose is not None:
            return pose
    return _axes(type_name, fields) if upper in _AXIS_TYPES else None


def _pose(type_name: str, fields: list[tuple[str, float]]) -> Pose | None:
    values = _filled(_POSE_SLOTS, fields)
    if values is None:
        return None
    x, y, z, a, b, c, s, t, *rest = values
    external = _in_order(rest)
    status, turn = _whole(s), _whole(t)
    if external is None or len(external) == len(fields):
        return None
    if (status is None) != (s is None) or (turn is None) != (t is None):
        return None
    return Pose(x, y, z, a, b, c, status, turn, external, type_name)


def _axes(type_name: str, fields: list[tuple[str, float]]) -> Axes | None:
    values = _filled(_AXIS_SLOTS, fields)
    if values is None:
        return None
    a1, a2, a3, a4, a5, a6, *rest = values
    external = _in_order(rest)
    if external is None or len(external) == len(fields):
        return None
    return Axes(a1, a2, a3, a4, a5, a6, external, type_name)


def _filled(slots: dict[str, int], fields: list[tuple[str, float]]) -> list[float | None] | None:
    values: list[float | None] = [None] * len(slots)
    for name, value in fields:
        slot = slots.get(name) or slots.get(name.upper())
        if slot is None or values[slot] is not None:
            return None
        values[slot] = float(value)
    return values


def _in_order(values: list[float | None]) -> tuple[float, ...] | None:
    """Return E1..Ek, None if one before the last is missing."""
    external = tuple(value for value in values if value is not None)
    return external if values[: len(external)] == list(external) else None


def _whole(value: float | None) -> int | None:
    """Return an INT, None for what is no whole number of 32 bits."""
    if value is None or abs(value) >= _INT or value != int(value):
        return None
    return int(value)


def number(text: str) -> int | float:
    """Return an INT or REAL literal."""
    if text.isdigit():
        if len(text) > 15:
            raise KrlSyntaxError(f"the number {text[:20]} is too large")
        return int(text)
    value = float(text)
    if value - value != 0.0:
        raise KrlSyntaxError(f"the number {text[:20]} is too large")
    return value


def bits(text: str) -> int:
    """Return the INT of ``'B101'`` or ``'H1F'``."""
    try:
        return int(text[2:-1], 2 if text[1] in "bB" else 16)
    except ValueError:
        raise KrlSyntaxError(f"{text} is no binary or hexadecimal number") from None


def components(value: Pose | Axes) -> Iterator[tuple[str, float]]:
    """Yield name and number of every component that is written."""
    more = (value.status, value.turn) if isinstance(value, Pose) else ()
    named = [*zip(FIELDS[type(value)], (*value.six, *more), strict=True)]
    yield from ((name, number_) for name, number_ in named if number_ is not None)
    yield from zip(_EXTERNAL, value.external, strict=False)


_INT = 2.0**31


def table_of(points: Sequence[Pose | Axes]) -> FloatArray:
    """Return X to C or A1 to A6 (n, 6) [mm, deg] of points, NaN where one is not written."""
    rows = [point.six for point in points]
    try:
        flat = np.fromiter(chain.from_iterable(rows), np.float64, 6 * len(rows))
    except TypeError:  # one is not written
        flat = np.array(rows, dtype=np.float64)
    return flat.reshape(-1, 6)


def quick_literal(text: str) -> Pose | Axes | None:
    """Return a pose or axes literal of plain numbers, else None (then parse it in full).

    A hundred thousand of them are read by one pattern, or by splitting at commas, instead of by
    tokens.
    """
    return _plain(text) or _split(text)


def _plain(text: str) -> Pose | Axes | None:
    """Return a literal written as nearly all are: six decimal numbers in order."""
    for pattern, kind in _PLAIN:
        match = pattern.fullmatch(text)
        if match is not None:
            first, second, third, fourth, fifth, sixth = map(float, match.groups())
            return kind(first, second, third, fourth, fifth, sixth)
    return None


def _split(text: str) -> Pose | Axes | None:
    body = text[1:-1]
    if "{" in body or "_" in body or not body.isascii():
        return None
    type_name = ""
    if ":" in body:
        type_name, _, body = body.partition(":")
        type_name = type_name.strip()
    fields: list[tuple[str, float]] = []
    try:
        for part in body.split(","):
            name, digits = part.split()
            if digits[-1] not in "0123456789.":
                if digits[0] != "'":
                    return None
                fields.append((name, bits(digits)))
            else:
                fields.append((name, float(digits)))
    except (ValueError, IndexError):
        return None
    if not math.isfinite(sum(value for _, value in fields)):
        return None
    return pose_or_axes(type_name, fields)
