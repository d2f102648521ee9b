from __future__ import annotations

import struct
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from pydantic import TypeAdapter

from postproc.cell.cell import Cell, MeshPlacement, Tool, Workpiece
from postproc.cell.robotfile import load_robot
from postproc.cell.schema import KrlOptions, Limits, Motion, Optimize, Process, Read
from postproc.collision.mesh import Mesh, box, cylinder, joined, loft, ring
from postproc.geometry.frames import transform
from postproc.kinematics import build

HERE = np.eye(4)


def at(x=0.0, y=0.0, z=0.0):
    return transform(np.eye(3), np.array([x, y, z]))


def box_at(name, size, T, cutting=False):
    return MeshPlacement(name, T, size=np.array(size), cutting=cutting)


def write_stl(path: Path, mesh: Mesh, unit: float = 1e-3) -> Path:
    """Write a binary STL, millimetres unless said otherwise."""
    records = b"".join(
        struct.pack("<12fH", 0, 0, 0, *(corner / unit).ravel(), 0) for corner in mesh.corners
    )
    path.write_bytes(bytes(80) + struct.pack("<I", len(mesh.faces)) + records)
    return path


def wavy_sheet(n: int = 24) -> Mesh:
    """A closed curved panel that is not convex, 1.2 m x 0.8 m, 6 mm thick."""
    x, y = np.meshgrid(np.linspace(-0.6, 0.6, n), np.linspace(-0.4, 0.4, n), indexing="ij")
    z = 0.05 * np.cos(4.0 * x) + 0.04 * np.sin(5.0 * y)
    top = np.stack([x, y, z], axis=-1).reshape(-1, 3)
    vertices = np.vstack([top, top - [0.0, 0.0, 0.006]])
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    faces = np.vstack([np.stack(t, -1).reshape(-1, 3) for t in ((a, b, c), (a, c, d))])
    rim = np.concatenate([index[:, 0], index[-1, 1:], index[-2::-1, -1], index[0, -2:0:-1]])
    after = np.roll(rim, -1)
    low = n * n
    walls = np.vstack(
        [np.stack([after, rim, rim + low], 1), np.stack([after, rim + low, after + low], 1)]
    )
    return Mesh(vertices, np.vstack([faces, faces[:, ::-1] + low, walls]))


def motions_along(scene, q_path, contact=None):
    """Check the straight joint motions between successive configurations (k, 6)."""
    return scene.check_paths(q_path[:-1], q_path[1:], contact)


def cell_of(
    tool=(),
    workpiece=(),
    obstacles=(),
    T_robroot_base=HERE,
    clearance=0.0,
    contact_depth=np.inf,
    robot="kuka_kr500_r2830",
    T_world_robroot=HERE,
) -> Cell:
    arm = replace(load_robot(robot), T_world_robroot=T_world_robroot)
    return Cell(
        name="test",
        path="cell.toml",
        robot=arm,
        tools=(Tool(1, "tool", at(0.1, 0.0, 0.4), np.array([1.0, 0.0, 0.0]), meshes=tuple(tool)),),
        bases=(Workpiece(1, T_robroot_base, tuple(workpiece)),),
        obstacles=tuple(obstacles),
        limits=Limits(0.0, 0.0, clearance, contact_depth),
        optimize=TypeAdapter(Read[Optimize]).validate_python({}),
        process=Process(),
        motion=TypeAdapter(Read[Motion]).validate_python({}),
        krl=TypeAdapter(Read[KrlOptions]).validate_python({}),
    )


@pytest.fixture
def busy_cell(tmp_path):
    """An angle head before a wavy panel, among posts, on a floor, robot turned in the world."""
    head = joined([box(np.array([0.16, 0.16, 0.28])).moved(at(z=0.14)), cylinder(0.08, 0.3)])
    panel = write_stl(tmp_path / "panel.stl", wavy_sheet())
    turn = transform(
        np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]), np.array([0.4, -0.3, 0.2])
    )
    posts = loft([ring(0.06, 12), ring(0.03, 12)], [0.0, 1.6])
    return cell_of(
        tool=[
            MeshPlacement("tool", HERE, write_stl(tmp_path / "head.stl", head)),
            box_at("drill", [0.12, 0.01, 0.01], at(0.15, 0.0, 0.4), cutting=True),
        ],
        workpiece=[MeshPlacement("workpiece", HERE, panel)],
        T_robroot_base=transform(
            np.array([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]), np.array([2.0, 0, 1.2])
        ),
        obstacles=[
            MeshPlacement("post", turn @ at(1.7, 0.7, 0.0), write_stl(tmp_path / "p.stl", posts)),
            MeshPlacement("pipe", turn @ at(1.5, -0.9, 0.6), radius=0.05, length=1.2),
            box_at("floor", [5.0, 5.0, 0.1], turn @ at(z=-0.051)),
        ],
        T_world_robroot=turn,
    )


@pytest.fixture
def random_q():
    """Random configurations (n, 6) within the limits of the KR 500."""

    def draw(count, seed=0):
        robot = load_robot("kuka_kr500_r2830")
        rng = np.random.default_rng(seed)
        return rng.uniform(robot.q_min, robot.q_max, (count, 6))

    return draw


@pytest.fixture
def arm_of():
    return lambda cell: build(cell.robot)
