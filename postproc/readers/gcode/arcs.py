"""G2 and G3 to arcs of the model: from the centre or the radius, in the plane that holds."""

from __future__ import annotations

from math import copysign, hypot, sqrt, tau

import numpy as np

from postproc.arrays import FloatArray
from postproc.geometry import angle_about
from postproc.readers.base import FULL_CIRCLE_GAP, radius_gap
from postproc.readers.text import Faults
from postproc.records import dataclass
from postproc.units import MM

PLANES = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
"""First and second axis of a plane, and its normal: counterclockwise leads from first to second."""

ArcRow = tuple[FloatArray, FloatArray, float, float]
"""A row of ``Arcs``: centre (3,) and unit normal (3,), radius [m], sweep [rad]."""


@dataclass(frozen=True, slots=True)
class ArcWords:
    """What a block says of its arc: centre (3,) [m], NaN where it says nothing, and ``radius``."""

    plane: str
    clockwise: bool
    centre: FloatArray
    radius: float
    turns: int
    line: int


def arc_of(words: ArcWords, start: FloatArray, end: FloatArray, faults: Faults) -> ArcRow:
    """Return the arc from start to end (3,) [m]; GCD011 where the words give none."""
    first, second, third = PLANES[words.plane]
    normal = np.zeros(3)
    normal[third] = -1.0 if words.clockwise else 1.0
    if np.isnan(words.radius):
        centre = words.centre.copy()
    else:
        centre = start.copy()
        centre[[first, second]] = _by_radius(words, start, end, faults)
    centre[third] = start[third]
    if np.isnan(centre).any():
        raise faults.error("GCD011", "an arc without a centre or radius", words.line)
    to_start, to_end = start - centre, end - centre
    to_end[third] = 0.0
    radius, other = hypot(*to_start), hypot(*to_end)
    if abs(radius - other) > radius_gap(radius) or radius < FULL_CIRCLE_GAP:
        text = f"an arc of radius {radius / MM:.4f} mm at its start and {other / MM:.4f} at its end"
        raise faults.error("GCD011", text + ", expected one circle", words.line)
    if hypot(*(to_end - to_start)) <= FULL_CIRCLE_GAP:
        sweep = tau
    else:
        sweep = float(angle_about(normal[None], to_start[None], to_end[None])[0])
    return centre, normal, radius, sweep + tau * (words.turns - 1)


def _by_radius(words: ArcWords, start: FloatArray, end: FloatArray, faults: Faults) -> FloatArray:
    """Return the centre (2,) in the plane: of the shorter arc, of the longer one for R below 0."""
    first, second, _ = PLANES[words.plane]
    chord = np.array([end[first] - start[first], end[second] - start[second]])
    length = hypot(*chord)
    if length <= FULL_CIRCLE_GAP:
        raise faults.error("GCD011", "a full circle by its radius, expected its centre", words.line)
    rest = words.radius**2 - 0.25 * length**2
    if rest < -radius_gap(abs(words.radius)) * abs(words.radius):
        text = (
            f"an arc of radius {abs(words.radius) / MM:g} mm whose ends lie {length / MM:g} apart"
        )
        raise faults.error("GCD011", text, words.line)
    side = copysign(1.0, words.radius) * (-1.0 if words.clockwise else 1.0)
    across = np.array([-chord[1], chord[0]]) / length
    middle = np.array([start[first], start[second]]) + 0.5 * chord
    centre: FloatArray = middle + side * sqrt(max(rest, 0.0)) * across
    return centre
