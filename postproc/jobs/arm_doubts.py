"""What speaks against the arm of a cell and its load, whatever the program is."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import KUKA_OFFSETS_DEG, KUKA_SIGNS, Cell, OpwGeometry, UrdfGeometry, cell_toml
from postproc.collision import Body, Scene, nearest_outside
from postproc.errors import Finding, Severity, SourceRef
from postproc.geometry import inverse
from postproc.kinematics import Kinematics, build
from postproc.model import WORKING, ToolPath
from postproc.process import assign
from postproc.toml import TomlText
from postproc.units import DEG, MM

_SAME_ZERO_DEG = 0.1


def arm_doubts(
    cell: Cell, kinematics: Kinematics, toml: Callable[[], TomlText]
) -> Iterator[Finding]:
    """Yield what says that the real arm may not do what the model of it does.

    ``toml`` returns the cell file, which findings point into.
    """
    robot = cell.robot
    if "geometry" in robot.doubts:
        text = f"lengths of {robot.name} in doubt: {robot.doubts['geometry']}"
        yield finding_at(toml(), Severity.WARNING, "CEL140", text, "robot")
    elif (lengths := robot.origins.get("geometry")) and lengths.trust == "C":
        text = f"the lengths of {robot.name} rest on one source alone: {lengths.source}"
        yield finding_at(toml(), Severity.WARNING, "CEL141", text, "robot")
    arm = kinematics.arm
    if isinstance(robot.geometry, UrdfGeometry) and arm is not None:
        against = [f"A{i + 1}" for i in np.flatnonzero(_against_kuka(arm.geometry))]
        if against:
            text = f"{', '.join(against)} of this URDF do not turn or count as on a KUKA controller"
            yield finding_at(toml(), Severity.WARNING, "CEL143", text, "robot", "urdf")
    for index, tool in enumerate(cell.tools):
        if tool.mass > robot.payload:
            at = ("tools", index) if "tools" in toml().data else ("tool",)
            name = f"tool {tool.number} {tool.name}".strip() + ": " if len(cell.tools) > 1 else ""
            text = f"the tool weighs {tool.mass:g} kg, the robot carries {robot.payload:g} kg"
            yield finding_at(toml(), Severity.ERROR, "CEL103", name + text, *at, "mass_kg")


def warned_doubts(cell: Cell) -> tuple[Finding, ...]:
    """Return the doubts as warnings: a program can be made, and its reader has to know them."""
    found = arm_doubts(cell, build(cell.robot), cache(lambda: cell_toml(cell)))
    return tuple(replace(finding, severity=Severity.WARNING) for finding in found)


def finding_at(
    toml: TomlText, severity: Severity, code: str, message: str, *at: str | int
) -> Finding:
    """Return a finding that points at a key of the cell file."""
    source = toml.source(at)
    return Finding(severity, code, message, source=SourceRef(source.path, source.line))


def _against_kuka(geometry: OpwGeometry) -> BoolArray:
    """Return (6,) whether an axis has another sense or zero than on every arm of KUKA."""
    turned = np.asarray(geometry.signs) != np.array(KUKA_SIGNS)
    offset = np.asarray(geometry.offsets) / DEG - np.array(KUKA_OFFSETS_DEG)
    shifted = np.abs((offset + 180.0) % 360.0 - 180.0) > _SAME_ZERO_DEG
    return np.asarray(turned | shifted)


LEAST = 1.0 * MM
"""A solid that is nowhere larger is none: a part of a metre read as one of a mm is so large."""
SMALL = 10.0 * MM
"""A workpiece that is nowhere larger is smaller than what robots work on."""
NEAR = 20.0 * MM
"""No CAM system leaves so much between a path that works and its part, stock included."""
_OVERTRAVEL = 100.0 * MM
"""Paths may go so far beyond their part, for run-in and run-out."""
_LARGE = 2.0
"""So many times the reach of an arm that stands still, a solid is out of proportion."""


def size_findings(cell: Cell, kinematics: Kinematics) -> tuple[Finding, ...]:
    """Return what the sizes of the solids of tools, workpieces and obstacles say."""
    reach = float(np.linalg.norm(kinematics.fk(np.zeros(6))[:3, 3]))
    seen: dict[str, Finding] = {}
    for index in range(len(cell.tools)):
        for base in range(len(cell.bases)):
            scene = Scene.shared(cell.with_tool(index, base), kinematics)
            for body in scene.bodies:
                for finding in () if body.kind == "link" else _of_size(body, cell, reach):
                    seen.setdefault(body.name, finding)
    return tuple(seen.values())


def _of_size(body: Body, cell: Cell, reach: float) -> Iterator[Finding]:
    size = float(np.ptp(body.vertices, axis=0).max())
    is_fixed = not cell.external_axes
    if size < LEAST:
        what, severity = "nothing can hit it", Severity.ERROR
    elif size < SMALL and body.kind == "workpiece":
        what, severity = "a part of this size is unlikely", Severity.WARNING
    elif size > _LARGE * reach and is_fixed and body.kind in ("tool", "cutting", "workpiece"):
        what, severity = f"the arm reaches {reach:.3g} m", Severity.WARNING
    else:
        return
    text = f"{body.name} measures {size / MM:.3g} mm: {what}"
    source = SourceRef(cell.path)
    yield Finding(severity, "CEL150", text, source=source, hint="check its scale and its unit")


def place_findings(toolpath: ToolPath, cell: Cell) -> tuple[Finding, ...]:
    """Return what says that the part is not where the tool works on it, once for each base."""
    if not any(base.meshes for base in cell.bases):
        return ()
    kinematics = build(cell.robot)
    assigned = assign(toolpath, cell)
    points = np.asarray(assigned.toolpath.points)
    works = np.isin(assigned.toolpath.kind, WORKING) & np.isfinite(points).all(axis=1)
    found: list[Finding] = []
    for base in np.unique(assigned.base[works & (assigned.base >= 0)]).tolist():
        scene = Scene.shared(cell.with_tool(cell.tool_index, base), kinematics)
        bodies = [body for body in scene.bodies if body.kind == "workpiece" and body.base == base]
        if bodies:
            rows = works & (assigned.base == base)
            T_world_base = cell.robot.T_world_robroot @ cell.bases[base].T_robroot_base
            found += _of_place(points[rows], inverse(T_world_base), bodies, toolpath.path)
    return tuple(found)


def _of_place(
    points: FloatArray, T_base_world: FloatArray, bodies: list[Body], path: str
) -> Iterator[Finding]:
    """Compare tags (n, 3) [m] with the solids of their part."""
    parts = [body.mesh.moved(T_base_world) for body in bodies]
    boxes = [(part.vertices.min(axis=0), part.vertices.max(axis=0)) for part in parts]
    gap = nearest_outside(points, parts, NEAR)
    low, high = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0)
    spread, size = float(np.ptp(points, axis=0).max()), float((high - low).max())
    names = " and ".join(body.name for body in bodies)
    if gap > NEAR:
        text = f"no tag of this file is nearer than {gap / MM:.4g} mm to {names}"
    elif spread > _LARGE * size + _OVERTRAVEL:
        text = f"tags reach over {spread / MM:.4g} mm, {names} measures {size / MM:.4g} mm"
    else:
        return
    yield Finding(
        Severity.WARNING,
        "CEL151",
        f"{text}: collisions with the part would be missed",
        source=SourceRef(path),
        hint="check frame, scale and unit of the workpiece's meshes, and the unit of this file",
    )
