"""What the planner does to the program: corners that it rounds, feeds that it does not keep.

Stage ``program``: programmed path to command. Nothing here needs a clock: rounding is a distance,
the feed a speed. The proof is on corners and lines that were not fitted.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.model import ModelFile
from postproc.records import dataclass
from postproc.trace.program import Corner, Match, corners_of
from postproc.trace.scene import Scene
from postproc.trace.signals import memory
from postproc.units import MM

PLANNER = {
    "corner_rounding": (
        "the planner cuts corners",
        "lower the approximation at the lines that matter, or split them off",
    ),
    "feed_deviation": (
        "lines are not run at the programmed feed",
        "check override, planner time per block and axis speeds",
    ),
}
"""Title and remedy of what the planner does."""
FORMS = ("parabola", "arc")
SHORTEST, LONGEST = 0.05 * MM, 100.0 * MM
STEPS = 120
"""Distances that are tried, each three percent above the one before; then refined."""
LEAST = 2e-3 * MM
"""A deviation that no program's decimals show: below it nothing is rounded."""
SLACK = 0.01
"""Feed that is kept: one percent."""
PLATEAU = 0.08
"""Least time [s] at one speed of a line whose feed is judged."""
LEVEL = 0.02
"""Largest change of the speed within 40 ms, and from the line's highest, that is one speed."""
SCATTERS = 0.03
"""Largest scatter of the lines' ratios of a deviation that is one factor."""


@dataclass(frozen=True, slots=True, eq=False)
class Planned:
    """An effect of the planner.

    value: (n, 3) [m] of it on the command's place, on all rows; withheld: the same from the other
    corners or lines; scale: (n, 3) [m] that it is judged against.
    """

    name: str
    probability: float
    parameters: dict[str, Any]
    value: FloatArray
    withheld: FloatArray
    scale: FloatArray
    is_place: bool


def asked(scene: Scene, match: Match) -> list[Planned]:
    """Return what can be told of the planner."""
    return [p for p in (rounding(scene, match), feed(scene, match)) if p is not None]


def rounding(scene: Scene, match: Match) -> Planned | None:
    """Return how far before its corners the command leaves the program; None without corners."""
    corners = corners_of(match.program)
    passages = [p for c in corners for p in _passages(scene, match, c)]
    if not passages:
        return None
    fits = []
    for form in FORMS:
        distance = _distance(passages, form)
        fits.append((_left(passages, form, distance), distance, form))
    left, distance, form = min(fits)
    total = sum(float(np.sum(p.off**2)) for p in passages)
    rows = sum(len(p.off) for p in passages)
    rest = np.concatenate([p.off - p.model(form, distance) for p in passages])
    count = rows / memory(rest, [slice(0, len(rest))])
    top = max(float(p.off.max()) for p in passages)
    gain = 0.5 * count * np.log(max(total, 1e-30) / max(left, (0.1 * LEAST) ** 2 * rows))
    odds = gain - np.log(max(count, 2.0)) + np.log(0.1)
    probability = 1.0 / (1.0 + np.exp(-np.clip(odds, -50.0, 50.0))) if top > LEAST else 0.0
    value, withheld = (np.zeros_like(match.off) for _ in range(2))
    halves = [_distance(passages[k::2], form) if passages[k::2] else distance for k in (1, 0)]
    for number, passage in enumerate(passages):
        passage.put(value, form, distance)
        passage.put(withheld, form, halves[number % 2])
    # of the corner itself from the path, as ISO 9283 has the round-off error
    deviations = [_miss(c.half, form) * min(distance, c.reach) for c in corners]
    apo = [match.program.cdis[c.motion] for c in corners]
    parameters = {
        "cdis_mm": round(distance / MM, 4),
        "deviation_mm": round(float(np.median(deviations)) / MM, 5),
        "form": form,
        "radius_mm": round(
            float(np.median([_radius(c.half, form) * distance for c in corners])) / MM, 4
        ),
        "apo_cdis_mm": round(float(np.median(apo)) / MM, 4),
        "corners": len(corners),
    }
    return Planned(
        "corner_rounding", float(probability), parameters, value, withheld, match.off, True
    )


def _radius(half: float, form: str) -> float:
    """Return the smallest radius of a corner that is left one metre before it."""
    if form == "arc":
        return float(1.0 / np.tan(half))
    return float(np.cos(half) ** 2 / np.sin(half))


def _miss(half: float, form: str) -> float:
    """Return the distance of a corner from the path that leaves it one metre before."""
    way, off = _shape(half, form)
    return float(np.hypot(way[0], off[0]))


class _Passage:
    """One run past one corner: rows, way from the corner (k,) [m], how far inside (k,) [m]."""

    def __init__(self, corner: Corner, rows: AnyIntArray, way: FloatArray, off: FloatArray) -> None:
        self.corner, self.rows, self.way = corner, rows, way
        self.off = np.linalg.norm(off, axis=1)

    def model(self, form: str, distance: float) -> FloatArray:
        """Return how far inside (k,) [m] a corner left at ``distance`` lies."""
        d = min(distance, self.corner.reach)
        way, off = _shape(self.corner.half, form)
        return np.asarray(np.interp(np.abs(self.way), d * way, d * off, right=0.0))

    def put(self, value: FloatArray, form: str, distance: float) -> None:
        """Write the model into rows of (n, 3): inside, square to the leg."""
        u, w = self.corner.before, self.corner.after
        sides = [w - (w @ u) * u, -(u - (u @ w) * w)]
        unit = [s / max(float(np.linalg.norm(s)), 1e-12) for s in sides]
        inside = np.where(self.way[:, None] < 0.0, unit[0], unit[1])
        value[self.rows] = self.model(form, distance)[:, None] * inside


@lru_cache(maxsize=256)
def _shape(half: float, form: str) -> tuple[FloatArray, FloatArray]:
    """Return way from the corner (k,), rising, and distance inside (k,) of a corner left at 1."""
    if form == "parabola":
        # on the first leg: place -(1-t)^2 u + t^2 w for t up to the middle
        t = np.linspace(0.5, 0.0, 60)
        along = (1.0 - t) ** 2 - t**2 * np.cos(2.0 * half)
        return along, t**2 * np.sin(2.0 * half)
    radius = 1.0 / np.tan(half)
    angle = np.linspace(half, 0.0, 60)
    return 1.0 - radius * np.sin(angle), radius * (1.0 - np.cos(angle))


def _passages(scene: Scene, match: Match, corner: Corner) -> list[_Passage]:
    found = []
    from_corner = match.way - corner.way
    for part in scene.stretches:
        near = np.abs(from_corner[part]) < corner.reach
        rows = np.flatnonzero(near) + part.start
        if len(rows) > 3:
            found.append(_Passage(corner, rows, from_corner[rows], match.off[rows]))
    return found


def _left(passages: list[_Passage], form: str, distance: float) -> float:
    return sum(float(np.sum((p.off - p.model(form, distance)) ** 2)) for p in passages)


def _distance(passages: list[_Passage], form: str) -> float:
    """Return the distance [m] that leaves least."""
    low, high = SHORTEST, LONGEST
    best = low
    for steps in (STEPS, STEPS // 4):
        tried = np.geomspace(low, high, steps)
        left = [_left(passages, form, float(d)) for d in tried]
        at = int(np.argmin(left))
        best = float(tried[at])
        low, high = float(tried[max(0, at - 1)]), float(tried[min(steps - 1, at + 1)])
    return best


def feed(scene: Scene, match: Match) -> Planned | None:
    """Return by which factor the lines are run at another feed; None where no line tells."""
    program = match.program
    speed = np.linalg.norm(_rate(scene), axis=1)
    ratios, lines, rows_of = [], [], []
    window = max(2, int(0.04 / max(scene.recording.cycle, 1e-6)))
    for part in scene.stretches:
        motion, v = match.motion[part], speed[part]
        # an arm that stands is at one speed too, of which no line tells anything
        steady = _level(v, window) & scene.phases.moves[part]
        for number in np.unique(motion[motion >= 0]):
            if not program.feed[number] > 0.0:
                continue
            here = motion == number
            # the smallest speed in a rounded corner is one speed too, and no feed
            rows = np.flatnonzero(steady & here & (v > (1.0 - LEVEL) * v[here].max()))
            if len(rows) * scene.recording.cycle < PLATEAU:
                continue
            # a short line is never at speed: its top is no plateau, or its plateau is no top
            ratios.append(float(np.median(v[rows])) / float(program.feed[number]))
            lines.append(int(program.line[number]))
            rows_of.append(rows + part.start)
    if not ratios:
        return None
    values = np.array(ratios)
    factor = float(np.median(values))
    alike = np.abs(values - factor) < SCATTERS * factor
    off = np.abs(values - 1.0) > SLACK
    if not off.any():
        named: BoolArray = np.zeros(len(values), dtype=np.bool_)
    elif abs(factor - 1.0) > SLACK:
        named = alike
    else:
        named = off
        factor = float(np.median(values[off]))
        named &= np.abs(values - factor) < SCATTERS * factor
    probability = float(named.sum() / max(1, off.sum())) if named.any() else 0.0
    probability *= float(named.sum() >= min(2, len(values)))
    value, scale = np.zeros_like(match.off), np.zeros_like(match.off)
    for rows, ratio, mine in zip(rows_of, values, named, strict=True):
        way = (scene.time[rows] - scene.time[rows[0]]) * speed[rows] / ratio
        scale[rows, 0] = way * (ratio - 1.0)
        value[rows, 0] = way * (factor - 1.0) * mine
    hit = [line for line, mine in zip(lines, named, strict=True) if mine]
    parameters = {
        "factor": round(factor if named.any() else 1.0, 5),
        "from_line": min(hit, default=0),
        "to_line": max(hit, default=0),
    }
    return Planned("feed_deviation", probability, parameters, value, value, scale, False)


def _rate(scene: Scene) -> FloatArray:
    parts = [np.gradient(scene.points[p], scene.time[p], axis=0) for p in scene.stretches]
    return np.concatenate(parts)


def _level(speed: FloatArray, window: int) -> BoolArray:
    """Return the rows (n,) about which the speed does not change."""
    level = np.zeros(len(speed), dtype=np.bool_)
    if len(speed) <= 2 * window:
        return level
    change = np.abs(speed[2 * window :] - speed[: -2 * window])
    middle = speed[window:-window]
    level[window:-window] = (change < LEVEL * middle) & (middle > 0.0)
    return level


def less_known(scene: Scene, match: Match, model: ModelFile) -> tuple[Match, tuple[str, ...]]:
    """Return a match without the rounding and the feed that a model file has, and their names."""
    known = []
    if "corner_rounding" in model.effects:
        distance = model.values("corner_rounding", "cdis_mm", within=(0.0, np.inf))
        form = FORMS[model.choice("corner_rounding", "form", FORMS)]
        value = np.zeros_like(match.off)
        for corner in corners_of(match.program):
            for passage in _passages(scene, match, corner):
                passage.put(value, form, float(np.asarray(distance)))
        match = replace(match, off=match.off - value)
        known.append("corner_rounding")
    if "feed_deviation" in model.effects:
        factor = model.values("feed_deviation", "factor", within=(0.0, np.inf))
        feed = match.program.feed * np.asarray(factor)
        match = replace(match, program=replace(match.program, feed=feed))
        known.append("feed_deviation")
    return match, tuple(known)
