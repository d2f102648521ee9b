"""DELMIA's OLP XML (``OLPData``) to a toolpath: tasks that call tasks, motions, profiles, frames.

The toolpath stands in the base frame of the robot that recorded it, so a cell puts its own robot
under it by its workpiece frame. Object frames and ``BaseWRTWorld`` are resolved. Tool axes come
from the full orientation and ``ReadOptions.tool_axis``.

Proven by samples: element names of tasks, calls, joint motions, Cartesian and joint targets,
profiles; units; R = Rz(Roll) Ry(Pitch) Rx(Yaw). Taken as a DELMIA user would expect, without a
sample: ``MotionType`` Linear, Circular and CircularVia, speeds in m/s, fly-by by distance, object
frames that are not zero (relative to their reference frame, World or RobotBase). A ``ViaPoint`` is
passed by as far as the cell approximates where its accuracy profile does not fly by.
"""

from __future__ import annotations

from dataclasses import field
from pathlib import Path

import numpy as np

from postproc.arrays import NONE, FloatArray, IntArray
from postproc.geometry import circles, inverse
from postproc.model import (
    Arcs,
    CamSetup,
    CamTool,
    Event,
    EventKind,
    MotionKind,
    Operation,
    ToolPath,
    WordClass,
    WordUse,
)
from postproc.readers.base import ReadOptions, distinct, tool_changes
from postproc.readers.delmia.profiles import Profiles
from postproc.readers.delmia.records import N_JOINTS, Document, Motion, Statement, pose
from postproc.readers.delmia.tasks import expanded
from postproc.readers.delmia.xml import read_document
from postproc.readers.text import Faults
from postproc.records import dataclass

_KINDS = {
    "joint": MotionKind.JOINT, "jointmotion": MotionKind.JOINT, "slew": MotionKind.JOINT,
    "": MotionKind.JOINT, "linear": MotionKind.LINEAR, "linearmove": MotionKind.LINEAR,
    "linearmotion": MotionKind.LINEAR, "circular": MotionKind.ARC,
    "circularmotion": MotionKind.ARC,
}  # fmt: skip
_EVENTS = {"signal": EventKind.SIGNAL, "wait": EventKind.WAIT_SIGNAL, "delay": EventKind.DWELL}
_VIA = frozenset({"circularvia", "circularviamotion"})
_IN_NO_TABLE = "an element, attribute or value in no table of OLP files"
_NOT_DONE = "an activity that is not carried out"


@dataclass(slots=True)
class _Path:
    """Tags as they are expanded, in lists of equal length, and what happens between them."""

    motions: list[Motion] = field(default_factory=list)
    vias: list[Motion | None] = field(default_factory=list)
    operation: list[int] = field(default_factory=list)
    operations: list[Operation] = field(default_factory=list)
    events: list[Event] = field(default_factory=list)
    unknown: dict[str, list[int]] = field(default_factory=dict)
    """Lines of activities that are not carried out, by type."""


def read_file(path: str, options: ReadOptions) -> ToolPath:
    """Return the motions of one task or of all tasks that no other one calls."""
    faults = Faults(path, options.recover)
    document = read_document(path, faults)
    return _toolpath(_collected(document, options, faults), document, options, faults)


def _collected(document: Document, options: ReadOptions, faults: Faults) -> _Path:
    """Return the motions of the tasks in the order they run."""
    result = _Path()
    via: Motion | None = None
    for name, item in expanded(document, options.task, faults):
        if isinstance(item, Statement):
            what = _EVENTS.get(item.kind, EventKind.UNKNOWN)
            is_signal = what in (EventKind.SIGNAL, EventKind.WAIT_SIGNAL)
            text, port = item.name, (float(item.port),) if is_signal else ()
            if what is EventKind.UNKNOWN:
                text = f"{item.kind} {item.name}".strip()
                result.unknown.setdefault(item.kind, []).append(item.line)
            event = Event(len(result.motions), what, item.value, text, item.line, port)
            result.events.append(event)
            continue
        if not result.operations or result.operations[-1].name != name:
            result.operations.append(Operation(name, document.task_lines[name]))
        kind = item.kind.replace(" ", "").lower()
        if kind in _VIA:
            if via is not None:
                raise faults.error("DEL019", "two CircularVia motions in a row", item.line)
            via = item
            continue
        _check_arc(kind, via, item, faults)
        result.motions.append(item)
        result.vias.append(via)
        result.operation.append(len(result.operations) - 1)
        via = None
    if via is not None:
        raise faults.error("DEL019", "a CircularVia without a Circular after it", via.line)
    return result


def _check_arc(kind: str, via: Motion | None, item: Motion, faults: Faults) -> None:
    if kind not in _KINDS:
        raise faults.error("DEL017", "unknown MotionType", item.line, item.kind)
    is_arc = _KINDS[kind] is MotionKind.ARC
    if is_arc and via is None:
        raise faults.error("DEL018", "a Circular without a CircularVia before it", item.line)
    if not is_arc and via is not None:
        raise faults.error("DEL019", "a CircularVia without a Circular after it", via.line)


def _toolpath(path: _Path, document: Document, options: ReadOptions, faults: Faults) -> ToolPath:
    motions = path.motions
    n = len(motions)
    kind = np.array(
        [_KINDS[m.kind.replace(" ", "").lower()] for m in motions], dtype=np.int32
    ).reshape(n)
    T = _poses(motions, document, faults)
    points = T[:, :3, 3]
    axes = -(T[:, :3, :3] @ np.asarray(options.tool_axis, dtype=np.float64)) + 0.0
    arcs, arc = _arcs(path, points, kind, document, faults)
    tool, tools, events = _tools(path, document, faults)
    setup, setups = _setups(motions, document, faults)
    _note_joint_only(points, motions, faults)
    _note_coordinates(document, faults)
    joints = np.array([m.joints or (np.nan,) * N_JOINTS for m in motions]).reshape(n, N_JOINTS)
    profiles = Profiles(document.robot, faults)
    feed, joint_fraction = profiles.speeds(motions, kind)
    largest_blend = profiles.blends(motions)
    return ToolPath(
        path=faults.path,
        name=Path(faults.path).stem,
        format="delmia",
        dialect="delmia",
        units="m",
        points=points,
        axes=axes,
        kind=kind,
        feed=feed,
        line=np.array([m.line for m in motions], dtype=np.int32),
        operation=np.array(path.operation, dtype=np.int32),
        tool=tool,
        arc=arc,
        cycle=np.full(n, NONE, dtype=np.int32),
        operations=tuple(path.operations),
        tools=tools,
        arcs=arcs,
        events=tuple(sorted(path.events + events, key=lambda event: event.index)),
        rotations=T[:, :3, :3],
        joints=joints if not np.isnan(joints).all() else None,
        largest_blend=largest_blend,
        joint_fraction=joint_fraction,
        setup=setup,
        setups=setups,
        names=tuple(m.name for m in motions),
        extra={"tag_group": tuple(m.group for m in motions)},
        unknown_words={
            kind: len(lines) for kind, lines in sorted({**document.strange, **path.unknown}.items())
        },
        word_uses=(
            *(
                WordUse(kind, WordClass.PROCESS, tuple(lines), _NOT_DONE, True)
                for kind, lines in path.unknown.items()
            ),
            *(
                WordUse(word, WordClass.UNKNOWN, tuple(lines), _IN_NO_TABLE, True)
                for word, lines in document.strange.items()
            ),
            *profiles.uses(),
        ),
        warnings=faults.warnings,
        recovered=faults.fixes,
    )


def _poses(motions: list[Motion], document: Document, faults: Faults) -> FloatArray:
    """Return T_base_tcp (n, 4, 4) in the recording robot's base frame, NaN for joint targets."""
    frames: dict[tuple[str, tuple[float, ...]], FloatArray] = {}
    for m in motions:
        key = (m.object_profile, m.base)
        if key not in frames:
            frames[key] = _frame_of(m, document, faults)
    xyz = np.array([m.xyz for m in motions]).reshape(-1, 3)
    rpy = np.array([m.rpy for m in motions]).reshape(-1, 3)
    T_frame_tcp = pose(xyz, rpy)  # type: ignore[arg-type]
    T_base_frame = np.array([frames[m.object_profile, m.base] for m in motions])
    T: FloatArray = T_base_frame.reshape(-1, 4, 4) @ T_frame_tcp
    return T


def _frame_of(motion: Motion, document: Document, faults: Faults) -> FloatArray:
    """Return T_base_object: the identity for a zero object frame."""
    objects = document.robot.objects
    if motion.object_profile not in objects:
        if not objects or motion.object_profile == "":
            return np.eye(4)
        text = "no object frame profile of this name"
        raise faults.error("DEL016", text, motion.line, motion.object_profile)
    reference, T_reference_object = objects[motion.object_profile]
    if np.array_equal(T_reference_object, np.eye(4)):
        return np.eye(4)
    if reference == "RobotBase":
        return T_reference_object
    if reference != "World":
        text = "an object frame in a frame other than World or RobotBase"
        raise faults.error("DEL021", text, motion.line, reference)
    T_world_base = pose(motion.base[:3], motion.base[3:])
    return inverse(T_world_base) @ T_reference_object


def _tools(
    path: _Path, document: Document, faults: Faults
) -> tuple[IntArray, tuple[CamTool, ...], list[Event]]:
    """Return the tool (n,), the tools used, and an event for each change after the first."""
    motions, known = path.motions, document.robot.tools
    for m in motions:
        if m.tool_profile and known and m.tool_profile not in known:
            raise faults.error("DEL016", "no tool profile of this name", m.line, m.tool_profile)
    column, first = distinct(m.tool_profile for m in motions)
    tools = tuple(CamTool(0, name, line=motions[row].line) for name, row in first.items())
    line = np.array([m.line for m in motions], dtype=np.int32)
    return column, tools, tool_changes(column, tools, line, with_first=False)


def _setups(
    motions: list[Motion], document: Document, faults: Faults
) -> tuple[IntArray | None, tuple[CamSetup, ...]]:
    """Return the object frame (n,) of each motion and the frames; None if all are the robot's."""
    known = document.robot.objects
    column, first = distinct(m.object_profile in known and m.object_profile for m in motions)
    setups = []
    for name, row in first.items():
        T = _frame_of(motions[row], document, faults)
        matrix = tuple(map(tuple, (T[:3] + 0.0).tolist()))
        setups.append(CamSetup(name, motions[row].line, matrix, carried=True))
    return (column, tuple(setups)) if setups else (None, ())


def _arcs(
    path: _Path, points: FloatArray, kind: IntArray, document: Document, faults: Faults
) -> tuple[Arcs, IntArray]:
    """Return the arcs through start, via and end, and which one leads to each tag."""
    ends = np.flatnonzero(kind == MotionKind.ARC)
    column = np.full(len(kind), NONE, dtype=np.int32)
    column[ends] = np.arange(len(ends))
    if len(ends) == 0:
        return Arcs.none(), column
    lines = [path.motions[int(i)].line for i in ends]
    if ends[0] == 0:
        raise faults.error("DEL020", "an arc with no point before it to start from", lines[0])
    vias = [via for via in path.vias if via is not None]
    middle = _poses(vias, document, faults)[:, :3, 3]
    start, end = points[ends - 1], points[ends]
    known = np.isfinite(np.hstack([start, middle, end])).all(axis=1)
    found = circles(start, middle, end)
    for good, reason in (
        (known, "an arc needs Cartesian targets all along it"),
        (found.valid, "an arc through three points on one line"),
    ):
        if not good.all():
            raise faults.error("DEL020", reason, lines[int(np.argmin(good))])
    return Arcs(found.centre, found.normal, found.radius, found.sweep), column


def _note_coordinates(document: Document, faults: Faults) -> None:
    coordinates = document.robot.coordinates
    if coordinates not in ("", "RobotBase"):
        text = (
            f"DownloadCoordinates is {coordinates[:40]!r}: targets without an object frame are "
            "taken to stand in the cell's workpiece frame as they are"
        )
        faults.warn("DEL111", text, 1)


def _note_joint_only(points: FloatArray, motions: list[Motion], faults: Faults) -> None:
    missing = np.flatnonzero(np.isnan(points).any(axis=1))
    if len(missing):
        text = f"{len(missing)} targets hold joint angles only, of the robot that recorded them"
        faults.warn("DEL121", text, motions[int(missing[0])].line)
