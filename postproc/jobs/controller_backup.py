"""A cell held against the backup of a controller."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from postproc.backup import BackupComparison, compare, read_backup
from postproc.cell import Cell, cell_toml
from postproc.errors import Finding, Severity
from postproc.jobs.arm_doubts import finding_at


def compare_backup(cell: Cell, path: str | Path) -> tuple[BackupComparison, tuple[Finding, ...]]:
    """Return where a cell and a controller differ, also as findings with their line in the cell."""
    comparison = compare(cell, read_backup(path))
    toml = cell_toml(cell)
    findings = []
    for difference in comparison.differences:
        how, at = difference.severity, _as_written(difference.at, toml.data)
        is_error, is_warning = how is Severity.ERROR, how is Severity.WARNING
        findings.append(
            finding_at(
                toml,
                how,
                "BAK101" if is_error else "BAK102" if is_warning else "BAK103",
                difference.text,
                *at,
            )
        )
    return comparison, tuple(findings)


def _as_written(at: tuple[str | int, ...], data: dict[str, Any]) -> tuple[str | int, ...]:
    """Return where a key stands in a cell of the short form: [tool] for the first of tools."""
    short = {"tools": "tool", "bases": "workpiece"}.get(str(at[0])) if at else None
    return at if short is None or at[0] in data else (short, *at[2:])
