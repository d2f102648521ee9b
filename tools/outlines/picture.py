"""Side-by-side picture of arms: our solids beside the real bodies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw

from postproc.arrays import FloatArray
from postproc.cell import load_robot
from postproc.collision.links import default_links
from postproc.geometry import apply
from postproc.kinematics import build
from postproc.units import DEG
from tools.outlines.meshes import Triangles

_POSE = np.array([0.0, -70.0, 100.0, 0.0, 40.0, 0.0]) * DEG
_SIZE = 420
_VIEW = np.array([[0.55, -0.83, 0.0], [0.25, 0.17, 0.95], [-0.8, -0.52, 0.3]])
"""Right, up and towards the viewer in robroot."""
_OURS, _REAL = (236, 128, 44), (150, 156, 164)


def draw(arms: Mapping[str, Triangles], names: Sequence[str], path: Path) -> None:
    """Write a picture: one column an arm, ours above, the real one below."""
    sheet = Image.new("RGB", (_SIZE * len(names), 2 * _SIZE), "white")
    pen = ImageDraw.Draw(sheet)
    for column, name in enumerate(names):
        robot = load_robot(name)
        kinematics = build(robot)
        frames = kinematics.link_frames(_POSE)
        ours = [mesh.corners for mesh in default_links(robot, kinematics)]
        both = [_placed(frames, ours), _placed(frames, arms[name])]
        reach = np.concatenate(both).reshape(-1, 3) @ _VIEW[:2].T
        low, span = reach.min(axis=0), float(np.ptp(reach, axis=0).max())
        for row, (corners, colour) in enumerate(zip(both, (_OURS, _REAL), strict=True)):
            origin = np.array([column * _SIZE + 15.0, row * _SIZE + _SIZE - 15.0])
            _paint(pen, corners, colour, origin, low, (_SIZE - 30.0) / span)
        pen.text((column * _SIZE + 10, 6), name, fill="black")
    sheet.save(path, optimize=True)


def _placed(frames: FloatArray, links: Sequence[FloatArray]) -> FloatArray:
    moved = [apply(T, c.reshape(-1, 3)) for T, c in zip(frames, links, strict=True)]
    return np.concatenate(moved).reshape(-1, 3, 3)


def _paint(
    pen: ImageDraw.ImageDraw,
    corners: FloatArray,
    colour: tuple[int, int, int],
    origin: FloatArray,
    low: FloatArray,
    scale: float,
) -> None:
    """Paint triangles from back to front, brighter towards the light."""
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normal, axis=1)
    light = np.abs(normal @ np.array([0.3, -0.6, 0.75])) / np.maximum(size, 1e-12)
    order = np.argsort((corners @ _VIEW[2]).mean(axis=1))
    flat = (corners @ _VIEW[:2].T - low) * scale * np.array([1.0, -1.0]) + origin
    for k in order.tolist():
        shade = tuple(int(part * (0.45 + 0.5 * light[k])) for part in colour)
        pen.polygon([tuple(point) for point in flat[k].tolist()], fill=shade)
