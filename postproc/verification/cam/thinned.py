"""Points of cuts that a program passes instead of going to them, as ``[motion] thin`` allows.

A point that no motion ends at counts as passed where the motions from the point before it to the
point behind it that the program does go to are path motions alone, and the file asks for nothing at
the point itself. It is held against the way that is driven there: its distance, and the angle of
the tool axis at the nearest place. The places follow each other as the points do. All else is
judged on the points that are left.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.controller import Blend, MotionType
from postproc.errors import RunKind
from postproc.kinematics import corner_miss
from postproc.model import BLEND_SHARE, ToolPath
from postproc.paths import Displacement, Paths
from postproc.process import claimed, may_be_passed, only
from postproc.records import dataclass
from postproc.units import DEG, MM
from postproc.verification.cam.compare import compare, paths_of, visits_of
from postproc.verification.cam.comparison import Comparison, Tolerances
from postproc.verification.cam.elements import curve_points
from postproc.verification.cam.feeds import AT_MOST
from postproc.verification.cam.matching import wanted_of
from postproc.verification.cam.real import RealPaths
from postproc.verification.cam.tilt import Tilts
from postproc.verification.report import Result

_PIECE = 0.125
"""Share of a motion between two of its ``curve_points``."""
_BACK = 0.005 * MM
"""By so much [m] a place may lie before the one of the point before."""


@dataclass(frozen=True, slots=True)
class Passed:
    """Tags (k,) that are passed: by which ``motion``, where on it, how far off [m].

    Where the motion begins or ends with an approximated corner there, by how far that may be passed
    is in it.
    """

    tag: IndexArray
    motion: AnyIntArray
    share: FloatArray
    chord: FloatArray


def compare_thinned(
    result: Result,
    cell: Cell,
    toolpath: ToolPath,
    tolerances: Tolerances,
    displacement: Displacement | None = None,
) -> Comparison:
    """Compare as ``compare`` does, with points passed that the cell lets the program pass."""
    thin = cell.motion.thin
    if thin is None or not len(result.paths) or not len(toolpath):
        return compare(result, cell, toolpath, tolerances, displacement)
    real = paths_of(result, cell, toolpath, displacement)
    left = 0.0 if displacement is None else displacement.left
    wanted, claims = wanted_of(toolpath), claimed(toolpath, cell)
    served = visits_of(result, real, wanted, claims, tolerances.position, left).first
    may = may_be_passed(toolpath, cell)
    _give_back(served, may, real, toolpath, tolerances.position)
    passed = _passed(result.paths, real, toolpath, served, may)
    if not len(passed.tag):
        return compare(result, cell, toolpath, tolerances, displacement)
    kept = np.setdiff1d(np.arange(len(toolpath)), passed.tag)
    tilts = Tilts.of(toolpath, cell)
    fewer = only(toolpath, kept)
    found = compare(result, cell, fewer, tolerances, displacement, tilts.rows(kept))
    error, tilt = tilts.judge(passed.tag, _axes(result.paths, passed))
    limits = thin.chord + (tolerances.position + left if displacement else 0.0), thin.axis
    _judge(result, toolpath, passed, error, limits)
    result.passed = len(passed.tag)
    whole = _spread(found, toolpath, kept, passed, real)
    whole.axis_error[passed.tag], whole.tilt[passed.tag] = error, tilt
    return whole


def _give_back(
    served: AnyIntArray, may: BoolArray, real: RealPaths, toolpath: ToolPath, tolerance: float
) -> None:
    """Let a motion serve the tag that may not be passed (n,) of those that lie together, in place.

    It could be that of a neighbour as well, if that is no farther off than the tolerance [m].
    """
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


def _passed(
    paths: Paths, real: RealPaths, toolpath: ToolPath, served: AnyIntArray, may: BoolArray
) -> Passed:
    """Return the tags that are passed, by whatever distance."""
    n = len(toolpath)
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
    found = _nearest(paths, real, np.asarray(toolpath.points), rows, low, high)
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
    paths: Paths,
    real: RealPaths,
    points: FloatArray,
    rows: IndexArray,
    low: AnyIntArray,
    high: AnyIntArray,
) -> Passed:
    """Return where the motions ``low`` to ``high`` (k,) of tags ``rows`` pass them."""
    k = len(rows)
    found = Passed(rows, low.astype(np.int64), np.zeros(k), np.zeros(k))
    way = np.zeros(k)
    is_line = paths.trace.motion_type == MotionType.LIN
    plain = (low == high) & is_line[low] & (len(real.paths) == 1)
    at = np.flatnonzero(plain)
    ends = paths.end_point[low[at] - 1], paths.end_point[low[at]]
    found.share[at], found.chord[at] = _onto(points[rows[at]], *ends)
    way[at] = found.share[at] * np.linalg.norm(ends[1] - ends[0], axis=1)
    for place in np.flatnonzero(~plain).tolist():
        tag = int(rows[place])
        motion, begin, knots = _course(real.of(tag), int(low[place]), int(high[place]))
        point = np.broadcast_to(points[tag], (len(motion), 3))
        share, chord = _onto(point, knots[:-1], knots[1:])
        best = int(chord.argmin())
        length = np.linalg.norm(np.diff(knots, axis=0), axis=1)
        found.motion[place], found.chord[place] = motion[best], chord[best]
        found.share[place] = begin[best] + share[best] * _PIECE
        way[place] = length[:best].sum() + share[best] * length[best]
    back = np.flatnonzero((np.diff(way) < -_BACK) & (np.diff(low) == 0))
    found.chord[back + 1] = np.inf
    return found


def _onto(points: FloatArray, start: FloatArray, end: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return the share (k,) of lines at which points (k, 3) are nearest, and how far off [m]."""
    way, here = end - start, points - start
    square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-24)
    share = np.clip(np.einsum("ij,ij->i", here, way) / square, 0.0, 1.0)
    return share, np.linalg.norm(here - share[:, None] * way, axis=1)


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


def _judge(
    result: Result,
    toolpath: ToolPath,
    passed: Passed,
    axis: FloatArray,
    limits: tuple[float, float],
) -> None:
    """Report tags that are passed farther off than the cell allows, the worst first."""
    excess = np.maximum(passed.chord / limits[0], axis / limits[1])
    bad = np.flatnonzero(excess > 1.0)
    more = f", {len(bad)} such tags" if len(bad) > AT_MOST else ""
    for place in bad[np.argsort(-excess[bad], kind="stable")][:AT_MOST].tolist():
        tag = int(passed.tag[place])
        off = f"{passed.chord[place] / MM:.4f} mm and {axis[place] / DEG:.4f} deg off"
        allowed = f"{limits[0] / MM:g} mm and {limits[1] / DEG:g} deg are allowed"
        text = f"tag {toolpath.tag_name(tag)} (line {int(toolpath.line[tag])}): passed {off}"
        kind = RunKind.POSITION if passed.chord[place] > limits[0] else RunKind.AXIS
        result.finding(kind, int(passed.motion[place]), f"{text}, {allowed}{more}")


def _spread(
    found: Comparison, toolpath: ToolPath, kept: IndexArray, passed: Passed, real: RealPaths
) -> Comparison:
    """Return a comparison of the tags ``kept`` as one of all tags of the toolpath."""
    n = len(toolpath)

    def whole(values: AnyIntArray | FloatArray, of_passed: AnyIntArray | FloatArray) -> Any:  # noqa: ANN401
        column = np.zeros(n, dtype=values.dtype)
        column[kept], column[passed.tag] = values, of_passed
        return column

    nominal = found.nominal_error
    return replace(
        found,
        wanted=wanted_of(toolpath),
        served=whole(found.served, passed.motion),
        latest=whole(found.latest, passed.motion),
        position_error=whole(found.position_error, passed.chord),
        axis_error=whole(found.axis_error, np.zeros(len(passed.tag))),
        tilt=whole(found.tilt, np.zeros(len(passed.tag))),
        real=real,
        nominal_error=None if nominal is None else whole(nominal, passed.chord),
    )
