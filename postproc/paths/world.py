"""Runs a program on the controller of a cell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, HomeStyle
from postproc.controller import Trace, World, pose_of, run
from postproc.kinematics import Kinematics
from postproc.krl import Aggregate, Assign, Axes, Enum, KrlModule, Pose, Reference, parse_expression
from postproc.paths.motion import joint_paths
from postproc.units import DEG

_DELIVERED = {
    "FHOME": Aggregate((("TOOL_NO", 1), ("BASE_NO", 0), ("IPO_FRAME", Enum("BASE")))),
    "PDEFAULT": Aggregate((("VEL", 100.0), ("ACC", 100.0), ("APO_DIST", 100.0))),
}
"""Data of the form of HOME, as in the $config.dat of a delivered controller."""


def run_in_cell(
    modules: Sequence[KrlModule], name: str, cell: Cell, kinematics: Kinematics
) -> Trace:
    """Return the executed motions of a program.

    Args:
        modules: the program and what it calls.
        name: module to start, in any case.
        cell: its frames and home position, unless a set-up module enters other frames.
        kinematics: of its robot.
    """
    return run(modules, name, kinematics, _world_of(modules, cell, kinematics))


def _world_of(modules: Sequence[KrlModule], cell: Cell, kinematics: Kinematics) -> World:
    """Return what the program finds: frames that a set-up module enters, else those of the cell."""
    tools = {tool.number: pose_of(tool.T_flange_tcp) for tool in cell.tools}
    T_world_robroot = cell.robot.T_world_robroot
    bases = {base.number: pose_of(T_world_robroot @ base.T_robroot_base) for base in cell.bases}
    for module in modules:
        for routine in module.routines:
            for statement in [s for s in routine.statements if type(s) is Assign]:
                if isinstance(statement.value, Pose):
                    _set_up(statement, tools, bases)
    points: dict[str, Pose | Axes | Aggregate] = {}
    if cell.motion.home is not None:
        a1, a2, a3, a4, a5, a6 = (float(v) / DEG for v in cell.motion.home)
        points = dict.fromkeys(("XHOME", "HOME"), Axes(a1, a2, a3, a4, a5, a6))
    if cell.krl.home is HomeStyle.FORM:
        points |= _DELIVERED
    return World(
        tools,
        bases,
        points,
        np.asarray(cell.robot.T_world_robroot),
        lambda trace: _joints_at_end(trace, cell, kinematics),
        frozenset(name.upper() for name in cell.krl.hooks.values()),
        frozenset(cell.krl.hooks[key].upper() for key in cell.krl.stops_advance or ()),
        frozenset(" ".join(name.upper().split()) for name in cell.accept),
    )


def _set_up(statement: Assign, tools: dict[int, Pose], bases: dict[int, Pose]) -> None:
    name = statement.target.upper()
    if not name.startswith(("TOOL_DATA[", "BASE_DATA[")):
        return
    node = parse_expression(statement.target)
    index = node.selectors[0] if isinstance(node, Reference) and node.selectors else ()
    if len(index) == 1 and isinstance(index[0], int) and isinstance(statement.value, Pose):
        (tools if name.startswith("TOOL") else bases)[index[0]] = statement.value


def _joints_at_end(trace: Trace, cell: Cell, kinematics: Kinematics) -> FloatArray | None:
    """Return the joints (6,) [rad] where the last motion ends, None if they are not known."""
    if len(trace) == 0:
        return None
    q = joint_paths(trace, cell, kinematics).q[-1]
    return q if np.isfinite(q).all() else None
