"""Collisions along the executed motions, between the sampled poses as well.

Nothing is missed between two poses, whether joints move, external axes or both.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.errors import RunKind
from postproc.kinematics import Kinematics
from postproc.verification.report import Result

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
    if not cell.solids:
        return False
    from postproc.collision import Scene

    paths = result.paths
    motion, share, q, _ = paths.in_order()
    external = paths.curves.external_at(motion, share, paths.external)
    known = np.isfinite(q).all(axis=1)
    motion, q = motion[known], np.hstack([q, external])[known]
    if len(q) < 2:
        return True
    is_cp = paths.trace.is_cp
    touch = is_cp if is_cut is None else _with_way_out(is_cut, is_cp)
    reported = _Reported(result)
    tool = paths.station.tool[motion[1:]]
    for index in np.unique(tool).tolist():
        rows = np.flatnonzero(tool == index)
        scene = Scene.build(cell.with_tool(index), kinematics)
        hits = scene.check_paths(q[rows], q[rows + 1], touch[motion[rows + 1]])
        for row in np.flatnonzero(hits.hit).tolist():
            reported.add(int(motion[rows[row] + 1]), hits.pairs[int(hits.pair[row])])
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


def _with_way_out(is_cut: BoolArray, is_cp: BoolArray) -> BoolArray:
    """Return the cuts and the path motion behind each: the tool stands in the part there."""
    behind = np.r_[False, is_cut[:-1]] & is_cp
    return np.asarray(is_cut | behind)
