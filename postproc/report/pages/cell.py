"""The page of a cell: what it is, what is wrong with it, and how it looks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, Tool, Workpiece
from postproc.errors import Finding, Severity
from postproc.records import dataclass
from postproc.report.parts import Drawing, Page, escape, scene_data, table


@dataclass(frozen=True, slots=True)
class Stance:
    """How the robot stands: q (6,) [rad], flange (4, 4) in robroot.

    ``colliding``: for each tool and each base the solids that collide there.
    """

    q: FloatArray
    T_robroot_flange: FloatArray
    colliding: tuple[tuple[tuple[str, ...], ...], ...]


def cell_page(
    drawing: Drawing, stance: Stance, facts: Mapping[str, Any], findings: Sequence[Finding]
) -> bytes:
    """Return the page of a cell as one self-contained HTML file.

    Frames are those of the robot root, of the workpieces and of the tools; of several tools and
    bases one each is shown, which the reader chooses.

    Args:
        drawing: of the cell.
        stance: how the robot stands in it.
        facts: what ``check --json`` says of it.
        findings: findings.
    """
    cell = drawing.cell
    page = Page(f"Cell {cell.name}", _lead(cell, findings))
    page.data |= scene_data(drawing)
    page.script = "cell.js"
    T_world_robroot = np.asarray(cell.robot.T_world_robroot)
    T_world_flange = T_world_robroot @ stance.T_robroot_flange
    frames = [
        ("robot root", T_world_robroot),
        *(("base", T_world_robroot @ base.T_robroot_base) for base in cell.bases),
        *(("tcp", T_world_flange @ tool.T_flange_tcp) for tool in cell.tools),
    ]
    T_world_tcp = frames[-1][1]
    page.data |= {
        "home": [float(v) for v in stance.q],
        "reach": float(np.linalg.norm(T_world_tcp[:3, 3] - T_world_robroot[:3, 3])),
        "colliding": [[list(pair) for pair in row] for row in stance.colliding],
        "frames": [{"name": n, "matrix": [float(v) for v in T.ravel()]} for n, T in frames],
    }
    where = "at home" if cell.motion.home is not None else "upright"
    note = f'<p class="soft">The robot {where}; axes of robot root, base and tool: x red, y green, '
    shown = f'<div id="scene"></div>{_choices(cell)}{note}z blue.</p>'
    page.section("The cell", shown, "wide")
    page.section("Axes", '<div id="axes"></div>', "third")
    page.section("Findings", _findings(findings), "half")
    page.section("What it is", table(("", ""), _facts(_each_once(facts))), "half")
    return page.render()


def _choices(cell: Cell) -> str:
    """Return the lists from which tool and base are chosen, empty where there is one of each."""
    if len(cell.tools) == len(cell.bases) == 1:
        return ""
    lists = []
    named: tuple[tuple[str, Sequence[Tool | Workpiece]], ...] = (
        ("tool", cell.tools),
        ("base", cell.bases),
    )
    for what, entries in named:
        options = "".join(
            f'<option value="{index}">{escape(f"{entry.number} {entry.name}".strip())}</option>'
            for index, entry in enumerate(entries)
        )
        lists.append(f'<label>{what} <select id="{what}">{options}</select></label>')
    return f'<div class="bar">{"".join(lists)}</div>'


def _each_once(facts: Mapping[str, Any]) -> dict[str, Any]:
    """Return facts that say a tool and a base once: alone, or in a list by number."""
    result = dict(facts)
    for one, all_ in (("tool", "tools"), ("workpiece", "bases")):
        entries = result.pop(all_)
        if len(entries) > 1:
            del result[one]
            result |= {f"{one} {entry['number']}": entry for entry in entries}
    return result


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
