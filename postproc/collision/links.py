"""Solids of the robot links where the cell brings none of its own.

A built-in arm gets its outline or that of its size class (``outlines``), which encloses the real
bodies, or where the cell asks for it the convex hull of each link's outline, which is one solid and
thicker. A URDF arm gets its own collision geometry, else prisms between its joints.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry, Robot, RobotSolids
from postproc.collision.arm import Arm
from postproc.collision.mesh import Mesh, convex_hull, joined, loft, ring
from postproc.collision.outlines import upright_solids
from postproc.geometry import across, inverse, transform

_SIDES = 24


@lru_cache(maxsize=8)
def default_links(robot: Robot, arm: Arm) -> tuple[Mesh, ...]:
    """Return the solids of links 0..6 of a built-in arm, each in the frame of its link."""
    geometry = robot.geometry
    if not isinstance(geometry, OpwGeometry):
        return tuple(_prisms(arm))
    q = geometry.signs * geometry.offsets  # the posture in which the arm stands upright
    T_link_robroot = inverse(arm.link_frames(q))
    links = [joined(solids) for solids in upright_solids(robot, geometry)]
    if robot.solids is RobotSolids.SIMPLE:
        links = [convex_hull(link.vertices) for link in links]
    return tuple(link.moved(T) for link, T in zip(links, T_link_robroot, strict=True))


_SHARES = (0.10, 0.09, 0.065, 0.06, 0.05, 0.04, 0.035)
"""Radius of links 0..6 of an arm of unknown shape, as a share of its reach; assumed."""


def _prisms(arm: Arm) -> list[Mesh]:
    """Return prisms along the line from each joint to the next, rounded up at both ends."""
    q = np.zeros(6)
    T_robroot_link = arm.link_frames(q)
    ends = np.vstack([T_robroot_link[:, :3, 3], arm.fk(q)[:3, 3]])
    steps = np.diff(ends, axis=0)
    reach = float(np.linalg.norm(steps[1:], axis=1).sum())
    return [
        _prism(ends[i], steps[i], share * reach, is_last=i == 6).moved(inverse(T_robroot_link[i]))
        for i, share in enumerate(_SHARES)
    ]


def _prism(start: FloatArray, step: FloatArray, radius: float, is_last: bool) -> Mesh:
    """Return a prism with bevelled ends around the line from ``start`` along ``step`` [m].

    It reaches one radius past both ends, but not past the flange, where the tool begins.
    """
    length = float(np.linalg.norm(step))
    over = 0.0 if is_last and length > 0.0 else radius
    z = step / length if length > 0.0 else np.array([0.0, 0.0, 1.0])
    x, y = across(z)
    wide, narrow = ring(radius, _SIDES), ring(0.5 * radius, _SIDES)
    body = loft(
        [narrow, wide, wide, narrow], [-radius, 0.0, max(length, 1e-6), length + over + 1e-6]
    )
    return body.moved(transform(np.stack([x, y, z], axis=1), start))
