"""Which side each joint comes from at the points of a program, and how far off it turns back.

Where a joint turns back while the tool cuts, its gear needs the other command at once: a step in
the path, in the wrong place by as much as the arm differs from its model. So compensation fades
towards the reversal and grows again behind it. It then never acts against the side that a joint is
on, and is never worse there than none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, forward_filled
from postproc.paths import Paths, directions

_APART = 1e3
"""Points [m] that no cut joins are at least this far from each other."""


@dataclass(frozen=True, slots=True)
class Sides:
    """At r places of a run: side (r, 6), -1, 1 or 0 before the first motion; distance (r, 6) [m].

    ``distance`` is the way along the cuts to the nearest place where the joint turns back.
    """

    side: FloatArray
    distance: FloatArray

    def faded(self, reach: FloatArray) -> FloatArray:
        """Return sides (r, 6) that fade to 0 within ``reach`` (r, 1) [m] of a reversal."""
        known = np.maximum(reach, 1e-12)
        faded: FloatArray = self.side * np.minimum(self.distance / known, 1.0)
        return faded


def sides_of(paths: Paths, cuts: AnyIntArray, row: AnyIntArray, share: FloatArray) -> Sides:
    """Return the sides at places of a run.

    Args:
        paths: of the run.
        cuts: motions that cut; those that follow each other are one stretch.
        row: (r,) motions.
        share: (r,) place on each, 0..1.
    """
    samples = paths.in_order()
    q = forward_filled(samples.q)
    is_cut = np.isin(samples.row, cuts)
    side = _last_sign(np.sign(directions(q)))
    least = _last_sign(np.sign(directions(q, np.zeros(6))))
    step = np.linalg.norm(np.diff(samples.point, axis=0, prepend=samples.point[:1]), axis=1)
    along = np.cumsum(np.where(is_cut, np.nan_to_num(step), _APART))
    at = np.searchsorted(samples.row + samples.share, row + share)
    at = np.minimum(at, len(samples.row) - 1)
    distance = np.empty((len(at), 6))
    for joint in range(6):
        turns = along[_turns(q[:, joint], side[:, joint], is_cut)]
        distance[:, joint] = _nearest(turns, along[at])
    # a hole is drilled at rest: there a joint is on the side of its least motion
    return Sides(np.where(is_cut[at][:, None], side[at], least[at]), distance)


def _last_sign(sign: FloatArray) -> FloatArray:
    """Return signs (k, 6) with the one before in place of a 0."""
    rows = np.arange(len(sign))[:, None]
    last = np.maximum.accumulate(np.where(sign != 0.0, rows, 0), axis=0)
    return np.take_along_axis(sign, last, axis=0)


def _turns(q: FloatArray, side: FloatArray, is_cut: BoolArray) -> AnyIntArray:
    """Return the samples at which one joint (k,) begins to turn back, of turns in a cut.

    The turn shows later, when the joint has really moved back; it began at its farthest point, or
    with the cut.
    """
    shown = np.flatnonzero((side[1:] != side[:-1]) & (side[:-1] != 0.0)) + 1
    start_of_cut = np.maximum.accumulate(np.where(is_cut, 0, np.arange(len(q))))
    begun = []
    before = 0
    for turn in shown.tolist():
        if is_cut[turn]:
            first = max(before, int(start_of_cut[turn]))
            begun.append(first + int(np.argmax(side[turn - 1] * q[first : turn + 1])))
        before = turn
    return np.array(begun, dtype=np.int64)


def _nearest(turns: FloatArray, places: FloatArray) -> FloatArray:
    """Return the distance (n,) of each place to the nearest of the turns, which are in order."""
    if not len(turns):
        return np.full(len(places), np.inf)
    after = np.searchsorted(turns, places)
    behind = np.abs(places - turns[np.maximum(after - 1, 0)])
    ahead = np.abs(turns[np.minimum(after, len(turns) - 1)] - places)
    nearest: FloatArray = np.minimum(behind, ahead)
    return nearest
