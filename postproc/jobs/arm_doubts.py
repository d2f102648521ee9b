"""What speaks against the arm of a cell and its load, whatever the program is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import KUKA_OFFSETS_DEG, KUKA_SIGNS, Cell, OpwGeometry, UrdfGeometry, cell_toml
from postproc.errors import Finding, Severity, SourceRef
from postproc.kinematics import Kinematics, build
from postproc.toml import Location, TomlText
from postproc.units import DEG

_SAME_ZERO_DEG = 0.1


def arm_doubts(
    cell: Cell, kinematics: Kinematics, toml: Callable[[], TomlText]
) -> Iterator[Finding]:
    """Yield what says that the real arm may not do what the model of it does.

    Args:
        cell: arm and tools.
        kinematics: of the arm.
        toml: the cell file, which findings point into.
    """
    robot = cell.robot
    if "geometry" in robot.doubts:
        text = f"lengths of {robot.name} in doubt: {robot.doubts['geometry']}"
        yield _finding(toml(), Severity.WARNING, "CEL140", text, "robot")
    elif (lengths := robot.origins.get("geometry")) and lengths.trust == "C":
        text = f"the lengths of {robot.name} rest on one source alone: {lengths.source}"
        yield _finding(toml(), Severity.WARNING, "CEL141", text, "robot")
    arm = kinematics.arm
    if isinstance(robot.geometry, UrdfGeometry) and arm is not None:
        against = [f"A{i + 1}" for i in np.flatnonzero(_against_kuka(arm.geometry))]
        if against:
            text = f"{', '.join(against)} of this URDF do not turn or count as on a KUKA controller"
            yield _finding(toml(), Severity.WARNING, "CEL143", text, "robot", "urdf")
    for index, tool in enumerate(cell.tools):
        if tool.mass > robot.payload:
            at = ("tools", index) if "tools" in toml().data else ("tool",)
            name = f"tool {tool.number} {tool.name}".strip() + ": " if len(cell.tools) > 1 else ""
            text = f"the tool weighs {tool.mass:g} kg, the robot carries {robot.payload:g} kg"
            yield _finding(toml(), Severity.ERROR, "CEL103", name + text, *at, "mass_kg")


def warned_doubts(cell: Cell) -> tuple[Finding, ...]:
    """Return the doubts as warnings: a program can be made, and its reader has to know them."""
    found = arm_doubts(cell, build(cell.robot), cache(lambda: cell_toml(cell)))
    return tuple(replace(finding, severity=Severity.WARNING) for finding in found)


def _finding(
    toml: TomlText, severity: Severity, code: str, message: str, *at: str | int
) -> Finding:
    location: Location = at
    source = toml.source(location)
    return Finding(severity, code, message, source=SourceRef(source.path, source.line))


def _against_kuka(geometry: OpwGeometry) -> BoolArray:
    """Return (6,) whether an axis has another sense or zero than on every arm of KUKA."""
    turned = np.asarray(geometry.signs) != np.array(KUKA_SIGNS)
    offset = np.asarray(geometry.offsets) / DEG - np.array(KUKA_OFFSETS_DEG)
    shifted = np.abs((offset + 180.0) % 360.0 - 180.0) > _SAME_ZERO_DEG
    return np.asarray(turned | shifted)
