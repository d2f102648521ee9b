"""A KRL module to the bytes of its .src and .dat file: ASCII, CR LF, one canonical spelling.

The text depends on the module and on nothing else, so reading it back and printing it again gives
the same bytes. Numbers follow ``krl.numbers``: the digits go by what the number is.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from postproc.errors import KrlError, SourceRef
from postproc.krl.text import numbers
from postproc.krl.text import program as krl
from postproc.krl.text.literals import components

INDENT = "  "
_PRINTABLE = bytes(range(0x20, 0x7F))
_SPEEDS = ("$VEL.CP", "$VEL_CP", "$ACC.CP")
_LENGTHS = frozenset({"X", "Y", "Z"})
_ANGLES = frozenset({"A", "B", "C", "A1", "A2", "A3", "A4", "A5", "A6"})
_EXTERNALS = frozenset({"E1", "E2", "E3", "E4", "E5", "E6"})


def render(module: krl.KrlModule) -> tuple[bytes, bytes]:
    """Return the bytes of the .src and of the .dat file; the latter are empty without a data list.

    KRL901 to KRL912 for a number or a text that cannot be written as it is.
    """
    lines = [f"&{attribute}" for attribute in module.attributes]
    lines += _lines(module.before)
    for routine in module.routines:
        lines += _routine(routine)
    data = b"" if module.data is None else _encode(_data(module.data), f"{module.name}.dat")
    return _encode(lines, f"{module.name}.src"), data


def render_statement(statement: krl.Statement) -> str:
    """Return one statement as its line, without indentation and line end."""
    text = _TEXT[type(statement)](statement)
    return f"{text} ;{statement.comment}" if statement.comment else text


def _encode(lines: list[str], name: str) -> bytes:
    """Return the file; a text that carries a line end or other controls is refused here."""
    text = "\r\n".join([*lines, ""])
    content = text.encode("ascii", "replace")
    rest = content.translate(None, _PRINTABLE)
    if rest != b"\r\n" * len(lines) or not text.isascii():
        number, line = next(
            (i, text)
            for i, text in enumerate(lines, 1)
            if not (text.isascii() and (text.isprintable() or not text))
        )
        raise KrlError("KRL911", f"not printable ASCII: {line[:80]!r}", SourceRef(name, number))
    return content


# ------------------------------------------------------------------------------------- modules


def _routine(routine: krl.Routine) -> list[str]:
    word = "DEF" if routine.result_type is None else f"DEFFCT {routine.result_type}"
    parameters = ",".join(_parameter(item) for item in routine.parameters)
    head = f"{'GLOBAL ' if routine.is_global else ''}{word} {routine.name}({parameters or ' '})"
    lines = [_with_comment(head, routine.comment), *_lines(routine.statements)]
    if routine.is_closed:
        lines.append("END" if routine.result_type is None else "ENDFCT")
    return lines + _lines(routine.after)


def _parameter(parameter: krl.Parameter) -> str:
    dimension = "" if parameter.dimension is None else f"[{parameter.dimension}]"
    return f"{parameter.name}{dimension}{':' if parameter.mode else ''}{parameter.mode}"


def _data(data: krl.DataList) -> list[str]:
    lines = [f"&{attribute}" for attribute in data.attributes]
    lines += _lines(data.before)
    head = f"DEFDAT {data.name}{' PUBLIC' if data.is_public else ''}"
    lines.append(_with_comment(head, data.comment))
    lines += _lines(data.statements)
    return [*lines, "ENDDAT"] if data.is_closed else lines


def _lines(statements: Iterable[krl.Statement]) -> list[str]:
    """Return the lines of statements, indented by the blocks they stand in."""
    lines: list[str] = []
    append, dispatch = lines.append, _TEXT
    depth = 0
    for statement in statements:
        kind = type(statement)
        text = dispatch[kind](statement)
        if statement.comment:
            text = f"{text} ;{statement.comment}"
        if kind in _BLOCKS:
            before, after = _steps(statement)
            depth = max(depth + before, 0)
            append(f"{INDENT * depth}{text}")
            depth += after
        else:
            append(f"{INDENT * depth}{text}" if depth and text else text)
    return lines


_BLOCKS = frozenset({krl.Control, krl.SplineBegin, krl.SplineEnd})


def _steps(statement: krl.Statement) -> tuple[int, int]:
    """Return how the indentation changes before and after a line that opens or closes a block."""
    if isinstance(statement, krl.SplineBegin):
        return 0, 1
    if isinstance(statement, krl.SplineEnd):
        return -1, 0
    word = statement.word if isinstance(statement, krl.Control) else ""
    is_branch = word in krl.BRANCHES
    return -int(is_branch or word in krl.OPENERS), int(is_branch or word in krl.CLOSERS)


def _with_comment(text: str, comment: str) -> str:
    return f"{text} ;{comment}" if comment else text


# -------------------------------------------------------------------------------------- values


def value_text(value: krl.Value, digits: int = numbers.PLAIN_DIGITS) -> str:
    """Return a value as text; ``digits``: decimals of a REAL that nothing else says."""
    kind = type(value)
    if kind is float:
        return numbers.real(value, digits)  # type: ignore[arg-type]
    return _VALUE[kind](value)


def _pose(pose: krl.Pose) -> str:
    x, y, z, a, b, c = pose.six
    try:
        total = abs(x) + abs(y) + abs(z) + abs(a) + abs(b) + abs(c)  # type: ignore[arg-type]
    except TypeError:
        return _partial(pose)
    if not total <= numbers.LARGEST:
        raise KrlError("KRL901", f"a position of {(x, y, z, a, b, c)} cannot be written")
    head = f"{pose.type_name}: " if pose.type_name else ""
    text = f"{{{head}X {x:z.4f},Y {y:z.4f},Z {z:z.4f},A {a:z.5f},B {b:z.5f},C {c:z.5f}"
    if pose.status is not None:
        text += f",S {numbers.status(pose.status)}"
    if pose.turn is not None:
        text += f",T {numbers.turn(pose.turn)}"
    return f"{text}{_external(pose.external)}}}"


def _partial(point: krl.Pose | krl.Axes) -> str:
    """Return a point of which not all is written, or which names the number that cannot be."""
    inside = [item for item in components(point) if item[0][0] != "E"]
    parts = [f"{name} {_component(name, value)}" for name, value in inside]
    return _braces(parts, point.external, point.type_name)


def _axes(axes: krl.Axes) -> str:
    a1, a2, a3, a4, a5, a6 = axes.six
    try:
        total = abs(a1) + abs(a2) + abs(a3) + abs(a4) + abs(a5) + abs(a6)  # type: ignore[arg-type]
    except TypeError:
        return _partial(axes)
    if not total <= numbers.LARGEST:
        return _partial(axes)
    head = f"{axes.type_name}: " if axes.type_name else ""
    text = f"A1 {a1:z.5f},A2 {a2:z.5f},A3 {a3:z.5f},A4 {a4:z.5f},A5 {a5:z.5f},A6 {a6:z.5f}"
    return f"{{{head}{text}{_external(axes.external)}}}"


def _braces(parts: list[str], external: tuple[float, ...], type_name: str) -> str:
    head = f"{type_name}: " if type_name else ""
    content = f"{','.join(parts)}{_external(external)}"
    return f"{{{head}{content.removeprefix(',')}}}"


def _external(values: tuple[float, ...]) -> str:
    if not values:
        return ""
    return "".join(
        f",E{number} {numbers.real(value, numbers.ANGLE_DIGITS)}"
        for number, value in enumerate(values, 1)
    )


def _component(name: str, value: krl.Value) -> str:
    """Return the value of a structure component, digits by the component's name."""
    if type(value) is not float:
        return value_text(value)
    if name in _LENGTHS:
        return numbers.real(value, numbers.LENGTH_DIGITS)
    if name in _ANGLES or name in _EXTERNALS:
        return numbers.real(value, numbers.ANGLE_DIGITS)
    is_speed = name in ("CP", "VEL")
    return numbers.significant(value) if is_speed else numbers.real(value, numbers.PLAIN_DIGITS)


def _aggregate(value: krl.Aggregate) -> str:
    parts = [f"{name} {_component(name.upper(), part)}" for name, part in value.fields]
    return _braces(parts, (), value.type_name)


def _quoted(value: krl.Text) -> str:
    if '"' in value.value:
        raise KrlError("KRL912", f"a string with a quote inside: {value.value[:80]!r}")
    return f'"{value.value}"'


_VALUE: dict[type, Callable[[Any], str]] = {
    int: str,
    bool: lambda value: "TRUE" if value else "FALSE",
    krl.Text: _quoted,
    krl.Enum: lambda value: f"#{value.name}",
    krl.Expr: lambda value: _plain(value.text),
    krl.Pose: _pose,
    krl.Axes: _axes,
    krl.Aggregate: _aggregate,
}


def _plain(text: str) -> str:
    """Return a text that stands as code: it must not hide its end in a comment."""
    if ";" in text and ";" in "".join(text.split('"')[::2]):
        raise KrlError("KRL912", f"code with a comment mark inside: {text[:80]!r}")
    return text


# ---------------------------------------------------------------------------------- statements


def _move(move: krl.Move) -> str:
    target = move.target
    text = move.word + " "
    if move.auxiliary is not None:
        text += f"{value_text(move.auxiliary)},"
    text += _pose(target) if type(target) is krl.Pose else value_text(target)
    if move.angle_deg is not None:
        text += f",CA {value_text(move.angle_deg, numbers.ANGLE_DIGITS)}"
    if move.settings:
        text += _settings(move.settings)
    if move.blend:
        text += " " + " ".join(move.blend)
    return f"{text} #{move.frame}" if move.frame else text


def _settings(settings: tuple[krl.Assign, ...]) -> str:
    return " WITH " + ",".join(_assign(item) for item in settings)


def _assign(statement: krl.Assign) -> str:
    value = statement.value
    if type(value) is float and statement.target in _SPEEDS:
        return f"{statement.target}={numbers.significant(value)}"
    return f"{_plain(statement.target)}={value_text(value)}"


def _call(statement: krl.Call) -> str:
    arguments = ",".join("" if a is None else _argument(a) for a in statement.arguments)
    return f"{_plain(statement.name)}({arguments})"


def _argument(value: krl.Value) -> str:
    """Return an argument; speeds are passed to BAS, so a REAL gets the digits of a speed."""
    return numbers.significant(value) if type(value) is float else value_text(value)


def _trigger(statement: krl.Trigger) -> str:
    start = " ONSTART" if statement.on_start else ""
    priority = "" if statement.priority is None else f" PRIO={value_text(statement.priority)}"
    return (
        f"TRIGGER WHEN {statement.word}={value_text(statement.where)}{start} "
        f"DELAY={value_text(statement.delay_ms)} DO {_inner(statement.action)}{priority}"
    )


def _interrupt(statement: krl.Interrupt) -> str:
    words = ["GLOBAL INTERRUPT" if statement.is_global else "INTERRUPT", statement.word]
    if statement.number is not None:
        words.append(value_text(statement.number))
    if statement.condition:
        words.append(f"WHEN {_plain(statement.condition)}")
    if statement.action is not None:
        words.append(f"DO {_inner(statement.action)}")
    return " ".join(words)


def _inner(statement: krl.Statement) -> str:
    return _TEXT[type(statement)](statement)


def _control(statement: krl.Control) -> str:
    if statement.word == "LABEL":
        return f"{_plain(statement.text)}:"
    return f"{statement.word} {_plain(statement.text)}" if statement.text else statement.word


def _declaration(statement: krl.Declaration) -> str:
    words = [
        word
        for word, present in (
            ("DECL", statement.has_decl),
            ("GLOBAL", statement.is_global),
            ("CONST", statement.is_const),
        )
        if present
    ]
    variables = ",".join(_variable(item) for item in statement.variables)
    return " ".join([*words, statement.type_name, variables])


def _variable(variable: krl.Variable) -> str:
    dimension = "" if variable.dimension is None else f"[{variable.dimension}]"
    value = "" if variable.value is None else f"={value_text(variable.value)}"
    return f"{variable.name}{dimension}{value}"


def _comment(statement: krl.Comment) -> str:
    if statement.text.lstrip().upper().startswith(("FOLD", "ENDFOLD")):
        raise KrlError("KRL912", f"a comment that reads as a fold: {statement.text[:80]!r}")
    return f";{statement.text}"


_TEXT: dict[type, Callable[[Any], str]] = {
    krl.Move: _move,
    krl.SplineBegin: lambda s: s.word + (_settings(s.settings) if s.settings else ""),
    krl.SplineEnd: lambda s: " ".join(("ENDSPLINE", *s.blend)),
    krl.Assign: _assign,
    krl.Call: _call,
    krl.WaitSec: lambda s: f"WAIT SEC {value_text(s.seconds, numbers.SECOND_DIGITS)}",
    krl.WaitFor: lambda s: f"WAIT FOR {_plain(s.condition)}",
    krl.Halt: lambda _: "HALT",
    krl.Continue: lambda _: "CONTINUE",
    krl.Trigger: _trigger,
    krl.Interrupt: _interrupt,
    krl.Control: _control,
    krl.Declaration: _declaration,
    krl.External: lambda s: f"{s.word} {_plain(s.text)}",
    krl.FoldBegin: lambda s: f";FOLD {s.text}".rstrip(),
    krl.FoldEnd: lambda s: f";ENDFOLD {s.text}".rstrip(),
    krl.Comment: _comment,
    krl.Blank: lambda _: "",
    krl.Raw: lambda s: _plain(s.text),
}
