"""What the 3D view of a page needs of a cell: solids, and the arm as turns about joint axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray, IntArray
from postproc.cell import Cell
from postproc.geometry import apply, inverse
from postproc.records import dataclass
from postproc.report.parts.page import packed
from postproc.units import DEG


@dataclass(frozen=True, slots=True)
class Solid:
    """Triangles: vertices (v, 3) [m] in the frame of the link (0: world), faces (f, 3).

    ``tool``: the tool of the cell that it belongs to, -1 for none; ``bases``: the setups of the
    cell in whose work it is there, none for all.
    """

    name: str
    kind: str
    link: int
    vertices: FloatArray
    faces: IntArray
    tool: int = -1
    bases: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True)
class Drawing:
    """A cell to draw: its solids, and the arm in the zero pose.

    ``link_frames`` (7, 4, 4) in robroot [m]; ``joint_axes`` (6, 3) unit, robroot;
    ``T_robroot_flange`` (4, 4).
    """

    cell: Cell
    link_frames: FloatArray
    joint_axes: FloatArray
    T_robroot_flange: FloatArray
    solids: tuple[Solid, ...]


def scene_data(drawing: Drawing) -> dict[str, Any]:
    """Return the robot and the solids of a cell for the page's scripts."""
    return {"robot": robot_data(drawing), "bodies": body_data(drawing)}


def robot_data(drawing: Drawing) -> dict[str, Any]:
    """Return frames and axes of the zero pose [m], limits and speeds [deg, deg/s]."""
    robot = drawing.cell.robot
    T_link_flange = inverse(drawing.link_frames[-1]) @ drawing.T_robroot_flange
    tips = np.array([tool.T_flange_tcp[:3, 3] for tool in drawing.cell.tools])
    return {
        "link_frames": [[float(v) for v in frame.ravel()] for frame in drawing.link_frames],
        "joint_axes": [[float(v) for v in axis] for axis in drawing.joint_axes],
        "joint_points": [[float(v) for v in frame[:3, 3]] for frame in drawing.link_frames[1:]],
        "tips": apply(T_link_flange, tips).tolist(),
        "tool": drawing.cell.tool_index,
        "T_world_robroot": [float(v) for v in robot.T_world_robroot.ravel()],
        "T_world_base": [float(v) for v in T_world_base(drawing.cell).ravel()],
        # an arm whose limits nobody knows can still be looked at
        "limits": [
            [float(np.nan_to_num(low / DEG, nan=-180.0)), float(np.nan_to_num(high / DEG, nan=180))]
            for low, high in zip(robot.q_min, robot.q_max, strict=True)
        ],
        "speeds": [float(v / DEG) if np.isfinite(v) else None for v in robot.qd_max],
    }


def body_data(drawing: Drawing) -> list[dict[str, Any]]:
    """Return the solids, each in the frame that carries it.

    Links and tools lie in the frame of their link, the workpiece in its own frame, the rest in the
    world.
    """
    T_base_world = inverse(T_world_base(drawing.cell))
    return [
        {
            "name": solid.name,
            "kind": solid.kind,
            "link": solid.link,
            "tool": solid.tool,
            "bases": list(solid.bases),
            "vertices": packed(
                apply(T_base_world, solid.vertices) if solid.kind == "workpiece" else solid.vertices
            ),
            "faces": packed(solid.faces, "uint16" if len(solid.vertices) < 65536 else "int32"),
        }
        for solid in drawing.solids
    ]


def extent_of(points: FloatArray) -> dict[str, Any]:
    """Return middle and size of the box around points (n, 3) for the camera."""
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(3),) * 2
    return {
        "centre": [float(v) for v in (low + high) / 2],
        "extent": float(np.linalg.norm(high - low)),
    }


def in_drawn_base(cell: Cell, base: AnyIntArray, points: FloatArray) -> FloatArray:
    """Return points (n, 3) [m] of bases (n,) in that of the drawing: the one in work."""
    return _moved(cell, base, points, 1.0)


def axes_in_drawn_base(cell: Cell, base: AnyIntArray, axes: FloatArray) -> FloatArray:
    """Return directions (n, 3) of bases (n,) in axes of that of the drawing."""
    return _moved(cell, base, axes, 0.0)


def _moved(cell: Cell, base: AnyIntArray, rows: FloatArray, scale: float) -> FloatArray:
    if len(cell.bases) < 2:
        return rows
    T = inverse(cell.T_robroot_base) @ np.array([b.T_robroot_base for b in cell.bases])
    own = T[np.maximum(base, 0)]
    return np.asarray(np.einsum("nij,nj->ni", own[:, :3, :3], rows) + scale * own[:, :3, 3])


def T_world_base(cell: Cell) -> FloatArray:
    """Return the workpiece frame in the world (4, 4) [m]."""
    T: FloatArray = cell.robot.T_world_robroot @ cell.workpiece.T_robroot_base
    return T
