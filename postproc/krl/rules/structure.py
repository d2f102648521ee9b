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
                subject.add(2, ERROR, module.src_path, routine.end_line, message)
            _balance(part)
        if module.data is not None and not module.data.is_closed:
            message = f"{module.data.name} has no ENDDAT"
            subject.add(2, ERROR, module.dat_path, module.data.end_line, message)


def _balance(part: Part) -> None:
    module, stack = part.module, list[tuple[str, int]]()
    for statement in part.of_kinds(krl.SplineBegin, krl.SplineEnd, krl.Control):
        if isinstance(statement, krl.SplineBegin):
            stack.append(("SPLINE", statement.line))
        elif isinstance(statement, krl.SplineEnd):
            _close(part.subject, module, stack, "SPLINE", "ENDSPLINE", statement.line)
        elif isinstance(statement, krl.Control):
            _control(part.subject, module, stack, statement)
    for word, line in stack:
        part.subject.add(2, ERROR, module.src_path, line, f"{word} is never closed")


def _control(
    subject: Subject, module: krl.KrlModule, stack: list[tuple[str, int]], statement: krl.Control
) -> None:
    word = statement.word
    if word in krl.CLOSERS:
        stack.append((word, statement.line))
    elif word in krl.OPENERS:
        _close(subject, module, stack, krl.OPENERS[word], word, statement.line)
    elif word in krl.BRANCHES and (not stack or stack[-1][0] != krl.BRANCHES[word]):
        subject.add(
            2, ERROR, module.src_path, statement.line, f"{word} outside {krl.BRANCHES[word]}"
        )
    elif word == "EXIT" and not any(opener in krl.LOOPS for opener, _ in stack):
        subject.add(2, ERROR, module.src_path, statement.line, "EXIT outside a loop")


def _close(
    subject: Subject,
    module: krl.KrlModule,
    stack: list[tuple[str, int]],
    opener: str,
    closer: str,
    line: int,
) -> None:
    if stack and stack[-1][0] == opener:
        stack.pop()
        return
    open_ = f"{stack[-1][0]} of line {stack[-1][1]} is open" if stack else "nothing is open"
    subject.add(2, ERROR, module.src_path, line, f"{closer} without {opener}: {open_}")


def declarations(subject: Subject) -> None:
    """Row 6: in a .src declarations come first and have no value; in a .dat both in one line."""
    for module in subject.modules:
        for part in subject.parts_of(module):
            _routine_declarations(part)
        if module.data is not None:
            _data_lines(subject, module, module.data)


def _routine_declarations(part: Part) -> None:
    module, routine, statements = part.module, part.routine, part.routine.statements
    instructions = (
        i for i, s in enumerate(statements) if not (isinstance(s, _QUIET) or _declares(s))
    )
    first = next(instructions, len(statements))
    for index in part.places(krl.Declaration, krl.External, krl.Raw):
        statement = statements[index]
        if index > first and _declares(statement):
            message = f"a declaration behind the first instruction (line {statements[first].line})"
            part.subject.add(6, ERROR, module.src_path, statement.line, message)
        for variable in statement.variables if isinstance(statement, krl.Declaration) else ():
            _sized(part.subject, module, routine, statement.line, variable)
            if variable.value is not None:
                part.subject.add(
                    6,
                    ERROR,
                    module.src_path,
                    statement.line,
                    f"{variable.name} is given a value in a .src declaration",
                    hint="declare it in the .dat with its value, or assign it behind INI",
                )


def _sized(
    subject: Subject, module: krl.KrlModule, routine: krl.Routine, line: int, variable: krl.Variable
) -> None:
    """An array has a size, but for a parameter, which takes that of its argument."""
    name = variable.name.upper()
    if variable.dimension is None or variable.dimension.strip(" ,"):
        return
    if all(parameter.name.upper() != name for parameter in routine.parameters):
        subject.add(6, ERROR, module.src_path, line, f"{variable.name} is an array without a size")


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
