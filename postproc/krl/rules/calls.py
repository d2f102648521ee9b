"""Row 28: calls fit the routines that they reach, and routines declare their parameters."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial

from postproc.krl import text as krl
from postproc.krl.rules.expressions import nodes_of
from postproc.krl.rules.part import Part, bas, key_of
from postproc.krl.rules.scope import Place
from postproc.krl.rules.subject import ERROR, WARNING, Subject

_WITHOUT_NUMBER = frozenset({"INITMOV", "FRAMES", "PTP_DAT", "CP_DAT", "OUT_SYNC", "OUT_ASYNC"})
"""Commands of BAS that read no second parameter."""


def calls(subject: Subject) -> None:
    """Row 28: arguments as there are parameters, values from functions, parameters declared."""
    needed = {part.key: frozenset(_needed(part)) for part in subject.parts}
    for part in subject.parts:
        place = (part.module, part.routine)
        _parameters(part)
        _returns(part)
        for call in part.calls:
            _bas(subject, part.path, call)
            target = subject.called(call.name, part.module)
            if target is not None:
                _call(subject, part.path, place, call.line, target, call.arguments, needed)
        subject.each(part, partial(_functions, subject, part.path, place, needed))


_Target = tuple[krl.KrlModule, krl.Routine]
_NeededBy = dict[tuple[str, str, str, int], frozenset[str]]


def _functions(
    subject: Subject, path: str, place: Place, needed: _NeededBy, statement: krl.Statement
) -> None:
    for node in nodes_of(statement, "("):
        if isinstance(node, krl.FunctionCall):
            _function(subject, path, place, statement.line, node, needed)


def _function(
    subject: Subject, path: str, place: Place, line: int, node: krl.FunctionCall, needed: _NeededBy
) -> None:
    target = subject.called(node.name, place[0])
    if target is None:
        return
    if target[1].result_type is None:
        message = f"{node.name} is no function: it has no value"
        subject.add(28, ERROR, path, line, message, hint="DEFFCT with a type, and RETURN")
    _call(subject, path, place, line, target, node.arguments, needed)


def _call(
    subject: Subject,
    path: str,
    place: Place,
    line: int,
    target: _Target,
    arguments: Sequence[krl.Value | krl.Node | None],
    needed: _NeededBy,
) -> None:
    module, routine = target
    names = [parameter.name for parameter in routine.parameters]
    if len(arguments) > len(names):
        message = f"{routine.name}: arguments {len(arguments)}, parameters {len(names)}"
        subject.add(28, ERROR, path, line, message)
        return
    given = [*arguments, *[None] * (len(names) - len(arguments))]
    # A call may leave arguments out (BAS(#FRAMES)): the parameter has no value then.
    missing = [n for n, argument in zip(names, given, strict=True) if argument is None]
    stops = [n for n in missing if n.upper() in needed[key_of(module, routine)]]
    if stops:
        message = f"{routine.name} without {stops[0]}, which it reads: the program would stop there"
        subject.add(28, WARNING, path, line, message)
    wanted = subject.scope.parameters(module, routine)
    for name, kind, argument in zip(names, wanted, given, strict=True):
        found = subject.scope.mismatch(_value(argument), kind, place)
        if found and kind is not None:
            message = f"{routine.name}: {name} is of type {kind.name} and does not take {found}"
            subject.add(27, ERROR, path, line, message)


def _value(argument: krl.Value | krl.Node | None) -> krl.Value | None:
    """Return an argument as a value; None: a part of an expression that is not followed."""
    if isinstance(argument, krl.Reference):
        return krl.Expr(argument.name) if not argument.selectors else None
    return (
        None if isinstance(argument, krl.Node) and not isinstance(argument, krl.Value) else argument
    )


def _parameters(part: Part) -> None:
    declared = {v.name.upper() for s in part.of(krl.Declaration) for v in s.variables}
    for parameter in part.routine.parameters:
        if parameter.name.upper() not in declared:
            message = f"parameter {parameter.name} of {part.routine.name} is not declared"
            hint = f"DECL with its type behind DEF {part.routine.name}"
            part.error(28, part.routine.line, message, hint)


def _returns(part: Part) -> None:
    values = [s for s in part.of(krl.Control) if s.word == "RETURN" and s.text]
    if part.routine.result_type is not None:
        if not values:
            message = f"{part.routine.name} is a function and returns no value"
            part.warn(28, part.routine.line, message)
        return
    for statement in values:
        part.error(28, statement.line, f"{part.routine.name} is no function: RETURN takes no value")


def _bas(subject: Subject, path: str, call: krl.Call) -> None:
    if call.name.upper() != "BAS":
        return
    command, argument = bas(call)
    first = call.arguments[0] if call.arguments else None
    if first is None:
        subject.add(28, ERROR, path, call.line, "BAS without a command")
    elif isinstance(first, krl.Enum) and argument is None and command not in _WITHOUT_NUMBER:
        message = f"BAS(#{command}) without its value: the program stops there"
        subject.add(28, ERROR, path, call.line, message)


def _needed(part: Part) -> Iterator[str]:
    """Yield the parameters that a routine decides or reckons by, whatever happens."""
    parameters = {parameter.name.upper() for parameter in part.routine.parameters}
    depth, read, asked = 0, set[str](), False
    for statement in part.routine.statements if parameters else ():
        word = statement.word if isinstance(statement, krl.Control) else ""
        nodes = list(nodes_of(statement, ""))
        asked |= any(
            isinstance(n, krl.FunctionCall) and n.name.upper() == "VARSTATE" for n in nodes
        )
        if not depth:
            used = nodes[:1] if word in ("SWITCH", "IF", "WHILE") else []
            for node in nodes:
                used += (node.left, node.right) if isinstance(node, krl.Binary) else ()
                used += (node.operand,) if isinstance(node, krl.Unary) else ()
            read |= {node.name for node in used if isinstance(node, krl.Reference)} & parameters
        if word in ("RETURN", "GOTO"):
            break
        depth += (word in krl.CLOSERS) - (word in krl.OPENERS)
    return iter(() if asked else read)
