"""The shared planning workloads: their scene as a cell, their holes, candidates of the holes."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.cell import Cell, MeshPlacement, parse_cell
from postproc.geometry import inverse, transform
from postproc.kinematics import Kinematics, build
from postproc.units import DEG, MM
from tests.places import SHARED

WORKLOADS = SHARED / "workloads"
SPINS = 36
TEXT = """\
schema = "postproc.cell/1"
name = "workload"
[robot]
model = "kuka_kr500_r2830"
[tool]
name = "angle head"
axis = "+z"
[limits]
joint_margin_deg = 0
singularity_deg = 0
clearance_mm = 0
[optimize]
objective = {{ travel = 1.0 }}
turns = {turns}
[motion]
feed_mm_min = 600
approach_mm = {approach_mm}
"""


def workload_cell(
    hard: bool = False,
    panel: Path | None = None,
    *,
    turns: bool = True,
    approach_mm: float = 50.0,
    folder: Path = WORKLOADS,
) -> Cell:
    """The cell of ``scene.json``.

    Args:
        hard: with the four beams between robot and panel.
        panel: another mesh [m] for the panel.
        turns: also use joint angles a whole turn away.
        approach_mm: height above a hole from which its stroke begins.
        folder: the workloads.
    """
    scene = json.loads((folder / "scene" / "scene.json").read_text(encoding="utf-8"))
    text = TEXT.format(turns=str(turns).lower(), approach_mm=approach_mm)
    cell = parse_cell(text.encode(), "workload.toml")
    arm = build(cell.robot)
    links, T_flange_scene6 = _link_frames(arm, scene["robot"])

    def solids(names: list[str], T: np.ndarray) -> tuple[MeshPlacement, ...]:
        files = [folder / "scene" / name for name in names]
        return tuple(MeshPlacement(file.stem, T, file, scale=1.0) for file in files)

    files = scene["files"]
    workpiece = solids(files["panel"], np.eye(4))
    if panel is not None:
        workpiece = (replace(workpiece[0], file=panel),)
    more = scene["hard_extra_obstacles"] if hard else []
    limits = np.array(scene["robot"]["limits_deg"]) * DEG
    return replace(
        cell,
        robot=replace(
            cell.robot,
            link_meshes=tuple(
                (i, solid) for i, T in enumerate(links) for solid in solids(files[f"link{i}"], T)
            ),
            q_min=limits[:, 0],
            q_max=limits[:, 1],
        ),
        tools=(
            replace(
                cell.tool,
                T_flange_tcp=np.array(scene["flange_to_tcp"]),
                meshes=solids(files["tool"], T_flange_scene6),
            ),
        ),
        bases=(replace(cell.workpiece, meshes=workpiece),),
        obstacles=solids([*files["obst"], *more], np.eye(4)),
    )


def _link_frames(arm: Kinematics, size: dict[str, float]) -> tuple[list[np.ndarray], np.ndarray]:
    """Return the scene's link frames in ours, and its last one in the flange.

    At zero all frames of the scene are parallel to that of the base.
    """
    elbow = size["a1"] + size["a2"]
    wrist = (elbow + size["d4"], 0.0, size["d1"] + size["a3"])
    shoulder = (size["a1"], 0.0, size["d1"])
    origins = [(0.0, 0.0, 0.0), (0.0, 0.0, 0.0), shoulder, (elbow, 0.0, size["d1"]), *[wrist] * 3]
    at = [transform(np.eye(3), np.array(origin)) for origin in origins]
    frames = arm.link_frames(np.zeros(6))
    links = [inverse(frame) @ T for frame, T in zip(frames, at, strict=True)]
    return links, inverse(arm.fk(np.zeros(6))) @ at[6]


def holes(count: int, folder: Path = WORKLOADS) -> tuple[np.ndarray, np.ndarray]:
    """Points (n, 3) [m] and outward normals (n, 3) of a workload of 200, 1000 or 10000 holes."""
    table = np.loadtxt(folder / f"workload_{count}.csv", delimiter=",", skiprows=1)
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
