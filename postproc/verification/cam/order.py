"""Holes whose order is free: compares in the order in which the program drills them.

Where the cell says ``free_order``, the holes of one operation and tool that follow each other in
the CAM file without an event between may be drilled in any order. Each such run of the file is put
into the order in which the program reaches the bottoms; then everything is judged as ever: depth,
axis, feed, the way down and out, and that nothing of the file is missed. A hole that is drilled
more often than the file asks for is a violation.
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.errors import DataError, RunKind
from postproc.model import ToolPath
from postproc.paths import Displacement
from postproc.process import hole_places, hole_runs, reordered
from postproc.verification.cam.comparison import Comparison, Tolerances
from postproc.verification.cam.holes import passed_pecks
from postproc.verification.cam.matching import Wanted, neighbours, wanted_of
from postproc.verification.cam.real import RealPaths, real_paths
from postproc.verification.cam.thinned import compare_thinned
from postproc.verification.report import Result

_LISTED = 20
_BESIDE = 10.0
"""A motion that ends so many tolerances beside a hole's axis still tells when it was drilled."""
_FAR = 1e9


def compare_served(
    result: Result,
    cell: Cell,
    toolpath: ToolPath,
    tolerances: Tolerances,
    displacement: Displacement | None = None,
) -> Comparison:
    """Compare as ``compare`` does, with the order of holes left free where the cell leaves it free.

    Returns:
        The comparison; its rows are the tags in the order of the CAM file.

    Raises:
        DataError: VER001 if a tag has no point, only the joint angles of some robot.
    """
    _require_points(toolpath)
    runs = hole_runs(toolpath) if cell.optimize.free_order else []
    if not runs or not len(result.paths):
        return compare_thinned(result, cell, toolpath, tolerances, displacement)
    real = RealPaths.nominal(result.paths, len(toolpath))
    if displacement is not None:
        real = real_paths(result.paths, cell, toolpath, displacement)
    visited = np.where(np.isfinite(real.end_point), real.end_point, _FAR)
    passed = passed_pecks(result.paths, tolerances.position)
    visited = np.where(passed[:, None], _FAR, visited)
    places = hole_places(toolpath)
    drilled = _Drilled(wanted_of(toolpath), visited, real.case, tolerances.position, places)
    order = drilled.order(runs)
    found = compare_thinned(result, cell, reordered(toolpath, order), tolerances, displacement)
    for row, motion, times in drilled.repeated(runs)[:_LISTED]:
        name, line = toolpath.tag_name(row), int(toolpath.line[row])
        text = f"tag {name} (line {line}): drilled {times} times, the CAM file asks for fewer"
        result.finding(RunKind.ORDER, motion, text)
    return _rows(found, np.argsort(order))


def in_program_order(
    toolpath: ToolPath, cell: Cell, found: Comparison
) -> tuple[ToolPath, Comparison]:
    """Return both with holes whose order is free in the order in which the program drills them."""
    runs = hole_runs(toolpath) if cell.optimize.free_order else []
    if not runs:
        return toolpath, found
    order = np.arange(len(toolpath))
    for low, high in runs:
        order[low:high] = low + np.argsort(found.served[low:high], kind="stable")
    return reordered(toolpath, order), _rows(found, order)


def _require_points(toolpath: ToolPath) -> None:
    missing = np.flatnonzero(~np.isfinite(toolpath.points).all(axis=1))
    if len(missing):
        row = int(missing[0])
        raise DataError(
            "VER001",
            f"tag {toolpath.tag_name(row)} gives joint angles only, no point to compare with",
            toolpath.source(row),
        )


def _rows(found: Comparison, index: IndexArray) -> Comparison:
    """Return a comparison with its tags in another order."""
    nominal = found.nominal_error
    wanted = found.wanted
    columns = {name: getattr(wanted, name)[index] for name in Wanted.__slots__}
    return replace(
        found,
        wanted=Wanted(**columns),
        served=found.served[index],
        latest=found.latest[index],
        position_error=found.position_error[index],
        axis_error=found.axis_error[index],
        tilt=found.tilt[index],
        real=replace(found.real, case=found.real.case[index]),
        nominal_error=None if nominal is None else nominal[index],
    )


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

    def order(self, runs: list[tuple[int, int]]) -> IntArray:
        """Return the tags (n,) in the order of the program inside runs, else of the file."""
        order = np.arange(len(self._wanted.point), dtype=np.int32)
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
            keys[lost] = [self._about(low + int(k)) for k in lost[:_LISTED]] + [np.inf] * max(
                len(lost) - _LISTED, 0
            )
            order[low:high] = low + np.argsort(keys, kind="stable")
            begin = max(taken, default=begin)
        return order

    def repeated(self, runs: list[tuple[int, int]]) -> list[tuple[int, int, int]]:
        """Return (row, motion, times) of holes that the program drills too often."""
        asked: dict[tuple[int, ...], int] = defaultdict(int)
        for row in range(len(self._wanted.point)):
            asked[tuple(self._motions[row])] += 1
        rows = [row for low, high in runs for row in range(low, high) if not self._passed[row]]
        found = ((row, self._motions[row]) for row in rows)
        return [
            (row, motions[-1], len(motions))
            for row, motions in found
            if len(motions) > asked[tuple(motions)]
        ]

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
