"""Outlines of arms by size class: what the links of an arm look like, measured on real ones.

``outlines.json`` holds each link of an arm that stands straight up as a stack of frusta with eight
sides, which enclose the bodies of all arms that were measured. They follow the lengths of the arm:
their ends are shares of the link's length and distances beyond it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, partial
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import LENGTHS, OpwGeometry, Robot, load_robot
from postproc.collision.mesh import Mesh, loft, welded
from postproc.records import dataclass
from postproc.units import MM

_FILE = Path(__file__).resolve().parent / "outlines.json"
_ANGLES = np.arange(8) * (np.pi / 4.0)
DIRECTIONS = np.stack([np.cos(_ANGLES), np.sin(_ANGLES)], axis=1)
_THINNEST = 1e-4
_PARALLEL = 1e-9
_SAME_LENGTH = 1e-4
_SMALL_REACH, _MEDIUM_REACH, _LONG_REACH = 1.25, 2.0, 2.4
_LIGHT, _HEAVY, _VERY_HEAVY = 20.0, 80.0, 300.0
_LOW_SHOULDER = 0.62
"""Height of axis 2 [m] below which a large arm is one that stands on a shelf."""
_MOST_PAYLOAD = {
    "agilus": 16.0, "cybertech": 20.0, "iontec": 70.0, "quantec": 300.0, "quantec_2": 300.0,
    "quantec_k": 300.0, "fortec": 600.0, "fortec_2": 800.0,
}  # fmt: skip
"""Payload [kg] of the strongest arm of a class over a size; a stronger one is thicker."""


@dataclass(frozen=True, slots=True)
class Segment:
    """A frustum: ends as (share of the length, distance beyond it [m]), reach (2, 8) [m] there."""

    low: tuple[float, float]
    high: tuple[float, float]
    reach: FloatArray


@dataclass(frozen=True, slots=True)
class Outline:
    """Links 0..6 of a size class, or of ``arms``; ``a1``, ``a2`` [m]: of what was measured."""

    arms: frozenset[str]
    a1: float
    a2: float
    links: tuple[tuple[Segment, ...], ...]


def upright_solids(
    robot: Robot, g: OpwGeometry, known: Mapping[str, Outline] | None = None
) -> list[list[Mesh]]:
    """Return the solids of links 0..6 in robroot with the arm standing straight up.

    Args:
        robot: the arm.
        g: its lengths.
        known: outlines by name; those of the product where not given.
    """
    known = _outlines() if known is None else known
    name = _class_of(robot, g, known)
    outline = known[name]
    most = _MOST_PAYLOAD.get(name, np.inf)
    scale = float((robot.payload / most) ** (1.0 / 3.0)) if robot.payload > most else 1.0
    forwards = np.maximum(DIRECTIONS[:, 0], 0.0) * max(g.a1 - outline.a1, 0.0)
    aside = np.maximum(DIRECTIONS[:, 0] * (g.a2 - outline.a2), 0.0)
    more = {1: forwards, 3: aside}
    return [
        [
            frustum
            for segment in segments
            if (frustum := _frustum(segment, place, scale, more.get(link, 0.0), g.b)) is not None
        ]
        for link, (segments, place) in enumerate(zip(outline.links, places(g), strict=True))
    ]


def is_measured(robot: Robot) -> bool:
    """Return whether the outline of an arm is of its own body or of one of the same castings."""
    geometry, known = robot.geometry, _outlines()
    if not isinstance(geometry, OpwGeometry):
        return False
    return bool(known[_class_of(robot, geometry, known)].arms)


def places(g: OpwGeometry) -> list[tuple[float, float, float]]:
    """Return for links 0..6 of an upright arm: height of the lower end, length, x of the axis."""
    elbow = g.c1 + g.c2
    wrist, x_wrist = elbow + g.c3, g.a1 + g.a2
    return [
        (0.0, g.c1, 0.0),
        (0.0, g.c1, 0.0),
        (g.c1, g.c2, g.a1),
        (elbow, g.c3, g.a1),
        (elbow, g.c3, x_wrist),
        (wrist, g.c4, x_wrist),
        (wrist, g.c4, x_wrist),
    ]


def _frustum(
    segment: Segment,
    place: tuple[float, float, float],
    scale: float,
    more: FloatArray | float,
    y: float,
) -> Mesh | None:
    z, length, x = place
    (share, beyond), (share_high, beyond_high) = segment.low, segment.high
    low, high = z + share * length + scale * beyond, z + share_high * length + scale * beyond_high
    sections = [octagon(scale * reach + more) + np.array([x, y]) for reach in segment.reach]
    if high - low < _THINNEST or min(np.ptp(section) for section in sections) < _THINNEST:
        return None
    return welded(loft(sections, [low, high]).corners)


def octagon(reach: FloatArray) -> FloatArray:
    """Return the corners (8, 2) of what lies within the reach (8,) in eight directions.

    Each corner is that of two neighbouring sides; sides that the others cut off have no length.
    """
    across = np.stack([-DIRECTIONS[:, 1], DIRECTIONS[:, 0]], axis=1)
    steps, gaps = DIRECTIONS @ across.T, reach[:, None] - DIRECTIONS @ DIRECTIONS.T * reach
    with np.errstate(divide="ignore", invalid="ignore"):
        along = gaps / steps  # how far along side i (columns) it meets side j
    start = np.where(steps < -_PARALLEL, along, -np.inf).max(axis=0)
    end = np.where(steps > _PARALLEL, along, np.inf).min(axis=0)
    sides = np.flatnonzero(start <= end)
    ends = np.concatenate([start, end])[np.concatenate([sides, sides + len(start)])]
    sides = np.tile(sides, 2)
    corners = reach[sides, None] * DIRECTIONS[sides] + ends[:, None] * across[sides]
    tight = (corners @ DIRECTIONS.T).max(axis=0, initial=-np.inf)
    far = (np.roll(tight, -1) - tight * np.sqrt(0.5)) / np.sqrt(0.5)
    corners = tight[:, None] * DIRECTIONS + far[:, None] * across
    for side in (*range(8), *range(8)):  # one without length has one corner, to the last digit
        if np.abs(corners[side] - corners[side - 1]).max() < _PARALLEL:
            corners[side] = corners[side - 1]
    return np.asarray(corners)


def _class_of(robot: Robot, g: OpwGeometry, known: Mapping[str, Outline]) -> str:
    """Return the size class of an arm: its own where it was measured, else the nearest.

    An arm with all lengths of a measured one that carries no more is made of the same castings.
    """
    for name, outline in known.items():
        if robot.name in outline.arms:
            return name
    for name, outline in known.items():
        if any(map(partial(_is_alike, robot, g), sorted(outline.arms))):
            return name
    reach = g.a1 + g.c2 + float(np.hypot(g.c3, g.a2))
    payload = robot.payload
    if np.isnan(payload):
        payload = _LIGHT if reach < _MEDIUM_REACH else _HEAVY if reach < _LONG_REACH else 2 * _HEAVY
    if payload >= _VERY_HEAVY and g.c1 > _LOW_SHOULDER:
        return "fortec" if g.a2 > 0.0 else "fortec_2"
    if payload > _HEAVY:
        return "quantec_k" if g.c1 < _LOW_SHOULDER else "quantec" if g.a2 > 0.0 else "quantec_2"
    if payload > _LIGHT:
        return "iontec"
    return "agilus" if reach < _SMALL_REACH else "cybertech"


def _is_alike(robot: Robot, g: OpwGeometry, name: str) -> bool:
    """Return whether an arm has the lengths of a measured one and carries no more than it."""
    measured = load_robot(name)
    own = [getattr(g, key) for key in LENGTHS]
    theirs = [getattr(measured.geometry, key) for key in LENGTHS]
    is_same = bool(np.abs(np.subtract(own, theirs)).max() <= _SAME_LENGTH)
    return is_same and robot.payload <= measured.payload


@cache
def _outlines() -> dict[str, Outline]:
    return read_outlines(_FILE.read_text(encoding="utf-8"))


def read_outlines(text: str) -> dict[str, Outline]:
    """Return the outlines of a file by name."""
    return {
        name: Outline(
            frozenset(table["arms"]),
            table["a1_mm"] * MM,
            table["a2_mm"] * MM,
            tuple(tuple(map(_segment, link)) for link in table["links"]),
        )
        for name, table in json.loads(text)["outlines"].items()
    }


def _segment(row: list[list[float]]) -> Segment:
    (share, beyond), (share_high, beyond_high), *reach = row
    ends = (share, beyond * MM), (share_high, beyond_high * MM)
    return Segment(*ends, np.array(reach, dtype=np.float64) * MM)
