"""Pairs of links whose outlines meet where the arm does not, against the real bodies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import coal
import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import load_robot
from postproc.collision.bodies import Body, thinner
from postproc.collision.links import default_links
from postproc.collision.mesh import Mesh
from postproc.collision.pairs import OUTLINE_SHARES
from postproc.kinematics import build
from tools.bench.collision import coal_mesh
from tools.outlines.meshes import Triangles

BETWEEN = {(0, 2): (0, 1), (2, 4): (2, 3), (3, 6): (3, 4)}
"""The two joints between the links of a pair, counted from 0."""


def meeting(
    name: str, links: Triangles, count: int
) -> Iterator[tuple[tuple[int, int], BoolArray, BoolArray]]:
    """Yield each pair with which of ``count`` squared poses within the limits meet.

    Args:
        name: the arm.
        links: its real bodies.
        count: poses of each of the two joints between the links; the others stand at 0.

    Yields:
        the pair; (count, count) where the outlines meet; where the real bodies do.
    """
    robot = load_robot(name)
    arm = build(robot)
    low, high = np.asarray(robot.q_min), np.asarray(robot.q_max)
    outlines = default_links(robot, arm)
    bodies = [
        Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3))
        for corners in links
    ]
    for pair, share in OUTLINE_SHARES.items():
        joints = list(BETWEEN[pair])
        q = np.tile(np.clip(np.zeros(6), low, high), (count, count, 1))
        grid = [np.linspace(low[joint], high[joint], count) for joint in joints]
        q[..., joints] = np.stack(np.meshgrid(*grid, indexing="ij"), axis=-1)
        smaller = {
            link: thinner(Body(f"link {link}", "link", link, outlines[link]), share).mesh
            for link in pair
        }
        T = arm.link_frames(q.reshape(-1, 6))[:, list(pair)]
        found = [
            np.array([_meet(*solids, *frames) for frames in T]).reshape(count, count)
            for meshes in (smaller, bodies)
            for solids in [[coal_mesh(meshes[link]) for link in pair]]
        ]
        yield pair, found[0], found[1]


def table(arms: Mapping[str, Triangles], count: int) -> Iterator[str]:
    """Yield a line for each arm and pair: share of poses [%] that meet, and that are told wrong."""
    yield "| arm | links | real bodies meet | taken for contact | contact missed |"
    yield "| --- | --- | --: | --: | --: |"
    for name, links in arms.items():
        for (a, b), ours, real in meeting(name, links, count):
            numbers = [100.0 * float(part.mean()) for part in (real, ours & ~real, real & ~ours)]
            shown = " | ".join(f"{number:.1f}" for number in numbers)
            yield f"| {name.removeprefix('kuka_')} | {a}, {b} | {shown} |"


def _meet(
    one: coal.BVHModelOBBRSS, two: coal.BVHModelOBBRSS, T_one: FloatArray, T_two: FloatArray
) -> bool:
    places = [coal.Transform3s(T[:3, :3], T[:3, 3]) for T in (T_one, T_two)]
    asked, answer = coal.CollisionRequest(), coal.CollisionResult()
    return bool(coal.collide(one, places[0], two, places[1], asked, answer))
