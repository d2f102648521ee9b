"""Rows 15, 16, 17: path speeds, axis and orientation speeds, advance and approximation."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from postproc.arrays import FloatArray
from postproc.krl.rules.expressions import settings_of
from postproc.krl.rules.part import Part, bas, known_number, number
from postproc.krl.rules.subject import ERROR, WARNING, Subject
from postproc.krl.system import components_of, system_variable
from postproc.krl.text import Aggregate, Assign, Call, Declaration, Move, Statement, Value

_INDEX = re.compile(r"\[(\d+)\]")
_ORIENTATION = ("$VEL.ORI1", "$VEL.ORI2")
_BLENDS = {
    "$APO.CDIS": ("C_DIS", "C_SPL"),
    "$APO.CPTP": ("C_PTP",),
    "$APO.CORI": ("C_ORI",),
    "$APO.CVEL": ("C_VEL",),
}
"""Where the words of approximation begin to cut a corner."""


def speeds(subject: Subject) -> None:
    """Rows 15 to 17: all settings that stand in the text."""
    for part in subject.parts:
        subject.each(part, partial(_speeds, subject, part.path))
        _blend_lengths(part)
        _without_advance(part)
        _blends_of_nothing(part)
    for module in subject.modules:
        for statement in module.listed:
            if isinstance(statement, Declaration):
                _motion_data(subject, module.dat_path, statement)


def _speeds(subject: Subject, path: str, statement: Statement) -> None:
    for item in settings_of(statement):
        for name, value in _parts(item):
            _setting(subject, path, statement.line, name, value)
    if isinstance(statement, Call):
        _bas(subject, path, statement)


def _parts(item: Assign) -> Sequence[tuple[str, Value]]:
    """Return what an assignment sets: (variable, value), structures by component."""
    name, value = item.target.upper(), item.value
    if isinstance(value, Aggregate) and name in components_of():
        return [(f"{name}.{key.upper()}", component) for key, component in value.fields]
    return ((name, value),)


def _setting(subject: Subject, path: str, line: int, name: str, value: Value) -> None:
    """Check index and number of a system variable against the table."""
    variable = system_variable(name) if name.startswith("$") else None
    if variable is None:
        return
    if variable.name in _ORIENTATION:
        variable = replace(variable, most=subject.options.orientation_speed_max)
    row = 30
    if name.startswith(("$APO", "$ADVANCE")):
        row = 17
    elif name.startswith(("$VEL_", "$ACC_", *_ORIENTATION)):
        row = 16
    elif name.startswith(("$VEL", "$ACC")):
        row = 15
    found = number(value)
    index = _INDEX.search(name)
    if variable.size and index and not 1 <= int(index.group(1)) <= variable.size:
        message = f"{name}: the index goes from 1 to {variable.size}"
        hint = "$VEL_EXTAX[i] for external axes" if "_AXIS" in name else ""
        subject.add(row, ERROR, path, line, message, hint)
    elif found is None:
        return
    elif name == "$VEL.CP":
        _path_speed(subject, path, line, found, by_bas=False)
    elif not variable.takes(found):
        unit = f" {variable.unit}" if variable.unit else ""
        subject.add(row, ERROR, path, line, f"{name} {found:g}{unit}, expected {variable.expected}")


def _path_speed(subject: Subject, path: str, line: int, value: float, *, by_bas: bool) -> None:
    options = subject.options
    if value <= 0.0:
        message = f"a path speed of {value:g} m/s: the robot would not move"
        subject.add(15, ERROR, path, line, message)
    elif value > options.path_speed_max:
        message = f"a path speed of {value:g} m/s, the controller allows {options.path_speed_max:g}"
        subject.add(15, ERROR, path, line, message)
    elif value > options.path_speed_default and by_bas:
        message = f"BAS cuts {value:g} m/s to {options.path_speed_default:g} without a message"
        subject.add(15, WARNING, path, line, message)
    elif value > options.path_speed_default:
        message = f"{value:g} m/s is above the default of {options.path_speed_default:g}"
        subject.add(15, WARNING, path, line, message)


def _bas(subject: Subject, path: str, call: Call) -> None:
    command, argument = bas(call)
    value = number(argument)
    if value is None:
        return
    if command in ("VEL_CP", "CP_PARAMS"):
        _path_speed(subject, path, call.line, value, by_bas=True)
    elif command in ("VEL_PTP", "PTP_PARAMS", "ACC_PTP", "ACC_CP") and not 0.0 < value <= 100.0:
        message = f"BAS(#{command},{value:g}): percent, expected above 0 and at most 100"
        subject.add(16, ERROR, path, call.line, message)


def _motion_data(subject: Subject, path: str, statement: Declaration) -> None:
    kind = statement.type_name.upper()
    if kind not in ("PDAT", "LDAT"):
        return
    for variable in statement.variables:
        if not isinstance(variable.value, Aggregate):
            continue
        velocity = number(variable.value.get("VEL"))
        if kind == "LDAT" and velocity is not None:
            _path_speed(subject, path, statement.line, velocity, by_bas=True)
        for name in ("ACC", *(("VEL",) if kind == "PDAT" else ())):
            share = number(variable.value.get(name))
            if share is not None and not 0.0 < share <= 100.0:
                message = f"{variable.name}: {name} {share:g} %, expected above 0 and at most 100"
                # BAS takes the acceleration of 100 % for one above it
                severity = WARNING if name == "ACC" and share > 100.0 else ERROR
                subject.add(16, severity, path, statement.line, message)


# ------------------------------------------------------------------------------------ blending


def _blend_lengths(part: Part) -> None:
    """Row 17: $APO.CDIS beyond half of the shorter neighbouring segment is cut short."""
    if len(part.steps) < 3:
        return
    length = np.linalg.norm(np.diff(part.positions, axis=0), axis=1)
    short = 0.5 * np.fmin(length[:-1], length[1:])
    distance = _in_force(part, "$APO.CDIS")[1:-1]
    blended = np.array(["C_DIS" in b or "C_SPL" in b for b in part.blends])[1:-1]
    known = np.isfinite(length[:-1]) & np.isfinite(length[1:]) & part.is_path[1:-1]
    cut = known & part.is_path[2:] & blended & (distance > short * (1.0 + 1e-6) + 1e-6)
    rows = np.flatnonzero(cut)
    if len(rows):
        first = part.steps[int(rows[0]) + 1].move.line
        message = (
            f"$APO.CDIS is longer than half of a neighbouring segment at {len(rows)} points: "
            "the controller cuts it"
        )
        part.warn(17, first, message)


def _in_force(part: Part, variable: str) -> FloatArray:
    """Return a part of $APO (k,) in force at each motion, NaN where it is not known."""
    changes = []
    for index, statement in zip(
        part.places(Assign, Call), part.of_kinds(Assign, Call), strict=True
    ):
        if isinstance(statement, Assign):
            if statement.target.upper().startswith("$APO"):
                for name, value in _parts(statement):
                    if name in (variable, "$APO"):
                        changes.append((index, known_number(value)))
        else:
            command, _ = bas(statement)
            if command == "INITMOV" or command.endswith(("PARAMS", "_DAT")):
                changes.append((index, float("nan")))
    return part.in_force(changes)


def _blends_of_nothing(part: Part) -> None:
    """Row 17: where approximation begins at 0, every point is an exact stop."""
    for variable, words in _BLENDS.items():
        for place in np.flatnonzero(_in_force(part, variable) == 0.0).tolist():
            move = part.steps[place].move
            own = [i for i in move.settings if i.target.upper().startswith("$APO")]
            if not own and move.blend and move.blend[-1] in words:
                message = f"{move.blend[-1]} with {variable} 0: every point is an exact stop"
                part.warn(17, move.line, message)
                break


def _without_advance(part: Part) -> None:
    """Row 17: with $ADVANCE 0 nothing is blended."""
    advance: float | None = None
    settings = [item for item in part.of(Assign) if item.target == "$ADVANCE"]
    if all(number(item.value) != 0 for item in settings):
        return
    for statement in part.of_kinds(Assign, Move):
        if isinstance(statement, Assign) and statement.target == "$ADVANCE":
            advance = number(statement.value)
        elif isinstance(statement, Move) and statement.blend and advance == 0:
            message = f"{statement.blend[0]} with $ADVANCE 0: every point is an exact stop"
            part.warn(17, statement.line, message)
            return
