"""A cell from the backup of a controller, and a cell held against one."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from postproc.backup import BackupComparison, Difference, cell_values, compare, read_backup
from postproc.cell import Cell, cell_text, cell_toml, load_robot
from postproc.errors import Finding, Severity, SourceRef
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class NewCell:
    """Text of a cell file, the robot in it, and what a person must know."""

    text: str
    robot: str
    notes: tuple[str, ...]
    facts: dict[str, Any]


def cell_from_backup(path: str | Path, name: str, robot: str | None = None) -> NewCell:
    """Return a cell that says what the backup of a controller says.

    Args:
        path: ZIP or folder.
        name: of the cell.
        robot: built-in robot, where the caller knows better than the files.

    Raises:
        ReadError: BAK001 to BAK007 if the backup cannot be used.
        CellError: CEL010 for an unknown robot.
    """
    controller = read_backup(path)
    values, remarks = cell_values(controller, load_robot(robot) if robot else None)
    table = values["robot"]
    facts = {
        "software": controller.software or None,
        "trafoname": controller.machine.trafoname or None,
        "tools": [tool["number"] for tool in values["tools"]],
        "bases": [base["number"] for base in values["bases"]],
    }
    notes = [*controller.notes, *remarks["robot"][:1]]
    arm = table.get("model") or table["name"]
    return NewCell(cell_text({"name": name, **values}, remarks), arm, tuple(notes), facts)


def compare_backup(cell: Cell, path: str | Path) -> tuple[BackupComparison, tuple[Finding, ...]]:
    """Return where a cell and a controller differ, also as findings with their line in the cell.

    Raises:
        ReadError: BAK001 to BAK007 if the backup cannot be used.
    """
    comparison = compare(cell, read_backup(path))
    toml = cell_toml(cell)
    findings = []
    for difference in comparison.differences:
        source = toml.source(_as_written(difference.at, toml.data))
        place = SourceRef(source.path, source.line)
        findings.append(_finding(difference, place))
    return comparison, tuple(findings)


def _finding(difference: Difference, place: SourceRef) -> Finding:
    if difference.severity is Severity.ERROR:
        return Finding(Severity.ERROR, "BAK101", difference.text, source=place)
    if difference.severity is Severity.WARNING:
        return Finding(Severity.WARNING, "BAK102", difference.text, source=place)
    return Finding(Severity.NOTE, "BAK103", difference.text, source=place)


def _as_written(at: tuple[str | int, ...], data: dict[str, Any]) -> tuple[str | int, ...]:
    """Return where a key stands in a cell of the short form: [tool] for the first of tools."""
    short = {"tools": "tool", "bases": "workpiece"}.get(str(at[0])) if at else None
    return at if short is None or at[0] in data else (short, *at[2:])
