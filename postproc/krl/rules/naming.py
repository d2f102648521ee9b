"""Rows 3 and 4: names of files and routines, legal and unique names."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator

from postproc.krl.rules.subject import ERROR, Subject
from postproc.krl.text import (
    KEYWORDS,
    NAME_LENGTH,
    Control,
    Declaration,
    FoldBegin,
    KrlModule,
    Statement,
)

_LEGAL = re.compile(r"[A-Za-z_][A-Za-z0-9_$]*\Z")
_BUILT_IN = """
BAS IR_STOPM ABS SQRT SIN COS TAN ACOS ASIN ATAN ATAN2 INV_POS EK EB EO LK VARSTATE PULSE CAST_TO
CAST_FROM CWRITE CREAD COPEN CCLOSE SREAD SWRITE FORWARD INVERSE DELETE_BACKWARD_BUFFER
GET_SIG_INF STRTOINT STRADD STRCLEAR STRCOMP STRCOPY STRDECLLEN STRFIND STRLEN STRTOREAL STRTOBOOL
STRTOFRAME STRTOPOS STRTOE6POS STRTOAXIS STRTOE6AXIS
"""
BUILT_IN = frozenset(_BUILT_IN.split())
"""Routines of every controller, which no module may define for itself."""
_POINT = re.compile(r"(?:S?PTP|S?LIN|S?CIRC|SPL)\s+([A-Za-z_]\w*)", re.IGNORECASE)


def file_names(subject: Subject) -> None:
    """Row 3: DEF and DEFDAT are called as the file; no two modules of one name."""
    first: dict[str, str] = {}
    for module in subject.modules:
        wanted = module.name.upper()
        if module.routines and module.main.name.upper() != wanted:
            message = f"DEF {module.main.name} in a file called {module.name}.src"
            subject.add(3, ERROR, module.src_path, module.main.line, message)
        if module.data is not None and module.data.name.upper().lstrip("$") != wanted.lstrip("$"):
            message = f"DEFDAT {module.data.name} in a file called {module.name}.dat"
            subject.add(3, ERROR, module.dat_path, module.data.line, message)
        path = module.src_path or module.dat_path
        if wanted.startswith("$"):
            continue  # data of the system: STEU has a second $config and $machine
        if wanted in first:
            message = f"a second module {module.name}: all folders share one name space"
            subject.add(3, ERROR, path, 1, message, hint=f"the first is {first[wanted]}")
        first.setdefault(wanted, path)


def legal_names(subject: Subject) -> None:
    """Row 4: names are legal, at most 24 characters, unique in the module, GLOBAL ones in all."""
    everywhere: dict[str, str] = {}
    for module in subject.modules:
        if module.name.startswith("$") or _is_system_data(module):
            continue
        _check_name(subject, module.src_path or module.dat_path, 1, module.name)
        _unique_routines(subject, module)
        for name, path, line in _own_names(subject, module):
            _check_name(subject, path, line, name)
        for name, path, line in global_names(module):
            key = name.upper()
            if key in everywhere:
                message = f"GLOBAL {name} is defined a second time"
                subject.add(4, ERROR, path, line, message, hint=f"first in {everywhere[key]}")
            everywhere.setdefault(key, f"{path}:{line}")
        _form_points(subject, module)


def _is_system_data(module: KrlModule) -> bool:
    return module.data is not None and module.data.name.startswith("$")


def _check_name(subject: Subject, path: str, line: int, name: str) -> None:
    if len(name) > NAME_LENGTH:
        message = f"{name} has {len(name)} characters, at most {NAME_LENGTH} are legal"
        subject.add(4, ERROR, path, line, message)
    elif not _LEGAL.match(name):
        message = f"{name!r}: only letters, digits, _ and $ are legal, digits and $ not in front"
        subject.add(4, ERROR, path, line, message)
    elif name.upper() in KEYWORDS:
        subject.add(4, ERROR, path, line, f"{name} is a word of the language")


def _unique_routines(subject: Subject, module: KrlModule) -> None:
    seen: set[str] = set()
    for part in subject.parts_of(module):
        routine = part.routine
        if routine.name.upper() in seen:
            message = f"a second routine {routine.name} in this module"
            subject.add(4, ERROR, module.src_path, routine.line, message)
        seen.add(routine.name.upper())
        if routine is not module.main and routine.name.upper() in BUILT_IN:
            message = f"{routine.name} is a routine of every controller"
            subject.add(4, ERROR, module.src_path, routine.line, message)
        _unique(subject, module.src_path, part.of(Declaration))
    if module.data is not None:
        _unique(subject, module.dat_path, module.data.statements)


def _unique(subject: Subject, path: str, statements: Iterable[Statement]) -> None:
    """Report names declared twice; a parameter is declared once more inside its routine."""
    seen: set[str] = set()
    for statement in statements:
        if not isinstance(statement, Declaration):
            continue
        for variable in statement.variables:
            key = variable.name.upper()
            if key in seen:
                message = f"{variable.name} is declared a second time"
                subject.add(4, ERROR, path, statement.line, message)
            seen.add(key)


def _own_names(subject: Subject, module: KrlModule) -> Iterator[tuple[str, str, int]]:
    for part in subject.parts_of(module):
        routine = part.routine
        yield routine.name, module.src_path, routine.line
        for parameter in routine.parameters:
            yield parameter.name, module.src_path, routine.line
        yield from _declared_in(part.of_kinds(Declaration, Control), module.src_path)
    if module.data is not None:
        yield from _declared_in(module.data.statements, module.dat_path)


def _declared_in(statements: Iterable[Statement], path: str) -> Iterator[tuple[str, str, int]]:
    for statement in statements:
        if isinstance(statement, Declaration):
            for variable in statement.variables:
                yield variable.name, path, statement.line
        elif isinstance(statement, Control) and statement.word == "LABEL":
            yield statement.text, path, statement.line


def global_names(module: KrlModule) -> Iterator[tuple[str, str, int]]:
    """Yield name, file and line of what other modules see."""
    for routine in module.routines:
        if routine.is_global:
            yield routine.name, module.src_path, routine.line
    for statement in module.listed:
        if isinstance(statement, Declaration) and statement.is_global:
            for variable in statement.variables:
                yield variable.name, module.dat_path, statement.line


def _form_points(subject: Subject, module: KrlModule) -> None:
    """The name of a form's point gets a letter in front: 23 characters are left for it."""
    for part in subject.parts_of(module):
        for fold in part.of(FoldBegin):
            found = _POINT.match(fold.text.strip())
            name = found.group(1) if found else ""
            if len(name) > NAME_LENGTH - 1:
                message = f"form point {name}: X{name} has {len(name) + 1} characters"
                subject.add(4, ERROR, module.src_path, fold.line, message)
