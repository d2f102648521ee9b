"""What is wrong or worth knowing about a cell that loads: reach, home, tool, stiffness."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import (
    KUKA_OFFSETS_DEG,
    KUKA_SIGNS,
    Cell,
    OpwGeometry,
    Provenance,
    UrdfGeometry,
    missing_numbers,
)
from postproc.collision import Scene
from postproc.emitters import emitter_of
from postproc.errors import CellError, EmitError, Finding, Severity, SourceRef
from postproc.geometry import inverse, kuka_from_transform, rotation_about, transform
from postproc.kinematics import Kinematics, build, is_coaxial_with_axis_6, wrist_distance
from postproc.planning import PlanOptions, settle
from postproc.toml import Location, TomlText, load_toml
from postproc.units import DEG, MM, NMM_PER_RAD

_SOFTEST_USUAL = 1e4
"""Joint stiffness [N*m/rad] below which an industrial arm's value looks like a wrong unit."""
_SAME_ZERO_DEG = 0.1
_SPINS = 12
_STRAIGHT_IN = ("+x", "-x", "+y", "-y", "+z", "-z")


@dataclass(frozen=True, slots=True)
class CellCheck:
    """A loaded cell with what was found: an error makes the answer bad."""

    cell: Cell
    facts: dict[str, Any]
    findings: tuple[Finding, ...]

    @property
    def is_good(self) -> bool:
        """Whether no finding is an error."""
        return not any(finding.severity is Severity.ERROR for finding in self.findings)

    def with_findings(self, more: Sequence[Finding]) -> CellCheck:
        """Return the check with further findings, in order of severity and line."""
        return replace(self, findings=_in_order([*self.findings, *more]))


def check_cell(cell: Cell) -> CellCheck:
    """Return what a loaded cell is and what is wrong with it.

    Raises:
        CellError: if a mesh file is broken or the robot's geometry cannot be used.
    """
    kinematics = build(cell.robot)
    context = _Context(
        cell,
        kinematics,
        load_toml(cell.path, CellError, "CEL001"),
        _reachable_directions(cell, kinematics),
    )
    findings = [finding for check in _CHECKS for finding in check(context)]
    return CellCheck(cell, _facts(context), _in_order(findings))


def _in_order(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    order = list(Severity)
    return tuple(
        sorted(findings, key=lambda i: (order.index(i.severity), i.source.line if i.source else 0))
    )


@dataclass(frozen=True, slots=True)
class _Context:
    cell: Cell
    kinematics: Kinematics
    toml: TomlText
    reachable: tuple[str, ...]
    """Workpiece axes along which the tool can point at the workpiece's origin."""

    def finding(self, severity: Severity, code: str, message: str, *at: str) -> Finding:
        """Return a finding that points at a key of the file."""
        location: Location = at
        source = self.toml.source(location)
        return Finding(severity, code, message, source=SourceRef(source.path, source.line))

    def is_given(self, key: str) -> bool:
        """Return whether a key such as ``motion.feed_mm_min`` stands in the file."""
        origin = self.cell.origins.get(key)
        return origin is not None and origin.provenance is Provenance.USER


def _tool(context: _Context) -> Iterator[Finding]:
    tool, robot = context.cell.tool, context.cell.robot
    if tool.known_axis is None:
        return
    if is_coaxial_with_axis_6(context.kinematics, tool.T_flange_tcp, tool.axis):
        text = "the tool axis lies on A6: turning about it turns A6 alone, no stiffness to gain"
        yield context.finding(Severity.WARNING, "CEL101", text, "tool", "frame")
    if np.isnan(tool.mass):
        text = "no mass_kg: the load data of the program are incomplete"
        yield context.finding(Severity.WARNING, "CEL102", text, "tool")
    elif tool.mass > robot.payload:
        text = f"the tool weighs {tool.mass:g} kg, the robot carries {robot.payload:g} kg"
        yield context.finding(Severity.ERROR, "CEL103", text, "tool", "mass_kg")
    if tool.mass > 0 and tool.com is None:
        text = "no cog_mm: the centre of gravity is needed for load data and sag"
        yield context.finding(Severity.NOTE, "CEL104", text, "tool")


def _axes(context: _Context) -> Iterator[Finding]:
    for tool in context.cell.tools:
        if tool.known_axis is None:
            text = f"tool {tool.number} {tool.name} has no axis: no job can use it yet"
            yield Finding(Severity.NOTE, "CEL142", text, source=tool.source)


def _solids(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    for owner, meshes in (("tool", cell.tool.meshes), ("workpiece", cell.workpiece.meshes)):
        if not meshes:
            text = f"the {owner} has no meshes: its collisions cannot be seen"
            yield context.finding(Severity.WARNING, "CEL105", text, owner)
    has_both = cell.tool.meshes and cell.workpiece.meshes
    if has_both and not any(mesh.cutting for mesh in cell.tool.meshes):
        text = "no mesh of the tool is marked cutting = true: every cut collides with the workpiece"
        yield context.finding(Severity.WARNING, "CEL106", text, "tool", "meshes")


def _stiffness(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    if cell.joint_stiffness is None:
        text = "no joint stiffness, neither here nor of the robot: poses are not optimised for it"
        yield context.finding(Severity.WARNING, "CEL107", text, "stiffness")
        return
    if not context.is_given("stiffness.joint_Nmm_per_rad"):
        origin = cell.robot.origins["joint_stiffness"]
        text = f"joint stiffness is not this robot's own but {origin.provenance}: {origin.source}"
        yield context.finding(Severity.NOTE, "CEL108", text, "robot", "model")
    if cell.robot.payload > 100.0 and float(cell.joint_stiffness.min()) < _SOFTEST_USUAL:
        least = float(cell.joint_stiffness.min()) / NMM_PER_RAD
        text = f"a joint stiffness of {least:g} N*mm/rad is very soft; is it in N*m/rad?"
        yield context.finding(Severity.WARNING, "CEL109", text, "stiffness", "joint_Nmm_per_rad")


def _workpiece(context: _Context) -> Iterator[Finding]:
    if not context.is_given("workpiece.frame") and "bases" not in context.toml.data:
        text = "no workpiece frame: CAM coordinates are taken as robot root coordinates"
        yield context.finding(Severity.WARNING, "CEL110", text, "workpiece")
    if context.cell.tool.known_axis is None:
        return
    if not context.reachable and missing_numbers(context.cell) is None:
        text = "the origin of the workpiece frame cannot be reached with the tool along any axis"
        yield context.finding(Severity.WARNING, "CEL111", text, "workpiece", "frame")


def _reachable_directions(cell: Cell, kinematics: Kinematics) -> tuple[str, ...]:
    """Return the workpiece axes along which the tool can point at the frame's origin."""
    if cell.tool.known_axis is None:
        return ()
    spins = np.arange(_SPINS) * (360.0 / _SPINS) * DEG
    margin = cell.limits.joint_margin
    found = []
    for name in _STRAIGHT_IN:
        wanted = np.eye(3)["xyz".index(name[1])] * (1.0 if name[0] == "+" else -1.0)
        R = rotation_about(wanted, spins) @ _turning(np.asarray(cell.tool.axis), wanted)
        T_robroot_tcp = cell.T_robroot_base @ transform(R, np.zeros(3))
        q, valid = kinematics.ik(T_robroot_tcp @ inverse(cell.tool.T_flange_tcp))
        turned, _ = kinematics.turns(q[valid])
        if kinematics.within_limits(turned, margin).any():
            found.append(name)
    return tuple(found)


def _turning(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) that takes unit vector ``a`` to unit vector ``b``."""
    cross, cosine = np.cross(a, b), float(a @ b)
    length = float(np.linalg.norm(cross))
    if length > 1e-9:
        return rotation_about(cross / length, np.arctan2(length, cosine))
    across = np.eye(3)[int(np.argmin(np.abs(a)))]
    axis = np.cross(a, across)
    return rotation_about(axis / np.linalg.norm(axis), 0.0 if cosine > 0 else np.pi)


def _home(context: _Context) -> Iterator[Finding]:
    cell, kinematics = context.cell, context.kinematics
    scene = Scene.build(cell, kinematics)
    home = cell.motion.home
    if home is None:
        return
    hits = scene.check(home[None])
    if hits.hit[0]:
        text = f"the robot collides at home: {hits.name(0)}"
        yield context.finding(Severity.ERROR, "CEL112", text, "motion", "home_deg")
    if not kinematics.within_limits(home, cell.limits.joint_margin):
        text = "home does not keep joint_margin_deg from the limits"
        yield context.finding(Severity.WARNING, "CEL113", text, "motion", "home_deg")
    if float(wrist_distance(kinematics, home)) < cell.limits.singularity:
        text = "home has a straight wrist (A5 near 0); axis moves there are fine, path moves not"
        yield context.finding(Severity.NOTE, "CEL114", text, "motion", "home_deg")


def _options(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    if missing_numbers(cell) is not None:
        return
    try:
        _, settings = settle(cell, PlanOptions())
    except CellError as problem:
        key = "step_deg" if problem.code == "PLN207" else "objective"
        yield context.finding(Severity.ERROR, problem.code, problem.message, "optimize", key)
    else:
        asked = {name for name, _, _ in settings.weights.states}
        if "process" in asked and not cell.process.wrench_tcp[:3].any():
            text = "objective process needs a force: force_N is zero"
            yield context.finding(Severity.ERROR, "CEL115", text, "optimize", "objective")
    if tilt := cell.optimize.tilt:
        lead, side = (
            f"{low / DEG:g} to {high / DEG:g} deg" for low, high in (tilt.lead, tilt.side)
        )
        text = f"milling may tilt the tool axis: lead {lead}, side tilt {side}"
        yield context.finding(Severity.NOTE, "CEL119", text, "optimize")
    if np.isnan(cell.motion.feed):
        text = "no feed_mm_min: CAM data without a feed are refused"
        yield context.finding(Severity.NOTE, "CEL116", text, "motion")


def _robot(context: _Context) -> Iterator[Finding]:
    robot = context.cell.robot
    missing = missing_numbers(context.cell)
    if missing is not None:
        text = f"{missing.message}; {missing.hint}"
        yield context.finding(Severity.ERROR, missing.code, text, "robot")
    if "geometry" in robot.doubts:
        text = f"lengths of {robot.name} in doubt: {robot.doubts['geometry']}"
        yield context.finding(Severity.WARNING, "CEL140", text, "robot")
    elif (lengths := robot.origins.get("geometry")) and lengths.trust == "C":
        text = f"the lengths of {robot.name} rest on one source alone: {lengths.source}"
        yield context.finding(Severity.WARNING, "CEL141", text, "robot")
    origins = robot.origins
    assumed = [
        name
        for name, origin in origins.items()
        if origin.provenance is Provenance.ASSUMED and "." not in name
    ]
    if assumed:
        words = {"qd_max": "speeds", "qdd_max": "accelerations", "q_min": "limits"}
        named = ", ".join(words.get(name, name) for name in assumed if name != "q_max")
        text = f"numbers of the robot that no source gives, wholly or for some axes: {named}"
        yield context.finding(Severity.NOTE, "CEL117", text, "robot")
    arm = context.kinematics.arm
    if isinstance(robot.geometry, UrdfGeometry) and arm is not None:
        against = [f"A{i + 1}" for i in np.flatnonzero(_against_kuka(arm.geometry))]
        if against:
            text = f"{', '.join(against)} of this URDF do not turn or count as on a KUKA controller"
            yield context.finding(Severity.WARNING, "CEL143", text, "robot", "urdf")
    if not context.kinematics.is_closed_form:
        text = "this arm has no closed-form inverse kinematics: planning is slow"
        yield context.finding(Severity.NOTE, "CEL118", text, "robot", "urdf")


def _against_kuka(geometry: OpwGeometry) -> BoolArray:
    """Return (6,) whether an axis has another sense or zero than on every arm of KUKA."""
    turned = np.asarray(geometry.signs) != np.array(KUKA_SIGNS)
    offset = np.asarray(geometry.offsets) / DEG - np.array(KUKA_OFFSETS_DEG)
    shifted = np.abs((offset + 180.0) % 360.0 - 180.0) > _SAME_ZERO_DEG
    return np.asarray(turned | shifted)


def _emitter(context: _Context) -> Iterator[Finding]:
    try:
        emitter_of(context.cell)
    except EmitError as problem:
        text = problem.message
        yield context.finding(Severity.ERROR, problem.code, text, "krl", "emitter")


_CHECKS: tuple[Callable[[_Context], Iterator[Finding]], ...] = (
    _robot,
    _tool,
    _axes,
    _solids,
    _stiffness,
    _workpiece,
    _home,
    _options,
    _emitter,
)


def _facts(context: _Context) -> dict[str, Any]:
    """Return what the cell is, in the units of files."""
    cell = context.cell
    tcp, tcp_abc = kuka_from_transform(cell.tool.T_flange_tcp)
    base, base_abc = kuka_from_transform(cell.T_robroot_base)
    stiffness = cell.joint_stiffness
    return {
        "name": cell.name,
        "robot": cell.robot.name,
        "robot_solids": cell.robot.solids,
        "closed_form": context.kinematics.is_closed_form,
        "tool": {
            "number": cell.tool.number,
            "name": cell.tool.name,
            "xyz_mm": _rounded(tcp),
            "abc_deg": _rounded(tcp_abc),
            "axis": _axis_name(cell.tool.known_axis),
            "mass_kg": None if np.isnan(cell.tool.mass) else cell.tool.mass,
            "solids": len(cell.tool.meshes),
        },
        "workpiece": {
            "number": cell.workpiece.number,
            "name": cell.workpiece.name,
            "xyz_mm": _rounded(base),
            "abc_deg": _rounded(base_abc),
            "solids": len(cell.workpiece.meshes),
            "reachable_along": list(context.reachable),
        },
        "obstacles": [obstacle.name for obstacle in cell.obstacles],
        "external_axes": [axis.name for axis in cell.external_axes],
        "clearance_mm": round(cell.limits.clearance / MM, 6),
        "joint_stiffness_Nmm_per_rad": None
        if stiffness is None
        else _rounded(stiffness / NMM_PER_RAD),
        "objective": cell.optimize.objective
        if isinstance(cell.optimize.objective, str)
        else dict(cell.optimize.objective),
        "strategy": cell.optimize.strategy,
    }


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(value), 6) + 0.0 for value in values]


def _axis_name(axis: FloatArray | None) -> str | None:
    if axis is None:
        return None
    place = int(np.argmax(np.abs(axis)))
    return f"{'+' if axis[place] > 0 else '-'}{'xyz'[place]}"
