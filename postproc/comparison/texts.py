"""Values, statements and targets as text in which only what counts is different."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from postproc.arrays import FloatArray
from postproc.controller import Trace, text_of
from postproc.krl import (
    Aggregate,
    Axes,
    Call,
    Declaration,
    Enum,
    Expr,
    KrlModule,
    KrlSyntaxError,
    Move,
    Pose,
    Statement,
    Value,
    components,
    tokenise,
)
from postproc.units import DEG, MM

POSE = ("X", "Y", "Z", "A", "B", "C")
AXES = ("A1", "A2", "A3", "A4", "A5", "A6")


def target_text(trace: Trace, row: int) -> str:
    """Return where a motion goes, in mm and degrees."""
    angles = trace.target[row] / DEG
    if trace.is_axes[row]:
        return " ".join(f"{n} {v:.3f}" for n, v in zip(AXES, angles, strict=True))
    xyz = trace.target[row, :3] / MM
    return " ".join(f"{n} {v:.3f}" for n, v in zip(POSE, (*xyz, *angles[3:]), strict=True))


def status_text(status: int, turn: int) -> str:
    """Return S and T of a target."""
    return "no S, T" if status < 0 and turn < 0 else f"S {status}, T {turn}"


def externals_text(values: FloatArray) -> str:
    """Return the external axes of a target."""
    return "E " + " ".join(f"{value:.3f}" for value in values)


def seen_by_others(module: KrlModule) -> Iterator[tuple[str, Value, int]]:
    """Yield name, value and line of data that other modules see.

    Global points that the module itself moves to are compared where it does.
    """
    data = module.data
    if data is None or not module.routines:
        yield from () if data is None else data.values()
        return
    declared = [s for s in data.statements if isinstance(s, Declaration) and s.is_global]
    seen = {variable.name.upper() for statement in declared for variable in statement.variables}
    moves = [s for r in module.routines for s in r.statements if type(s) is Move]
    seen -= {move.target.text.upper() for move in moves if isinstance(move.target, Expr)}
    for name, value, line in data.values():
        if name.upper().partition("[")[0].partition(".")[0] in seen:
            yield name, value, line


def bas_command(statement: Statement) -> str:
    """Return the command of a call of BAS, empty for anything else."""
    if not isinstance(statement, Call) or statement.name.upper() != "BAS":
        return ""
    command = statement.arguments[0] if statement.arguments else None
    return command.name.upper() if isinstance(command, Enum) else "?"


def is_vague(arguments: tuple[object, ...]) -> bool:
    """Return whether one of the arguments of a hook is not known."""
    return any("UNKNOWN" in str(argument) for argument in arguments)


def spaced(text: str) -> str:
    """Return code in upper case with one blank between its tokens, numbers as they count."""
    try:
        return " ".join(_plain_token(token.text) for token in tokenise(text)).strip()
    except KrlSyntaxError:
        return " ".join(text.upper().split())


def _plain_token(text: str) -> str:
    try:
        return f"{float(text):.9g}"
    except ValueError:
        return text if text[:1] == '"' else text.upper()


def value_text(value: Any) -> str:  # noqa: ANN401 - a KRL value
    """Return a value as text in which the digits of a number do not matter."""
    if isinstance(value, Aggregate):
        return ",".join(f"{name} {{{value_text(part)}}}" for name, part in value.fields)
    if isinstance(value, Pose | Axes):
        return ",".join(f"{name} {number:.9g}" for name, number in components(value))
    if isinstance(value, float | int) and not isinstance(value, bool):
        return f"{value:.9g}"
    return text_of(value)
