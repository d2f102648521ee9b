"""Collision checks per second on the shared workload scene, beside coal in one run.

    python -m tools.bench collision [--holes 1000] [--count 20000] [--hard] [--panel 200000]

Configurations are IK candidates within limits (36 spins, all branches) of the holes, and uniformly
random ones. Both judge the same pairs of the same meshes; their answers are compared.
"""

from __future__ import annotations

import argparse
import tempfile
from collections.abc import Callable
from pathlib import Path

import coal
import numpy as np
import pinocchio as pin

from postproc.cell import Cell
from postproc.collision.bodies import Body
from postproc.collision.check import Tally
from postproc.collision.mesh import Mesh, load_mesh
from postproc.collision.scene import Scene
from postproc.kinematics import Kinematics, build
from tools.bench.harness import rate
from tools.bench.workload import candidates, fixed_spin_path, holes, workload_cell


def main() -> None:
    """Print a table for candidates and for random configurations, then motions and distances."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--holes", type=int, default=1000, choices=(200, 1000, 10000))
    parser.add_argument("--count", type=int, default=20000, help="configurations for postproc")
    parser.add_argument("--hard", action="store_true", help="with four beams in the way")
    parser.add_argument("--panel", type=int, default=0, help="triangles of the panel, at least")
    args = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        cell = workload_cell(args.hard, _panel(args.panel, Path(folder)))
        arm = build(cell.robot)
        scene = Scene.build(cell, arm)
        triangles = sum(len(body.faces) for body in tested_bodies(scene))
        print(f"{len(scene.bodies)} bodies, {triangles} triangles, {len(scene.pairs)} pairs")
        rng = np.random.default_rng(0)
        every = candidates(arm, cell, *holes(args.holes))
        print(f"{len(every)} candidates of {args.holes} holes: ", end="")
        print(f"{scene.check(every).hit.mean():.2%} collide")
        chosen = every[np.sort(rng.permutation(len(every))[: args.count])]
        spread = rng.uniform(cell.robot.q_min, cell.robot.q_max, (args.count, 6))
        for name, q in (("candidates", chosen), ("random", spread)):
            compare(name, scene, arm, q)
        motions(scene, chosen)
        path = fixed_spin_path(arm, cell, *holes(10000))
        hit, speed = timed(lambda rows: scene.check_paths(rows[:-1], rows[1:]).hit, path)
        print(f"  {'10,000 successive holes':<34}{speed:>10,.0f} /s   {hit.mean():.1%} hit")


def compare(name: str, scene: Scene, arm: Kinematics, q: np.ndarray) -> None:
    """Time both on the same configurations and compare their answers."""
    tally = Tally()
    ours, speed = timed(lambda rows: scene.check(rows).hit, q)
    scene.check(q, tally=tally)
    share = 1.0 - tally.exact / tally.pairs
    print(f"{name}: {ours.mean():.2%} of {len(q)} collide; culled by boxes {share:.3%}")
    print(f"  {'postproc':<34}{speed:>10,.0f} /s")
    answer, other = timed(CoalModel(scene, arm).check, q[:4000])
    wrong, label = int((answer != ours[:4000]).sum()), "pinocchio + coal, computeCollisions"
    print(f"  {label:<34}{other:>10,.0f} /s   {speed / other:5.1f}x   {wrong} disagree")


def motions(scene: Scene, q: np.ndarray) -> None:
    """Time swept checks and distances from configurations that are free."""
    free = q[~scene.check(q).hit][:1000]
    rng = np.random.default_rng(1)
    for text, step in (("0.1 deg", 0.002), ("1 deg", 0.02), ("6 deg", 0.1)):
        end = free + step * rng.uniform(-1.0, 1.0, free.shape)
        paths = np.stack([free, end], axis=1)
        hit, speed = timed(lambda two: scene.check_paths(two[:, 0], two[:, 1]).hit, paths)
        print(f"  motions of about {text:<18}{speed:>10,.0f} /s   {hit.mean():.1%} hit")
    for text, most in (("smallest distance", np.inf), ("smallest distance up to 50 mm", 0.05)):
        speed = rate(lambda most=most: scene.clearance(free, most=most), len(free))
        print(f"  {text:<34}{speed:>10,.0f} /s")


def timed(check: Callable[[np.ndarray], np.ndarray], q: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the answer and configurations per second of CPU time, after a short warm-up."""
    check(q[:50])
    answers = []
    speed = rate(lambda: answers.append(check(q)), len(q))
    return answers[0], speed


class CoalModel:
    """pinocchio's model of the arm with coal's meshes, the loop over pairs in C++."""

    def __init__(self, scene: Scene, arm: Kinematics) -> None:
        self._model = pin.Model()
        joint = 0
        for place, axis in zip(arm.chain.placements[:6], arm.chain.axes, strict=True):
            kind = pin.JointModelRevoluteUnaligned(axis)
            joint = self._model.addJoint(joint, kind, pin.SE3(place), f"a{joint + 1}")
        self._geometry = pin.GeometryModel()
        for body in tested_bodies(scene):
            thing = pin.GeometryObject(
                body.name, max(body.link, 0), pin.SE3.Identity(), coal_mesh(body.mesh)
            )
            self._geometry.addGeometryObject(thing)
        for a, b in index_pairs(scene):
            self._geometry.addCollisionPair(pin.CollisionPair(a, b))
        self._data = self._model.createData()
        self._found = self._geometry.createData()

    def check(self, q: np.ndarray) -> np.ndarray:
        """Return (n,) whether anything collides."""
        args = (self._model, self._data, self._geometry, self._found)
        return np.array([pin.computeCollisions(*args, row, True) for row in q])


def tested_bodies(scene: Scene) -> list[Body]:
    """Return the solids that are tested, stand-ins among them, each once."""
    return list({id(body): body for pair in scene.pair_bodies for body in pair}.values())


def index_pairs(scene: Scene) -> list[tuple[int, int]]:
    """Return the pairs of a scene as indices of its tested bodies."""
    index = {id(body): i for i, body in enumerate(tested_bodies(scene))}
    return [(index[id(one)], index[id(two)]) for one, two in scene.pair_bodies]


def coal_mesh(mesh: Mesh) -> coal.BVHModelOBBRSS:
    """Return a mesh for coal."""
    vertices, triangles = coal.StdVec_Vec3s(), coal.StdVec_Triangle()
    for vertex in mesh.vertices:
        vertices.append(np.array(vertex))
    for face in mesh.faces:
        triangles.append(coal.Triangle(*(int(i) for i in face)))
    model = coal.BVHModelOBBRSS()
    model.beginModel(len(mesh.faces), len(mesh.vertices))
    model.addSubModel(vertices, triangles)
    model.endModel()
    return model


def _panel(triangles: int, folder: Path) -> Path | None:
    """Write the panel with each triangle cut into four until there are enough."""
    if triangles <= 0:
        return None
    corners = load_mesh(_panel_file(workload_cell()), 1.0).corners
    while len(corners) < triangles:
        a, b, c = corners[:, 0], corners[:, 1], corners[:, 2]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        parts = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in parts])
    record = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    table = np.zeros(len(corners), dtype=record)
    table["corners"] = corners
    path = folder / "panel.stl"
    path.write_bytes(bytes(80) + len(corners).to_bytes(4, "little") + table.tobytes())
    return path


def _panel_file(cell: Cell) -> Path:
    file = cell.workpiece.meshes[0].file
    if file is None:
        raise SystemExit("the workload scene has no panel file")
    return file
