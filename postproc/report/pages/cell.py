"""The page of a cell: what it is, what is wrong with it, and how it looks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.report.parts import Drawing, Page, T_world_base, add_scene, escape, table


@dataclass(frozen=True, slots=True)
class Stance:
    """How the robot stands: q (6,) [rad], TCP (4, 4) in robroot, solids that collide there."""

    q: FloatArray
    T_robroot_tcp: FloatArray
    colliding: tuple[str, ...]


def cell_page(
    drawing: Drawing, stance: Stance, facts: Mapping[str, Any], findings: Sequence[Finding]
) -> bytes:
    """Return the page of a cell as one self-contained HTML file.

    Frames are those of the robot root, of the workpiece and of the tool.

    Args:
        drawing: of the cell.
        stance: how the robot stands in it.
        facts: what ``check --json`` says of it.
        findings: findings.
    """
    cell = drawing.cell
    page = Page(f"Cell {cell.name}", _lead(cell, findings))
    add_scene(page, drawing)
    page.script = "cell.js"
    T_world_robroot = np.asarray(cell.robot.T_world_robroot)
    T_world_tcp = T_world_robroot @ stance.T_robroot_tcp
    frames = (("robot root", T_world_robroot), ("base", T_world_base(cell)), ("tcp", T_world_tcp))
    page.data |= {
        "home": [float(v) for v in stance.q],
        "reach": float(np.linalg.norm(T_world_tcp[:3, 3] - T_world_robroot[:3, 3])),
        "colliding": list(stance.colliding),
        "frames": [{"name": n, "matrix": [float(v) for v in T.ravel()]} for n, T in frames],
    }
    where = "at home" if cell.motion.home is not None else "upright"
    note = f'<p class="soft">The robot {where}; axes of robot root, base and tool: x red, y green, '
    page.section("The cell", f'<div id="scene"></div>{note}z blue.</p>', "wide")
    page.section("Axes", '<div id="axes"></div>', "third")
    page.section("What is wrong", _findings(findings), "half")
    page.section("What it is", table(("", ""), _facts(facts)), "half")
    return page.render()


def _lead(cell: Cell, findings: Sequence[Finding]) -> list[str]:
    errors = sum(finding.severity is Severity.ERROR for finding in findings)
    warnings = sum(finding.severity is Severity.WARNING for finding in findings)
    if errors:
        first = next(finding for finding in findings if finding.severity is Severity.ERROR)
        return [f"This cell cannot work as it is: {first.message}."]
    if warnings:
        word = "one warning" if warnings == 1 else f"{warnings} warnings"
        return [f"This cell works, with {word}.", f"Robot {cell.robot.name}."]
    return ["Nothing is wrong with this cell.", f"Robot {cell.robot.name}."]


def _findings(findings: Sequence[Finding]) -> str:
    if not findings:
        return '<p class="good">nothing</p>'
    marks = {Severity.ERROR: "bad", Severity.WARNING: "warn"}
    items = "".join(
        f'<li class="{marks.get(finding.severity, "soft")}">'
        + (f"line {finding.source.line}: " if finding.source else "")
        + f"{escape(finding.message)}</li>"
        for finding in findings
    )
    return f"<ul>{items}</ul>"


def _facts(facts: Mapping[str, Any], prefix: str = "") -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for key, value in facts.items():
        name = f"{prefix}{key}".replace("_", " ")
        if isinstance(value, Mapping):
            rows += _facts(value, f"{name} ")
        elif isinstance(value, list):
            shown = [f"{v:g}" if isinstance(v, float) else str(v) for v in value]
            rows.append((name, "  ".join(shown) or "none"))
        else:
            rows.append((name, "none" if value is None else str(value)))
    return rows
