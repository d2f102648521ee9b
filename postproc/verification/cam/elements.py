"""Whether the tool follows one line or arc of the CAM file, between two of its points.

The motions from the one point to the other must cover the element from its start to its end,
forward, within the tolerance. In between the tool may leave the element and come back (a
re-entry, another arm pose): it must leave by a joint motion or along the tool axis, return along
the tool axis, and go on from no further than where it left. What is not covered is a gap.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from postproc.arrays import AnyIntArray, FloatArray
from postproc.controller import MotionType
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.paths import Paths
from postproc.records import dataclass
from postproc.units import MM
from postproc.verification.cam.matching import Wanted
from postproc.verification.cam.real import RealPaths

_SHARES = np.array([0.125, 0.25, 0.375, 0.5, 0.625, 0.75, 0.875, 1.0])
_FULL = 2.0 * np.pi
NEAR = 10.0
"""A motion within this many tolerances belongs to the element; its distance is measured."""
_STAYS = 0.01 * MM
"""A joint motion by less [m] stays where the one before ended, as at the head of a sub-program."""
ALONG_AXIS = 0.9999
"""Cosine to the tool axis from which on a motion is one along the axis."""
ON_TOP = 1e-5
"""So near [m] to the height where the feed starts a tool is at it."""


@dataclass(frozen=True, slots=True)
class Line:
    """A straight element."""

    start: FloatArray
    end: FloatArray

    @property
    def length(self) -> float:
        """[m]."""
        return float(np.linalg.norm(self.end - self.start))

    def measure(self, points: FloatArray, _hint: float) -> tuple[FloatArray, FloatArray]:
        """Return distance and way along (n,) [m]."""
        length = self.length
        if length < 1e-12:
            return np.linalg.norm(points - self.start, axis=1), np.zeros(len(points))
        along = (points - self.start) @ (self.end - self.start) / length
        inside = np.clip(along, 0.0, length)[:, None] / length
        nearest = self.start + inside * (self.end - self.start)
        return np.linalg.norm(points - nearest, axis=1), along


@dataclass(frozen=True, slots=True)
class Arc:
    """A circular or helical element, counterclockwise about its normal."""

    start: FloatArray
    end: FloatArray
    centre: FloatArray
    normal: FloatArray
    sweep: float

    @property
    def radius(self) -> float:
        """Distance of the start from the axis [m]."""
        flat = self.start - self.centre
        return float(np.linalg.norm(flat - (flat @ self.normal) * self.normal))

    @property
    def length(self) -> float:
        """[m]."""
        return self.radius * self.sweep

    def measure(self, points: FloatArray, hint: float) -> tuple[FloatArray, FloatArray]:
        """Return distance and way along (n,) [m].

        The angle is only known up to whole turns: the one nearest to ``hint``, the way reached so
        far [m], is taken. Radius and height run linearly from start to end, as CAM data close
        only within their digits.
        """
        first = self.start - self.centre
        rise = float(first @ self.normal)
        u = first - rise * self.normal
        radius = float(np.linalg.norm(u))
        last = self.end - self.centre
        rise_end = float(last @ self.normal)
        radius_end = float(np.linalg.norm(last - rise_end * self.normal))
        relative = points - self.centre
        height = relative @ self.normal
        flat = relative - height[:, None] * self.normal
        angle = np.arctan2(flat @ np.cross(self.normal, u), flat @ u)
        middle = hint / max(radius, 1e-12)
        angle = angle + _FULL * np.rint((middle - angle) / _FULL)
        share = np.clip(angle / self.sweep, 0.0, 1.0)
        off = np.linalg.norm(flat, axis=1) - (radius + share * (radius_end - radius))
        lift = height - (rise + share * (rise_end - rise))
        outside = np.maximum(np.maximum(-angle, angle - self.sweep), 0.0) * radius
        return np.sqrt(off**2 + lift**2 + outside**2), angle * radius


def element_to(toolpath: ToolPath, row: int) -> Line | Arc:
    """Return the line or arc of a toolpath that ends at tag ``row``."""
    start, end = np.asarray(toolpath.points[row - 1]), np.asarray(toolpath.points[row])
    number = int(toolpath.arc[row])
    if toolpath.kind[row] != MotionKind.ARC or number < 0:
        return Line(start, end)
    arcs = toolpath.arcs
    return Arc(start, end, arcs.centre[number], arcs.normal[number], float(arcs.sweep[number]))


@dataclass(frozen=True, slots=True)
class Followed:
    """How an element was followed.

    ``deviation``: worst distance [m], of ``motion``; ``fault`` in words, empty if there is none;
    ``covered``: motions that run along the element.
    """

    deviation: float
    motion: int
    fault: str = ""
    covered: tuple[int, ...] = ()

    def is_wrong(self, tolerance: float) -> bool:
        """Return whether the way is at fault, or farther off than ``tolerance`` [m]."""
        return bool(self.fault) or self.deviation > tolerance


@dataclass(frozen=True, slots=True)
class Ways:
    """By which motions served tags of lines and arcs are reached: numbers of tags of each kind.

    ``open``: the file does not say where the cut comes from, a line reaches it; ``behind``: the
    cut begins behind a hole; ``direct``: one straight motion; ``followed``: all others, and how;
    ``loose``: whose way from the tag before nothing is said of; ``to`` (n,): motion to each tag.
    """

    open: AnyIntArray
    behind: AnyIntArray
    direct: AnyIntArray
    followed: Mapping[int, Followed]
    loose: AnyIntArray
    to: AnyIntArray

    @property
    def covered(self) -> dict[int, tuple[int, ...]]:
        """The motions that cut towards each tag from the one before."""
        direct = {row: (int(self.to[row]),) for row in self.direct.tolist()}
        return direct | {row: done.covered for row, done in self.followed.items()}

    @property
    def is_cut(self) -> AnyIntArray:
        """Motions that run along lines and arcs."""
        rows = np.concatenate([self.open, self.behind, self.direct])
        covered = [motion for done in self.followed.values() for motion in done.covered]
        return np.concatenate([self.to[rows], np.array(covered, dtype=np.int64)])

    def judged(self, tolerance: float) -> Iterator[tuple[int, int]]:
        """Yield first and last motion of ways of which no more is said, and of wrong ones [m]."""
        for row in self.loose.tolist():
            yield int(self.to[row - 1]) + 1, int(self.to[row]) - 1
        for row, done in self.followed.items():
            if done.is_wrong(tolerance):
                yield int(self.to[row - 1]) + 1, int(self.to[row])


def ways_of(
    toolpath: ToolPath, wanted: Wanted, served: AnyIntArray, real: RealPaths, tolerance: float
) -> Ways:
    """Return how the lines and arcs between tags served by motions (n,), -1 for none, are run."""
    paths, kind = real.commanded, np.asarray(wanted.kind)
    rows = np.flatnonzero(np.isin(kind, CUTS) & (served >= 0))
    first, rows = rows[rows == 0], rows[rows > 0]
    rows = rows[served[rows - 1] >= 0]
    frames = np.stack([paths.station.tool, paths.station.base], axis=1)
    changed = (frames[served[rows]] != frames[served[rows - 1]]).any(axis=1)
    behind_hole = kind[rows - 1] == MotionKind.HOLE
    ahead = served[rows] > served[rows - 1]
    # first of all and behind a change the file does not say where a cut comes from: any way will
    # do, a line at feed
    open_ = np.concatenate([first, rows[changed]])
    open_ = open_[paths.trace.is_cp[served[open_]]]
    loose = rows[(changed | behind_hole) & ahead]  # pieces of a compensated line
    behind = rows[~changed & behind_hole]
    # not where the tool stands there already when it has left the hole
    left = wanted.top - np.maximum(wanted.clear, wanted.retract)[:, None] * wanted.axis
    behind = behind[np.linalg.norm(wanted.top[behind] - left[behind - 1], axis=1) > ON_TOP]
    rows = rows[~changed & ~behind_hole]
    step = served[rows] - served[rows - 1]
    direct = (kind[rows] == MotionKind.LINEAR) & (step == 1)
    direct &= paths.trace.motion_type[served[rows]] == MotionType.LIN
    followed = {
        row: follow(
            element_to(toolpath, row),
            real.of(row),
            int(served[row - 1]) + 1,
            int(served[row]),
            tolerance,
            real.of(row - 1),
        )
        for row in rows[~direct & (step > 0)].tolist()
    }
    return Ways(open_, behind, rows[direct], followed, loose, served)


def follow(
    element: Line | Arc,
    paths: Paths,
    first: int,
    last: int,
    tolerance: float,
    before: Paths | None = None,
) -> Followed:
    """Return how motions first..last follow an element whose start is the end of ``first - 1``.

    ``before``: all motions under the load of the element's start, if another; the load changes
    along the first motion. ``tolerance`` [m].
    """
    before = before or paths
    reached, worst, worst_motion = 0.0, 0.0, last
    covered: list[int] = []
    near = NEAR * tolerance
    for motion in range(first, last + 1):
        start = (before if motion == first else paths).end_point[motion - 1]
        on_start = _is_on(element, start, reached, tolerance)
        points = _points(paths, motion, before if motion == first else paths)
        deviation, at_end, way = _trail(element, points, reached)
        if on_start and deviation <= near and paths.trace.is_cp[motion]:
            _, begin = element.measure(start[None], reached)
            if begin[0] > reached + near:
                left = _left_out(float(begin[0]) - reached)
                return Followed(worst, motion, left, tuple(covered))
            if deviation > worst:
                worst, worst_motion = deviation, motion
            reached = max(reached, way)
            covered.append(motion)
            continue
        fault = _excursion(paths, motion, on_start, at_end <= near)
        if fault:
            return Followed(max(worst, deviation), motion, fault, tuple(covered))
    if element.length - reached > near:
        return Followed(worst, last, _left_out(element.length - reached), tuple(covered))
    return Followed(worst, worst_motion, covered=tuple(covered))


def _left_out(way: float) -> str:
    return f"{way / MM:.3f} mm of it are left out"


def _is_on(element: Line | Arc, point: FloatArray, hint: float, tolerance: float) -> bool:
    distance, _ = element.measure(point[None], hint)
    return bool(distance[0] <= NEAR * tolerance)


def _points(paths: Paths, motion: int, before: Paths) -> FloatArray:
    """Return points (k, 3) [m] of a motion, its end included; the load changes on the way."""
    if not paths.trace.is_cp[motion]:
        return np.asarray(paths.end_point[motion][None])
    points = curve_points(paths, motion)
    if before is paths:
        return points
    share = _SHARES[:, None]
    return np.asarray((1.0 - share) * curve_points(before, motion) + share * points)


def _trail(element: Line | Arc, points: FloatArray, reached: float) -> tuple[float, float, float]:
    """Return worst distance [m] of points (k, 3), that of the last, its way along the element."""
    if isinstance(element, Line) or len(points) == 1:
        distance, along = element.measure(points, reached)
        return float(distance.max()), float(distance[-1]), float(along[-1])
    worst, last, way = 0.0, 0.0, reached
    for point in points:  # each only a step on: the way around the circle is not ambiguous
        distance, along = element.measure(point[None], way)
        last, way = float(distance[0]), float(along[0])
        worst = max(worst, last)
    return worst, last, way


def curve_points(paths: Paths, motion: int) -> FloatArray:
    """Return points (8, 3) [m] along a path motion, in the part, the end included."""
    if paths.trace.motion_type[motion] == MotionType.LIN and paths.shift is None:
        start, end = paths.end_point[motion - 1], paths.end_point[motion]
        return np.asarray(start + _SHARES[:, None] * (end - start))
    return paths.points_at(np.full(len(_SHARES), motion), _SHARES)


def _excursion(paths: Paths, motion: int, leaves: bool, returns: bool) -> str:
    """Return what is wrong with a motion off the element, empty if nothing is."""
    step = paths.end_point[motion] - paths.end_point[motion - 1]
    length = float(np.linalg.norm(step))
    if not paths.trace.is_cp[motion]:
        is_still = length <= _STAYS
        return "" if is_still or not returns else "the tool comes back by a joint motion"
    if length < 1e-9 or not (leaves or returns):
        return ""
    along = abs(float(step @ paths.end_axis[motion])) / length
    if along > ALONG_AXIS:
        return ""
    return "the tool leaves the path" if leaves else "the tool comes back from the side"
