"""The separate modules: data of tool, base and load, and an example of the integrator's routines.

A program never carries these data itself: it selects tool and base by number, so what was measured
in the cell is what counts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from postproc.arrays import FloatArray
from postproc.cell import Cell, Tool
from postproc.emitters.kuka.template import TemplateSet
from postproc.geometry import kuka_from_transform
from postproc.krl import Aggregate, KrlModule, Pose, Statement, value_text
from postproc.units import MM

HOOKS_MODULE = "PP_HOOKS"
"""Name of the example module; its routines are those of ``krl.hooks``."""
SETUP_ENDING = "_SETUP"
"""Behind the program's name: the module that enters tool, base and load data."""


def setup_statements(
    cell: Cell, tools: Sequence[int], bases: Sequence[int], templates: TemplateSet
) -> list[Statement]:
    """Return the body of the set-up module, for indices of the tools and bases that are used."""
    statements = templates.statements("setup", {})
    for index in tools:
        tool = cell.tools[index]
        load = _load(tool)
        values: dict[str, object] = {
            "tool_number": tool.number,
            "tool_frame": value_text(_frame(tool.T_flange_tcp)),
            "load": "" if load is None else value_text(load),
        }
        texts = {"tool_name": f"tool: {tool.name}", "load_note": _load_note(tool)}
        statements += templates.statements("setup_tool", values, texts)
    for index in bases:
        base = cell.bases[index]
        T_world_base = cell.robot.T_world_robroot @ base.T_robroot_base
        values = {"base_number": base.number, "base_frame": value_text(_frame(T_world_base))}
        statements += templates.statements("setup_base", values)
    return statements


def hooks_module(cell: Cell, templates: TemplateSet) -> KrlModule:
    """Return the example of the integrator's routines; errors as ``TemplateSet.module``."""
    values = {"hooks": dict(cell.krl.hooks), "steps": list(cell.process.hole)}
    return templates.module("hooks", values, HOOKS_MODULE)


def _frame(T: FloatArray) -> Pose:
    xyz_mm, abc_deg = kuka_from_transform(T)
    x, y, z, a, b, c = (float(v) for v in (*xyz_mm, *abc_deg))
    return Pose(x, y, z, a, b, c)


def _load(tool: Tool) -> Aggregate | None:
    """Return LOAD_DATA, inertia 0 where not measured; None without mass or centre of gravity."""
    if math.isnan(tool.mass) or tool.com is None:
        return None
    x, y, z = (float(v) / MM for v in tool.com)
    jx, jy, jz = (0.0, 0.0, 0.0) if tool.inertia is None else tool.inertia
    return Aggregate(
        (
            ("M", float(tool.mass)),
            ("CM", Pose(x, y, z, 0.0, 0.0, 0.0)),
            ("J", Aggregate((("X", float(jx)), ("Y", float(jy)), ("Z", float(jz))))),
        )
    )


def _load_note(tool: Tool) -> str:
    """Return what of the load is not known, empty if all is."""
    if not math.isnan(tool.mass) and tool.com is not None:
        if tool.inertia is None:
            return "the inertia is not known: as of a mass in one point, enter the measured one"
        return ""
    known = []
    if not math.isnan(tool.mass):
        known.append(f"mass {tool.mass:g} kg")
    if tool.com is not None:
        known.append("centre of gravity " + ", ".join(f"{v / MM:g}" for v in tool.com) + " mm")
    missing = [
        name
        for name, absent in (
            ("mass", math.isnan(tool.mass)),
            ("centre of gravity", tool.com is None),
        )
        if absent
    ]
    have = f", from the cell: {', '.join(known)}" if known else ""
    return f"enter by hand: not known {', '.join(missing)}{have}"
