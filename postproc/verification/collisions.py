"""Collisions along the executed motions, between the sampled poses as well.

Where external axes stand still, nothing is missed between two poses. While they travel, poses are
checked every ``TRAVEL_STEP`` of the way.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind
from postproc.kinematics import Kinematics
from postproc.verification.report import Result

TRAVEL_STEP = 0.1
"""Way of an external axis [m or rad] between two checked poses."""
_MOST_STEPS = 60
_LISTED = 20


def check_collisions(
    result: Result, cell: Cell, kinematics: Kinematics, is_cut: BoolArray | None
) -> bool:
    """Search the joint paths for collisions; False if the cell has no solid to collide with.

    Args:
        result: joint paths; collects the findings.
        cell: its solids.
        kinematics: of its robot.
        is_cut: (m,) motions on which cutting solids may touch the workpiece; None: all path
            motions, as no CAM file tells.
    """
    if not (cell.obstacles or cell.tool.meshes or cell.workpiece.meshes):
        return False
    from postproc.collision import Scene

    trace = result.paths.trace
    motion, share, q, _ = result.paths.in_order()
    known = np.isfinite(q).all(axis=1)
    motion, share, q = motion[known], share[known], q[known]
    if len(q) < 2:
        return True
    touch = trace.is_cp if is_cut is None else _with_way_out(is_cut, trace.is_cp)
    reported = _Reported(result)
    for here, rows in _standing(result, cell, motion):
        scene = Scene.build(here, kinematics)
        hits = scene.check_paths(q[rows], q[rows + 1], touch[motion[rows + 1]])
        found = np.flatnonzero(hits.hit)
        for row in found.tolist():
            reported.add(int(motion[rows[row] + 1]), hits.pairs[int(hits.pair[row])])
    for here, row, pose in _travelling(result, cell, q, motion, share):
        hit = Scene.build(here, kinematics).check(pose[None])
        if hit.hit[0]:
            reported.add(int(motion[row + 1]), hit.pairs[int(hit.pair[0])])
    return True


class _Reported:
    """Reports each pair once a motion, and not more than a few in all."""

    def __init__(self, result: Result) -> None:
        self._result = result
        self._known: set[tuple[int, tuple[str, str]]] = set()

    def add(self, motion: int, pair: tuple[str, str]) -> None:
        """Report a collision on the way to the end of a motion."""
        if (motion, pair) not in self._known and len(self._known) < _LISTED:
            self._known.add((motion, pair))
            text = f"{pair[0]} hits {pair[1]} on the way there"
            self._result.finding(RunKind.COLLISION, motion, text)


def _standing(
    result: Result, cell: Cell, motion: AnyIntArray
) -> Iterator[tuple[Cell, AnyIntArray]]:
    """Yield the cell and the steps row -> row + 1 that are made while it stands so."""
    paths = result.paths
    steps = np.arange(len(motion) - 1)
    if not paths.station.externals:
        yield cell, steps
        return
    external = paths.external
    to = motion[1:]
    still = (external[to] == external[np.maximum(to - 1, 0)]).all(axis=1) | (to == 0)
    places, number = np.unique(external[to[still]], axis=0, return_inverse=True)
    for place, values in enumerate(places):
        rows = steps[still][number.reshape(-1) == place]
        yield paths.station.externals.at(cell, values), rows


def _travelling(
    result: Result, cell: Cell, q: FloatArray, motion: AnyIntArray, share: FloatArray
) -> Iterator[tuple[Cell, int, FloatArray]]:
    """Yield the cell, the step and the joints (6,) on the way of external axes."""
    paths = result.paths
    if not paths.station.externals:
        return
    for row in range(len(motion) - 1):
        to = int(motion[row + 1])
        start, end = paths.external[max(to - 1, 0)], paths.external[to]
        if to == 0 or (start == end).all():
            continue
        if paths.trace.is_cp[to]:
            values = start + share[row + 1] * (end - start)
            yield paths.station.externals.at(cell, values), row, q[row + 1]
            continue
        count = min(int(np.ceil(np.abs(end - start).max() / TRAVEL_STEP)), _MOST_STEPS)
        for part in np.linspace(0.0, 1.0, count + 1)[1:]:
            here = paths.station.externals.at(cell, start + part * (end - start))
            yield here, row, q[row] + part * (q[row + 1] - q[row])


def _with_way_out(is_cut: BoolArray, is_cp: BoolArray) -> BoolArray:
    """Return the cuts and the path motion behind each: the tool stands in the part there."""
    behind = np.r_[False, is_cut[:-1]] & is_cp
    return np.asarray(is_cut | behind)
