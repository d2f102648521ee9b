"""Whether holes are drilled as the cycle says: down the axis, to the depth, and out again."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise
from typing import Protocol

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, IntArray
from postproc.controller import EventWord
from postproc.errors import RunKind
from postproc.model import ToolPath
from postproc.paths import Paths
from postproc.process import FEED_OUT, LEAST_PECK
from postproc.records import dataclass
from postproc.units import MM
from postproc.verification.cam.matching import Wanted
from postproc.verification.cam.real import RealPaths
from postproc.verification.report import Result

NEAR = 10.0
"""A vertex within this many tolerances of the hole's axis lies on it."""
DWELL_SHARE = 0.01
DWELL_SLACK = 1e-3
"""A dwell may differ by this share, and by so many seconds."""
_PECK_MOVES = 3
"""Most motions from one peck to the bottom of the next: up, back down, drill."""
_LISTED = 20


def passed_pecks(paths: Paths, tolerance: float) -> BoolArray:
    """Return (m,) motions that end where the tool soon goes deeper by less than ``tolerance`` [m].

    Both places are within the tolerance of the bottom of a hole, which is the deeper one.
    """
    rows = np.flatnonzero(~paths.stands)
    point, axis = paths.end_point[rows], paths.end_axis[rows]
    is_cp, count = paths.trace.is_cp[rows], len(rows)
    passed = np.zeros(len(paths), dtype=np.bool_)
    for ahead in range(1, min(_PECK_MOVES, count - 1) + 1):
        step = point[ahead:] - point[:-ahead]
        along = np.einsum("ij,ij->i", step, axis[:-ahead])
        deeper = (along > LEAST_PECK / 2) & (np.linalg.norm(step, axis=1) <= tolerance)
        for motion in range(1, ahead + 1):
            deeper &= is_cp[motion : count - ahead + motion]
        passed[rows[:-ahead][deeper]] = True
    return passed


@dataclass(frozen=True, slots=True)
class Drilled:
    """What was found at holes.

    ``on_axis`` (m,): row of the hole along whose axis a path motion runs, -1 for none; ``spans``:
    by row the motion that begins to drill and the last one that is not out of the hole.
    """

    on_axis: AnyIntArray
    spans: Mapping[int, tuple[int, int]]


class Feeds(Protocol):
    """Collects the feed that motions should have."""

    def expect(self, row: int, motions: tuple[int, ...]) -> None:
        """Expect the feed of a tag at these motions."""
        ...


def check_holes(
    result: Result,
    real: RealPaths,
    wanted: Wanted,
    toolpath: ToolPath,
    served: IntArray,
    is_cut: BoolArray,
    tolerance: float,
    feeds: Feeds,
) -> Drilled:
    """Check every hole that the program drills; its drilling motions are marked in ``is_cut``."""
    rows = np.flatnonzero(wanted.is_hole & (served >= 0))
    on_axis = np.full(len(is_cut), -1, dtype=np.int64)
    spans: dict[int, tuple[int, int]] = {}
    if not len(rows):
        return Drilled(on_axis, spans)
    dwells = _dwells(result)
    checker = _Holes(result, real, wanted, served, NEAR * tolerance)
    for row in rows.tolist():
        drilled = checker.check(row)
        is_cut[list(drilled)] = True
        cycle = toolpath.cycles[int(toolpath.cycle[row])]
        fed = (*drilled, *checker.bottomed)
        feeds.expect(row, (*fed, *(checker.feed_out(row) if cycle.kind in FEED_OUT else ())))
        spans[row] = (min((*drilled, int(served[row]))), checker.left(row))
        checker.dwell(row, dwells.get(int(served[row]), 0.0))
    on_axis[list(checker.along)] = list(checker.along.values())
    return Drilled(on_axis, spans)


def _dwells(result: Result) -> dict[int, float]:
    """Return the seconds waited behind each motion."""
    found: dict[int, float] = {}
    for event in result.paths.trace.events:
        if event.word is EventWord.DWELL:
            found[event.motion - 1] = found.get(event.motion - 1, 0.0) + event.value
    return found


class _Holes:
    """Checks the motions around the bottom of one hole after the other."""

    def __init__(
        self, result: Result, real: RealPaths, wanted: Wanted, served: IntArray, near: float
    ) -> None:
        self._result = result
        self._wanted = wanted
        self._served = served
        self._near = near
        self._case = real.case.tolist()
        self._all_points = [paths.end_point.tolist() for paths in real.paths]
        self._points = self._all_points[0]
        self._is_cp = (result.paths.trace.is_cp | result.paths.stands).tolist()
        self._is_exact = result.paths.trace.is_exact.tolist()
        self._reported: dict[RunKind, int] = {}
        self.along: dict[int, int] = {}
        """Path motions that begin and end on the axis of a hole, to the row of the hole."""
        self.bottomed: list[int] = []
        """Motions of the last hole that go back in as far as it is drilled, no deeper."""
        self._left: dict[int, int] = {}
        """Vertex at which the tool is out of a hole, to the row of the hole."""
        self._holes = frozenset(np.flatnonzero(wanted.is_hole & (served >= 0)).tolist())
        count = len(self._points)
        self._before = np.r_[-1, np.maximum.accumulate(served)[:-1]]
        later = np.where(served >= 0, served, count)
        self._behind = np.r_[np.minimum.accumulate(later[::-1])[::-1], count]

    def check(self, row: int) -> tuple[int, ...]:
        """Check one hole and return the motions that drill."""
        wanted, bottom = self._wanted, int(self._served[row])
        self._points = self._all_points[self._case[row]]
        base, axis = wanted.point[row].tolist(), wanted.axis[row].tolist()
        if not self._is_exact[bottom]:
            self._tell(
                RunKind.BLENDED_PLUNGE, bottom, "the bottom of the hole is blended: not reached"
            )
        earlier = int(self._served[row - 1]) if row else -1
        down = list(self._walk(bottom, -1, base, axis, earlier))
        top = max((height for _, height in down), default=0.0)
        needed = float(wanted.clear[row] + wanted.depth[row])
        if top < needed - self._near:
            self._tell(
                RunKind.PLUNGE,
                bottom,
                f"the tool comes onto the hole's axis {(needed - top) / MM:.3f} mm too low",
            )
        self._way_out(row, bottom, base, axis)
        self._inside(row, base, axis, needed)
        drilled = self._drilling(down, bottom, needed)
        self._steps(row, drilled, base, axis)
        return drilled

    def _steps(
        self, row: int, drilled: tuple[int, ...], base: list[float], axis: list[float]
    ) -> None:
        """Check that what is drilled at once is what the cycle orders, and chips get out.

        Steps as small as what still counts as on the axis may be drilled together.
        """
        wanted = self._wanted
        depth, step = float(wanted.depth[row]), float(wanted.peck_first[row])
        if not np.isfinite(step):
            return
        before, last = 0.0, -1
        for vertex in drilled:
            now = depth - (self._on_axis(vertex, base, axis) or 0.0)
            if now <= self._near:
                continue
            asked = min(before + step, depth)
            is_less = now < asked - self._near and step > 2.0 * self._near
            if now > asked + self._near or is_less:
                text = (
                    f"{(now - before) / MM:.3f} mm at once, the cycle orders "
                    f"{(asked - before) / MM:.3f}"
                )
                self._tell(RunKind.PECK, vertex, text)
            if last >= 0:
                self._lift(row, last, vertex, depth - before, base, axis)
            before, step, last = now, float(wanted.peck[row]), vertex

    def _lift(
        self, row: int, last: int, vertex: int, height: float, base: list[float], axis: list[float]
    ) -> None:
        """Check how far the tool comes up between two pecks; ``height`` of the first of them."""
        wanted = self._wanted
        up = max((self._on_axis(v, base, axis) or 0.0) for v in range(last, vertex))
        needed = float(wanted.depth[row] + wanted.clear[row])
        needed = height + self._near if wanted.break_chip[row] else needed - self._near
        if up < needed:
            self._tell(RunKind.PECK, vertex, "the tool does not come up before the next peck")

    def left(self, row: int) -> int:
        """Return the motion that comes out of a hole."""
        return self._left[row]

    def feed_out(self, row: int) -> tuple[int, ...]:
        """Return the motions that leave a hole, up to the height where its feed began."""
        wanted, bottom = self._wanted, int(self._served[row])
        base, axis = wanted.point[row].tolist(), wanted.axis[row].tolist()
        clear = float(wanted.clear[row] + wanted.depth[row])
        motions, height = [], 0.0
        for vertex, above in self._walk(bottom, 1, base, axis, len(self._points)):
            if height >= clear - self._near:
                break
            motions.append(vertex)
            height = above
        return tuple(motions)

    def _inside(self, row: int, base: list[float], axis: list[float], clear: float) -> None:
        """Below the clearance height the tool may only move along the axis, never by PTP.

        What the tool does at the tag before is judged there; where that or the next one is a hole
        at the same place, so is what the tool does from there on, or up to there.
        """
        begin, stop = int(self._before[row]), min(int(self._behind[row + 1]), len(self._points))
        if self._is_hole_at(row - 1, base, axis):
            begin = max(begin, self._left[row - 1])
        if self._is_hole_at(row + 1, base, axis):
            stop = min(stop, self._left[row] + 1)
        offset = max(begin, 0)
        places = [self._on_axis(v, base, axis) for v in range(offset, stop)]
        both = [a is not None and b is not None for a, b in pairwise(places)]
        ends = [offset + number + 1 for number, is_both in enumerate(both) if is_both]
        self.along.update((motion, row) for motion in ends if self._is_cp[motion])
        for number, height in enumerate(places):
            if number + offset == begin or height is None:
                continue
            if height < -self._near:
                text = f"the tool goes {-height / MM:.3f} mm deeper than the hole"
                self._tell(RunKind.DEPTH, number + offset, text)
                return
            if not height < clear - self._near:
                continue
            for motion, other in ((number, number - 1), (number + 1, number + 1)):
                if not 0 <= other < len(places):
                    continue
                if places[other] is None or not self._is_cp[motion + offset]:
                    text = f"the tool moves sideways {(clear - height) / MM:.3f} mm deep"
                    self._tell(RunKind.PLUNGE, motion + offset, text)
                    return

    def _is_hole_at(self, row: int, base: list[float], axis: list[float]) -> bool:
        """Return whether a row is a hole with its top or its bottom on the axis of another."""
        wanted = self._wanted
        if row not in self._holes:
            return False
        ends = (wanted.point[row].tolist(), wanted.top[row].tolist())
        return any(self._height(end, base, axis) is not None for end in ends)

    def _on_axis(self, vertex: int, base: list[float], axis: list[float]) -> float | None:
        """Return the height above the bottom of a vertex on the hole's axis, None beside it."""
        return self._height(self._points[vertex], base, axis)

    def _height(self, point: list[float], base: list[float], axis: list[float]) -> float | None:
        a, b, c = (p - q for p, q in zip(point, base, strict=True))
        height = -(a * axis[0] + b * axis[1] + c * axis[2])
        d, e, f = (p + height * q for p, q in zip((a, b, c), axis, strict=True))
        return height if d * d + e * e + f * f <= self._near * self._near else None

    def _way_out(self, row: int, bottom: int, base: list[float], axis: list[float]) -> None:
        """Check how far the tool goes out along the axis, and remember where it is out."""
        wanted = self._wanted
        out = list(self._walk(bottom, 1, base, axis, len(self._points)))
        top = max((height for _, height in out), default=0.0)
        lift = float(wanted.retract[row] or wanted.clear[row])
        needed = float(wanted.depth[row]) + lift
        high = (vertex for vertex, height in out if height >= needed - self._near)
        self._left[row] = next(high, bottom)
        if top < needed - self._near:
            self._tell(
                RunKind.RETRACT,
                min(bottom + 1, len(self._points) - 1),
                f"the tool leaves the hole's axis {(needed - top) / MM:.3f} mm too low",
            )

    def _walk(
        self, bottom: int, way: int, base: list[float], axis: list[float], stop: int
    ) -> Iterator[tuple[int, float]]:
        """Yield (vertex, height above the bottom) along the axis, backwards or forwards."""
        vertex = bottom
        while True:
            motion = vertex if way < 0 else vertex + 1
            vertex += way
            if not 0 <= vertex < len(self._points) or not self._is_cp[motion]:
                return
            if way < 0 and vertex <= stop:
                return
            height = self._on_axis(vertex, base, axis)
            if height is None:
                return
            yield vertex, height

    def _drilling(
        self, down: list[tuple[int, float]], bottom: int, clear: float
    ) -> tuple[int, ...]:
        """Return the motions that go deeper than any before, below the clearance height."""
        drilled: list[int] = []
        self.bottomed = []
        deepest = clear - self._near
        before = down[-1][1] if down else 0.0
        for vertex, height in [*reversed(down[:-1]), (bottom, 0.0)]:
            if height < deepest - LEAST_PECK / 2 and height < before:
                drilled.append(vertex)
                deepest = height
                if not self._is_exact[vertex - 1]:
                    self._tell(
                        RunKind.BLENDED_PLUNGE, vertex - 1, "the point before a plunge is blended"
                    )
            elif drilled and height < before and height < deepest + LEAST_PECK / 2:
                self.bottomed.append(vertex)
            before = height
        return tuple(drilled)

    def dwell(self, row: int, seconds: float) -> None:
        """Compare the dwell at the bottom."""
        asked = float(self._wanted.dwell[row])
        if abs(seconds - asked) > max(DWELL_SHARE * asked, DWELL_SLACK) and asked > 0.0:
            text = f"{seconds:g} s at the bottom, the CAM file asks for {asked:g} s"
            self._tell(RunKind.DWELL, int(self._served[row]), text)

    def _tell(self, kind: RunKind, motion: int, text: str) -> None:
        self._reported[kind] = self._reported.get(kind, 0) + 1
        if self._reported[kind] <= _LISTED:
            self._result.finding(kind, motion, text)
