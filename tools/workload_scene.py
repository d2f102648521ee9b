"""The collision scene of the shared workloads as a cell, and the candidates of its holes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.cell.cell import (
    Cell,
    Limits,
    MeshPlacement,
    Process,
    Tool,
    Workpiece,
)
from postproc.cell.options import krl_of, motion_of, optimize_of
from postproc.cell.robotfile import load_robot
from postproc.cell.schema import KrlTable, MotionTable, OptimizeTable
from postproc.geometry.frames import inverse, transform
from postproc.kinematics.model import Kinematics, build
from postproc.units import DEG, MM

WORKLOADS = Path(__file__).resolve().parents[2] / "shared" / "workloads"
SPINS = 36


def workload_cell(hard: bool = False, panel: Path | None = None) -> Cell:
    """The cell of ``scene.json``.

    Args:
        hard: with the four beams between robot and panel.
        panel: another mesh [m] for the panel.
    """
    folder = WORKLOADS / "scene"
    scene = json.loads((folder / "scene.json").read_text(encoding="utf-8"))
    robot = load_robot("kuka_kr500_r2830")
    arm = build(robot)
    frames = arm.link_frames(np.zeros(6))
    dimensions = scene["robot"]
    elbow = dimensions["a1"] + dimensions["a2"]
    wrist = (elbow + dimensions["d4"], 0.0, dimensions["d1"] + dimensions["a3"])
    origins = [
        (0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0),
        (dimensions["a1"], 0.0, dimensions["d1"]),
        (elbow, 0.0, dimensions["d1"]),
        *[wrist] * 3,
    ]
    at = [transform(np.eye(3), np.array(origin)) for origin in origins]
    T_link_scene = [inverse(frame) @ T for frame, T in zip(frames, at, strict=True)]
    T_flange_scene6 = inverse(arm.fk(np.zeros(6))) @ at[6]

    def solids(group: str, T: np.ndarray) -> tuple[MeshPlacement, ...]:
        names = scene["files"][group]
        return tuple(MeshPlacement(Path(n).stem, T, folder / n, scale=1.0) for n in names)

    links = tuple((i, solid) for i in range(7) for solid in solids(f"link{i}", T_link_scene[i]))
    workpiece = solids("panel", np.eye(4))
    if panel is not None:
        workpiece = (replace(workpiece[0], file=panel),)
    obstacles = solids("obst", np.eye(4))
    if hard:
        scene["files"]["hard"] = scene["hard_extra_obstacles"]
        obstacles += solids("hard", np.eye(4))
    limits = np.array(dimensions["limits_deg"])
    return Cell(
        name="workload",
        path="scene.json",
        robot=replace(
            robot,
            link_meshes=links,
            q_min=limits[:, 0] * DEG,
            q_max=limits[:, 1] * DEG,
        ),
        tool=Tool(
            1,
            "angle head",
            np.array(scene["flange_to_tcp"]),
            np.array([0.0, 0.0, 1.0]),
            meshes=solids("tool", T_flange_scene6),
        ),
        workpiece=Workpiece(1, np.eye(4), workpiece),
        obstacles=obstacles,
        limits=Limits(0.0, 0.0, 0.0, 0.0),
        optimize=optimize_of(OptimizeTable()),
        process=Process(np.zeros(6)),
        motion=motion_of(MotionTable()),
        krl=krl_of(KrlTable()),
    )


def holes(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) [m] and outward normals (n, 3) of a workload of 200, 1000 or 10000 holes."""
    table = np.loadtxt(WORKLOADS / f"workload_{count}.csv", delimiter=",", skiprows=1)
    return table[:, :3] * MM, table[:, 3:6]


def candidates(arm: Kinematics, cell: Cell, points: np.ndarray, normals: np.ndarray) -> np.ndarray:
    """All configurations (m, 6) within limits: 36 spins about the tool axis, 8 branches."""
    q, valid = _solved(arm, cell, points, normals, np.arange(SPINS) * (2.0 * np.pi / SPINS))
    return np.asarray(q[valid])


def fixed_spin_path(
    arm: Kinematics, cell: Cell, points: np.ndarray, normals: np.ndarray
) -> np.ndarray:
    """Configurations (m, 6) of successive holes at the spin and branch that reach the most."""
    best = np.zeros((0, 6))
    for spin in np.arange(SPINS) * (2.0 * np.pi / SPINS):
        q, valid = _solved(arm, cell, points, normals, np.array([spin]))
        branch = int(valid.sum(axis=0).argmax())
        if valid[:, branch].sum() > len(best):
            best = q[valid[:, branch], branch]
    return np.unwrap(best, axis=0)


def _solved(
    arm: Kinematics, cell: Cell, points: np.ndarray, normals: np.ndarray, spin: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Joints (n * s, 8, 6) and whether they are within limits, for every point and spin."""
    z = -normals
    x = np.cross([0.0, 1.0, 0.0], z)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    y = np.cross(z, x)
    side = np.cos(spin)[:, None] * x[:, None] + np.sin(spin)[:, None] * y[:, None]
    forward = np.broadcast_to(z[:, None], side.shape)
    R = np.stack([side, np.cross(forward, side), forward], axis=-1)
    T = transform(R, np.broadcast_to(points[:, None], side.shape)).reshape(-1, 4, 4)
    q, valid = arm.ik(T @ inverse(cell.tool.T_flange_tcp))
    valid &= arm.within_limits(np.where(valid[..., None], q, 0.0))
    return q, valid
