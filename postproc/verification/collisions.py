"""Collisions along the executed motions, between the sampled poses as well.

Nothing is missed between two poses, whether joints move, external axes or both.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, taken
from postproc.cell import Cell
from postproc.errors import RunKind
from postproc.kinematics import Corners, Kinematics
from postproc.process import ALONG_AXIS, on_the_way_out
from postproc.verification.corners import check_corner_ways
from postproc.verification.report import Result

_LISTED = 20
_STILL = 1e-6
"""A tool point that moves by less [m] against the part stays where it is."""


def check_collisions(
    result: Result,
    cell: Cell,
    kinematics: Kinematics,
    is_cut: BoolArray,
    slack: float,
    corners: Corners,
    at: AnyIntArray,
) -> bool:
    """Search the joint paths for collisions; False if the cell has no solid but the arm itself.

    Args:
        result: joint paths; collects the findings.
        cell: its solids.
        kinematics: of its robot.
        is_cut: (m,) motions that cut.
        slack: how far [m] commanded points may be off the real ones.
        corners: approximated corners, at the ends of motions ``at`` (c,).
        at: (c,) motions.
    """
    from postproc.collision import Scene

    paths = result.paths
    motion, share, q, point, axis = paths.in_order()
    external = paths.curves.external_at(motion, share, paths.external)
    known = np.isfinite(q).all(axis=1)
    pose = np.hstack([point, axis])[known]
    motion, q = motion[known], np.hstack([q, external])[known]
    if len(q) < 2:
        return bool(cell.solids)
    steps = _touching(result, is_cut, motion, pose, slack)
    reported = _Reported(result)
    frames = np.stack([paths.station.tool, paths.station.base], axis=1)
    for pair in np.unique(frames[np.unique(motion[1:])], axis=0):
        own = (frames == pair).all(axis=1)
        rows = np.flatnonzero(own[motion[1:]])
        scene = Scene.shared(cell.with_tool(*pair.tolist()), kinematics)
        if not scene.pairs:
            continue
        if motion[0] == 0 and own[0]:  # where the program begins nothing may touch yet
            first = scene.check(q[:1])
            if first.hit[0]:
                reported.add(0, first.pairs[int(first.pair[0])])
        hits = scene.check_paths(
            taken(q, rows), taken(q, rows + 1), steps[rows], track=motion[rows + 1]
        )
        for row in np.flatnonzero(hits.hit).tolist():
            reported.add(int(motion[rows[row] + 1]), hits.pairs[int(hits.pair[row])])
        corner = np.flatnonzero(own[at] & own[at + 1])
        if len(corner):
            here = corners.rows(corner)
            check_corner_ways(result, cell, scene, kinematics, here, at[corner], is_cut)
    return bool(cell.solids)


def _touching(
    result: Result, is_cut: BoolArray, motion: AnyIntArray, pose: FloatArray, slack: float
) -> BoolArray:
    """Return the steps (s,) on which cutting solids may touch the workpiece.

    Args:
        result: the run.
        is_cut: (m,) motions that cut.
        motion: (s + 1,) of each sampled pose; a step goes to a pose from the one before.
        pose: (s + 1, 6) tool tip [m] and tool axis in the part.
        slack: how far [m] commanded points may be off the real ones.
    """
    paths = result.paths
    end = np.hstack([paths.end_point, paths.end_axis])
    way = np.diff(end[:, :3], axis=0, prepend=np.nan)
    is_out = np.einsum("mi,mi->m", way, end[:, 3:]) <= -ALONG_AXIS * np.linalg.norm(way, axis=1)
    # what leaves along its axis with the feed has cut where it began
    cut_end = np.where(is_out[:, None], np.roll(end, 1, axis=0), end)
    last = np.maximum.accumulate(np.where(is_cut, np.arange(len(is_cut)), -1))
    station = paths.station
    same = (last >= 0) & (station.tool == station.tool[last]) & (station.base == station.base[last])
    to = motion[1:]
    cut = cut_end[last[to]]
    # a sub-program begins with a joint motion that stays where the one before ended
    stays = paths.stands & (np.linalg.norm(way, axis=1) < _STILL)
    out = same[to] & (paths.trace.is_cp | stays)[to]
    for at in (pose[:-1], pose[1:]):
        out &= on_the_way_out(cut[:, :3], cut[:, 3:], at[:, :3], at[:, 3:], slack)
    return np.asarray(is_cut[to] | out)


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
