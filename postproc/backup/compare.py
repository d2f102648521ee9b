"""Where a cell and a controller differ, number by number."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray
from postproc.backup.arm import limits_of, match_arm
from postproc.backup.controller import Controller
from postproc.backup.external import ExternalAxisEntry, ExternalKinematic
from postproc.backup.frames import BaseEntry, ToolEntry
from postproc.cell import LENGTHS, Cell, ExternalAxis, HomeStyle, OpwGeometry, Tool, Workpiece
from postproc.errors import Severity
from postproc.geometry import inverse, kuka_from_transform, rotation_angle, transform_from_kuka
from postproc.records import dataclass
from postproc.units import DEG, MM

_MASS_KG = 1e-3
_LENGTH_OF_ARM_MM = 0.1
_XHOME = "XHOME"
"""The home that programs may go to by its name."""

LENGTH_MM = 1e-3
ANGLE_DEG = 1e-3
SPEED = 1e-3
"""Share of a speed."""
_RANGE = 1e-3
"""mm of a rail, deg of a positioner."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One number that differs: key of the cell, both values in units of the key, weight, words."""

    key: str
    at: tuple[str | int, ...]
    cell: Any
    controller: Any
    severity: Severity
    text: str


@dataclass(slots=True)
class Counted:
    """How many numbers have been compared."""

    numbers: int = 0

    def differ(self, a: ArrayLike, b: ArrayLike, tolerance: float) -> bool:
        """Return whether two equally long lists of numbers are apart."""
        own, other = np.atleast_1d(np.asarray(a, float)), np.atleast_1d(np.asarray(b, float))
        self.numbers += own.size
        return not bool(np.abs(own - other).max() <= tolerance)


@dataclass(frozen=True, slots=True)
class BackupComparison:
    """How many numbers were compared, and those that differ."""

    compared: int
    differences: tuple[Difference, ...]


def compare(cell: Cell, controller: Controller) -> BackupComparison:
    """Return where a cell and a controller differ.

    An error is what would make programs wrong on this controller: lengths, wider limits, another
    frame, mass or root. What one side lacks is a warning in the cell, a note on the controller.
    """
    counted = Counted()
    found = [*_arm(cell, controller, counted), *_frames(cell, controller, counted)]
    found += [*_home(cell, controller, counted)]
    found += compare_external_axes(cell, controller, counted)
    return BackupComparison(counted.numbers, tuple(found))


def _arm(cell: Cell, controller: Controller, counted: Counted) -> Iterator[Difference]:
    robot, machine = cell.robot, controller.machine
    if isinstance(robot.geometry, OpwGeometry):
        own = [float(getattr(robot.geometry, key)) / MM for key in LENGTHS]
        for key, mine, theirs in zip(LENGTHS, own, machine.lengths_mm, strict=True):
            if counted.differ(mine, theirs, _LENGTH_OF_ARM_MM):
                yield _number("robot.dimensions_mm." + key, ("robot",), mine, theirs, "mm")
    match = match_arm(machine)
    if match.robot is not None and match.robot.name != robot.name:
        text = f"the arm is {robot.name}, $TRAFONAME of the controller {machine.trafoname}"
        at, severity = ("robot", "model"), Severity.WARNING
        yield Difference("robot.model", at, robot.name, match.robot.name, severity, text)
    limits, _ = limits_of(machine, match.robot)
    for axis, (low, high) in enumerate(limits):
        span = [float(robot.q_min[axis] / DEG), float(robot.q_max[axis] / DEG)]
        if counted.differ(span, [low, high], ANGLE_DEG):
            is_wider = span[0] < low - ANGLE_DEG or span[1] > high + ANGLE_DEG
            yield Difference(
                f"robot.limits_deg[{axis + 1}]", ("robot", "limits_deg"), span, [low, high],
                Severity.ERROR if is_wider else Severity.NOTE,
                f"limits of A{axis + 1} are {span[0]:g} to {span[1]:g} deg, on the controller "
                f"{low:g} to {high:g}{', the cell allows more' if is_wider else ''}",
            )  # fmt: skip
    for axis, theirs in enumerate(machine.speed_deg_s or ()):
        speed = float(robot.qd_max[axis] / DEG)
        if counted.differ(speed, theirs, SPEED * theirs):
            key = f"robot.speed_deg_s[{axis + 1}]"
            severity = Severity.WARNING if speed > theirs else Severity.NOTE
            yield _number(key, ("robot", "speed_deg_s"), speed, theirs, "deg/s", severity)
    T_world_robroot = transform_from_kuka(controller.root[:3], controller.root[3:])
    yield from _frame(
        "robot.base", ("robot", "base"), robot.T_world_robroot, T_world_robroot, counted
    )


def _home(cell: Cell, controller: Controller, counted: Counted) -> Iterator[Difference]:
    """Yield a home that differs: an error where programs go to the controller's own by its name."""
    by_name = cell.krl.home is not HomeStyle.AXES
    name = _XHOME if by_name else next(iter(controller.homes), _XHOME)
    if cell.motion.home is None:
        return
    mine = [round(float(angle / DEG), 6) for angle in cell.motion.home]
    theirs = controller.homes.get(name)
    at = ("motion", "home_deg")
    if theirs is None:
        if by_name:
            text = f"programs go to {name}, which the backup does not have"
            yield Difference("motion.home_deg", at, mine, None, Severity.WARNING, text)
        return
    if counted.differ(mine, theirs, ANGLE_DEG):
        shown = (" ".join(f"{angle:g}" for angle in home) for home in (mine, theirs))
        text = "motion.home_deg is {}, {name} of the controller {}".format(*shown, name=name)
        text += ": programs go there by its name" if by_name else ""
        severity = Severity.ERROR if by_name else Severity.NOTE
        yield Difference("motion.home_deg", at, mine, list(theirs), severity, text)


def _number(
    key: str,
    at: tuple[str | int, ...],
    mine: float,
    theirs: float,
    unit: str,
    severity: Severity = Severity.ERROR,
) -> Difference:
    text = f"{key} is {mine:g} {unit}, on the controller {theirs:g}"
    return Difference(key, at, mine, theirs, severity, text)


def _frame(
    key: str, at: tuple[str | int, ...], mine: FloatArray, theirs: FloatArray, counted: Counted
) -> Iterator[Difference]:
    """Yield a frame that differs; angles are compared as rotations, B near 90 has many."""
    step = np.asarray(mine)[:3, 3] - np.asarray(theirs)[:3, 3]
    turn = float(rotation_angle(np.asarray(mine)[:3, :3], np.asarray(theirs)[:3, :3]) / DEG)
    is_apart = counted.differ(step / MM, np.zeros(3), LENGTH_MM)
    if counted.differ([turn] * 3, np.zeros(3), ANGLE_DEG) or is_apart:
        text = (
            f"{key} is {_shown(mine)}, on the controller {_shown(theirs)}: "
            f"{float(np.linalg.norm(step)) / MM:.3f} mm and {turn:.3f} deg apart"
        )
        yield Difference(key, at, _listed(mine), _listed(theirs), Severity.ERROR, text)


def _listed(T: FloatArray) -> list[float]:
    xyz, abc = kuka_from_transform(np.asarray(T))
    return [round(float(value), 6) + 0.0 for value in (*xyz, *abc)]


def _shown(T: FloatArray) -> str:
    return " ".join(f"{value:g}" for value in _listed(T))


def _frames(cell: Cell, controller: Controller, counted: Counted) -> Iterator[Difference]:
    tools = {tool.number: tool for tool in controller.tools if tool.is_carried}
    for place, tool in enumerate(cell.tools):
        if tool.number in tools:
            yield from _tool(("tools", place), tool, tools.pop(tool.number), counted)
        elif not _is_zero(tool.T_flange_tcp):
            yield _lacking(f"TOOL_DATA[{tool.number}]", ("tools", place), controller.tools)
    bases = {
        base.number: base for base in controller.bases if controller.T_world_base(base) is not None
    }
    for place, base in enumerate(cell.bases):
        if base.number in bases:
            entry = bases.pop(base.number)
            yield from _base(("bases", place), base, entry, controller, counted)
        elif not _is_zero(base.T_robroot_base):
            yield _lacking(f"BASE_DATA[{base.number}]", ("bases", place), controller.bases)
    left: list[tuple[str, ToolEntry | BaseEntry]] = [("TOOL", tool) for tool in tools.values()]
    left += [("BASE", base) for base in bases.values()]
    for name, item in left:
        text = f"{name}_DATA[{item.number}] {item.name} of the controller is not in the cell"
        key = f"{name.lower()}s[{item.number}]"
        yield Difference(key, (), None, list(item.frame), Severity.NOTE, text)


def _is_zero(T: FloatArray) -> bool:
    """Return whether a frame is that of a number which the controller does not use."""
    return bool(np.allclose(T, np.eye(4), atol=1e-12))


def _lacking(
    name: str, at: tuple[str | int, ...], entries: Sequence[ToolEntry | BaseEntry]
) -> Difference:
    known = ", ".join(str(entry.number) for entry in entries) or "none"
    text = f"{name} is not used on the controller, used are {known}"
    return Difference(name, at, None, None, Severity.WARNING, text)


def _tool(
    at: tuple[str | int, ...], tool: Tool, entry: ToolEntry, counted: Counted
) -> Iterator[Difference]:
    key = f"tools[{tool.number}]"
    T_flange_tcp = transform_from_kuka(entry.frame[:3], entry.frame[3:])
    yield from _frame(f"{key}.frame", (*at, "frame"), tool.T_flange_tcp, T_flange_tcp, counted)
    if entry.mass_kg is None:
        return
    if np.isnan(tool.mass):
        text = f"{key} has no mass_kg, on the controller {entry.mass_kg:g}"
        yield Difference(f"{key}.mass_kg", at, None, entry.mass_kg, Severity.WARNING, text)
    elif counted.differ(tool.mass, entry.mass_kg, _MASS_KG):
        yield _number(f"{key}.mass_kg", (*at, "mass_kg"), float(tool.mass), entry.mass_kg, "kg")
    if tool.com is not None and entry.cog is not None:
        mine, theirs = [float(v / MM) for v in tool.com], list(entry.cog[:3])
        if counted.differ(mine, theirs, LENGTH_MM):
            text = f"{key}.cog_mm is {mine}, on the controller {theirs}"
            yield Difference(f"{key}.cog_mm", (*at, "cog_mm"), mine, theirs, Severity.ERROR, text)


def _base(
    at: tuple[str | int, ...],
    base: Workpiece,
    entry: BaseEntry,
    controller: Controller,
    counted: Counted,
) -> Iterator[Difference]:
    T_robroot_world = inverse(transform_from_kuka(controller.root[:3], controller.root[3:]))
    T_world_base = controller.T_world_base(entry)
    if T_world_base is not None:
        theirs = T_robroot_world @ T_world_base
        key = f"bases[{base.number}].frame"
        yield from _frame(key, (*at, "frame"), base.T_robroot_base, theirs, counted)


def compare_external_axes(
    cell: Cell, controller: Controller, counted: Counted
) -> Iterator[Difference]:
    """Yield what differs; programs with values for an axis that is not there are errors."""
    own = {axis.name: (place, axis) for place, axis in enumerate(cell.external_axes)}
    for kinematic in controller.externals:
        for entry in kinematic.axes:
            if entry.name in own:
                place, axis = own.pop(entry.name)
                at = ("external_axes", place)
                yield from _axis(at, axis, entry, kinematic, counted)
            else:
                text = f"{entry.name} of the controller ({kinematic.name}) is not in the cell: "
                key = f"external_axes[{entry.name}]"
                text += "programs do not move it"
                yield Difference(key, (), None, entry.name, Severity.WARNING, text)
    for place, axis in own.values():
        text = f"{axis.name} of the cell is not on the controller, it has {_names(controller)}"
        key, at = f"external_axes[{axis.name}]", ("external_axes", place)
        yield Difference(key, at, axis.name, None, Severity.ERROR, text)


def _names(controller: Controller) -> str:
    names = [axis.name for kinematic in controller.externals for axis in kinematic.axes]
    return ", ".join(names) or "no external axes"


def _axis(
    at: tuple[str | int, ...],
    axis: ExternalAxis,
    entry: ExternalAxisEntry,
    kinematic: ExternalKinematic,
    counted: Counted,
) -> Iterator[Difference]:
    key = f"external_axes[{axis.name}]"
    if kinematic.kind != axis.kind:
        theirs = kinematic.kind or "of no kinematic"
        text = f"{axis.name} is a {axis.kind} of the cell, on the controller {theirs}"
        yield Difference(f"{key}.kind", at, axis.kind, kinematic.kind, Severity.ERROR, text)
        return
    unit, per = ("mm", MM) if entry.is_linear else ("deg", DEG)
    span = [axis.q_min / per, axis.q_max / per]
    if entry.limits and counted.differ(span, entry.limits, _RANGE):
        low, high = entry.limits
        is_wider = span[0] < low - _RANGE or span[1] > high + _RANGE
        text = f"{axis.name} goes from {span[0]:g} to {span[1]:g} {unit}, on the controller "
        text += f"{low:g} to {high:g}{', the cell allows more' if is_wider else ''}"
        severity = Severity.ERROR if is_wider else Severity.NOTE
        name = f"{key}.range_{unit}"
        yield Difference(name, (*at, f"range_{unit}"), span, list(entry.limits), severity, text)
    speed = axis.qd_max / per
    if entry.speed and counted.differ(speed, entry.speed, SPEED * entry.speed):
        text = f"{axis.name} runs at {speed:g} {unit}/s, on the controller {entry.speed:g}"
        severity = Severity.WARNING if speed > entry.speed else Severity.NOTE
        name = f"speed_{unit}_s"
        yield Difference(f"{key}.{name}", (*at, name), speed, entry.speed, severity, text)
    if entry.frame is not None:
        yield from _line(key, at, axis, entry.frame, counted)


def _line(
    key: str,
    at: tuple[str | int, ...],
    axis: ExternalAxis,
    frame: tuple[float, ...],
    counted: Counted,
) -> Iterator[Difference]:
    """Yield where an axis points elsewhere, or a positioner turns about another line."""
    T_world_axis = transform_from_kuka(frame[:3], frame[3:])
    direction = T_world_axis[:3, 2]
    off = float(np.arctan2(np.linalg.norm(np.cross(axis.axis, direction)), axis.axis @ direction))
    step = np.asarray(axis.T_world_axis)[:3, 3] - T_world_axis[:3, 3]
    aside = 0.0 if axis.kind == "rail" else float(np.linalg.norm(np.cross(step, direction)))
    is_turned = counted.differ(off / DEG, 0.0, ANGLE_DEG)
    if counted.differ(aside / MM, 0.0, LENGTH_MM) or is_turned:
        text = f"{axis.name} lies {aside / MM:.3f} mm and {off / DEG:.3f} deg off the controller's"
        yield Difference(f"{key}.axis", at, off / DEG, 0.0, Severity.ERROR, text)
