"""Speeds, blends and estimated times of moves in order."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray, blocks
from postproc.errors import Finding, Severity
from postproc.geometry import rotation_angle
from postproc.model import MoveKind, MoveRole
from postproc.paths import joint_path, joint_times, top_speeds, torques_of
from postproc.planning.checks import (
    LOWER,
    Checker,
    Lines,
    Reason,
    Track,
    Verdict,
    failure,
    poses_between,
)
from postproc.planning.route.corners import headings, lowered_blends, wished_blends
from postproc.planning.route.working import LEAVE
from postproc.planning.states import Moves, Problem
from postproc.process import AXIS_SHARE, TAPS, least_feeds, machining_speeds
from postproc.records import dataclass
from postproc.timing import (
    Bends,
    JointPath,
    Samples,
    axis_speed_cap,
    path_times,
    resolved,
)
from postproc.units import MM_PER_MIN

SLOWEST = 1e-5
"""Path speed [m/s] below which a cut is not possible: 0.6 mm/min."""
ON_THE_SPOT = 1e-5
"""On a way [m] as short as this the speed of the orientation counts: what program text rounds
would shift the one of the path."""


@dataclass(slots=True)
class Timed:
    """Columns (m,) of moves: path speed [m/s], share of axis speed, blend [m], time [s].

    ``orientation``: the speed [rad/s] to which the orientation of a move is slowed down, NaN where
    the cell's will do.
    """

    speed: FloatArray
    fraction: FloatArray
    blend: FloatArray
    duration: FloatArray
    orientation: FloatArray


def timed(
    checker: Checker,
    table: Moves,
    stops_before: BoolArray,
    findings: list[Finding],
    tolerance: FloatArray,
    *,
    runs: bool = True,
) -> Timed:
    """Return speeds that the axes can follow, blends, and times.

    Corners between cuts are passed by no more than ``tolerance`` (m,) [m]. A cut without a feed,
    and a motion too fast for an axis at any speed, are findings. Where it is known that the moves
    cannot be run (``runs``) no corner is blended: how far one may be takes long to find out.
    """
    problem = checker.problem
    rows, lines, track, cap, orientation = _paced(checker, table)
    length = np.zeros(len(table))
    length[rows] = lines.length
    speed = _capped(problem, table, rows, cap, findings)
    blend = wished_blends(problem, replace(table, speed=speed), length, stops_before)
    if runs and not any(finding.is_error for finding in findings):
        blend = lowered_blends(checker, table, lines, rows, blend, tolerance)
    else:
        blend[:] = 0.0
    is_path = np.isin(np.arange(len(table)), rows)
    fraction = np.where(is_path, np.nan, _axis_shares(problem, table))
    robot = problem.cell.robot
    torques = torques_of(robot, [problem.cell.tool])
    joints = joint_path(robot, track.row, track.share, track.q, lines.q_from, blend[rows], torques)
    duration = _durations(
        problem, table, length, np.minimum(speed, cap), blend, orientation, joints
    )
    return Timed(np.where(is_path, speed, np.nan), fraction, blend, duration, orientation)


def _axis_shares(problem: Problem, table: Moves) -> FloatArray:
    """Return the share (m,) of axis speed of joint moves: the cell's, or less as the file says.

    What the file says of the motion to a tag holds on the whole way there.
    """
    share = np.full(len(table), problem.cell.motion.rapid)
    asked = np.asarray(problem.toolpath.joint_fraction)[table.tag]
    return np.where(table.order < LEAVE, np.fmin(share, asked), share)


def least_of_moves(problem: Problem, table: Moves) -> FloatArray:
    """Return the lowest path speed (m,) [m/s] that the process takes at each move."""
    works = np.isin(table.role, (MoveRole.CUT, MoveRole.PLUNGE))
    return np.where(works, least_feeds(problem.toolpath, problem.cell)[table.tag], 0.0)


def followed_speeds(checker: Checker, table: Moves) -> FloatArray:
    """Return the path speeds (m,) [m/s] of moves, lowered to what the axes follow; NaN for PTP."""
    rows, _, _, cap, _ = _paced(checker, table)
    speed = np.full(len(table), np.nan)
    speed[rows] = _followed(table.speed, cap, least_of_moves(checker.problem, table))[rows]
    return speed


def _paced(
    checker: Checker, table: Moves
) -> tuple[IndexArray, Lines, Track, FloatArray, FloatArray]:
    """Return the rows of path moves, their lines, and their joint paths at the speeds asked.

    And for all moves what ``_caps`` says of these.
    """
    is_path = table.kind != MoveKind.PTP
    is_path[:1] = False
    rows = np.nonzero(is_path)[0]
    branch = np.asarray(checker.problem.kinematics.slot(table.q), dtype=np.int64)
    lines = Lines(
        T_from=table.T_base_tcp[rows - 1],
        T_to=table.T_base_tcp[rows],
        q_from=table.q[rows - 1],
        q_to=table.q[rows],
        branch=branch[rows],
        contact=np.ones(len(rows), dtype=np.bool_),
        external=(table.external[rows - 1], table.external[rows]),
        arcs=table.arcs.rows(rows),
    )
    cap, orientation = np.full(len(table), np.inf), np.full(len(table), np.nan)
    parts: dict[int, Track] = {}
    for part in blocks(max(len(rows), 1)):
        at, own = rows[part], lines.cut(part)
        track = checker.track(own, Verdict.clean(len(own)))
        track = parts[part.start] = _raced(checker.problem, own, track, table.speed[at])
        cap[at], orientation[at] = _caps(checker.problem, own, track)
    return rows, lines, Track.joined(parts), cap, orientation


def is_too_fast(problem: Problem, lines: Lines, track: Track, least: FloatArray) -> BoolArray:
    """Return at which motions (m,) an axis cannot follow the lowest speed (m,) [m/s] allowed."""
    known = _caps(problem, lines, track)[0] < least  # the mean over a piece needs more already
    fine = _raced(problem, lines, track, np.where(known, 0.0, least))
    return known | (_caps(problem, lines, fine)[0] < least)


def _caps(problem: Problem, lines: Lines, track: Track) -> tuple[FloatArray, FloatArray]:
    """Return the largest path speed (m,) [m/s] at which no axis exceeds its speed on the way.

    In the mean between samples of the track: well above the speed that these are made for it is an
    estimate. A move that turns the tool on the spot, or nearly so, has no useful path speed: there
    it is the speed of the orientation (m,) [rad/s] that is lowered, NaN where the cell's will do.
    """
    cap, orientation = np.full(len(lines), np.inf), np.full(len(lines), np.nan)
    same = track.row[1:] == track.row[:-1]
    row = track.row[1:][same]
    piece = (np.diff(track.share)[same]) * lines.length[row]
    places = np.hstack([track.q, lines.external_at(track.row, track.share)])
    dq = np.diff(places, axis=0)[same]
    speed = AXIS_SHARE * _axis_speeds(problem)
    np.minimum.at(cap, row, axis_speed_cap(dq, np.maximum(piece, ROUNDING), speed))
    cap[lines.length <= ROUNDING] = np.inf
    angle = rotation_angle(lines.T_from[:, :3, :3], lines.T_to[:, :3, :3])
    turning = np.full(len(lines), np.inf)
    np.minimum.at(turning, row, axis_speed_cap(dq, np.diff(track.share)[same] * angle[row], speed))
    on_the_spot = (angle > ROUNDING) & ((lines.length <= ON_THE_SPOT) | (cap < SLOWEST))
    slow = on_the_spot & (turning < problem.cell.krl.orientation_speed)
    orientation[slow] = turning[slow]
    cap[on_the_spot] = np.inf
    return cap, orientation


def _raced(problem: Problem, lines: Lines, track: Track, asked: FloatArray) -> Track:
    """Return joint paths sampled finely enough for the speeds of the axes at the speed asked."""
    angle = rotation_angle(lines.T_from[:, :3, :3], lines.T_to[:, :3, :3])
    with np.errstate(divide="ignore", invalid="ignore"):
        way = lines.length / np.where(asked > 0.0, asked, 0.0)
    time = np.where(lines.length > ON_THE_SPOT, way, angle / problem.cell.krl.orientation_speed)

    def places_at(row: IndexArray, share: FloatArray, near: FloatArray) -> FloatArray:
        T, external = poses_between(lines, row, share), lines.external_at(row, share)
        q, reached = problem.solve(T, external, lines.branch[row], near[:, :6])
        q[~reached] = np.nan
        return np.hstack([q, external])

    places = np.hstack([track.q, lines.external_at(track.row, track.share)])
    samples = Samples(track.row, track.share, places)
    row, share, places = resolved(samples, time, _axis_speeds(problem), places_at)
    return Track(row, share, places[:, :6])


def can_be_told(problem: Problem, lines: Lines, track: Track) -> BoolArray:
    """Return which straight rapids (m,) are no cuts for all that a text says of their speed.

    ``track``: the joint paths of the lines.
    """
    cell = problem.cell
    rapid = np.full(len(lines), cell.motion.rapid_speed)
    cap = _caps(problem, lines, _raced(problem, lines, track, rapid))[0]
    return ~machining_speeds(_followed(rapid, cap, 0.0), cell)


def _axis_speeds(problem: Problem) -> FloatArray:
    """Return the largest speeds (6 + k,) of the arm's axes and of the external ones that move."""
    speeds = top_speeds(problem.cell)
    return speeds if problem.placement.axes is not None else speeds[:6]


def _busiest(problem: Problem, table: Moves, row: int) -> str:
    """Return the axis that needs the largest share of its speed on a move."""
    places = np.hstack([table.q, table.external])[[row - 1, row]]
    axis = int(np.argmax(np.abs(places[1] - places[0]) / _axis_speeds(problem)))
    return f"A{axis + 1}" if axis < 6 else problem.cell.external_axes[axis - 6].name


def _capped(
    problem: Problem, table: Moves, rows: IndexArray, cap: FloatArray, findings: list[Finding]
) -> FloatArray:
    """Return the speeds with those lowered that an axis cannot follow, with a finding each."""
    speed = table.speed.copy()
    missing = rows[~np.isfinite(speed[rows])]
    for tag in np.unique(table.tag[missing]).tolist():
        findings.append(
            Finding(
                Severity.ERROR,
                "PLN205",
                "this cut has no feed: neither the input nor the cell gives one",
                tag,
                problem.toolpath.source(tag),
                hint="give [motion] feed_mm_min in the cell file",
            )
        )
    findings += _crawls(problem, table, rows[speed[rows] < SLOWEST])
    speed[missing] = np.inf
    least = least_of_moves(problem, table)
    cap = _followed(speed, cap, least)
    fast = rows[np.isfinite(speed[rows]) & (speed[rows] > cap[rows])]
    tapped = _is_tapped(problem, table)
    for row in fast.tolist():
        tag = int(table.tag[row])
        if cap[row] < SLOWEST or tapped[row]:
            findings.append(failure(problem, tag, Reason.SPEED, _too_slow(problem, table, row)))
        elif cap[row] < least[row]:
            axis = _busiest(problem, table, row)
            text = (
                f"{axis} follows the path at {cap[row] / MM_PER_MIN:.0f} mm/min at most, the "
                f"process takes no less than {least[row] / MM_PER_MIN:.0f}"
            )
            findings.append(failure(problem, tag, Reason.SPEED, text, LOWER))
    slow = np.maximum(least, SLOWEST)
    cuts = fast[np.isin(table.role[fast], (MoveRole.CUT, MoveRole.PLUNGE))]
    cuts = cuts[cap[cuts] >= slow[cuts]]
    for asked in np.unique(speed[cuts]).tolist():
        findings.append(_slower(problem, table, cuts[speed[cuts] == asked], asked, cap))
    speed[fast] = cap[fast]
    return np.where(np.isfinite(speed), speed, SLOWEST)


def _crawls(problem: Problem, table: Moves, rows: IndexArray) -> list[Finding]:
    """Return one error for each feed of moves (k,) that is too slow to be one."""
    asked, first = np.unique(table.speed[rows], return_index=True)
    return [
        failure(
            problem,
            int(table.tag[rows[row]]),
            Reason.SPEED,
            f"a feed of {speed / MM_PER_MIN:g} mm/min, expected at least {SLOWEST / MM_PER_MIN:g}",
        )
        for speed, row in zip(asked.tolist(), first.tolist(), strict=True)
    ]


def _is_tapped(problem: Problem, table: Moves) -> BoolArray:
    """Return (m,) moves whose feed is bound to the spindle: in and out of a tapped hole."""
    taps = [cycle.kind in TAPS for cycle in problem.toolpath.cycles]
    own = np.array([*taps, False])[np.asarray(problem.toolpath.cycle)[table.tag]]
    return np.asarray(own & (table.speed < problem.cell.motion.rapid_speed))


def _followed(speed: FloatArray, cap: FloatArray, least: FloatArray | float) -> FloatArray:
    """Return the speeds (m,) [m/s], lowered to even ones where they are above what axes follow.

    No speed that axes follow becomes less than ``least`` for being even.
    """
    fast = speed > cap * (1.0 + ROUNDING)
    result = speed.copy()
    even = _even(cap[fast])
    result[fast] = np.maximum(even, np.where(least <= cap, least, 0.0)[fast])
    return result


def _even(speed: FloatArray) -> FloatArray:
    """Return speeds lowered to even ones: a program need not follow every digit of a limit.

    Down to multiples of a fortieth or a hundredth of the power of ten above, 9 % lower at most.
    """
    size = 10.0 ** np.ceil(np.log10(np.maximum(speed, SLOWEST)))
    fine = np.where(speed < 0.5 * size, 0.01, 0.025) * size
    return np.asarray(np.floor(speed / fine + ROUNDING) * fine)


def _too_slow(problem: Problem, table: Moves, row: int) -> str:
    return f"{_busiest(problem, table, row)} cannot follow the path at any useful speed"


def _slower(
    problem: Problem, table: Moves, rows: IndexArray, asked: float, cap: FloatArray
) -> Finding:
    """Return one finding for all moves (k,) whose feed is lowered from the same value."""
    worst = int(rows[np.argmin(cap[rows])])
    tag = int(table.tag[worst])
    tags, axis = np.unique(table.tag[rows]), _busiest(problem, table, worst)
    lines = problem.toolpath.line[tags]
    more = f" at the slowest of {len(tags)} tags, lines {lines.min()} to {lines.max()}"
    return Finding(
        Severity.WARNING,
        "PLN301",
        f"feed lowered from {asked / MM_PER_MIN:.0f} to {cap[worst] / MM_PER_MIN:.0f} mm/min"
        f"{more if len(tags) > 1 else ''}: {axis} is at its largest speed",
        tag,
        problem.toolpath.source(tag),
    )


def _durations(
    problem: Problem,
    table: Moves,
    length: FloatArray,
    speed: FloatArray,
    blend: FloatArray,
    orientation: FloatArray,
    joints: JointPath | None,
) -> FloatArray:
    """Return the estimated time (m,) [s] of each move, without its dwell."""
    cell, krl = problem.cell, problem.cell.krl
    duration = np.zeros(len(table))
    joint = np.nonzero(table.kind == MoveKind.PTP)[0]
    later = joint[joint > 0]
    share = _axis_shares(problem, table)[later]
    duration[later] = joint_times(cell, share, table.q[later - 1], table.q[later])
    path = np.flatnonzero((table.kind != MoveKind.PTP) & (np.arange(len(table)) > 0))
    stop = (blend[path] == 0.0) | (krl.advance == 0)  # without advance run no corner is blended
    stop[:-1] |= np.diff(path) > 1
    R = table.T_base_tcp[:, :3, :3]
    turned = np.zeros(len(table))
    turned[1:] = rotation_angle(R[:-1], R[1:])
    turning = turned / np.where(np.isfinite(orientation), orientation, krl.orientation_speed)
    chain = np.cumsum(np.r_[True, stop[:-1]][: len(path)])
    top = np.clip(speed[path], SLOWEST, krl.path_speed_max)
    begin, end = headings(table)
    radius = np.where(table.arcs.sweep > 0.0, table.arcs.radius, np.inf)
    bends = Bends(begin[path], end[path], radius[path], blend[path])
    duration[path] = path_times(length[path], top, chain, turning[path], joints=joints, bends=bends)
    return duration
