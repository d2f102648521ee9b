"""Collisions along the executed motions, between the sampled poses as well.

Nothing is missed between two poses, whether joints move, external axes or both.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import RunKind
from postproc.kinematics import Corners, Kinematics
from postproc.verification.corners import check_corner_collisions
from postproc.verification.report import Result

_LISTED = 20
_ON_TOP = 1e-6
"""So near [m] to the height where the feed starts a motion is not in the hole."""


def check_collisions(
    result: Result,
    cell: Cell,
    kinematics: Kinematics,
    contact: Contact | None,
    corners: Corners,
    at: AnyIntArray,
) -> bool:
    """Search the joint paths for collisions; False if the cell has no solid to collide with.

    Args:
        result: joint paths; collects the findings.
        cell: its solids.
        kinematics: of its robot.
        contact: where cutting solids may touch the workpiece; None: on all path motions, as no
            CAM file tells.
        corners: approximated corners, at the ends of motions ``at`` (c,).
        at: (c,) motions.
    """
    if not cell.solids:
        return False
    from postproc.collision import Scene

    paths = result.paths
    motion, share, q, point = paths.in_order()
    external = paths.curves.external_at(motion, share, paths.external)
    known = np.isfinite(q).all(axis=1)
    motion, point, q = motion[known], point[known], np.hstack([q, external])[known]
    if len(q) < 2:
        return True
    is_cp = paths.trace.is_cp
    touch = is_cp if contact is None else contact.motions(is_cp)
    steps = touch[motion[1:]]
    if contact is not None:
        steps = contact.steps(steps, motion[1:], point[:-1], point[1:])
    reported = _Reported(result)
    frames = np.stack([paths.station.tool, paths.station.base], axis=1)
    for pair in np.unique(frames[motion[1:]], axis=0):
        own = (frames == pair).all(axis=1)
        rows = np.flatnonzero(own[motion[1:]])
        scene = Scene.shared(cell.with_tool(*pair.tolist()), kinematics)
        hits = scene.check_paths(q[rows], q[rows + 1], steps[rows], track=motion[rows + 1])
        for row in np.flatnonzero(hits.hit).tolist():
            reported.add(int(motion[rows[row] + 1]), hits.pairs[int(hits.pair[row])])
        corner = np.flatnonzero(own[at] & own[at + 1])
        if len(corner):
            here = corners.rows(corner)
            check_corner_collisions(result, scene, kinematics, here, at[corner], touch)
    return True


@dataclass(frozen=True, slots=True)
class Contact:
    """Where cutting solids may touch the workpiece: in cuts, and in holes up to the feed's start.

    ``is_cut`` (m,): motions that cut; ``strokes`` (m, 7): as ``cam.Comparison``.
    """

    is_cut: BoolArray
    strokes: FloatArray

    def motions(self, is_cp: BoolArray) -> BoolArray:
        """Return the motions (m,) on which there may be contact somewhere.

        On the way out of a cut the tool still stands in the part.
        """
        behind = np.r_[False, self.is_cut[:-1]] & is_cp
        return np.asarray(self.is_cut | behind | np.isfinite(self.strokes[:, 0]))

    def steps(
        self, touch: BoolArray, motion: AnyIntArray, start: FloatArray, end: FloatArray
    ) -> BoolArray:
        """Return the steps (s,) with contact: along a hole only those that begin or end in it.

        Args:
            touch: (s,) steps of motions with contact.
            motion: (s,) the motion of each.
            start: (s, 3) [m] TCP in the part.
            end: (s, 3) [m].
        """
        stroke = self.strokes[motion]
        axis, top, clear = stroke[:, :3], stroke[:, 3:6], stroke[:, 6]
        low = np.maximum(*(np.einsum("si,si->s", p - top, axis) for p in (start, end)))
        above = np.isfinite(clear) & ~(low > -clear + _ON_TOP)
        return np.asarray(touch & ~above)


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
