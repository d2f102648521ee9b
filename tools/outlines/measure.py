"""Outlines from real bodies: each link cut into frusta that enclose it with the least volume."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry, load_robot
from postproc.collision import outlines
from postproc.geometry import apply
from postproc.kinematics import build
from tools.outlines.meshes import Triangles, surface_points

SPARE = 0.006
"""Distance [m] that is added all round."""
FRUSTA = (4, 5, 5, 7, 4, 4, 2)
_STEP, _SLICES = 0.025, 48
_SLOPES = np.linspace(-1.0, 1.0, 17)
"""Of the sides of a frustum, in the range of the slices over its height."""
_ROUNDS = 20
_BETWEEN = 10.0
"""Length of a link in the coordinate that is in metres below and beyond it."""
SIZES: Mapping[str, Sequence[str]] = {
    "agilus": [
        "kr4_r600", "kr6_r700_sixx", "kr6_r900_sixx", "kr6_r700_2", "kr6_r900_2", "kr7_r900_3",
        "kr10_r900_2", "kr10_r1100_2", "kr10_r1100_3", "kr13_r900_3", "kr16_r1100_3",
    ],
    "cybertech": [
        "kr8_r1440_2_arc_hw", "kr12_r1450_3_hw", "kr8_r2100_2_arc_hw", "kr16_r1610_2",
        "kr20_r1810_2", "kr16_r2010_2", "kr20_r1820_2_e",
    ],
    "iontec": ["kr20_r3100", "kr30_r2100", "kr50_r2100", "kr50_r2500", "kr70_r2100"],
    "quantec_2": [
        "kr210_r2700_2", "kr210_r3100_2", "kr120_r2700_2", "kr300_r2700_2", "kr150_r3100_2",
        "kr240_r2900_2",
    ],
    "quantec": ["kr210_r3100_ultra"],
    "quantec_k": ["kr210_r3300_2_k"],
    "fortec_2": ["kr500_r2800_2", "kr560_r3100_2", "kr300_r2800_2_mt", "kr800_r2800_2"],
    "fortec": ["kr240_r3330", "kr360_r2830", "kr600_r2830"],
}  # fmt: skip
"""Measured arms by size. Arms of other packages stand for themselves and judge the sizes."""
_HEAD = [
    "Outlines of arms standing straight up: each link is a stack of frusta, [from, to, reach,",
    "reach]. From and to are [share of the link's length, mm beyond it], reach is that of the",
    "octagons there [mm] to 0, 45, .. 315 deg of x forwards, y left, from the link's axis.",
    "Measured by tools/outlines on collision meshes of KUKA's ROS 2 packages (Apache-2.0,",
    "kuka_robot_descriptions, July 2026) and, after those of the sizes, of ROS-Industrial's",
    "kuka_experimental (Apache-2.0), 6 mm to spare. arms: the one that looks like this; a class",
    "without arms is over all of its size and stands for arms that were not measured. a1_mm,",
    "a2_mm: largest and mean of the arms measured.",
]


def outlines_text(points: Mapping[str, list[FloatArray]], with_arms: bool = True) -> str:
    """Return the outline file of arms by name, with points of links 0..6 as ``upright_points``.

    Without ``with_arms`` it holds the sizes alone.
    """
    tables = []
    for size, names in SIZES.items():
        members = [f"kuka_{name}" for name in names if f"kuka_{name}" in points]
        for arm in members if with_arms else ():
            tables.append(_table(arm.removeprefix("kuka_"), [arm], [arm], points))
        if members:
            tables.append(_table(size, [], members, points))
    sized = {f"kuka_{name}" for names in SIZES.values() for name in names}
    for arm in sorted(set(points) - sized) if with_arms else ():
        tables.append(_table(arm.removeprefix("kuka_"), [arm], [arm], points))
    about = ",\n".join(json.dumps(line) for line in _HEAD)
    head = f'{{"schema": "postproc.outlines/3",\n"about": [\n{about}],\n"outlines": {{\n'
    return head + ",\n".join(tables) + "}}\n"


def upright_points(name: str, links: Triangles) -> list[FloatArray]:
    """Return points (n, 3) [m] of links 0..6 in robroot with the arm standing straight up."""
    robot = load_robot(name)
    geometry = robot.geometry
    assert isinstance(geometry, OpwGeometry)  # noqa: S101 - every built-in robot has one
    frames = build(robot).link_frames(geometry.signs * geometry.offsets)
    return [
        apply(T, surface_points(corners, _STEP)) for T, corners in zip(frames, links, strict=True)
    ]


def _table(
    name: str, own: Sequence[str], members: Sequence[str], points: Mapping[str, list[FloatArray]]
) -> str:
    geometries = {arm: load_robot(arm).geometry for arm in members}
    a1 = max(g.a1 for g in geometries.values())  # type: ignore[union-attr]
    a2 = float(np.mean([g.a2 for g in geometries.values()]))  # type: ignore[union-attr]
    links = []
    for link, count in enumerate(FRUSTA):
        sizes, clouds = [], []
        for arm in members:
            z, length, x = outlines.places(geometries[arm])[link]  # type: ignore[arg-type]
            cloud = points[arm][link]
            sizes.append(length)
            clouds.append(
                np.stack([_share(cloud[:, 2] - z, length), cloud[:, 0] - x, cloud[:, 1]], 1)
            )
        rows = _frusta(np.concatenate(clouds), float(np.mean(sizes)), count, link)
        links.append("[" + ",\n".join(rows) + "]")
    lengths = f'"a1_mm": {a1 * 1e3:.1f}, "a2_mm": {a2 * 1e3:.1f}'
    every = ",\n".join(links)
    return f'"{name}": {{"arms": {json.dumps(list(own))}, {lengths}, "links": [\n{every}]}}'


def _share(z: FloatArray, length: float) -> FloatArray:
    """Return heights as metres below the link, 0 to ``_BETWEEN`` along it, metres beyond."""
    along = _BETWEEN * z / max(length, 1e-9)
    return np.where(z < 0.0, z, np.where(z <= length, along, _BETWEEN + z - length))


def _frusta(cloud: FloatArray, length: float, count: int, link: int) -> list[str]:
    """Return the rows of the frusta that enclose a cloud (n, 3) of share, x, y."""
    is_last = link == len(FRUSTA) - 1
    height = _height(cloud[:, 0], length)
    top = min(height.max(), length) if is_last else height.max()
    borders = np.linspace(height.min(), top, _SLICES + 1)
    reach = np.full((_SLICES, 8), -np.inf)
    projected = cloud[:, 1:] @ outlines.DIRECTIONS.T
    for k, (low, high) in enumerate(pairwise(borders)):
        inside = (height >= low - 0.5 * _STEP) & (height <= high + 0.5 * _STEP)
        if inside.any():
            reach[k] = projected[inside].max(axis=0) + SPARE
    rows = []
    cuts = _best_cuts(reach, borders, count)
    for a, b in pairwise(cuts):
        ends = _closest(reach[a:b])
        if np.isfinite(ends).all():
            ends = _enclosing(reach[a:b], ends)
            low = _end(borders[a] - (SPARE if a == 0 else 0.0), length)
            high = _end(borders[b] + (SPARE if b == _SLICES and not is_last else 0.0), length)
            high = [1.0, 0.0] if is_last and b == _SLICES else high
            mm = np.ceil(1e3 * ends).astype(int).tolist()
            rows.append(json.dumps([low, high, *mm], separators=(",", ":")))
    return rows


def _closest(reach: FloatArray) -> FloatArray:
    """Return the reach (2, 8) at both ends of slices (n, 8) that lies closest around them.

    In each direction it is the line over all slices that is lowest in the middle, of ``_SLOPES``.
    """
    level, place = np.repeat(reach, 2, axis=0), _places(len(reach))
    widest = level.max(axis=0)
    if not np.isfinite(widest).all():
        return np.full((2, 8), -np.inf)
    narrowest = np.where(np.isfinite(level), level, np.inf).min(axis=0)
    slope = _SLOPES[:, None] * (widest - narrowest)
    start = (level - slope[:, None] * place[:, None]).max(axis=1)
    best = (start + 0.5 * slope).argmin(axis=0), np.arange(8)
    return np.stack([start[best], (start + slope)[best]])


def _places(count: int) -> FloatArray:
    """Return where ``count`` slices begin and end (2 count,), 0 to 1."""
    return np.repeat(np.arange(count + 1) / count, 2)[1:-1]


def _enclosing(reach: FloatArray, ends: FloatArray) -> FloatArray:
    """Return the ends widened until all slices lie within the frustum.

    A side that the others cut off at one end counts there for less than its reach.
    """
    level, place = np.repeat(reach, 2, axis=0), _places(len(reach))[:, None]
    for _ in range(_ROUNDS):
        low, high = ((outlines.octagon(end) @ outlines.DIRECTIONS.T).max(axis=0) for end in ends)
        short = (level - (1.0 - place) * low - place * high).max(axis=0)
        if short.max() <= 1e-6:
            break
        ends = ends + np.maximum(short, 0.0)
    return ends


def _height(share: FloatArray, length: float) -> FloatArray:
    along = share * length / _BETWEEN
    return np.where(share < 0, share, np.where(share <= _BETWEEN, along, length + share - _BETWEEN))


def _end(z: float, length: float) -> list[float]:
    if z < 0.0:
        return [0.0, round(1e3 * z, 1)]
    return [round(z / length, 4), 0.0] if z <= length else [1.0, round(1e3 * (z - length), 1)]


def _best_cuts(reach: FloatArray, borders: FloatArray, count: int) -> list[int]:
    """Return the borders between which ``count`` frusta have the least volume in all."""
    n = len(reach)
    cost = np.full((n, n + 1), np.inf)
    for a in range(n):
        for b in range(a + 1, n + 1):
            low, high = _closest(reach[a:b])
            areas = _area(np.stack([low, 0.5 * (low + high), high]))
            cost[a, b] = areas @ [1.0, 4.0, 1.0] / 6.0 * (borders[b] - borders[a])
    best, before = np.full((count + 1, n + 1), np.inf), np.zeros((count + 1, n + 1), int)
    best[0, 0] = 0.0
    for used in range(1, count + 1):
        whole = best[used - 1, :n, None] + cost
        before[used], best[used] = whole.argmin(axis=0), whole.min(axis=0)
    cuts, used = [n], int(best[:, n].argmin())
    while cuts[-1] > 0:
        cuts.append(int(before[used, cuts[-1]]))
        used -= 1
    return cuts[::-1]


def _area(reach: FloatArray) -> FloatArray:
    """Return the area (n,) of octagons, 0 where nothing is."""
    s = np.where(np.isfinite(reach), reach, 0.0)
    corners = [s[:, j] + s[:, (j + 2) % 8] - np.sqrt(2.0) * s[:, j + 1] for j in (0, 2, 4, 6)]
    cut = sum(np.maximum(corner, 0.0) ** 2 / 2.0 for corner in corners)
    return np.asarray((s[:, 0] + s[:, 4]) * (s[:, 2] + s[:, 6]) - cut)


def write(packages: Path, arms: Mapping[str, Triangles]) -> None:
    """Write the outline file of the product."""
    points = {name: upright_points(name, links) for name, links in arms.items()}
    Path(outlines.__file__).with_name("outlines.json").write_text(outlines_text(points))
    print(f"{len(arms)} arms of {packages}")
