"""What is wrong or worth knowing about a cell that loads: reach, home, tool, stiffness."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, OpwGeometry, Provenance, Tool, Workpiece, cell_toml, missing_numbers
from postproc.collision import OUTLINE_SHARES, Scene, is_measured
from postproc.emitters import emitter_of
from postproc.errors import CellError, EmitError, Finding, Severity, SourceRef
from postproc.geometry import (
    AXES,
    across,
    axis_name,
    inverse,
    kuka_from_transform,
    rotation_about,
    transform,
)
from postproc.jobs.arm_doubts import arm_doubts, finding_at, size_findings
from postproc.jobs.given import Source, cell_of
from postproc.jobs.paged import Paged
from postproc.kinematics import Kinematics, build, is_coaxial_with_axis_6, wrist_distance
from postproc.planning import free_posture, settle
from postproc.records import dataclass
from postproc.toml import TomlText
from postproc.units import DEG, MM, NMM_PER_RAD

_SOFTEST_USUAL = 1e4
"""Joint stiffness [N*m/rad] below which an industrial arm's value looks like a wrong unit."""
_SPINS = 12
_Entry = TypeVar("_Entry", Tool, Workpiece)


class CellCheck(Paged):
    """A loaded cell with what was found: an error makes the answer bad.

    ``backup``: what a controller was compared in, for the document; None: with none.
    """

    def __init__(
        self,
        cell: Cell,
        facts: dict[str, Any],
        findings: Sequence[Finding],
        backup: dict[str, Any] | None = None,
    ) -> None:
        order = list(Severity)
        self.cell, self.facts, self._backup = cell, facts, backup
        self.findings = tuple(
            sorted(
                findings, key=lambda i: (order.index(i.severity), i.source.line if i.source else 0)
            )
        )

    @property
    def good(self) -> bool:
        """Whether no finding is an error."""
        return not any(finding.is_error for finding in self.findings)

    @property
    def document(self) -> dict[str, Any]:
        """The ``postproc.check/1`` document, as ``check --json`` prints it."""
        return {
            "schema": "postproc.check/1",
            "ok": self.good,
            **self.facts,
            **({} if self._backup is None else {"backup": self._backup}),
            "findings": [
                {
                    "severity": str(finding.severity),
                    "code": finding.code,
                    "line": finding.source.line if finding.source else None,
                    "text": finding.message,
                }
                for finding in self.findings
            ],
        }

    def page(self) -> bytes:
        """Return the page that draws the cell: one HTML file that opens offline."""
        from postproc.jobs.pages import page_of_cell

        return page_of_cell(self)


def check(
    cell: Cell | Source, *, backup: Source | None = None, templates: bool = False
) -> CellCheck:
    """Return what a cell is and what is wrong with it.

    Args:
        cell: a cell of ``load_cell``, or a file.
        backup: of the controller to compare with: ZIP or folder.
        templates: test the cell's own templates without a part.

    Returns:
        ``good``, ``findings``, ``document``, ``report(file)``.

    Raises:
        CellError: if the cell cannot be loaded, a mesh is broken or the robot's geometry cannot be
            used.
        ReadError: BAK001 to BAK007 if the backup cannot be used.
    """
    cell = cell_of(cell)
    found = check_cell(cell)
    if templates:
        from postproc.jobs.check_templates import template_findings

        found = CellCheck(cell, found.facts, [*found.findings, *template_findings(cell)])
    if backup is None:
        return found
    from postproc.jobs.controller_backup import compare_backup

    comparison, different = compare_backup(cell, backup)
    told = ("key", "cell", "controller", "severity", "text")
    differences = [{name: getattr(d, name) for name in told} for d in comparison.differences]
    counted = {"compared": comparison.compared, "differences": differences}
    return CellCheck(cell, found.facts, [*found.findings, *different], counted)


def check_cell(cell: Cell) -> CellCheck:
    """Return what a loaded cell is and what is wrong with it."""
    kinematics = build(cell.robot)
    reachable = [_reachable_directions(cell, kinematics, base) for base in range(len(cell.bases))]
    toml = cell_toml(cell)
    context = _Context(cell, kinematics, toml, tuple(reachable))
    findings = [finding for check in _CHECKS for finding in check(context)]
    return CellCheck(cell, _facts(context), findings)


@dataclass(frozen=True, slots=True)
class _Context:
    cell: Cell
    kinematics: Kinematics
    toml: TomlText
    reachable: tuple[tuple[str, ...], ...]
    """For each base the axes of it along which a tool can point at its origin."""

    def finding(self, severity: Severity, code: str, message: str, *at: str | int) -> Finding:
        """Return a finding that points at a key of the file."""
        return finding_at(self.toml, severity, code, message, *at)

    def tools(self) -> Iterator[tuple[Tool, tuple[str | int, ...], str]]:
        """Yield every tool, where the file has it, and its name where there are several."""
        yield from self._entries(self.cell.tools, "tools", "tool")

    def bases(self) -> Iterator[tuple[Workpiece, tuple[str | int, ...], str]]:
        """Yield every base, where the file has it, and its name where there are several."""
        yield from self._entries(self.cell.bases, "bases", "workpiece")

    def _entries(
        self, entries: Sequence[_Entry], table: str, short: str
    ) -> Iterator[tuple[_Entry, tuple[str | int, ...], str]]:
        if table not in self.toml.data:
            yield entries[0], (short,), ""
            return
        word = table.removesuffix("s")
        for index, entry in enumerate(entries):
            name = f"{word} {entry.number} {entry.name}".strip()
            yield entry, (table, index), f"{name}: " if len(entries) > 1 else ""

    def is_given(self, key: str) -> bool:
        """Return whether a key such as ``motion.feed_mm_min`` stands in the file."""
        origin = self.cell.origins.get(key)
        return origin is not None and origin.provenance is Provenance.USER


def _tool(context: _Context) -> Iterator[Finding]:
    for tool, at, name in context.tools():
        if tool.known_axis is None:
            text = f"tool {tool.number} {tool.name} has no axis: no job can use it yet"
            yield Finding(Severity.NOTE, "CEL142", text, source=tool.source)
            continue
        if is_coaxial_with_axis_6(context.kinematics, tool.T_flange_tcp, tool.axis):
            text = "the tool axis lies on A6: spin turns A6 only and gains no stiffness"
            yield context.finding(Severity.WARNING, "CEL101", name + text, *at, "frame")
        if np.isnan(tool.mass):
            text = "no mass_kg: the load data of the program are incomplete"
            yield context.finding(Severity.WARNING, "CEL102", name + text, *at)
        if tool.mass > 0 and tool.com is None:
            text = "no cog_mm: the centre of gravity is needed for load data and sag"
            yield context.finding(Severity.NOTE, "CEL104", name + text, *at)


def _solids(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    has_part = any(base.meshes for base in cell.bases)
    unseen = "has no meshes: collisions with it are not checked"
    if not has_part:
        at = next(where for _, where, _ in context.bases())
        yield context.finding(Severity.WARNING, "CEL105", f"the workpiece {unseen}", *at)
    for tool, at, name in context.tools():
        if not tool.meshes:
            yield context.finding(Severity.WARNING, "CEL105", f"{name}the tool {unseen}", *at)
        elif has_part and not any(mesh.cutting for mesh in tool.meshes):
            text = (
                f"{name}no mesh of the tool is marked cutting = true: every cut collides with the "
                "workpiece"
            )
            yield context.finding(Severity.WARNING, "CEL106", text, *at, "meshes")
    yield from size_findings(cell, context.kinematics)
    seen = set()
    for index in range(len(cell.tools)):
        for finding in Scene.shared(cell.with_tool(index), context.kinematics).findings:
            if finding.code == "COL103" and finding.message not in seen:
                seen.add(finding.message)
                yield replace(finding, source=SourceRef(cell.path))


def _stiffness(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    if cell.joint_stiffness is None:
        text = (
            "no joint stiffness in the cell or for the robot: poses are not optimised for stiffness"
        )
        yield context.finding(Severity.WARNING, "CEL107", text, "stiffness")
        return
    if not context.is_given("stiffness.joint_Nmm_per_rad"):
        origin = cell.robot.origins["joint_stiffness"]
        text = f"joint stiffness is not this robot's own but {origin.provenance}: {origin.source}"
        yield context.finding(Severity.NOTE, "CEL108", text, "robot", "model")
    if cell.robot.payload > 100.0 and float(cell.joint_stiffness.min()) < _SOFTEST_USUAL:
        least = float(cell.joint_stiffness.min()) / NMM_PER_RAD
        text = f"a joint stiffness of {least:g} N*mm/rad is very low; is it in N*m/rad?"
        yield context.finding(Severity.WARNING, "CEL109", text, "stiffness", "joint_Nmm_per_rad")


def _workpiece(context: _Context) -> Iterator[Finding]:
    if not context.is_given("workpiece.frame") and "bases" not in context.toml.data:
        text = "no workpiece frame: CAM coordinates are taken as robot root coordinates"
        yield context.finding(Severity.WARNING, "CEL110", text, "workpiece")
    if all(tool.known_axis is None for tool in context.cell.tools):
        return
    for (_, at, name), reachable in zip(context.bases(), context.reachable, strict=True):
        if not reachable and missing_numbers(context.cell) is None:
            text = "the origin of the workpiece frame cannot be reached with the tool along any"
            yield context.finding(Severity.WARNING, "CEL111", f"{name}{text} axis", *at, "frame")


def _reachable_directions(cell: Cell, kinematics: Kinematics, base: int) -> tuple[str, ...]:
    """Return the axes of a base along which any tool can point at its origin."""
    spins = np.arange(_SPINS) * (360.0 / _SPINS) * DEG
    margin = cell.limits.joint_margin
    found = set()
    for tool in cell.tools:
        if tool.known_axis is None:
            continue
        for name, wanted in AXES.items():
            R = rotation_about(wanted, spins) @ _turning(np.asarray(tool.axis), wanted)
            T_robroot_tcp = cell.bases[base].T_robroot_base @ transform(R, np.zeros(3))
            q, valid = kinematics.ik(T_robroot_tcp @ inverse(tool.T_flange_tcp))
            turned, _ = kinematics.turns(q[valid])
            if kinematics.within_limits(turned, margin).any():
                found.add(name)
    return tuple(name for name in AXES if name in found)


def _turning(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) that takes unit vector ``a`` to unit vector ``b``."""
    cross, cosine = np.cross(a, b), float(a @ b)
    length = float(np.linalg.norm(cross))
    if length > 1e-9:
        return rotation_about(cross / length, np.arctan2(length, cosine))
    return rotation_about(across(a)[0], 0.0 if cosine > 0 else np.pi)


def _home(context: _Context) -> Iterator[Finding]:
    cell, kinematics = context.cell, context.kinematics
    home = cell.motion.home
    if home is None:
        text = "no home_deg: programs begin with a PTP from wherever the arm is"
        frames = itertools.product(range(len(cell.tools)), range(len(cell.bases)))
        free = free_posture(cell, frames)
        hint = "" if free is None else f"home_deg = {np.round(free / DEG).tolist()} is free"
        found = context.finding(Severity.WARNING, "CEL147", text, "motion")
        yield replace(found, hint=hint)
        return
    for pair, name in _home_hits(context, home):
        text = f"{name}the robot collides at home: {pair}"
        yield context.finding(Severity.ERROR, "CEL112", text, "motion", "home_deg")
    if not kinematics.within_limits(home, cell.limits.joint_margin):
        text = "home is closer to the limits than joint_margin_deg"
        yield context.finding(Severity.WARNING, "CEL113", text, "motion", "home_deg")
    if float(wrist_distance(kinematics, home)) < cell.limits.singularity:
        text = "home has a straight wrist (A5 near 0); PTP moves there are fine, path moves are not"
        yield context.finding(Severity.NOTE, "CEL114", text, "motion", "home_deg")


def _home_hits(context: _Context, home: FloatArray) -> Iterator[tuple[str, str]]:
    """Yield what collides at home, once with each tool, and the tool where there are several."""
    cell = context.cell
    for index, (_, _, name) in enumerate(context.tools()):
        seen = set()
        for base in range(len(cell.bases)):
            scene = Scene.shared(cell.with_tool(index, base), context.kinematics)
            hits = scene.check(home[None])
            if hits.hit[0] and hits.name(0) not in seen:
                seen.add(hits.name(0))
                yield hits.name(0), name


def _options(context: _Context) -> Iterator[Finding]:
    cell = context.cell
    if missing_numbers(cell) is not None:
        return
    try:
        _, settings = settle(cell)
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


def _outline(context: _Context) -> Iterator[Finding]:
    robot = context.cell.robot
    if not isinstance(robot.geometry, OpwGeometry) or robot.link_meshes:
        return
    sizes = " and ".join(
        f"links {a} and {b} at {share:.0%}" for (a, b), share in OUTLINE_SHARES.items()
    )
    text = f"some outlines of {robot.name} are tested at reduced size: {sizes}"
    yield context.finding(Severity.NOTE, "CEL145", text, "robot")
    if not is_measured(robot):
        text = (
            f"no mesh of {robot.name}: its outline is that of arms of its size, out of which real "
            "arms protrude by up to 0.4 m; give link_meshes of the arm"
        )
        yield context.finding(Severity.NOTE, "CEL144", text, "robot")


def _robot(context: _Context) -> Iterator[Finding]:
    robot = context.cell.robot
    missing = missing_numbers(context.cell)
    if missing is not None:
        text = f"{missing.message}; {missing.hint}"
        yield context.finding(Severity.ERROR, missing.code, text, "robot")
    origins = robot.origins
    assumed = [
        name
        for name, origin in origins.items()
        if origin.provenance is Provenance.ASSUMED and "." not in name
    ]
    if assumed:
        words = {"qd_max": "speeds", "qdd_max": "accelerations", "q_min": "limits"}
        named = ", ".join(words.get(name, name) for name in assumed if name != "q_max")
        text = f"no source for these numbers of the robot, or for some axes: {named}"
        yield context.finding(Severity.NOTE, "CEL117", text, "robot")
    if robot.torque_max is not None:
        light = [t.name for t in context.cell.tools if t.com is None or not np.isfinite(t.mass)]
        text = f"times respect the joint torques: {origins['torque_max'].source}"
        if light:
            text += f"; the weight of tool {', '.join(light)} is not known and not included"
        yield context.finding(Severity.NOTE, "CEL146", text, "robot")
    if not context.kinematics.is_closed_form:
        text = "this arm has no closed-form inverse kinematics: planning is slow"
        yield context.finding(Severity.NOTE, "CEL118", text, "robot", "urdf")


def _emitter(context: _Context) -> Iterator[Finding]:
    try:
        emitter_of(context.cell)
    except EmitError as problem:
        text = problem.message
        yield context.finding(Severity.ERROR, problem.code, text, "krl", "emitter")


_CHECKS: tuple[Callable[[_Context], Iterator[Finding]], ...] = (
    _robot,
    lambda context: arm_doubts(context.cell, context.kinematics, lambda: context.toml),
    _outline,
    _tool,
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
    tools = [_tool_facts(tool) for tool in cell.tools]
    bases = [
        _base_facts(base, reachable)
        for base, reachable in zip(cell.bases, context.reachable, strict=True)
    ]
    stiffness = cell.joint_stiffness
    return {
        "name": cell.name,
        "robot": cell.robot.name,
        "robot_solids": cell.robot.solids,
        "closed_form": context.kinematics.is_closed_form,
        "tool": tools[0],
        "workpiece": bases[0],
        "tools": tools,
        "bases": bases,
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


def _tool_facts(tool: Tool) -> dict[str, Any]:
    xyz, abc = kuka_from_transform(tool.T_flange_tcp)
    return {
        "number": tool.number,
        "name": tool.name,
        "xyz_mm": _rounded(xyz),
        "abc_deg": _rounded(abc),
        "axis": None if tool.known_axis is None else axis_name(tool.known_axis),
        "mass_kg": None if np.isnan(tool.mass) else tool.mass,
        "solids": len(tool.meshes),
        "cam": list(tool.cam),
    }


def _base_facts(base: Workpiece, reachable: Sequence[str]) -> dict[str, Any]:
    xyz, abc = kuka_from_transform(base.T_robroot_base)
    return {
        "number": base.number,
        "name": base.name,
        "xyz_mm": _rounded(xyz),
        "abc_deg": _rounded(abc),
        "solids": len(base.meshes),
        "reachable_along": list(reachable),
        "cam": list(base.cam),
    }


def _rounded(values: FloatArray) -> list[float]:
    return [round(float(value), 6) + 0.0 for value in values]
