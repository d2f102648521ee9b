"""How a program drills each hole: which motions come down its axis, drill, and leave it."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator, Mapping
from itertools import pairwise, takewhile

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.model import ToolPath
from postproc.process import LEAST_PECK, hole_places, hole_runs
from postproc.records import dataclass
from postproc.verification.cam.matching import Wanted, neighbours, passed_pecks, wanted_of
from postproc.verification.cam.real import FAR, RealPaths
from postproc.verification.report import AT_MOST

NEAR = 10.0
"""A vertex within this many tolerances of the hole's axis lies on it."""


@dataclass(frozen=True, slots=True)
class Hole:
    """The motions around the bottom of a hole; heights [m] are above it, along its axis.

    ``down``, ``out``: motions and the height at their end, along the axis back from the bottom and
    on from it. ``first``: the motion from whose end on the hole is what is judged, -1 for the
    start; ``heights``: at the ends from there on (None beside the axis). ``drilled``: motions that
    go deeper than any before; ``again``: back in as far as it is drilled; ``left``: the motion
    that is out of the hole.
    """

    bottom: int
    down: tuple[tuple[int, float], ...]
    out: tuple[tuple[int, float], ...]
    first: int
    heights: tuple[float | None, ...]
    drilled: tuple[int, ...]
    again: tuple[int, ...]
    left: int

    @property
    def offset(self) -> int:
        """The motion at whose end the first of ``heights`` is."""
        return max(self.first, 0)

    @property
    def begin(self) -> int:
        """The motion with which drilling begins."""
        return min((*self.drilled, self.bottom))

    @property
    def on_axis(self) -> Iterator[int]:
        """Motions that begin and end on the axis."""
        for number, (a, b) in enumerate(pairwise(self.heights), start=self.offset + 1):
            if a is not None and b is not None:
                yield number

    def way_out(self, height: float) -> tuple[int, ...]:
        """Return the motions that leave the hole, until one has come to a height [m]."""
        below = (0.0, *(above for _, above in self.out))
        steps = takewhile(lambda step: step[1] < height, zip(self.out, below, strict=False))
        return tuple(motion for (motion, _), _ in steps)


def holes_of(
    real: RealPaths, wanted: Wanted, served: AnyIntArray, tolerance: float
) -> Mapping[int, Hole]:
    """Return by row how each hole that a motion of ``served`` (n,) reaches is drilled."""
    return _Drilling(real, wanted, served, NEAR * tolerance).holes()


class _Drilling:
    """Looks along the axes of holes for the motions around their bottoms."""

    def __init__(self, real: RealPaths, wanted: Wanted, served: AnyIntArray, near: float) -> None:
        paths = real.commanded
        self._wanted, self._near, self._served = wanted, near, served.tolist()
        self._case = real.case.tolist()
        self._points = [paths.end_point.tolist() for paths in real.paths]
        self._is_cp = (paths.trace.is_cp | paths.stands).tolist()
        self._rows = np.flatnonzero(wanted.is_hole & (served >= 0)).tolist()
        count = len(paths)
        self._before = np.r_[-1, np.maximum.accumulate(served)[:-1]]
        later = np.where(served >= 0, served, count)
        self._behind = np.r_[np.minimum.accumulate(later[::-1])[::-1], count]

    def holes(self) -> dict[int, Hole]:
        """Return the holes by row; each needs to know when the one before it was left."""
        found: dict[int, Hole] = {}
        known = frozenset(self._rows)
        for row in self._rows:
            axis = _Axis(
                self._points[self._case[row]],
                self._wanted.point[row].tolist(),
                self._wanted.axis[row].tolist(),
                self._near,
            )
            before = found.get(row - 1) if self._shares(row - 1, axis, known) else None
            found[row] = self._hole(row, axis, before, self._shares(row + 1, axis, known))
        return found

    def _shares(self, row: int, axis: _Axis, known: frozenset[int]) -> bool:
        """Return whether a row is a hole with its top or its bottom on an axis."""
        if row not in known:
            return False
        ends = (self._wanted.point[row].tolist(), self._wanted.top[row].tolist())
        return any(axis.height(end) is not None for end in ends)

    def _hole(self, row: int, axis: _Axis, before: Hole | None, shares_next: bool) -> Hole:
        wanted, bottom = self._wanted, self._served[row]
        depth, clear = float(wanted.depth[row]), float(wanted.clear[row])
        earlier = self._served[row - 1] if row else -1
        down = tuple(self._walk(axis, bottom, -1, earlier))
        out = tuple(self._walk(axis, bottom, 1, len(axis.points)))
        top = depth + float(wanted.retract[row] or clear)
        left = next((vertex for vertex, height in out if height >= top - self._near), bottom)
        first, stop = int(self._before[row]), min(int(self._behind[row + 1]), len(axis.points))
        if before is not None:
            first = max(first, before.left)
        if shares_next:
            stop = min(stop, left + 1)
        heights = tuple(axis.height(axis.points[v]) for v in range(max(first, 0), stop))
        drilled, again = self._drilled(down, bottom, clear + depth)
        return Hole(bottom, down, out, first, heights, drilled, again, left)

    def _walk(self, axis: _Axis, bottom: int, way: int, stop: int) -> Iterator[tuple[int, float]]:
        """Yield (vertex, height above the bottom) along the axis, backwards or forwards."""
        vertex = bottom
        while True:
            motion = vertex if way < 0 else vertex + 1
            vertex += way
            if not 0 <= vertex < len(axis.points) or not self._is_cp[motion]:
                return
            if way < 0 and vertex <= stop:
                return
            height = axis.height(axis.points[vertex])
            if height is None:
                return
            yield vertex, height

    def _drilled(
        self, down: tuple[tuple[int, float], ...], bottom: int, clear: float
    ) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the motions that go deeper than any before, and those as deep, below ``clear``."""
        drilled: list[int] = []
        again: list[int] = []
        deepest = clear - self._near
        before = down[-1][1] if down else 0.0
        for vertex, height in [*reversed(down[:-1]), (bottom, 0.0)]:
            if height < deepest - LEAST_PECK / 2 and height < before:
                drilled.append(vertex)
                deepest = height
            elif drilled and height < before and height < deepest + LEAST_PECK / 2:
                again.append(vertex)
            before = height
        return tuple(drilled), tuple(again)


@dataclass(frozen=True, slots=True)
class _Axis:
    """The axis of a hole: its bottom, direction into the part, and the ends of all motions [m]."""

    points: list[list[float]]
    base: list[float]
    axis: list[float]
    near: float

    def height(self, point: list[float]) -> float | None:
        """Return the height of a point above the bottom, None beside the axis."""
        a, b, c = (p - q for p, q in zip(point, self.base, strict=True))
        x, y, z = self.axis
        height = -(a * x + b * y + c * z)
        d, e, f = a + height * x, b + height * y, c + height * z
        return height if d * d + e * e + f * f <= self.near * self.near else None


_BESIDE = 10.0
"""A motion that ends so many tolerances beside a hole's axis still tells when it was drilled."""


@dataclass(frozen=True, slots=True)
class Again:
    """A tag whose hole is drilled too often, the last time by ``motion``."""

    tag: int
    motion: int
    times: int


def program_order(
    cell: Cell, toolpath: ToolPath, real: RealPaths, tolerance: float
) -> tuple[IndexArray, tuple[Again, ...]]:
    """Return the tags (n,) in the order of the program, and holes that it drills too often."""
    order = np.arange(len(toolpath))
    runs = hole_runs(toolpath) if cell.optimize.free_order else []
    if not runs or not len(real.commanded):
        return order, ()
    passed = passed_pecks(real.commanded, tolerance)
    visited = np.where(passed[:, None], FAR, real.visited)
    places = hole_places(toolpath)
    drilled = _Drilled(wanted_of(toolpath), visited, real.case, tolerance, places)
    return drilled.order(runs), tuple(drilled.again(runs))


class _Drilled:
    """Which motions of a program end at the bottoms of holes."""

    def __init__(
        self,
        wanted: Wanted,
        visited: FloatArray,
        case: IntArray,
        tolerance: float,
        places: IntArray,
    ) -> None:
        self._wanted, self._visited, self._case = wanted, visited, case
        self._tolerance = tolerance
        self._motions: list[list[int]] = [[]] * len(case)
        self._passed = _deepened(places, wanted.is_hole)
        for load, points in enumerate(visited):
            rows = np.flatnonzero(case == load)
            near = neighbours(wanted.point[rows], points, tolerance)
            for row, motions in zip(rows.tolist(), near, strict=True):
                self._motions[row] = _arrivals(sorted(motions))

    def order(self, runs: list[tuple[int, int]]) -> IndexArray:
        """Return the tags (n,) in the order of the program inside runs, else of the file."""
        order = np.arange(len(self._wanted.point))
        begin = -1
        for low, high in runs:
            taken: dict[int, int] = {}
            for row in range(low, high):
                for motion in self._motions[row]:
                    if motion > begin and motion not in taken:
                        taken[motion] = row
                        break
            motion_of = {row: motion for motion, row in taken.items()}
            keys = np.array([motion_of.get(row, -1) for row in range(low, high)], dtype=np.float64)
            lost = np.flatnonzero(keys < 0.0)
            keys[lost] = [self._about(low + int(k)) for k in lost[:AT_MOST]] + [np.inf] * max(
                len(lost) - AT_MOST, 0
            )
            order[low:high] = low + np.argsort(keys, kind="stable")
            begin = max(taken, default=begin)
        return order

    def again(self, runs: list[tuple[int, int]]) -> Iterator[Again]:
        """Yield the holes that the program drills too often."""
        asked: dict[tuple[int, ...], int] = defaultdict(int)
        for row in range(len(self._wanted.point)):
            asked[tuple(self._motions[row])] += 1
        rows = [row for low, high in runs for row in range(low, high) if not self._passed[row]]
        for row in rows:
            motions = self._motions[row]
            if len(motions) > asked[tuple(motions)]:
                yield Again(row, motions[-1], len(motions))

    def _about(self, row: int) -> float:
        """Return when a hole was drilled that has no motion to its bottom, after that motion."""
        off = self._visited[int(self._case[row])] - self._wanted.point[row]
        along = off @ self._wanted.axis[row]
        side = np.linalg.norm(off - along[:, None] * self._wanted.axis[row], axis=1)
        on_axis = side <= _BESIDE * self._tolerance
        gap = np.abs(along) if on_axis.any() else np.linalg.norm(off, axis=1)
        return float(np.argmin(np.where(on_axis | ~on_axis.any(), gap, np.inf))) + 0.5


def _deepened(places: IntArray, is_hole: BoolArray) -> BoolArray:
    """Return the rows (n,) at whose place the file makes a hole of another depth, too."""
    lines = np.unique(places[is_hole, 1:], axis=0)[:, 1]
    again = np.bincount(lines, minlength=int(places[:, 2].max(initial=-1)) + 1) > 1
    return np.asarray(again[places[:, 2]])


def _arrivals(motions: list[int]) -> list[int]:
    """Return the motions that come to a place: those that stay there do not count again."""
    return [motion for k, motion in enumerate(motions) if not k or motions[k - 1] != motion - 1]
