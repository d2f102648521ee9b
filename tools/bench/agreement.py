"""Do the checks of configurations decide as brute force does? Random cells, all pairs by coal.

    python -m tools.bench agreement [--cells 40] [--each 500] [--seed 0]

Cells of built-in arms with their default solids, a tool, a part and obstacles of all kinds: boxes,
pipes, unions, curved sheets, balls of many triangles. Every pair of meshes is tested by coal,
triangle by triangle; what lies wholly inside another by winding numbers.
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.cell import Cell, MeshPlacement, RobotSolids, load_robot, robot_names
from postproc.collision import Scene
from postproc.collision.bodies import WORLD
from postproc.collision.inside import parts_of
from postproc.collision.mesh import Mesh, box, cylinder, joined
from postproc.geometry import inverse, rotation_about, transform
from postproc.kinematics import Kinematics, build
from tests.collision.conftest import cell_of, wavy_sheet, write_stl
from tests.collision.oracle import winding_number
from tools.bench.cells import ball
from tools.bench.collision import CoalModel


def main() -> None:
    """Draw cells, compare, print the sums; ends badly if a collision is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--each", type=int, default=500, help="configurations of each cell")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    rng = np.random.default_rng(arguments.seed)
    total, hits, missed, refused = 0, 0, 0, 0
    for _ in range(arguments.cells):
        with tempfile.TemporaryDirectory() as folder:
            cell = drawn(rng, Path(folder))
            arm = build(cell.robot)
            scene = Scene.build(cell, arm)
        low, high = (
            np.clip(np.asarray(v), -np.pi, np.pi) for v in (cell.robot.q_min, cell.robot.q_max)
        )
        q = rng.uniform(low, high, (arguments.each, 6))
        ours, true = scene.check(q).hit, CoalModel(scene, arm).check(q)
        for row in np.flatnonzero(ours & ~true):
            true[row] = is_nested(scene, arm, q[row])
        total, hits = total + len(q), hits + int(true.sum())
        missed, refused = missed + int((true & ~ours).sum()), refused + int((ours & ~true).sum())
        print(f"{cell.robot.name:28}{true.mean():7.1%} hit {missed:4} missed {refused:4} refused")
    print(
        f"{total} configurations, {hits} hit: {missed} missed, {refused} of the free ones refused"
    )
    raise SystemExit(1 if missed else 0)


def drawn(rng: np.random.Generator, folder: Path) -> Cell:
    """Return a random cell; its mesh files are in a folder."""

    def placed(name: str, size: float, far: float) -> MeshPlacement:
        axis = rng.normal(size=3)
        R = rotation_about(axis / np.linalg.norm(axis), rng.uniform(-np.pi, np.pi))
        mesh = _solid(rng, size)
        way = rng.normal(size=3) * np.array([1.0, 1.0, 0.6])
        T = transform(R, far * way / np.linalg.norm(way) + np.array([0.0, 0.0, 0.5 * far]))
        return MeshPlacement(name, T, write_stl(folder / f"{name}.stl", mesh))

    names = robot_names()
    robot = load_robot(names[rng.integers(len(names))])
    while not np.isfinite(np.concatenate([robot.q_min, robot.q_max])).all():
        robot = load_robot(names[rng.integers(len(names))])
    frames = build(robot).link_frames(np.zeros(6))
    reach = float(np.linalg.norm(frames[-1, :3, 3] - frames[1, :3, 3]))
    cell = cell_of(
        tool=[placed(f"tool_{k}", 0.1 * reach, 0.08 * reach) for k in range(2)],
        workpiece=[placed("part", 0.4 * reach, 0.9 * reach)],
        obstacles=[
            placed(f"solid_{k}", 0.3 * reach * rng.uniform(0.3, 1.0), reach * rng.uniform(0.6, 1.1))
            for k in range(4)
        ],
    )
    return replace(cell, robot=replace(robot, solids=RobotSolids.OUTLINE))


def _solid(rng: np.random.Generator, size: float) -> Mesh:
    """Return a random solid of about this size [m]."""
    kind = rng.integers(5)
    if kind == 0:
        return box(size * rng.uniform(0.1, 1.0, 3))
    if kind == 1:
        return cylinder(0.5 * size * rng.uniform(0.1, 1.0), size)
    if kind == 2:
        parts = [box(size * rng.uniform(0.1, 0.6, 3)) for _ in range(4)]
        steps = rng.uniform(-0.4, 0.4, (4, 3)) * size
        return joined([p.moved(transform(np.eye(3), s)) for p, s in zip(parts, steps, strict=True)])
    mesh = wavy_sheet(int(rng.integers(8, 60))) if kind == 3 else ball(int(rng.integers(8, 60)))
    return Mesh(size * mesh.vertices / np.ptp(mesh.vertices, axis=0).max(), mesh.faces)


def is_nested(scene: Scene, arm: Kinematics, q: np.ndarray) -> bool:
    """Return whether a part of a solid lies wholly inside another, by winding numbers."""
    frames = [*arm.link_frames(q), np.eye(4)]
    for pair in scene.pair_bodies:
        for outer, inner in (pair, pair[::-1]):
            T = inverse(frames[outer.link if outer.link != WORLD else -1])
            T = T @ frames[inner.link if inner.link != WORLD else -1]
            first = np.unique(parts_of(inner.mesh).label, return_index=True)[1]
            points = inner.vertices[inner.faces[first, 0]] @ T[:3, :3].T + T[:3, 3]
            if (np.abs(winding_number(outer.mesh, points)) > 0.5).any():
                return True
    return False


if __name__ == "__main__":
    main()
