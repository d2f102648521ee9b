"""Rows 7, 8, 26: literals, how the files are written, traces of the day and of -0."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from itertools import chain

import numpy as np

from postproc.krl import text as krl
from postproc.krl.rules.part import number
from postproc.krl.rules.scope import COMPONENTS
from postproc.krl.rules.subject import ERROR, WARNING, Subject, files_of

_NESTED = "a part of a structure"
"""Stands for the type of what lies within a structure: only its declaration knows it."""
_NOT_NUMBERS = frozenset({"NAN", "INF", "INFINITY", "NULL", "NONE"})
_STAMP = re.compile(
    r"\b(19|20)\d\d[-./](0?[1-9]|1[0-2])[-./](0?[1-9]|[12]\d|3[01])\b"
    r"|\b(0?[1-9]|[12]\d|3[01])[./](0?[1-9]|1[0-2])[./](19|20)\d\d\b"
    r"|\b([01]?\d|2[0-3]):[0-5]\d:[0-5]\d\b"
)
_PARTED = re.compile(r"\d[-./:]\d")
"""What every date and every time has in it, and few other texts."""
_LARGEST = 1e6
LONGEST_SEEN = 431
"""Longest line in real .src files."""


def literals(subject: Subject) -> None:
    """Row 7: numbers are numbers, components known and not repeated, axes and poses not mixed."""
    for part in subject.parts:
        for statement in part.of(krl.WaitSec):
            seconds = number(statement.seconds)
            if seconds is not None and seconds < 0.0:
                part.error(7, statement.line, f"WAIT SEC {seconds:g}: expected at least 0")
    points = subject.points
    large = (np.abs(points.numbers) > _LARGEST).any(axis=1)
    passed = np.zeros(len(subject.written), dtype=np.bool_)
    passed[points.place[~(large | points.more)]] = True
    for place in np.flatnonzero(~passed).tolist():
        path, line, value, type_name = subject.written[place]
        kind = type(value)
        if kind is krl.Aggregate:
            _aggregate(subject, path, line, value, type_name)  # type: ignore[arg-type]
        elif kind is krl.Expr and value.text.upper() in _NOT_NUMBERS:  # type: ignore[union-attr]
            subject.add(7, ERROR, path, line, f"{value.text} is no number")  # type: ignore[union-attr]
        elif isinstance(value, krl.Pose | krl.Axes):
            _sizes(subject, path, line, value)


def _aggregate(
    subject: Subject, path: str, line: int, value: krl.Aggregate, type_name: str
) -> None:
    names = [name.upper().partition("[")[0] for name, _ in value.fields]
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        subject.add(7, ERROR, path, line, f"component {sorted(repeated)[0]} appears there twice")
    kind = value.type_name.upper() or type_name
    allowed = _allowed(kind, names)
    unknown = [name for name in names if allowed is not None and name not in allowed]
    if unknown:
        what = kind if kind and kind != "?" else "a position"
        subject.add(7, ERROR, path, line, f"{what} has no component {unknown[0]}")
    elif not repeated and ({"X", "Y", "Z"} & set(names)) and ({"A1", "A2", "A3"} & set(names)):
        subject.add(7, ERROR, path, line, "joint angles and coordinates are mixed")
    for name, item in value.fields:
        if isinstance(item, krl.Expr) and item.text.upper() in _NOT_NUMBERS:
            subject.add(7, ERROR, path, line, f"{name} {item.text} is no number")
        if isinstance(item, krl.Aggregate):
            _aggregate(subject, path, line, item, "" if kind == "LOAD" else _NESTED)


def _allowed(kind: str, names: list[str]) -> frozenset[str] | None:
    if kind in COMPONENTS:
        return COMPONENTS[kind]
    if kind not in ("", "?"):
        return None  # a structure of the controller or of the user
    if kind == "?" or set("XYZABC") <= set(names) or {"A1", "A2", "A3"} <= set(names):
        is_axes = any(name in ("A1", "A2", "A3") for name in names)
        return COMPONENTS["E6AXIS" if is_axes else "E6POS"]
    return None


def _sizes(subject: Subject, path: str, line: int, value: krl.Pose | krl.Axes) -> None:
    if isinstance(value, krl.Pose) and value.is_complete and not value.external:
        numbers: Iterable[float] = (value.x_mm, value.y_mm, value.z_mm)  # type: ignore[assignment]
    else:
        numbers = [found for _, found in krl.components(value)]
    for found in numbers:
        if abs(found) > _LARGEST:
            subject.add(7, WARNING, path, line, f"{found:g} is no coordinate of a robot")
            return


# --------------------------------------------------------------------------------------- the file


def text(subject: Subject) -> None:
    """Row 8: ASCII, CR LF, no byte order mark, a final newline, lines and files not too long."""
    for module in subject.modules:
        parts = subject.parts_of(module)
        moves = [move for part in parts for move in part.of(krl.Move)]
        # Parameters and code of a form of KSS 8.6 are long lines on real controllers, too.
        forms = {move.line for move in moves if move.settings}
        for part in parts:
            forms |= {s.line for s in part.of(krl.Comment) if s.text.startswith("Params ")}
        for facts in (module.src_facts, module.dat_facts):
            if facts is not None:
                _facts(subject, facts, forms if facts is module.src_facts else set())
        motions = len(moves)
        if motions > subject.options.max_points:
            message = f"{motions} motions in one file, more than {subject.options.max_points}"
            subject.add(8, WARNING, module.src_path, 1, message, hint="split the program")


def _facts(subject: Subject, facts: krl.TextFacts, forms: set[int]) -> None:
    path = facts.path
    if facts.has_bom:
        subject.add(8, ERROR, path, 1, "a byte order mark stands in front of the text")
    for line, in_comment in facts.non_ascii:
        severity = WARNING if in_comment else ERROR
        subject.add(8, severity, path, line, "a character that is not ASCII")
    if facts.lf and facts.crlf:
        subject.add(8, WARNING, path, 1, f"{facts.lf} lines end with LF, {facts.crlf} with CR LF")
    elif facts.lf:
        subject.add(8, WARNING, path, 1, "lines end with LF, controllers write CR LF")
    if not facts.ends_with_newline:
        subject.add(8, WARNING, path, facts.lines, "the last line is not closed")
    for line, length in facts.long_lines:
        if line in forms and length <= LONGEST_SEEN:
            continue
        message = f"a line of {length} characters, expected less than {krl.LONG_LINE}"
        subject.add(8, WARNING, path, line, message)
    if facts.size > subject.options.max_bytes:
        message = f"{facts.size} bytes: the pad gets slow, memory is a few MB for all programs"
        subject.add(8, WARNING, path, 1, message)


def traces(subject: Subject) -> None:
    """Row 26: no date or time in the text and no -0: two runs must give the same bytes."""
    found = list(chain.from_iterable(map(_stamps, subject.modules)))
    points = subject.points
    zero = ((points.numbers == 0.0) & np.signbit(points.numbers)).any(axis=1)
    for path, line, point in subject.points_at(zero | points.more):
        if _has_minus_zero(point):
            found.append((path, line, "a number reads -0"))
    for path, line, message in sorted(found):
        subject.add(26, WARNING, path, line, message)


def _stamps(module: krl.KrlModule) -> Iterator[tuple[str, int, str]]:
    """Yield file, line and message of every date or time."""
    for path, statements in files_of(module):
        for statement in statements:
            text = _said(statement)
            if text and _PARTED.search(text):
                yield from _stamp(path, statement.line, text)
    for line, text in enumerate(module.attributes, 1):
        yield from _stamp(module.src_path, line, text)


def _stamp(path: str, line: int, text: str) -> Iterator[tuple[str, int, str]]:
    found = _STAMP.search(text)
    if found:
        yield path, line, f"a date or time in the text: {found.group()}"


def _said(statement: krl.Statement) -> str:
    """Return what a line says to people."""
    kind = type(statement)
    return statement.text if kind is krl.Comment or kind is krl.FoldBegin else statement.comment  # type: ignore[attr-defined]


def _has_minus_zero(value: krl.Pose | krl.Axes) -> bool:
    numbers = (*value.six, *value.external)
    return 0.0 in numbers and any(n == 0.0 and math.copysign(1.0, n) < 0.0 for n in numbers)
