"""Synthetic cells, toolpaths and plans for the tests of what writes and reads programs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from pydantic import TypeAdapter

from postproc.cell.cell import Cell, ExternalAxis, OpwGeometry, Robot, Tool, Workpiece
from postproc.cell.schema import KrlOptions, Limits, Motion, Optimize, Process, Read
from postproc.geometry.frames import rotation_from_abc, transform
from postproc.model.plan import MoveKind, MoveRole, Plan
from postproc.model.toolpath import Event, EventKind, Operation, ToolPath
from postproc.units import DEG, MM

HOME = np.array([10.0, -95.5, 100.25, 5.0, 40.0, -3.5]) * DEG


def cell(tool_name="spindle", path="cell.toml", **krl) -> Cell:
    """A KR210 R2700-2 with round numbers; keyword arguments are keys of ``[krl]``."""
    geometry = OpwGeometry(0.330, -0.115, 0.0, 0.645, 1.150, 1.220, 0.215, np.ones(6), np.zeros(6))
    robot = Robot(
        "test_arm",
        geometry,
        np.array([-185, -140, -120, -350, -125, -350.0]) * DEG,
        np.array([185, -5, 168, 350, 125, 350.0]) * DEG,
        np.full(6, 2.0),
        np.full(6, 5.0),
        np.eye(4),
    )
    return Cell(
        name="test cell",
        path=path,
        robot=robot,
        tools=(
            Tool(1, tool_name, transform(np.eye(3), [0.107, 0.0, 0.362]), np.array([1.0, 0, 0])),
        ),
        bases=(Workpiece(2, transform(np.eye(3), [1.5, 0.0, 0.6])),),
        obstacles=(),
        limits=Limits(0.03, 0.08, 0.0, 0.0),
        optimize=TypeAdapter(Read[Optimize]).validate_python({}),
        process=Process(),
        motion=TypeAdapter(Read[Motion]).validate_python({"feed_mm_min": 600.0}),
        krl=TypeAdapter(Read[KrlOptions]).validate_python(krl),
    )


def toolpath(n, *, path="part.cls", operations=(), operation=None, names=None):
    """A toolpath with ``n`` tags; tag i stands in line 100 + i."""
    if operation is None:
        operation = np.zeros(n) if operations else np.full(n, -1)
    return ToolPath(
        path=path,
        name="part",
        format="apt",
        dialect="nx",
        units="mm",
        points=np.zeros((n, 3)),
        axes=np.tile([0.0, 0.0, 1.0], (n, 1)),
        kind=np.ones(n),
        feed=np.full(n, 0.01),
        line=100 + np.arange(n),
        operation=operation,
        tool=np.full(n, -1),
        arc=np.full(n, -1),
        cycle=np.full(n, -1),
        operations=tuple(Operation(text, 10 + i) for i, text in enumerate(operations)),
        names=names,
    )


def plan(moves, *, name="TEST", events=(), path=None, **changes) -> Plan:
    """A plan of moves given as dicts; what a dict leaves out gets a plain value.

    Keys: kind, role, xyz_mm, abc_deg, aux_mm, q_deg, speed, ptp, blend_mm, dwell, tag, external.
    """
    m = len(moves)
    kind = np.array([move.get("kind", MoveKind.LIN) for move in moves])
    is_ptp = kind == MoveKind.PTP
    xyz = np.array([move.get("xyz_mm", (10.0 * i, 0.0, 0.0)) for i, move in enumerate(moves)])
    xyz = xyz.reshape(m, 3)
    abc = np.array([move.get("abc_deg", (0.0, 90.0, 0.0)) for move in moves]).reshape(m, 3)
    q = np.array([move.get("q_deg", HOME / DEG + 0.01 * i) for i, move in enumerate(moves)])
    q = q.reshape(m, 6)
    aux = np.array([move.get("aux_mm", (np.nan,) * 3) for move in moves]).reshape(m, 3)
    tags = np.array([move.get("tag", i) for i, move in enumerate(moves)])
    path = path or toolpath(max(int(tags.max()) + 1 if m else 1, 1))
    default_role = np.where(is_ptp, MoveRole.ENTRY, MoveRole.CUT)
    external = np.array([move.get("external", ()) for move in moves])
    values = {
        "name": name,
        "toolpath": path,
        "kind": kind,
        "role": [move.get("role", r) for move, r in zip(moves, default_role, strict=True)],
        "tag": tags,
        "T_base_tcp": transform(rotation_from_abc(abc * DEG), xyz * MM),
        "aux": aux * MM,
        "q": q * DEG,
        "spin": np.zeros(m),
        "branch": np.zeros(m),
        "speed": np.where(is_ptp, np.nan, [move.get("speed", 0.01) for move in moves]),
        "ptp_fraction": np.where(is_ptp, [move.get("ptp", 0.5) for move in moves], np.nan),
        "blend": np.array([move.get("blend_mm", 0.0) for move in moves]) * MM,
        "dwell": np.array([move.get("dwell", 0.0) for move in moves]),
        "duration": np.ones(m),
        "external": external.reshape(m, -1 if m else 0),
        "stiffness": np.full(len(path), np.nan),
        "stiffness_initial": np.full(len(path), np.nan),
        "clearance": np.full(len(path), np.nan),
        "events": tuple(events),
    }
    return replace(Plan(**values), **changes) if changes else Plan(**values)


def milling(n=6, **changes) -> Plan:
    """An entry, a cut of ``n`` blended lines 10 mm long, the last of them exact."""
    moves = [{"kind": MoveKind.PTP}]
    moves += [{"blend_mm": 1.0} for _ in range(n)]
    return plan(moves, **changes)


def event(index, kind: EventKind, value=0.0, text="", line=7):
    """An event before move ``index``."""
    return index, Event(index, kind, value, text, line)


def with_axis(cell: Cell, name: str, kind: str) -> Cell:
    """The cell with one external axis."""
    axis = ExternalAxis(name, kind, np.array([0.0, 1.0, 0.0]), np.eye(4), -3.0, 3.0, 1.0)
    return replace(cell, external_axes=(axis,))


def heavy(cell: Cell, inertia=None) -> Cell:
    """The cell with a tool of known mass and centre of gravity."""
    tool = replace(cell.tool, mass=120.0, com=np.array([0.0, 0.0, 0.18]), inertia=inertia)
    return replace(cell, tools=(tool,))
