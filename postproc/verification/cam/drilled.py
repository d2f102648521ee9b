"""How a program drills each hole: which motions come down its axis, drill, and leave it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise, takewhile

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.process import LEAST_PECK
from postproc.records import dataclass
from postproc.verification.cam.matching import Wanted
from postproc.verification.cam.real import RealPaths

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
