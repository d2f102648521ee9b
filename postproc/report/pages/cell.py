"""The page of a cell: what it is, what is wrong with it, and how it looks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, ExternalAxis, Tool, Workpiece
from postproc.errors import Finding, Severity
from postproc.records import dataclass
from postproc.report.parts import Drawing, Page, escape, scene_data, table
from postproc.units import DEG, MM


@dataclass(frozen=True, slots=True)
class Stance:
    """How the robot stands: q (6,) [rad], flange (4, 4) in robroot.

    ``colliding``: for each tool and each base the solids that collide there; ``clearance`` [m]: the
    smallest of any tool and base, inf where nothing is near.
    """

    q: FloatArray
    T_robroot_flange: FloatArray
    colliding: tuple[tuple[tuple[str, ...], ...], ...]
    clearance: float


def cell_page(
    drawing: Drawing, stance: Stance, facts: Mapping[str, Any], findings: Sequence[Finding]
) -> bytes:
    """Return the page of a cell as one self-contained HTML file.

    Frames are those of the robot root, of the workpieces and of the tools; of several tools and
    bases one each is shown, which the reader chooses. ``facts``: what ``check --json`` says of it.
    """
    cell = drawing.cell
    good = not any(finding.is_error for finding in findings)
    page = Page(f"Cell {cell.name}", _lead(cell, findings, stance), good=good)
    page.data |= scene_data(drawing)
    page.script = "cell.js"
    T_world_robroot = np.asarray(cell.robot.T_world_robroot)
    T_world_flange = T_world_robroot @ stance.T_robroot_flange
    frames = [
        ("robot root", T_world_robroot),
        *(("base", T_world_robroot @ base.T_robroot_base) for base in cell.bases),
        *(("tcp", T_world_flange @ tool.T_flange_tcp) for tool in cell.tools),
    ]
    page.data |= {
        "home": [float(v) for v in stance.q],
        "externals": [_external(axis) for axis in cell.external_axes],
        "colliding": [[list(pair) for pair in row] for row in stance.colliding],
        "frames": [{"name": n, "matrix": [float(v) for v in T.ravel()]} for n, T in frames],
    }
    where = "at home" if cell.motion.home is not None else "upright"
    note = f'<p class="soft">The robot {where}; axes of robot root, base and tool: x red, y green, '
    shown = f'<div id="scene"></div>{_choices(cell)}{note}z blue.</p>'
    page.section("The cell", shown, "wide")
    keys = '<p class="soft">as keys of the cell: <code id="keys"></code></p>'
    page.section("Axes", f'<div id="axes"></div>{keys}', "third")
    page.findings(findings)
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


def _external(axis: ExternalAxis) -> dict[str, Any]:
    """Return an external axis for the page's scripts, in m or rad."""
    return {
        "name": axis.name,
        "turns": axis.kind == "positioner",
        "limits": [float(axis.q_min), float(axis.q_max)],
        "axis": np.asarray(axis.axis).tolist(),
        "point": np.asarray(axis.T_world_axis)[:3, 3].tolist(),
    }


def _lead(cell: Cell, findings: Sequence[Finding], stance: Stance) -> list[str]:
    errors = sum(finding.is_error for finding in findings)
    warnings = sum(finding.severity is Severity.WARNING for finding in findings)
    if errors:
        first = next(finding for finding in findings if finding.is_error)
        return [f"This cell cannot work as it is: {first.message}."]
    where = "at home" if cell.motion.home is not None else "upright"
    margin = np.minimum(stance.q - cell.robot.q_min, cell.robot.q_max - stance.q).min()
    near = f"clearance {stance.clearance / MM:.1f} mm, " if np.isfinite(stance.clearance) else ""
    stands = f"Robot {cell.robot.name}, {where}: {near}{margin / DEG:.1f} deg to a joint limit."
    if warnings:
        word = "one warning" if warnings == 1 else f"{warnings} warnings"
        return [f"This cell works, with {word}.", stands]
    return ["This cell works: nothing is wrong with it.", stands]


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
