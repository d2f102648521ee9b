"""The separate modules: data of tool, base and load, and an example of the integrator's routines.

A program never carries these data itself: it selects tool and base by number, so what was measured
in the cell is what counts.
"""

from __future__ import annotations

import math

from postproc.arrays import FloatArray
from postproc.cell import Cell, KrlOptions
from postproc.emitters.kuka.template import TemplateSet
from postproc.geometry import kuka_from_transform
from postproc.krl import Aggregate, KrlModule, Pose, Statement, value_text
from postproc.units import MM

HOOKS_MODULE = "PP_HOOKS"
"""Name of the example module; its routines are those of ``krl.hooks``."""
SETUP_ENDING = "_SETUP"
"""Behind the program's name: the module that enters tool, base and load data."""


def setup_statements(cell: Cell, templates: TemplateSet) -> list[Statement]:
    """Return the body of the set-up module; errors as ``TemplateSet.statements``."""
    load = _load(cell)
    values: dict[str, object] = {
        "tool_number": cell.tool.number,
        "base_number": cell.workpiece.number,
        "tool_frame": value_text(_frame(cell.tool.T_flange_tcp)),
        "base_frame": value_text(_frame(cell.robot.T_world_robroot @ cell.T_robroot_base)),
        "load": "" if load is None else value_text(load),
    }
    texts = {
        "tool_name": f"tool: {cell.tool.name}",
        "load_note": "" if load is not None else _load_note(cell),
    }
    return templates.statements("setup", values, texts)


def hooks_module(style: KrlOptions, templates: TemplateSet) -> KrlModule:
    """Return the example of the integrator's routines; errors as ``TemplateSet.module``."""
    return templates.module("hooks", {"hooks": dict(style.hooks)}, HOOKS_MODULE)


def _frame(T: FloatArray) -> Pose:
    xyz_mm, abc_deg = kuka_from_transform(T)
    x, y, z, a, b, c = (float(v) for v in (*xyz_mm, *abc_deg))
    return Pose(x, y, z, a, b, c)


def _load(cell: Cell) -> Aggregate | None:
    """Return LOAD_DATA, None if mass, centre of gravity or inertia is not known.

    An inertia of 0 would be taken for a point mass, so none is made up.
    """
    tool, inertia = cell.tool, cell.krl.inertia
    if math.isnan(tool.mass) or tool.com is None or inertia is None:
        return None
    x, y, z = (float(v) / MM for v in tool.com)
    jx, jy, jz = inertia
    return Aggregate(
        (
            ("M", float(tool.mass)),
            ("CM", Pose(x, y, z, 0.0, 0.0, 0.0)),
            ("J", Aggregate((("X", float(jx)), ("Y", float(jy)), ("Z", float(jz))))),
        )
    )


def _load_note(cell: Cell) -> str:
    tool = cell.tool
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
    missing.append("inertia")
    have = f", from the cell: {', '.join(known)}" if known else ""
    return f"enter by hand: not known {', '.join(missing)}{have}"
