"""Real bodies of arms in the link frames of the built-in arm, from ROS packages with meshes."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import expanded, find_robot, load_robot, read_urdf_robot
from postproc.collision.urdf_solids import urdf_links
from postproc.errors import PostprocError
from postproc.geometry import apply, inverse
from postproc.kinematics import build

_NAME = re.compile(rb'(<robot[^>]*name=")[^"]*(")')
Triangles = list[FloatArray]
"""Corners (f, 3, 3) [m] of links 0..6, each in its link frame."""


def real_arms(packages: Path) -> Iterator[tuple[str, Triangles]]:
    """Yield every built-in arm that the packages hold with all its meshes."""
    files = sorted(packages.glob("kuka_*_support/urdf/*.xacro"))
    for file in (f for f in files if "macro" not in f.name):
        try:
            name = find_robot(file.name.split(".")[0])
            with tempfile.NamedTemporaryFile(dir=file.parent, suffix=".urdf") as urdf:
                # a name of its own: this package turns A1 of one arm the other way, which the
                # check of known names refuses; bodies at zero are the same
                text = _NAME.sub(rb"\1measured\2", expanded(file, file.parent), count=1)
                urdf.write(text)
                urdf.flush()
                yield name, _triangles(name, Path(urdf.name))
        except PostprocError as problem:
            print(f"{file.name}: left out: {problem.message[:100]}")


def _triangles(name: str, urdf: Path) -> Triangles:
    robot = read_urdf_robot(urdf, "tool0")
    solids, _ = urdf_links(robot.geometry)  # type: ignore[arg-type]
    own = build(load_robot(name)).link_frames(np.zeros(6))
    theirs = build(robot).link_frames(np.zeros(6))
    return [
        np.concatenate([apply(inverse(a) @ b, mesh.corners.reshape(-1, 3)) for mesh in link])
        .reshape(-1, 3, 3)
        for a, b, link in zip(own, theirs, solids, strict=True)
    ]  # fmt: skip


def surface_points(corners: FloatArray, step: float) -> FloatArray:
    """Return points (n, 3) [m] on triangles, no farther apart than ``step`` along edges."""
    found = [corners.reshape(-1, 3)]
    for _ in range(12):
        longest = np.linalg.norm(np.roll(corners, -1, 1) - corners, axis=2).max(axis=1)
        corners = corners[longest > step]
        if not len(corners):
            break
        middle = 0.5 * (corners + np.roll(corners, -1, 1))
        a, b, c = np.moveaxis(corners, 1, 0)
        ab, bc, ca = np.moveaxis(middle, 1, 0)
        parts = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([np.stack(part, 1) for part in parts])
        found.append(middle.reshape(-1, 3))
    return np.unique(np.concatenate(found).round(3), axis=0)
