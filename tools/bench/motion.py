"""Judge the motion checks by brute force: random crowded cells, dense sampling, coal, all pairs.

    python -m tools.bench motion [--cells 40] [--moves 500] [--seed 1]

Each cell has an arm with a big tool, rods of 2 to 60 mm and blocks at random. Judged are joint
motions and approximated corners (0.5 to 300 mm), as planner and ``verify`` judge them, against
configurations no more than a millimetre apart, at corners along random polynomials within KUKA's
rules; every third cell stands on a rail that travels with the motion. A hit that brute force finds
in what the check lets pass is a miss; a motion that the check refuses while brute force comes no
nearer than a millimetre is a false refusal.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import comb
from time import process_time

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell, ExternalAxis, MeshPlacement, parse_cell
from postproc.collision import Scene
from postproc.geometry import inverse, rotation_from_vector, transform
from postproc.kinematics import Corners, Kinematics, bound_of, build, joint_share
from postproc.units import DEG, MM
from tests.cells import cell_text
from tools.bench.collision import CoalModel
from tools.bench.outside import mixed_rotations, weights

STEP = 1e-3
"""Longest way [m] of any point of the arm between two brute-force configurations."""
REACH = 3.5
"""Farthest that a point of arm and tool may be from a joint's axis [m]."""


@dataclass(slots=True)
class Tally:
    """Motions of one kind: all, refused, misses, false refusals."""

    moves: int = 0
    refused: int = 0
    missed: int = 0
    false: int = 0
    where: list[str] = field(default_factory=list)

    def add(self, brute: Brute, q: FloatArray, where: str, *, refused: bool) -> None:
        """Count one motion, as densely as (k, 6 + e)."""
        self.moves += 1
        self.refused += refused
        if brute.is_wrong(q, refused=refused):
            self.false += refused
            self.missed += not refused
            self.where.append(where)


def random_cell(rng: np.random.Generator, with_rail: bool) -> Cell:
    """Return a crowded cell."""
    cell = parse_cell(cell_text("[limits]\nclearance_mm = 0\n").encode(), "cell.toml")
    solids = []
    for number in range(14):
        T = np.eye(4)
        T[:3, :3] = rotation_from_vector(rng.uniform(-1.0, 1.0, 3) * (number % 3 > 0))
        angle, radius = rng.uniform(-np.pi, np.pi), rng.uniform(1.0, 2.6)
        T[:3, 3] = [radius * np.cos(angle), radius * np.sin(angle), rng.uniform(0.3, 2.6)]
        if number < 9:
            thick = 0.5 * np.exp(rng.uniform(np.log(2e-3), np.log(60e-3)))
            solids.append(MeshPlacement(f"rod {number}", T, radius=thick, length=2.0))
        else:
            solids.append(MeshPlacement(f"block {number}", T, size=rng.uniform(0.05, 0.5, 3)))
    T_tool = np.eye(4)
    T_tool[:3, 3] = [0.1, 0.05, 0.25]
    head = MeshPlacement("head", T_tool, size=rng.uniform([0.1, 0.1, 0.3], [0.3, 0.3, 0.48]))
    rail = ExternalAxis("E1", "rail", np.array([0.0, 1.0, 0.0]), np.eye(4), -3.0, 3.0, 1.0)
    tool = replace(cell.tool, meshes=(head,))
    return replace(
        cell,
        obstacles=tuple(solids),
        tools=(tool,),
        external_axes=(rail,) if with_rail else (),
    )


class Brute:
    """Exact tests of single configurations, many of them: by coal, with a rail by fcl."""

    def __init__(self, scene: Scene, arm: Kinematics, clearance: float) -> None:
        self._near = scene.kept(clearance)
        has_rail = bool(scene.external_axes)
        self._check: Callable[[FloatArray], FloatArray] = (
            (lambda q: scene.check(q).hit) if has_rail else CoalModel(scene, arm).check
        )

    def is_wrong(self, q: FloatArray, *, refused: bool) -> bool:
        """Return whether a verdict is wrong: a miss, or refused where nothing is near."""
        if refused:
            return not self._near.check(q).hit.any()
        return bool(self._check(q).any())


@dataclass(frozen=True, slots=True)
class Case:
    """A cell to judge motions in; ``free`` (f, 6 + e): configurations without a collision."""

    rng: np.random.Generator
    arm: Kinematics
    tool: FloatArray
    scene: Scene
    brute: Brute
    free: FloatArray


def dense(q: FloatArray) -> FloatArray:
    """Return a polyline of configurations with no point moving more than ``STEP`` in between."""
    parts = [q[:1]]
    for a, b in pairwise(q):
        way = np.abs(b - a)
        count = int(np.ceil((way[:6].sum() * REACH + way[6:].sum()) / STEP)) + 1
        parts.append(a + np.linspace(0.0, 1.0, count + 1)[1:, None] * (b - a))
    return np.concatenate(parts)


def bezier(points: FloatArray, count: int) -> FloatArray:
    """Return a polynomial with the given control points (n, k)."""
    s, n = np.linspace(0.0, 1.0, count)[:, None], len(points) - 1
    return np.asarray(
        sum(comb(n, i) * s**i * (1 - s) ** (n - i) * point for i, point in enumerate(points))
    )


def controls(rng: np.random.Generator, a: FloatArray, c: FloatArray, b: FloatArray) -> FloatArray:
    """Return random control points from a to b, on the legs to the corner c."""
    before = np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))
    behind = np.sort(rng.uniform(0.0, 1.0, rng.integers(1, 3)))
    first = [a + s * (c - a) for s in before]
    last = [b + s * (c - b) for s in behind[::-1]]
    return np.array([a, *first, *last, b])


def is_refused(scene: Scene, arm: Kinematics, corners: Corners) -> bool:
    """Return whether a corner is refused, as the planner judges it."""
    bound = bound_of(arm, corners)
    return bool(bound.lost.any() or scene.kept(0.3e-3).check_corners(bound, None, 0.2e-3).hit.any())


def joint_moves(case: Case, count: int, tally: Tally) -> None:
    """Judge joint motions between free configurations."""
    rng, free = case.rng, case.free
    a, b = free[rng.integers(len(free), size=(2, count))]
    b = a + rng.uniform(0.05, 0.6, (count, 1)) * (b - a)
    verdict = case.scene.kept(0.3e-3).check_paths(a, b, resolution=0.2e-3)
    for row in range(count):
        way = dense(np.stack([a[row], b[row]]))
        tally.add(case.brute, way, f"motion {row}", refused=bool(verdict.hit[row]))


def joint_corners(case: Case, count: int, tally: Tally) -> None:
    """Judge corners between joint motions."""
    rng, arm, tool, free = case.rng, case.arm, case.tool, case.free
    k = free.shape[1] - 6
    for row in range(count):
        far_a, corner, far_b = free[rng.integers(len(free), size=3)]
        far_a, far_b = (corner + 0.4 * (far - corner) for far in (far_a, far_b))
        distance = np.exp(rng.uniform(np.log(5e-4), np.log(0.3)))
        q = [corner]
        for far, place in ((far_a, 0), (far_b, 2)):
            share = joint_share(arm, far[None, :6], corner[None, :6], tool, np.array([distance]))
            q.insert(place, corner + share[0] * (far - corner))
        q3 = np.array(q)
        T = arm.fk(q3[:, :6]) @ tool
        corners = Corners(
            q3[None, :, :6], T[None], np.zeros((1, 2), bool), tool, q3[None, :, 6:].reshape(1, 3, k)
        )
        refused = is_refused(case.scene, arm, corners)
        ways = [dense(bezier(controls(rng, *q3), 25)) for _ in range(3)]
        way = np.concatenate([*ways, dense(q3)])
        tally.add(case.brute, way, f"corner {row}, {distance / MM:.1f} mm", refused=refused)


def path_corners(case: Case, count: int, tally: Tally) -> None:
    """Judge corners between path motions, and the motions up to them."""
    rng, arm, tool, free = case.rng, case.arm, case.tool, case.free
    for row in range(count):
        corner = free[rng.integers(len(free))]
        T_corner = arm.fk(corner[:6]) @ tool
        distance = np.exp(rng.uniform(np.log(5e-4), np.log(0.3)))
        T = np.repeat(T_corner[None], 3, axis=0)
        for end in (0, 2):
            way = rng.normal(size=3)
            T[end, :3, 3] += distance * way / np.linalg.norm(way)
            turn = rng.uniform(-0.2, 0.2, 3) * min(1.0, distance / 0.1)
            T[end, :3, :3] = T_corner[:3, :3] @ rotation_from_vector(turn)
        q, valid = _near(arm, T @ inverse(tool), corner)
        if not valid:
            continue
        external = np.repeat(corner[None, None, 6:], 3, axis=1)
        corners = Corners(q[None], T[None], np.ones((1, 2), bool), tool, external)
        refused = is_refused(case.scene, arm, corners)
        ways = [
            _near(arm, _along(rng, T) @ inverse(tool), corner) for _ in range(40 if refused else 4)
        ]
        if all(valid for _, valid in ways):
            way = [np.hstack([q, np.repeat(corner[None, 6:], len(q), axis=0)]) for q, _ in ways]
            where = f"corner {row}, {distance / MM:.1f} mm"
            tally.add(case.brute, np.concatenate([dense(q) for q in way]), where, refused=refused)


def _along(rng: np.random.Generator, T: FloatArray) -> FloatArray:
    """Return tool poses (n, 4, 4) along random polynomials of point and orientation."""
    u, v, w = weights(rng, 40)
    p = u[:, None] * T[0, :3, 3] + v[:, None] * T[1, :3, 3] + w[:, None] * T[2, :3, 3]
    return transform(mixed_rotations(T, *weights(rng, 40)), p)


def _near(arm: Kinematics, T: FloatArray, corner: FloatArray) -> tuple[FloatArray, bool]:
    q, valid = arm.ik_in(T, np.full(len(T), int(arm.slot(corner[:6]))))
    q = q + 2.0 * np.pi * np.round((corner[:6] - q) / (2.0 * np.pi))
    leaps = np.abs(np.diff(q, axis=0)).max(initial=0.0) if valid.all() else np.inf
    return q, bool(valid.all()) and leaps < 40.0 * DEG


def judged(cells: int, moves: int, seed: int) -> dict[str, Tally]:
    """Return the tallies by kind of motion over random cells."""
    tallies = {name: Tally() for name in ("joint", "joint corner", "path corner")}
    for number in range(cells):
        rng = np.random.default_rng([seed, number])
        cell = random_cell(rng, number % 3 == 2)
        arm = build(cell.robot)
        scene = Scene.build(cell, arm)
        low = np.array([-2.0, -2.2, -1.0, -2.5, -1.8, -3.0])
        high = np.array([2.0, -0.4, 2.2, 2.5, 1.8, 3.0])
        q = rng.uniform(low, high, (4000, 6))
        if cell.external_axes:
            q = np.hstack([q, rng.uniform(-1.5, 1.5, (len(q), 1))])
        free = q[~scene.kept(2e-3).check(q).hit]
        if len(free) < 10:
            continue
        tool = np.asarray(cell.tool.T_flange_tcp)
        case = Case(rng, arm, tool, scene, Brute(scene, arm, 1e-3), free)
        joint_moves(case, moves // 2, tallies["joint"])
        joint_corners(case, moves // 4, tallies["joint corner"])
        path_corners(case, moves // 4, tallies["path corner"])
    return tallies


def main() -> None:
    """Judge and print."""
    parser = argparse.ArgumentParser(description="Motion checks against brute force.")
    parser.add_argument("--cells", type=int, default=40)
    parser.add_argument("--moves", type=int, default=500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    start = process_time()
    for name, tally in judged(options.cells, options.moves, options.seed).items():
        free = max(tally.moves - tally.refused + tally.false, 1)
        print(
            f"{name:<13} {tally.moves} judged, {tally.refused} refused, {tally.missed} missed, "
            f"{tally.false} refused falsely ({tally.false / free:.1%} of the free ones)"
        )
        for where in tally.where[:3] if tally.missed else ():
            print(f"  wrong: {where}")
    print(f"{process_time() - start:.0f} s of CPU time")


if __name__ == "__main__":
    main()
