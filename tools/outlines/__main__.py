"""``measure|table|held-out|meeting PACKAGES [MORE]``, ``picture PACKAGES FILE.png NAME...``."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.spatial import ConvexHull

from postproc.arrays import FloatArray
from postproc.cell import LENGTHS, OpwGeometry, load_robot
from postproc.collision.outlines import Outline, read_outlines, upright_solids
from postproc.geometry import apply
from postproc.kinematics import build
from tools.outlines import measure, meeting, picture
from tools.outlines.meshes import Triangles, real_arms

_POSES = 37
"""So many poses of each of two joints are asked whether links meet."""


def stands_out(
    name: str, links: Triangles, known: Mapping[str, Outline] | None = None
) -> tuple[list[float], list[float]]:
    """Return per link how far [mm] the real body stands out of ours, and our volume by its hull's.

    A point's distance is the smallest over the prisms of the largest over their sides. The last
    link ends at the flange: what stands beyond is the tool's place.
    """
    robot = load_robot(name)
    geometry = robot.geometry
    assert isinstance(geometry, OpwGeometry)  # noqa: S101 - every built-in robot has one
    frames = build(robot).link_frames(geometry.signs * geometry.offsets)
    ours = upright_solids(robot, geometry, known)
    flange = sum((geometry.c1, geometry.c2, geometry.c3, geometry.c4))
    out, volume = [], []
    for T, corners, solids in zip(frames, links, ours, strict=True):
        points = apply(T, corners.reshape(-1, 3))
        points = points[points[:, 2] <= flange + 1e-9]
        hulls = [ConvexHull(solid.vertices) for solid in solids]
        far = np.min([_beyond(hull, points) for hull in hulls], axis=0)
        out.append(1e3 * max(float(far.max()), 0.0))
        volume.append(sum(hull.volume for hull in hulls) / max(ConvexHull(points).volume, 1e-6))
    return out, volume


def _beyond(hull: ConvexHull, points: FloatArray) -> FloatArray:
    return np.asarray((points @ hull.equations[:, :3].T + hull.equations[:, 3]).max(axis=1))


def held_out(
    arms: Mapping[str, Triangles], others: Mapping[str, Triangles]
) -> Iterator[tuple[str, list[float], list[float]]]:
    """Yield name, distances and volumes of arms against outlines made without them.

    An arm of the sizes is judged by the sizes of all others but those with its lengths; an arm of
    another package by all sizes, which were measured without it.
    """
    lengths = {name: load_robot(name).geometry for name in arms}
    cloud = {name: measure.upright_points(name, links) for name, links in arms.items()}
    sizes = read_outlines(measure.outlines_text(cloud, with_arms=False))
    for name in sorted(set(others) - set(arms)):
        yield f"{name} *", *stands_out(name, others[name], sizes)
    for name, links in arms.items():
        alike = {other for other in arms if _alike(lengths[name], lengths[other])}
        known, is_alone = dict(sizes), False
        for size, names in measure.SIZES.items():
            members = {f"kuka_{member}" for member in names} & set(arms)
            if members & alike:  # the other sizes stay as they are
                del known[size]
                rest = {other: cloud[other] for other in sorted(members - alike)}
                is_alone |= not rest
                known |= read_outlines(measure.outlines_text(rest, with_arms=False))
        if is_alone:
            print(f"{name}: left out: no other arm of its size was measured", file=sys.stderr)
        else:
            yield name, *stands_out(name, links, known)


def _alike(a: object, b: object) -> bool:
    return all(abs(getattr(a, key) - getattr(b, key)) < 1e-4 for key in LENGTHS)


def _others(folders: Sequence[str]) -> dict[str, Triangles]:
    return {name: links for folder in folders for name, links in real_arms(Path(folder))}


def main(command: str, packages: str, *more: str) -> None:
    """Measure the outlines, print how well they enclose the real bodies, or draw both."""
    arms = dict(real_arms(Path(packages)))
    if command == "picture":
        picture.draw(arms, more[1:], Path(more[0]))
        return
    others = _others(more)
    if command == "measure":
        measure.write(Path(packages), {**others, **arms})
        return
    if command == "meeting":
        for line in meeting.table({**others, **arms}, _POSES):
            print(line, flush=True)
        return
    print(f"{'mm outside of links 0..6':<42} | our volume by that of the hull of the real link")
    rows = ((name, *stands_out(name, links)) for name, links in {**others, **arms}.items())
    if command == "held-out":
        rows = held_out(arms, others)
    for name, out, volume in rows:
        far = " ".join(f"{value:3.0f}" for value in out)
        print(f"{name:<28}{far} | {' '.join(f'{value:5.2f}' for value in volume)}", flush=True)


main(*sys.argv[1:])
