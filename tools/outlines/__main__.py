"""``python -m tools.outlines measure|table PACKAGES``, ``picture PACKAGES FILE.png NAME...``."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry, load_robot
from postproc.collision.outlines import upright_solids
from postproc.geometry import apply
from postproc.kinematics import build
from tools.outlines import measure, picture
from tools.outlines.meshes import Triangles, real_arms


def stands_out(name: str, links: Triangles) -> tuple[list[float], list[float]]:
    """Return per link how far [mm] the real body stands out of ours, and our volume by its hull's.

    A point's distance is the smallest over the prisms of the largest over their sides.
    """
    robot = load_robot(name)
    geometry = robot.geometry
    assert isinstance(geometry, OpwGeometry)  # noqa: S101 - every built-in robot has one
    frames = build(robot).link_frames(geometry.signs * geometry.offsets)
    out, volume = [], []
    for T, corners, solids in zip(frames, links, upright_solids(robot, geometry), strict=True):
        points = apply(T, corners.reshape(-1, 3))
        hulls = [ConvexHull(solid.vertices) for solid in solids]
        far = np.min([_beyond(hull, points) for hull in hulls], axis=0)
        out.append(1e3 * max(float(far.max()), 0.0))
        volume.append(sum(hull.volume for hull in hulls) / max(ConvexHull(points).volume, 1e-6))
    return out, volume


def _beyond(hull: ConvexHull, points: FloatArray) -> FloatArray:
    return np.asarray((points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1))


def main(command: str, packages: str, *more: str) -> None:
    """Measure the outlines, print how well they enclose the real bodies, or draw both."""
    arms = dict(real_arms(Path(packages)))
    if command == "picture":
        picture.draw(arms, more[1:], Path(more[0]))
        return
    if command == "measure":
        measure.write(Path(packages), arms)
        return
    print(f"{'mm outside of links 0..6':<42} | our volume by that of the hull of the real link")
    for name, links in arms.items():
        out, volume = stands_out(name, links)
        far = " ".join(f"{value:3.0f}" for value in out)
        print(f"{name:<28}{far} | {' '.join(f'{value:5.2f}' for value in volume)}")


main(*sys.argv[1:])
