"""A controller as the values and remarks of a cell file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from postproc.backup.arm import ArmMatch, limits_of, match_arm, short_name
from postproc.backup.controller import Controller
from postproc.backup.external import ExternalAxisEntry, ExternalKinematic
from postproc.backup.frames import BaseEntry, ToolEntry
from postproc.backup.variables import matrix, six
from postproc.cell import LENGTHS, HomeStyle, Kss, Robot
from postproc.geometry import inverse
from postproc.units import DEG

Values = dict[str, Any]
Remarks = dict[str, list[str]]
_FARTHEST_MM, _LARGEST_DEG = 1e5, 360.0
_MOST_NUMBER = 128
_SPEED_TOLERANCE = 0.01


def cell_values(controller: Controller, robot: Robot | None = None) -> tuple[Values, Remarks]:
    """Return what a cell file takes over from a controller: values as for ``cell_text``, remarks.

    The remarks, by table, say what the cell cannot know, or takes over with a doubt. ``robot``: the
    arm, where the caller knows better than the files.
    """
    match = ArmMatch(robot, ("named by the caller",)) if robot else match_arm(controller.machine)
    values: Values = {}
    remarks: Remarks = {"": list(_header(controller))}
    values["robot"], remarks["robot"] = _robot(controller, match)
    tools = [t for t in controller.tools if _is_usable(t)]
    values["tools"] = [_tool(tool) for tool in tools]
    if not tools:
        values["tool"] = {"axis": None}
        remarks["tool"] = ["no tool is used on the controller"]
    for place, tool in enumerate(tools):
        remarks[f"tools.{place}"] = list(_tool_remarks(tool, controller))
    remarks["tools"] = [_left_out_tool(t) for t in controller.tools if not _is_usable(t)]
    bases = [b for b in controller.bases if _is_usable_base(b, controller)]
    values["bases"] = [_base(base, controller) for base in bases]
    for place, base in enumerate(bases):
        remarks[f"bases.{place}"] = list(_rewritten("BASE_DATA", base.number, controller))
    remarks["bases"] = [_left_out_base(b, controller) for b in controller.bases if b not in bases]
    values["motion"], remarks["motion"] = _home(controller, values["robot"])
    taken = (*controller.rails, *controller.positioners)
    values["external_axes"] = [_external_axis(e, axis) for e in taken for axis in e.axes]
    remarks["external_axes"] = [
        line for e in controller.externals for line in _external(e, e in taken)
    ]
    values["krl"] = _krl(controller)
    if "home_deg" in values["motion"] and "XHOME" in controller.homes and not taken:
        values["krl"]["home"] = HomeStyle.XHOME.value
    return values, remarks


def _header(controller: Controller) -> Iterator[str]:
    yield "made from the backup of a controller; what it cannot know is a comment"
    said = [("robot", controller.robot_name), ("serial number", controller.serial)]
    said += [("system software", controller.software)]
    known = [f"{word} {text}" for word, text in said if text]
    if known:
        yield ", ".join(known)
    yield from controller.notes


def _robot(controller: Controller, match: ArmMatch) -> tuple[Values, list[str]]:
    machine, robot, remarks = controller.machine, match.robot, list(match.remarks)
    values: Values = {}
    if robot is None:
        values["name"] = short_name(machine)
        values["dimensions_mm"] = dict(zip(LENGTHS, machine.lengths_mm, strict=True))
        if machine.payload_kg:
            values["payload_kg"] = machine.payload_kg
        remarks.append("masses, stiffness and accelerations of this arm are not known")
    else:
        values["model"] = robot.name
        remarks += _payload_remark(machine.payload_kg, robot)
    values["base"] = _placement(controller.root)
    if controller.rails:
        remarks.append("base is the robot root with the rail at 0; a rail overrides $ROBROOT")
    limits, words = limits_of(machine, robot)
    remarks += words
    if limits:
        values["limits_deg"] = limits
    if machine.speed_deg_s is not None:
        values["speed_deg_s"] = list(machine.speed_deg_s)
        remarks += _speed_remarks(machine.speed_deg_s, robot)
    return values, remarks


def _payload_remark(payload_kg: float | None, robot: Robot) -> list[str]:
    if payload_kg is None or payload_kg == robot.payload:
        return []
    return [f"$DEF_L_M is {payload_kg:g} kg, the rated payload of this arm {robot.payload:g} kg"]


def _speed_remarks(speed_deg_s: Sequence[float], robot: Robot | None) -> list[str]:
    if robot is None or np.isnan(robot.qd_max).any():
        return []
    own = robot.qd_max / DEG
    far = np.flatnonzero(np.abs(np.array(speed_deg_s) - own) > _SPEED_TOLERANCE * own)
    words = ", ".join(f"A{i + 1} {own[i]:g}" for i in far)
    return [f"published speeds differ from the controller's: {words} deg/s"] if words else []


def _is_usable(tool: ToolEntry) -> bool:
    return tool.is_carried and tool.number <= _MOST_NUMBER and _is_in_range(tool.frame)


def _is_usable_base(base: BaseEntry, controller: Controller) -> bool:
    is_in_range = base.number <= _MOST_NUMBER and _is_in_range(base.frame)
    return is_in_range and controller.T_world_base(base) is not None


def _is_in_range(frame: Sequence[float]) -> bool:
    far = max(map(abs, frame[:3])) > _FARTHEST_MM
    return not far and max(map(abs, frame[3:])) <= _LARGEST_DEG


def _placement(frame: Sequence[float]) -> Values:
    return {"xyz_mm": list(frame[:3]), "abc_deg": list(frame[3:])}


def _tool(tool: ToolEntry) -> Values:
    values: Values = {"number": tool.number, "name": tool.name or f"tool_{tool.number}"}
    values["frame"] = _placement(tool.frame)
    if tool.mass_kg is not None:
        values["mass_kg"] = tool.mass_kg
        if tool.cog is not None and max(map(abs, tool.cog[:3])) <= _FARTHEST_MM:
            values["cog_mm"] = list(tool.cog[:3])
        if tool.inertia_kg_m2 is not None:
            values["inertia_kg_m2"] = list(tool.inertia_kg_m2)
    return values


def _tool_remarks(tool: ToolEntry, controller: Controller) -> Iterator[str]:
    yield 'axis = "+z" or another: which TCP axis points into the part? TOOL_DATA does not say'
    if not tool.name:
        yield "has no name on the controller"
    if tool.mass_kg is None:
        yield "LOAD_DATA was not entered: the controller takes the rated load; weigh the tool"
    if tool.inertia_kg_m2 is not None and tool.cog is not None and any(tool.cog[3:]):
        a, b, c = tool.cog[3:]
        yield f"the axes of the inertia are turned by A {a:g}, B {b:g}, C {c:g}"
    if tool.kind == "#NONE":
        yield "TOOL_TYPE is #NONE: never set on the pad, used by programs alone"
    yield from _rewritten("TOOL_DATA", tool.number, controller)


def _rewritten(name: str, number: int, controller: Controller) -> Iterator[str]:
    found = [key for key in (f"{name}[{number}]", f"{name}[any]") if key in controller.rewritten]
    if found:
        yield f"programs of the controller assign {found[0]}: the frame in the cut may be another"


def _left_out_tool(tool: ToolEntry) -> str:
    why = "out of range" if tool.is_carried else "a workpiece on the flange (#TCP), no tool"
    return f"left out: TOOL {tool.number} {tool.name} {_words(tool.frame)}: {why}"


def _left_out_base(base: BaseEntry, controller: Controller) -> str:
    why = "out of range"
    if base.kind == "#TCP":
        why = "a tool that stands in the room (#TCP), no workpiece frame"
    elif base.parent and controller.T_world_base(base) is None:
        why = f"hangs on the kinematic {base.parent}"
    elif controller.positioners and not base.parent:
        why = "stands still beside the positioner that turns the bases of this cell"
    return f"left out: BASE {base.number} {base.name} {_words(base.frame)}: {why}"


def _words(frame: Sequence[float]) -> str:
    return ", ".join(f"{key} {value:g}" for key, value in zip("XYZABC", frame, strict=True))


def _base(base: BaseEntry, controller: Controller) -> Values:
    frame, root = list(base.frame), controller.root
    T_world_base = controller.T_world_base(base)
    if T_world_base is not None and (any(root) or base.parent):
        frame = six(inverse(matrix(root)) @ T_world_base)
    values: Values = {"number": base.number}
    if base.name:
        values["name"] = base.name
    return {**values, "frame": _placement(frame)}


def _home(controller: Controller, robot: Values) -> tuple[Values, list[str]]:
    homes = dict(controller.homes)
    usual = (0.0, -90.0, 90.0, 0.0, 0.0, 0.0)
    name = next(iter(homes), "")
    remarks = [
        f"{other} = {', '.join(f'{angle:g}' for angle in angles)}"
        for other, angles in homes.items()
        if other != name and angles not in (usual, homes[name])
    ]
    limits = robot.get("limits_deg")
    if not name:
        return {}, ["no XHOME in the backup: home_deg is not known"]
    outside = limits and any(
        not low <= angle <= high for angle, (low, high) in zip(homes[name], limits, strict=True)
    )
    if outside or max(map(abs, homes[name])) > 2 * _LARGEST_DEG:
        shown = ", ".join(f"{angle:g}" for angle in homes[name])
        return {}, [f"{name} = {shown} lies outside of the limits: home_deg is left out", *remarks]
    return {"home_deg": list(homes[name])}, [f"home_deg is {name}", *remarks]


def _external_axis(kinematic: ExternalKinematic, axis: ExternalAxisEntry) -> Values:
    unit = "mm" if axis.is_linear else "deg"
    return {
        "name": axis.name,
        "kind": kinematic.kind,
        "axis": "+z",
        f"range_{unit}": list(axis.limits or ()),
        f"speed_{unit}_s": axis.speed,
        **_placement(axis.frame or (0.0,) * 6),
    }


def _external(kinematic: ExternalKinematic, is_taken: bool) -> Iterator[str]:
    what = {"rail": "carries the robot", "positioner": "carries a workpiece"}
    kind = what.get(kinematic.kind, "belongs to no kinematic")
    if is_taken:
        yield f"{kinematic.name} {kind}: frames with all axes at 0, each moves along its +z"
        return
    axes = []
    for axis in kinematic.axes:
        unit = "mm" if axis.is_linear else "deg"
        span = "limits not set"
        if axis.limits:
            span = f"{axis.limits[0]:g} to {axis.limits[1]:g} {unit}"
        speed = f", {axis.speed:g} {unit}/s" if axis.speed else ""
        axes.append(f"{axis.name} ({'linear' if axis.is_linear else 'rotational'}, {span}{speed})")
    yield f"the controller has {kinematic.name}: {', '.join(axes)}, {kind}"
    for name, frame in kinematic.frames.items():
        if any(frame):
            yield f"  {name}: {_words(frame)}"
    why = kinematic.unknown or "no base of the controller hangs on it, or there are several"
    yield f"  left out: {why}; enter it here if the cell needs it"


def _krl(controller: Controller) -> Values:
    version = controller.kss
    if version is None:
        return {}
    known = [kss for kss in Kss if _version(kss) <= version]
    return {"kss": str(known[-1] if known else Kss.V5)}


def _version(kss: Kss) -> tuple[int, int]:
    major, _, minor = kss.partition(".")
    return int(major), int(minor or 0)
