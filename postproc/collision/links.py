"""Solids of the robot links where the cell brings none of its own.

A built-in arm gets simple closed bodies made from its dimensions and the cross sections of its
size class (estimated from pictures and overall dimensions: no maker's geometry), or where the cell
asks for it the outline of its size class (``outlines``), which encloses the real bodies. A URDF arm
gets its own collision geometry, else prisms between its joints.
"""

from __future__ import annotations

from dataclasses import asdict
from functools import lru_cache
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry, Robot, RobotSolids
from postproc.collision.arm import Arm
from postproc.collision.mesh import Mesh, joined, loft, ring
from postproc.collision.outlines import upright_solids
from postproc.geometry import across, inverse, transform
from postproc.records import dataclass

_SIDES = 24


@dataclass(frozen=True, slots=True)
class _Sections:
    """Cross sections of a size class [m], for an arm of ``reach`` [m]; assumed.

    ``arm_y``, ``elbow_y``: the upper arm and the elbow stand side by side, not in one plane.
    ``back``: how far the drives of the hand stand behind axis 3.
    """

    reach: float
    base: float
    column: float
    shoulder: float
    arm_depth: float
    arm_y: tuple[float, float]
    elbow: float
    elbow_y: tuple[float, float]
    back: float
    forearm: float
    wrist: float
    hand: float
    flange: float


_SMALL = _Sections(
    reach=0.90, base=0.14, column=0.09, shoulder=0.085, arm_depth=0.055, arm_y=(0.02, 0.13),
    elbow=0.075, elbow_y=(-0.09, 0.02), back=0.12, forearm=0.065, wrist=0.055, hand=0.042,
    flange=0.035,
)  # fmt: skip
_MEDIUM = _Sections(
    reach=2.70, base=0.42, column=0.33, shoulder=0.20, arm_depth=0.14, arm_y=(0.05, 0.27),
    elbow=0.18, elbow_y=(-0.24, 0.05), back=0.42, forearm=0.145, wrist=0.12, hand=0.10,
    flange=0.085,
)  # fmt: skip
_HEAVY = _Sections(
    reach=2.83, base=0.50, column=0.40, shoulder=0.24, arm_depth=0.16, arm_y=(0.06, 0.32),
    elbow=0.22, elbow_y=(-0.30, 0.06), back=0.50, forearm=0.17, wrist=0.15, hand=0.125,
    flange=0.11,
)  # fmt: skip
_SMALL_REACH = 1.4
_HEAVY_PAYLOAD = 300.0


@lru_cache(maxsize=8)
def default_links(robot: Robot, arm: Arm) -> tuple[Mesh, ...]:
    """Return the solids of links 0..6 of a built-in arm, each in the frame of its link."""
    geometry = robot.geometry
    if not isinstance(geometry, OpwGeometry):
        return tuple(_prisms(arm))
    q = geometry.signs * geometry.offsets  # the posture in which the arm stands upright
    T_robroot_link = arm.link_frames(q)
    T_link_robroot = inverse(T_robroot_link)
    if robot.solids is RobotSolids.OUTLINE:
        solids = upright_solids(robot, geometry)
    else:
        solids = _upright(geometry, _scaled_sections(robot, geometry))
    return tuple(joined(s).moved(T) for s, T in zip(solids, T_link_robroot, strict=True))


def _scaled_sections(robot: Robot, geometry: OpwGeometry) -> _Sections:
    """Return the cross sections of the size class, scaled down to a shorter reach."""
    reach = geometry.a1 + geometry.c2 + float(np.hypot(geometry.a2, geometry.c3))
    if reach < _SMALL_REACH:
        sections = _SMALL
    else:
        sections = _HEAVY if robot.payload >= _HEAVY_PAYLOAD else _MEDIUM
    scale = min(1.0, reach / sections.reach)
    sizes: dict[str, Any] = {
        name: (scale * value[0], scale * value[1]) if isinstance(value, tuple) else scale * value
        for name, value in asdict(sections).items()
    }
    return _Sections(**sizes)


def _upright(g: OpwGeometry, s: _Sections) -> list[list[Mesh]]:
    """Return the solids of links 0..6 in robroot with the arm standing straight up."""
    shoulder, elbow = g.c1, g.c1 + g.c2
    wrist, flange = elbow + g.c3, elbow + g.c3 + g.c4
    x_arm, x_wrist, y = g.a1, g.a1 + g.a2, g.b
    turntable = shoulder - min(1.75 * s.shoulder, 0.45 * g.c1)
    split = elbow + 0.6 * g.c3  # where axis 4 parts the forearm
    hand_end = wrist + 0.62 * g.c4
    return [
        [
            _cone((0.0, 0.0), (0.0, 0.5 * turntable), (s.base, 0.9 * s.base)),
            _cone((0.0, 0.0), (0.5 * turntable, turntable), (0.9 * s.base, s.column)),
        ],
        [
            _cone((0.0, 0.0), (turntable, shoulder), (s.column, 0.9 * s.column)),
            _block(
                (-0.5 * s.shoulder, g.a1 + 0.6 * s.shoulder),
                (-0.95 * s.shoulder, 0.95 * s.shoulder),
                (shoulder - s.shoulder, shoulder + 0.8 * s.shoulder),
            ),
        ],
        [
            _block(
                (x_arm - s.arm_depth, x_arm + s.arm_depth),
                s.arm_y,
                (shoulder - 1.2 * s.arm_depth, elbow + 1.2 * s.arm_depth),
            )
        ],
        [
            _block(
                (x_arm - s.elbow, x_arm + s.elbow),
                s.elbow_y,
                (elbow - s.back, elbow + s.elbow),
            ),
            _cone((x_wrist, y), (elbow, split), (1.15 * s.forearm, s.forearm)),
        ],
        [_cone((x_wrist, y), (split, wrist), (s.forearm, s.wrist))],
        [_cone((x_wrist, y), (wrist - 0.8 * s.hand, hand_end), (s.hand, s.hand))],
        [_cone((x_wrist, y), (hand_end, flange), (0.95 * s.flange, s.flange))],
    ]


def _cone(centre: tuple[float, float], z: tuple[float, float], radius: tuple[float, float]) -> Mesh:
    return loft([ring(r, _SIDES) + np.array(centre) for r in radius], list(z))


def _block(x: tuple[float, float], y: tuple[float, float], z: tuple[float, float]) -> Mesh:
    section = np.array([[x[0], y[0]], [x[1], y[0]], [x[1], y[1]], [x[0], y[1]]])
    return loft([section, section], list(z))


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
