"""Row 30: system variables exist, may be set, and take what they are given."""

from __future__ import annotations

import re
from collections.abc import Collection
from functools import partial

from postproc.krl.rules.expressions import nodes_of, settings_of
from postproc.krl.rules.part import Part, bas
from postproc.krl.rules.scope import declared_names
from postproc.krl.rules.subject import Subject
from postproc.krl.rules.values import nearest
from postproc.krl.system import Effect, bas_commands, components_of, system_variable
from postproc.krl.system import system_variables as listed_variables
from postproc.krl.text import Assign, Call, Enum, Expr, Reference, Statement

_BASE_NAME = re.compile(r"\$\w+")


def system_variables(subject: Subject) -> None:
    """Row 30: system variables exist, are not read only where set, take their constants."""
    known = {name.partition(".")[0] for name in listed_variables()}
    known |= {name.upper() for name in subject.options.names}
    known = known.union(*map(declared_names, subject.modules))
    commands = subject.scope.enumerations.get("BAS_COMMAND") or bas_commands()
    told: set[tuple[str, str]] = set()
    for part in subject.parts:
        subject.each(part, partial(_variables, part, known, told))
        for call in part.calls:
            _command(part, call, commands)


def _variables(
    part: Part, known: Collection[str], told: set[tuple[str, str]], statement: Statement
) -> None:
    for item in settings_of(statement):
        _set(part, statement.line, item)
    for node in nodes_of(statement, "$"):
        if isinstance(node, Reference) and node.name.startswith("$"):
            _exists(part, statement.line, node, known, told)


def _exists(
    part: Part, line: int, node: Reference, known: Collection[str], told: set[tuple[str, str]]
) -> None:
    name = node.name
    if name not in known:
        near = nearest(name, known, counts_digits=False)
        if near:
            part.error(30, line, f"no system variable {name}", hint=f"{near} is meant")
        elif (part.path, name) not in told:
            part.warn(30, line, f"{name} is no known system variable: an option must bring it")
        told.add((part.path, name))
        return
    variable = listed_variables().get(name)
    is_array = variable is not None and variable.size is not None
    if is_array and node.selectors and node.selectors[0] == (0,):
        part.error(30, line, f"{name}[0]: the first index is 1")
    components = components_of().get(name, frozenset())
    first = node.selectors[0] if node.selectors else ()
    if components and isinstance(first, str) and first not in components:
        expected = ", ".join(sorted(components))
        part.error(30, line, f"{name} has no component {first}, expected {expected}")


def _set(part: Part, line: int, item: Assign) -> None:
    found = _BASE_NAME.match(item.target)
    name = found.group().upper() if found else ""
    variable = system_variable(name)
    if variable is not None and variable.effect is Effect.READ_ONLY:
        part.error(30, line, f"{name} is read only")
    if variable is not None and variable.constants:
        if isinstance(item.value, Enum):
            _constant(part, line, name, item.value.name, variable.constants)
        elif not isinstance(item.value, Expr):
            expected = ", #".join(sorted(variable.constants))
            part.error(30, line, f"{name} takes one of its constants, expected #{expected}")


def _command(part: Part, call: Call, commands: Collection[str]) -> None:
    command, _ = bas(call)
    if command:
        _constant(part, call.line, "BAS", command, commands)


def _constant(part: Part, line: int, name: str, constant: str, known: Collection[str]) -> None:
    if constant.upper() not in known:
        near = nearest(constant.upper(), known)
        hint = f"#{near} is meant" if near else f"expected #{', #'.join(sorted(known))}"
        part.error(30, line, f"{name} knows no #{constant}", hint)
