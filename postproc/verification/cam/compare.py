"""The executed path against the CAM file.

Every point of the file (the bottom of a hole, else the tag itself) must be an end point of a
motion, in the file's order, within the tolerance; the tool's axis there must be the file's, or
tilted against it as the cell allows (see ``tilt``). How
the program gets from one point to the next is judged by what the file asks for:

- a rapid: any way will do (collisions are another check);
- a line or an arc: its whole length must be run by path motions within the path tolerance; the
  tool may leave and come back by joint motions or along its axis (see ``elements.follow``);
- a hole: it must come down the hole's axis from the clearance height in the pecks of its cycle,
  stop exactly at the bottom, wait there as asked, and leave along the axis to the retract height,
  with the feed where it is reamed, bored or tapped. Only what has been drilled may be entered
  faster than the feed;
- the end of a cut: the tool backs off along its axis before any motion that neither cuts nor is the
  straight rapid of the file (see ``leaving``).

A point that the program does not go to is *missed*; if it goes there at another time, it is out of
*order*. Both count with the distance to where the program does go between the neighbours.

With a model of the arm all this is asked of the real tool: the commanded points may be off the file
by what the arm is expected to give way (see ``real``).
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray
from postproc.cell import Cell
from postproc.controller import MotionType
from postproc.errors import RunKind
from postproc.geometry import angle_between
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.paths import Displacement
from postproc.process import Claims, claimed
from postproc.units import DEG, MM
from postproc.verification.cam.comparison import Comparison, Tolerances
from postproc.verification.cam.elements import NEAR, Followed, element_to, follow
from postproc.verification.cam.feeds import AT_MOST, Feeds
from postproc.verification.cam.holes import check_holes, passed_pecks
from postproc.verification.cam.leaving import check_leaving
from postproc.verification.cam.matching import (
    FAR,
    SAME_AXIS,
    Visits,
    Wanted,
    bottoms_apart,
    by_frames,
    match,
    wanted_of,
)
from postproc.verification.cam.real import RealPaths, real_paths
from postproc.verification.cam.strokes import ON_TOP, check_strokes
from postproc.verification.cam.tilt import Tilts, check_between
from postproc.verification.cam.unasked import check_unasked
from postproc.verification.report import Result

BENT = 0.25
"""Share of the turn of the tool axis by which it may be beside the shortest one."""


def compare(
    result: Result,
    cell: Cell,
    toolpath: ToolPath,
    tolerances: Tolerances,
    displacement: Displacement | None = None,
    tilts: Tilts | None = None,
) -> Comparison:
    """Compare a program with the CAM file it was made from.

    Args:
        result: joint paths of the program; collects the findings.
        cell: the chord tolerance and the feed where the file gives none.
        toolpath: what was asked for.
        tolerances: how far the program may be off.
        displacement: of the real tool point against the commanded one; None: as commanded.
        tilts: of a file with more points than ``toolpath`` at those it has; None: of ``toolpath``.
    """
    paths = result.paths
    wanted, claims = wanted_of(toolpath), claimed(toolpath, cell)
    n = len(toolpath)
    real = paths_of(result, cell, toolpath, displacement)
    left = 0.0 if displacement is None else displacement.left
    visits = visits_of(result, real, wanted, claims, tolerances.position, left)
    served = visits.first
    comparison = Comparison(
        wanted,
        served,
        visits.last,
        np.zeros(len(paths), dtype=np.bool_),
        np.zeros(len(paths), dtype=np.bool_),
        np.full(len(paths), -1),
        np.zeros(n),
        np.zeros(n),
        np.zeros(n),
        real,
        None if displacement is None else np.zeros(n),
    )
    tilts = Tilts.of(toolpath, cell) if tilts is None else tilts
    _points(result, comparison, claims, cell, tolerances, tilts)
    path_tolerance = tolerances.path if tolerances.path is not None else cell.motion.chord
    feeds = Feeds(result, toolpath, cell)
    path_tolerance += tolerances.position
    judged = np.zeros(len(paths), dtype=np.bool_)
    motions = _elements(result, comparison, toolpath, path_tolerance, feeds, judged)
    if tilts.allowed:
        check_between(result, tilts, toolpath, motions, comparison.tilt)
    else:
        _turned_between(result, wanted, motions, tolerances.axis)
    near, is_cut = tolerances.position, comparison.is_cut
    milled = comparison.milled
    milled[:] = is_cut
    comparison.cut_of[milled] = 0
    holes = check_holes(result, real, wanted, toolpath, served, is_cut, near, feeds)
    on_axis = holes.on_axis
    for row, (first, last) in holes.spans.items():
        comparison.cut_of[first : last + 1] = row + 1
    limits, shift = (tolerances.axis, path_tolerance), comparison.largest_shift()
    check_strokes(result, real, wanted, on_axis, limits, shift)
    check_leaving(result, cell, toolpath, served, visits.last, milled)
    judged |= comparison.is_cut | (on_axis >= 0)
    judged[served[served >= 0]] = True
    latest = visits.last[served >= 0]
    judged[latest] |= paths.trace.is_cp[latest]  # a joint motion serves a point once
    if (served >= 0).all():  # else what goes beside a point is told as that
        check_unasked(result, cell, judged, milled, NEAR * path_tolerance + shift)
    _relative(result, comparison.is_cut | (on_axis >= 0))
    feeds.report()
    return comparison


def paths_of(
    result: Result, cell: Cell, toolpath: ToolPath, displacement: Displacement | None
) -> RealPaths:
    """Return the paths of the tool that is compared: arguments as ``compare``."""
    if displacement is None:
        return RealPaths.nominal(result.paths, len(toolpath))
    return real_paths(result.paths, cell, toolpath, displacement)


def visits_of(
    result: Result, real: RealPaths, wanted: Wanted, claims: Claims, tolerance: float, left: float
) -> Visits:
    """Return which motions go to the wanted points.

    Args:
        result: the program.
        real: paths of the tool that is compared.
        wanted: what the CAM file asks for.
        claims: the tool and the base of each tag.
        tolerance: [m].
        left: up to this [m] the tolerance is doubled until all points are served.
    """
    paths = result.paths
    own = np.isin(wanted.kind, (MotionKind.ARC, MotionKind.HOLE))
    own[1:] |= wanted.kind[:-1] == MotionKind.HOLE  # a stroke ends above the point
    own[1:] |= angle_between(wanted.axis[1:], wanted.axis[:-1]) > SAME_AXIS
    own[[stretch.low for stretch in claims.stretches()]] = True
    moving = np.where(paths.stands[:, None], FAR, _visited(real))
    visited, case = by_frames(moving, real.case, claims, paths.station)
    pecks = passed_pecks(paths, tolerance)
    visited, case = bottoms_apart(visited, case, wanted.is_hole, pecks)
    return match(wanted.point, visited, tolerance, own, case, left)


def _visited(real: RealPaths) -> FloatArray:
    """Return the end points (cases, m, 3), far away where a motion has none."""
    points = real.end_point
    return np.where(np.isfinite(points), points, FAR)


def _relative(result: Result, serves: BoolArray) -> None:
    """Report relative motions that serve nothing: the file has none, and they shift the arm."""
    trace = result.paths.trace
    for motion in np.flatnonzero(trace.is_relative & ~serves)[:AT_MOST].tolist():
        text = "a relative motion that serves no point of the CAM file"
        result.finding(RunKind.PATH, motion, text)


# --------------------------------------------------------------------------------------- points


def _points(
    result: Result,
    comparison: Comparison,
    claims: Claims,
    cell: Cell,
    tolerances: Tolerances,
    tilts: Tilts,
) -> None:
    toolpath = claims.toolpath
    paths, wanted, served = result.paths, comparison.wanted, comparison.served
    found = np.flatnonzero(served >= 0)
    if len(found):
        motion = served[found]
        real = comparison.real
        off = real.end_point[real.case[found], motion] - wanted.point[found]
        comparison.position_error[found] = np.linalg.norm(off, axis=1)
        if comparison.nominal_error is not None:
            off = paths.end_point[motion] - wanted.point[found]
            comparison.nominal_error[found] = np.linalg.norm(off, axis=1)
        error, tilt = tilts.judge(found, paths.end_axis[motion])
        comparison.axis_error[found], comparison.tilt[found] = error, tilt
        _measure_points(result, comparison, found)
        if tilts.allowed:
            most = int(found[int(tilt.argmax())])
            value = float(comparison.tilt[most] / DEG)
            result.measure("tilt", value, "deg", int(served[most]))
        _wrong_axes(result, comparison, toolpath, found, tolerances.axis)
        _beside(result, comparison, toolpath, found, tolerances.position)
    _missed(result, comparison, claims, cell, tolerances.position, tilts)


def _turned_between(
    result: Result, wanted: Wanted, motions: dict[int, tuple[int, ...]], limit: float
) -> None:
    """Report where the tool axis, in the middle of a cut, is not between those of its two tags.

    Beside the shortest turn from one to the other by no more than a share of it: the turn about the
    tool's own axis bends the way.
    """
    inner = [(motion, row) for row, covered in motions.items() for motion in covered[:-1]]
    if not inner:
        return
    motion, row = np.array(inner).T
    axis = result.paths.end_axis[motion]
    turn = angle_between(wanted.axis[row - 1], wanted.axis[row])
    both = angle_between(axis, wanted.axis[row - 1]) + angle_between(axis, wanted.axis[row])
    off = 0.5 * (both - turn)
    bad = np.flatnonzero(off > limit + BENT * turn)
    for place in bad[np.argsort(-off[bad], kind="stable")][:AT_MOST].tolist():
        text = f"the tool axis is {off[place] / DEG:.4f} deg beside those of the cut's ends"
        result.finding(RunKind.AXIS, int(motion[place]), text + _more(len(bad)))


def _measure_points(result: Result, comparison: Comparison, found: AnyIntArray) -> None:
    for name, values, unit, size in (
        ("position", comparison.position_error, "mm", MM),
        ("axis", comparison.axis_error, "deg", DEG),
    ):
        row = int(found[int(values[found].argmax())])
        result.measure(name, float(values[row] / size), unit, int(comparison.served[row]))


def _wrong_axes(
    result: Result, comparison: Comparison, toolpath: ToolPath, found: AnyIntArray, limit: float
) -> None:
    bad = found[comparison.axis_error[found] > limit]
    for row in bad[np.argsort(-comparison.axis_error[bad], kind="stable")][:AT_MOST].tolist():
        result.finding(
            RunKind.AXIS,
            int(comparison.served[row]),
            f"the tool axis is {comparison.axis_error[row] / DEG:.4f} deg off at tag "
            f"{_tag(toolpath, row)}" + _more(len(bad)),
        )


def _beside(
    result: Result, comparison: Comparison, toolpath: ToolPath, found: AnyIntArray, limit: float
) -> None:
    """Report tags that are served, but from beside them."""
    error = comparison.position_error
    bad = found[error[found] > limit]
    for row in bad[np.argsort(-error[bad], kind="stable")][:AT_MOST].tolist():
        motion = int(comparison.served[row])
        visited = _visited(comparison.real)[comparison.real.case[row]]
        kind, text = _how(comparison.wanted, row, visited, motion, limit)
        result.finding(kind, motion, f"tag {_tag(toolpath, row)}: {text}" + _more(len(bad)))


def _missed(
    result: Result,
    comparison: Comparison,
    claims: Claims,
    cell: Cell,
    tolerance: float,
    tilts: Tilts,
) -> None:
    """Report tags that no motion goes to, with how far off the program is there."""
    toolpath, station = claims.toolpath, result.paths.station
    served, wanted, paths = comparison.served, comparison.wanted, result.paths
    lost = np.flatnonzero(served < 0)
    if not len(lost):
        return
    every, case = _visited(comparison.real), comparison.real.case
    before = np.maximum.accumulate(served)
    behind = np.minimum.accumulate(np.where(served < 0, len(paths), served)[::-1])[::-1]
    for number, row in enumerate(lost.tolist()):
        visited = every[case[row]]
        low, high = max(int(before[row]), 0), min(int(behind[row]) + 1, len(paths))
        gap = np.linalg.norm(visited[low:high] - wanted.point[row], axis=1)
        if not len(gap):
            comparison.position_error[row] = np.inf
            if not row:
                text = f"tag {_tag(toolpath, row)}: the program makes no motion at all"
                result.finding_at(RunKind.MISSED, None, text)
            continue
        nearest = low + int(gap.argmin())
        if comparison.nominal_error is not None:
            off = paths.end_point[nearest] - wanted.point[row]
            comparison.nominal_error[row] = float(np.linalg.norm(off))
        comparison.position_error[row] = float(gap.min())
        error, _ = tilts.judge(np.array([row]), paths.end_axis[nearest : nearest + 1])
        comparison.axis_error[row] = float(error[0])
        if number < AT_MOST:
            kind, text = _how(wanted, row, visited, nearest, tolerance)
            used = int(station.tool[nearest]), int(station.base[nearest])
            asked = int(claims.tool[row]), int(claims.base[row])
            if used != asked and gap.min() <= tolerance:
                kind, text = _other_tool(cell, used, asked)
            result.finding(kind, nearest, f"tag {_tag(toolpath, row)}: {text}" + _more(len(lost)))
    worst = int(lost[int(comparison.position_error[lost].argmax())])
    if np.isfinite(comparison.position_error[worst]):
        value = float(comparison.position_error[worst] / MM)
        result.measure("position", value, "mm", min(int(max(before[worst], 0)), len(paths) - 1))


def _other_tool(cell: Cell, used: tuple[int, int], asked: tuple[int, int]) -> tuple[RunKind, str]:
    """Return kind and words: which tool and base go there instead of those that the file means."""
    words = [
        f"tool {cell.tools[tool].number} in base {cell.bases[base].number}"
        for tool, base in (used, asked)
        if tool >= 0 and base >= 0
    ]
    wanted = " ".join(words[1:]) or "no such tool"
    return RunKind.TOOL, f"{words[0]} goes there, the file asks for {wanted}"


def _how(
    wanted: Wanted, row: int, visited: FloatArray, nearest: int, tolerance: float
) -> tuple[RunKind, str]:
    """Return kind and words for a tag that was not served."""
    off = visited[nearest] - wanted.point[row]
    distance = float(np.linalg.norm(off))
    anywhere = float(np.linalg.norm(visited - wanted.point[row], axis=1).min())
    beside = wanted.point[[max(row - 1, 0), min(row + 1, len(wanted.point) - 1)]]
    apart = np.linalg.norm(beside - wanted.point[row], axis=1)
    # a motion nearer than half the way to the next tag is this one's; strokes near a hole are not
    own = 0.5 * float(np.min(apart[apart > 0.0], initial=np.inf))
    is_own = distance <= own and not wanted.depth[row] > 0.0
    if anywhere <= tolerance and not is_own:
        return RunKind.ORDER, "the program goes there, but not in the order of the CAM file"
    if wanted.depth[row] > 0.0:
        along = float(off @ wanted.axis[row])
        side = float(np.linalg.norm(off - along * wanted.axis[row]))
        if side <= 10.0 * tolerance < 10.0 * abs(along):
            where = "deeper" if along > 0.0 else "higher"
            return RunKind.DEPTH, f"the hole ends {abs(along) / MM:.3f} mm {where} than asked"
    return RunKind.POSITION, f"the program goes no nearer than {distance / MM:.4f} mm"


def _tag(toolpath: ToolPath, row: int) -> str:
    return f"{toolpath.tag_name(row)} (line {int(toolpath.line[row])})"


def _more(count: int) -> str:
    return f", {count} such tags" if count > AT_MOST else ""


# ------------------------------------------------------------------------------------- elements


def _elements(
    result: Result,
    comparison: Comparison,
    toolpath: ToolPath,
    tolerance: float,
    feeds: Feeds,
    judged: BoolArray,
) -> dict[int, tuple[int, ...]]:
    """Check lines and arcs between served tags; return the motions that cut towards each tag.

    ``judged`` (m,), changed in place: motions on a way that is reported as wrong.
    """
    served, kind = comparison.served, comparison.wanted.kind
    rows = np.flatnonzero(np.isin(kind, CUTS) & (served >= 0))
    opens = rows[rows == 0]
    rows = rows[rows > 0]
    rows = rows[served[rows - 1] >= 0]
    station = result.paths.station
    frames = np.stack([station.tool, station.base], axis=1)
    changed = (frames[served[rows]] != frames[served[rows - 1]]).any(axis=1)
    # first of all and behind a change the file does not say where a cut comes from: any way will
    # do, a line at feed
    lines = np.concatenate([opens, rows[changed]])
    lines = lines[result.paths.trace.is_cp[served[lines]]]
    comparison.is_cut[served[lines]] = True
    feeds.expect_rows(lines, served[lines])
    loose = changed | (kind[rows - 1] == MotionKind.HOLE)
    for row in rows[loose & (served[rows] > served[rows - 1])].tolist():
        judged[int(served[row - 1]) + 1 : int(served[row])] = True  # pieces of a compensated line
    rows = rows[~changed]
    behind_hole = kind[rows - 1] == MotionKind.HOLE
    _behind_holes(result, comparison, toolpath, rows[behind_hole], feeds)
    rows = rows[~behind_hole]
    step = served[rows] - served[rows - 1]
    direct = (kind[rows] == MotionKind.LINEAR) & (step == 1)
    direct &= result.paths.trace.motion_type[served[rows]] == MotionType.LIN
    comparison.is_cut[served[rows[direct]]] = True
    feeds.expect_rows(rows[direct], served[rows[direct]])
    worst = _bent(result, comparison, toolpath, rows[direct], tolerance)
    motions: dict[int, tuple[int, ...]] = {}
    motions |= {row: (int(served[row]),) for row in rows[direct].tolist()}
    faults = 0
    for row in rows[~direct & (step > 0)].tolist():
        done = follow(
            element_to(toolpath, row),
            comparison.real.of(row),
            int(served[row - 1]) + 1,
            int(served[row]),
            tolerance,
            comparison.real.of(row - 1),
        )
        comparison.is_cut[list(done.covered)] = True
        motions[row] = done.covered
        feeds.expect(row, done.covered)
        if worst is None or done.deviation > worst.deviation:
            worst = done
        if done.fault or done.deviation > tolerance:
            faults += 1
            judged[int(served[row - 1]) + 1 : int(served[row]) + 1] = True
            if faults <= AT_MOST:
                text = done.fault or f"{done.deviation / MM:.4f} mm beside the path"
                result.finding(RunKind.PATH, done.motion, f"to tag {_tag(toolpath, row)}: {text}")
    if worst is not None:
        result.measure("path", worst.deviation / MM, "mm", worst.motion)
    return motions


def _behind_holes(
    result: Result, comparison: Comparison, toolpath: ToolPath, rows: AnyIntArray, feeds: Feeds
) -> None:
    """Check the last motion of cuts that begin behind a hole: at feed, wherever it comes from.

    Not where the tool stands there already when it has left the hole.
    """
    wanted = comparison.wanted
    left = wanted.top - np.maximum(wanted.clear, wanted.retract)[:, None] * wanted.axis
    rows = rows[np.linalg.norm(wanted.top[rows] - left[rows - 1], axis=1) > ON_TOP]
    motions = comparison.served[rows]
    comparison.is_cut[motions] = True
    is_cp = result.paths.trace.is_cp[motions]
    feeds.expect_rows(rows[is_cp], motions[is_cp])
    for row in rows[~is_cp][:AT_MOST].tolist():
        text = f"to tag {_tag(toolpath, row)}: a joint motion, the CAM file asks for a line"
        result.finding(RunKind.PATH, int(comparison.served[row]), text)


def _bent(
    result: Result, comparison: Comparison, toolpath: ToolPath, rows: AnyIntArray, tolerance: float
) -> Followed | None:
    """Return how far the real tool leaves straight lines that are right at both ends.

    Commanded points cannot; the arm gives way by another amount in the middle of a long line.
    """
    real = comparison.real
    if comparison.nominal_error is None or not len(rows):
        return None
    tag = np.full(len(result.paths), -1)
    tag[comparison.served[rows]] = rows
    own = tag[result.paths.row]
    sample = np.flatnonzero((own >= 0) & (result.paths.share < 1.0))
    if not len(sample):
        return None
    own, progress = own[sample], result.paths.share[sample, None]
    every = np.stack([paths.point for paths in real.paths])
    # where the load changes from tag to tag, it does so along the line
    points = (1.0 - progress) * every[real.case[own - 1], sample]
    points = points + progress * every[real.case[own], sample]
    start = np.asarray(toolpath.points)[own - 1]
    way = np.asarray(toolpath.points)[own] - start
    square = np.maximum(np.einsum("ij,ij->i", way, way), 1e-24)
    share = np.clip(np.einsum("ij,ij->i", points - start, way) / square, 0.0, 1.0)
    off = np.linalg.norm(points - start - share[:, None] * way, axis=1)
    off = np.where(np.isfinite(off), off, 0.0)
    place = int(off.argmax())
    motion = int(result.paths.row[sample[place]])
    beside = int(np.unique(own[off > tolerance]).size)
    if beside:
        text = f"the real tool is expected {off[place] / MM:.4f} mm beside the line, {beside} lines"
        result.finding(RunKind.PATH, motion, f"to tag {_tag(toolpath, int(own[place]))}: {text}")
    return Followed(float(off[place]), motion)
