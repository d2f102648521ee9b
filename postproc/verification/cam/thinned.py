"""Points of cuts that a program passes instead of going to them, as ``[motion] thin`` allows.

A point that no motion ends at counts as passed where the motions from the point before it to the
point behind it that the program does go to are path motions alone, and the file asks for nothing at
the point itself. It is held against the way that is driven there: its distance, and the angle of
the tool axis at the nearest place. The places follow each other as the points do. All else is
judged on the points that are left.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.controller import Blend, MotionType
from postproc.geometry import onto_line
from postproc.kinematics import corner_miss
from postproc.model import BLEND_SHARE, ToolPath
from postproc.paths import Paths
from postproc.process import assign, may_be_passed
from postproc.records import dataclass
from postproc.units import MM
from postproc.verification.cam.elements import curve_points
from postproc.verification.cam.matching import visits_of, wanted_of
from postproc.verification.cam.real import RealPaths
from postproc.verification.cam.tilt import Tilts

_PIECE = 0.125
"""Share of a motion between two of its ``curve_points``."""
_BACK = 0.005 * MM
"""By so much [m] a place may lie before the one of the point before."""


@dataclass(frozen=True, slots=True)
class Passed:
    """Tags (k,) that are passed: by which ``motion``, where on it, how far off [m].

    Where the motion begins or ends with an approximated corner there, by how far that may be passed
    is in it. ``axis_error``, ``tilt`` [rad]: of the tool axis there, as at any tag.
    """

    tag: IndexArray
    motion: AnyIntArray
    share: FloatArray
    chord: FloatArray
    axis_error: FloatArray
    tilt: FloatArray


_NONE = Passed(np.zeros(0, np.int64), np.zeros(0, np.int64), *[np.zeros(0)] * 4)


def passed_of(
    cell: Cell, toolpath: ToolPath, real: RealPaths, tilts: Tilts, limits: tuple[float, float]
) -> Passed:
    """Return the tags that are passed, as far as the cell lets the program pass any.

    ``limits``: the tolerance of points [m], and how far off they may be left at most.
    """
    if cell.motion.thin is None or not len(real.commanded) or not len(toolpath):
        return _NONE
    assigned = assign(toolpath, cell)
    served = visits_of(real, wanted_of(toolpath), assigned, *limits).first
    may = may_be_passed(toolpath, cell)
    _give_back(served, may, real, toolpath, limits[0])
    found = _passed(real, toolpath, served, may)
    error, tilt = tilts.judge(found.tag, _axes(real.commanded, found))
    return replace(found, axis_error=error, tilt=tilt)


def _give_back(
    served: AnyIntArray, may: BoolArray, real: RealPaths, toolpath: ToolPath, tolerance: float
) -> None:
    """Let a motion serve the tag that may not be passed (n,) among neighbours [m], in place."""
    points = np.asarray(toolpath.points)
    for tag in np.flatnonzero((served < 0) & ~may).tolist():
        for step in (1, -1):
            other = tag + step
            while 0 <= other < len(may) and may[other] and served[other] < 0:
                other += step
            if not (0 <= other < len(may) and may[other]):
                continue
            goes_to = real.of(tag).end_point[served[other]]
            if np.linalg.norm(goes_to - points[tag]) <= tolerance:
                served[tag], served[other] = served[other], -1
                break


def _passed(real: RealPaths, toolpath: ToolPath, served: AnyIntArray, may: BoolArray) -> Passed:
    """Return the tags that are passed, by whatever distance."""
    n, paths = len(toolpath), real.commanded
    rows = np.flatnonzero((served < 0) & may)
    before = np.maximum.accumulate(np.where(served >= 0, np.arange(n), -1))
    behind = np.minimum.accumulate(np.where(served >= 0, np.arange(n), n)[::-1])[::-1]
    rows = rows[(before[rows] >= 0) & (behind[rows] < n)]
    low, high = served[before[rows]] + 1, served[behind[rows]]
    # of the tags between two that are served, all are passed or none is
    wrong = np.append(0, np.cumsum((served < 0) & ~may))
    fine = wrong[behind[rows]] == wrong[before[rows]]
    is_way = paths.trace.is_cp | paths.stands
    others = np.append(0, np.cumsum(~is_way))
    fine &= (high >= low) & (others[high + 1] == others[low])
    rows, low, high = rows[fine], low[fine], high[fine]
    found = _nearest(real, np.asarray(toolpath.points), rows, low, high)
    found.chord[:] += _rounded(paths, found)
    return found


def _rounded(paths: Paths, passed: Passed) -> FloatArray:
    """Return by how much (k,) [m] approximation may lead away from where tags are passed."""
    trace, point = paths.trace, paths.end_point
    length = np.linalg.norm(np.diff(point, axis=0, prepend=point[:1]), axis=1)
    is_line = np.append(trace.motion_type == MotionType.LIN, False)
    reach = np.minimum(length, np.append(length[1:], 0.0)) * BLEND_SHARE
    reach = np.minimum(reach, np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), np.inf))
    off = np.zeros(len(passed.tag))
    for corner, way in (
        (passed.motion, (1.0 - passed.share) * length[passed.motion]),
        (passed.motion - 1, passed.share * length[passed.motion]),
    ):
        near = is_line[corner] & is_line[corner + 1] & ~trace.is_exact[corner]
        near &= (way < reach[corner]) & (corner > 0)
        at = corner[near]
        ends = [
            point[at] + (reach[at] / length[next_])[:, None] * (point[other] - point[at])
            for other, next_ in ((at - 1, at), (at + 1, at + 1))
        ]
        off[near] = np.maximum(off[near], corner_miss(ends[0], point[at], ends[1]))
    return off


def _nearest(
    real: RealPaths, points: FloatArray, rows: IndexArray, low: AnyIntArray, high: AnyIntArray
) -> Passed:
    """Return where the motions ``low`` to ``high`` (k,) of tags ``rows`` pass them."""
    k, paths = len(rows), real.commanded
    found = Passed(rows, low.astype(np.int64), *(np.zeros(k) for _ in range(4)))
    way = np.zeros(k)
    is_line = paths.trace.motion_type == MotionType.LIN
    plain = (low == high) & is_line[low] & (len(real.paths) == 1)
    at = np.flatnonzero(plain)
    ends = paths.end_point[low[at] - 1], paths.end_point[low[at]]
    found.share[at], found.chord[at] = onto_line(points[rows[at]], *ends)
    way[at] = found.share[at] * np.linalg.norm(ends[1] - ends[0], axis=1)
    for place in np.flatnonzero(~plain).tolist():
        tag = int(rows[place])
        motion, begin, knots = _course(real.of(tag), int(low[place]), int(high[place]))
        point = np.broadcast_to(points[tag], (len(motion), 3))
        share, chord = onto_line(point, knots[:-1], knots[1:])
        best = int(chord.argmin())
        length = np.linalg.norm(np.diff(knots, axis=0), axis=1)
        found.motion[place], found.chord[place] = motion[best], chord[best]
        found.share[place] = begin[best] + share[best] * _PIECE
        way[place] = length[:best].sum() + share[best] * length[best]
    back = np.flatnonzero((np.diff(way) < -_BACK) & (np.diff(low) == 0))
    found.chord[back + 1] = np.inf
    return found


def _course(paths: Paths, low: int, high: int) -> tuple[IndexArray, FloatArray, FloatArray]:
    """Return pieces (p,) of motions in order: motion, share where each begins; p + 1 knots."""
    motions = [motion for motion in range(low, high + 1) if paths.trace.is_cp[motion]]
    knots = [paths.end_point[low - 1][None], *(curve_points(paths, motion) for motion in motions)]
    begin = np.arange(0.0, 1.0, _PIECE)
    motion = np.repeat(np.array(motions, dtype=np.int64), len(begin))
    return motion, np.tile(begin, len(motions)), np.concatenate(knots)


def _axes(paths: Paths, passed: Passed) -> FloatArray:
    """Return the tool axis (k, 3) in the part at the places that are passed."""
    station = paths.station
    T = paths.curves.flange(passed.motion, passed.share, station.externals, paths.external)
    external = paths.curves.external_at(passed.motion, passed.share, paths.external)
    return station.in_part(T, external, passed.motion)[1]
