"""Rows 1, 2, 6: lines that are no KRL, blocks without their other half, declarations."""

from __future__ import annotations

import re

from postproc.krl import text as krl
from postproc.krl.rules.part import Part
from postproc.krl.rules.subject import ERROR, Subject

_FOREIGN = re.compile(r"^(INI\s*$|//|[NG]\d+\b|.*\bVel=|M\d+\s*$|%)", re.IGNORECASE)
_QUIET = (krl.Comment, krl.Blank, krl.FoldBegin, krl.FoldEnd)
_DECLARING = frozenset({"SIGNAL", "STRUC", "ENUM", "CHANNEL", "IMPORT"})
_DATA = (krl.Declaration, krl.External, krl.Raw, krl.Assign)


def parses(subject: Subject) -> None:
    """Row 1: every line is KRL. Row 2: nothing that the pad shows or another machine speaks."""
    for module in subject.modules:
        for problem in module.problems:
            place = problem.source
            text = place.text if place is not None else ""
            row = 2 if _FOREIGN.match(text) else 1
            path = place.path if place is not None else module.src_path
            subject.add(row, ERROR, path, place.line if place else 1, problem.message)


def blocks(subject: Subject) -> None:
    """Row 2: DEF and END, and all blocks, are balanced."""
    for module in subject.modules:
        for part in subject.parts_of(module):
            routine = part.routine
            if not routine.is_closed:
                message = f"{routine.name} has no END: the file is cut off or END is missing"
                part.error(2, routine.end_line, message)
            for line, message in krl.flow_of(routine).broken:
                part.error(2, line, message)
        if module.data is not None and not module.data.is_closed:
            message = f"{module.data.name} has no ENDDAT"
            subject.add(2, ERROR, module.dat_path, module.data.end_line, message)


def declarations(subject: Subject) -> None:
    """Row 6: in a .src declarations come first and have no value; in a .dat both in one line."""
    for module in subject.modules:
        for part in subject.parts_of(module):
            _routine_declarations(part)
        if module.data is not None:
            _data_lines(subject, module, module.data)


def _routine_declarations(part: Part) -> None:
    statements = part.routine.statements
    instructions = (
        i for i, s in enumerate(statements) if not (isinstance(s, _QUIET) or _declares(s))
    )
    first = next(instructions, len(statements))
    for index in part.places(krl.Declaration, krl.External, krl.Raw):
        statement = statements[index]
        if index > first and _declares(statement):
            message = f"a declaration behind the first instruction (line {statements[first].line})"
            part.error(6, statement.line, message)
        for variable in statement.variables if isinstance(statement, krl.Declaration) else ():
            _sized(part, statement.line, variable)
            if variable.value is not None:
                message = f"{variable.name} is given a value in a .src declaration"
                hint = "declare it in the .dat with its value, or assign it behind INI"
                part.error(6, statement.line, message, hint)


def _sized(part: Part, line: int, variable: krl.Variable) -> None:
    """An array has a size, but for a parameter, which takes that of its argument."""
    name = variable.name.upper()
    if variable.dimension is None or variable.dimension.strip(" ,"):
        return
    if all(parameter.name.upper() != name for parameter in part.routine.parameters):
        part.error(6, line, f"{variable.name} is an array without a size")


def _declares(statement: krl.Statement) -> bool:
    if isinstance(statement, krl.Raw):
        return statement.word in _DECLARING
    return isinstance(statement, (krl.Declaration, krl.External))


def _data_lines(subject: Subject, module: krl.KrlModule, data: krl.DataList) -> None:
    for statement in data.statements:
        if isinstance(statement, krl.Assign):
            if "[" not in statement.target and "." not in statement.target:
                message = f"{statement.target}: declaration and value belong on one line"
                subject.add(6, ERROR, module.dat_path, statement.line, message)
        elif not isinstance(statement, (*_QUIET, *_DATA)):
            subject.add(6, ERROR, module.dat_path, statement.line, "an instruction in a data list")


def labels(subject: Subject) -> None:
    """Row 29: every GOTO has its label in the routine, and no label appears there twice."""
    for part in subject.parts:
        controls = part.of(krl.Control)
        lines: dict[str, int] = {}
        for label in controls:
            name = label.text.upper()
            if label.word != "LABEL":
                continue
            if name in lines:
                message = f"label {label.text} stands in line {lines[name]} already"
                part.error(29, label.line, message)
            lines.setdefault(name, label.line)
        for jump in controls:
            if jump.word == "GOTO" and jump.text.upper() not in lines:
                message = f"GOTO {jump.text}: {part.routine.name} has no such label"
                part.error(29, jump.line, message)
