"""Holes whose order is free: the order in which the program drills them.

Where the cell says ``free_order``, the holes of one operation and tool that follow each other in
the CAM file without an event between may be drilled in any order. Each such run of the file is put
into the order in which the program reaches the bottoms; then everything is judged as ever: depth,
axis, feed, the way down and out, and that nothing of the file is missed. A hole that is drilled
more often than the file asks for is a violation.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.model import ToolPath
from postproc.process import hole_places, hole_runs
from postproc.records import dataclass
from postproc.verification.cam.matching import Wanted, neighbours, passed_pecks, wanted_of
from postproc.verification.cam.real import FAR, RealPaths
from postproc.verification.report import AT_MOST

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
    """Return the tags (n,) in the order of the program, and holes that it drills too often.

    Args:
        cell: says whether the order of holes is free.
        toolpath: what was asked for.
        real: paths of the tool that is compared.
        tolerance: of points [m].
    """
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
    """Return the rows (n,) at whose place the file makes a hole of another depth, too.

    The strokes of that one may pass the bottom, so how often it is reached tells nothing.

    Args:
        places: (n, 3) numbers of top, bottom and axis.
        is_hole: (n,).
    """
    lines = np.unique(places[is_hole, 1:], axis=0)[:, 1]
    again = np.bincount(lines, minlength=int(places[:, 2].max(initial=-1)) + 1) > 1
    return np.asarray(again[places[:, 2]])


def _arrivals(motions: list[int]) -> list[int]:
    """Return the motions that come to a place: those that stay there do not count again."""
    return [motion for k, motion in enumerate(motions) if not k or motions[k - 1] != motion - 1]
