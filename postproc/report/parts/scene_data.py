"""What the 3D view of a page needs of a cell: solids, and the arm as turns about joint axes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from postproc.geometry import apply, inverse
from postproc.report.parts.page import Page, packed
from postproc.units import DEG

if TYPE_CHECKING:
    from postproc.arrays import FloatArray
    from postproc.cell import Cell
    from postproc.collision import Scene
    from postproc.kinematics import Kinematics

MAX_FACES = 60_000
"""Faces of all solids together on a page; finer meshes are thinned."""
_FEWEST_FACES = 500


def add_scene(page: Page, cell: Cell, kinematics: Kinematics, scene: Scene | None = None) -> None:
    """Put the robot and the solids of a cell into a page."""
    page.data["robot"] = robot_data(cell, kinematics)
    page.data["bodies"] = body_data(cell, kinematics, scene)


def robot_data(cell: Cell, kinematics: Kinematics) -> dict[str, Any]:
    """Return frames and axes of the zero pose [m], limits and speeds [deg, deg/s]."""
    zero = np.zeros(6)
    frames = kinematics.link_frames(zero)
    axes = kinematics.jacobian(zero)[3:, :].T
    robot = cell.robot
    return {
        "link_frames": [[float(v) for v in frame.ravel()] for frame in frames],
        "joint_axes": [[float(v) for v in axis] for axis in axes],
        "joint_points": [[float(v) for v in frame[:3, 3]] for frame in frames[1:]],
        "T_world_robroot": [float(v) for v in robot.T_world_robroot.ravel()],
        "T_world_base": [float(v) for v in T_world_base(cell).ravel()],
        "limits": [
            [float(low / DEG), float(high / DEG)]
            for low, high in zip(robot.q_min, robot.q_max, strict=True)
        ],
        "speeds": [float(v / DEG) for v in robot.qd_max],
    }


def body_data(
    cell: Cell, kinematics: Kinematics, scene: Scene | None = None
) -> list[dict[str, Any]]:
    """Return the solids, thinned to ``MAX_FACES`` together, each in the frame that carries it.

    Links and tools lie in the frame of their link, the workpiece in its own frame, the rest in the
    world.
    """
    from postproc.collision import Scene as Solids

    built = scene or Solids.build(cell, kinematics)
    T_base_world = inverse(T_world_base(cell))
    share = max(_FEWEST_FACES, MAX_FACES // max(len(built.bodies), 1))
    return [
        {
            "name": body.name,
            "kind": body.kind,
            "link": body.link,
            "vertices": packed(
                apply(T_base_world, body.vertices) if body.kind == "workpiece" else body.vertices
            ),
            "faces": packed(body.faces, "uint16" if len(body.vertices) < 65536 else "int32"),
        }
        for body in built.display_bodies(share)
    ]


def T_world_base(cell: Cell) -> FloatArray:
    """Return the workpiece frame in the world (4, 4) [m]."""
    T: FloatArray = cell.robot.T_world_robroot @ cell.workpiece.T_robroot_base
    return T
