"""Leaves points of cuts out that the lines between the others pass closely enough.

A line leads the tool point straight, and its orientation about one axis in step with the way. What
is left out lies within the chord tolerance of that way, and there the tool axis points as planned
within the axis tolerance; from the one to the next it only goes forward. Of the turn about the tool
axis, which a cut does not show, the stiffness and margins planned ask less; a file that gives whole
orientations is held to the axis tolerance in all of them. Kept are the first and the
last point of a cut, ends of arcs, points at which the feed changes or something happens, and all
points of a stretch whose long line the arm cannot run.

From each point kept the next is looked for by doubling and halving the reach: the work grows with
the number of points and with the logarithm of how many are left out at once.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import TINY, BoolArray, FloatArray, IndexArray, numbered
from postproc.geometry import angle_between, axis_angle, rotation_about, rotation_angle
from postproc.model import MoveKind, MoveRole
from postproc.planning.checks import Checker, Lines
from postproc.planning.route.speeds import followed_speeds, is_too_fast
from postproc.planning.route.working import DOWN
from postproc.process import may_be_passed
from postproc.records import dataclass
from postproc.units import DEG, MM

if TYPE_CHECKING:
    from postproc.planning.states import Moves, Problem

LONGEST = 512
"""Of so many points in a row one is kept."""
DIGITS = 2e-4 * MM
"""By so much [m] the digits of a text may move a line."""
DIGITS_OF_TURN = 1e-4 * DEG
"""By so much [rad] the digits of a text may turn the tool."""
COURSE_SHARE = 0.75
"""Lines take this share of the chord tolerance; what is left of it is for approximated corners."""
ROLL = 1.0 * DEG
"""By so much [rad] the tool may be turned about its axis against the turn that was planned."""
_WIDEST = 90.0 * DEG
_TOGETHER = 16


@dataclass(frozen=True, slots=True)
class Left:
    """What the points left out cost: ``chord`` (n,) [m], ``axis`` (n,) [rad]; NaN for kept tags."""

    chord: FloatArray
    axis: FloatArray

    @classmethod
    def none(cls, n: int) -> Left:
        """Return that nothing of n tags is left out."""
        return cls(np.full(n, np.nan), np.full(n, np.nan))


@dataclass(frozen=True, slots=True)
class Course:
    """Points in a row: poses (k, 4, 4) and external axes (k, e), and how far each may be passed.

    ``chord`` [m] for points and rails, ``axis`` [rad] for the orientation and turning axes;
    ``turns`` (e,) which external axes turn. ``tool_axis`` (3,) in the TCP: of the orientation it
    alone is held to ``axis``, the turn about it to ``ROLL``; None: the whole orientation is.
    """

    T: FloatArray
    external: FloatArray
    chord: float
    axis: float
    turns: BoolArray
    tool_axis: FloatArray | None = None

    def off(
        self, first: IndexArray, last: IndexArray
    ) -> tuple[IndexArray, IndexArray, FloatArray, FloatArray]:
        """Return what lines (m,) from points ``first`` to ``last`` do to the points between.

        Returns:
            span (p,) and row (p,) of each point between, its distance (p,) [m] from the line and
            the angle (p,) [rad] by which the tool, or with ``tool_axis`` its axis, is turned there
            against its own; infinite where the line goes back, goes nowhere, or turns too far.
        """
        span, between = numbered(last - first - 1)
        row = first[span] + 1 + between
        start, end = self.T[first], self.T[last]
        way = end[:, :3, 3] - start[:, :3, 3]
        square = np.einsum("ij,ij->i", way, way)
        here = self.T[row, :3, 3] - start[span, :3, 3]
        reach = np.einsum("ij,ij->i", here, way[span]) / np.maximum(square, TINY**2)[span]
        share = np.clip(reach, 0.0, 1.0)
        chord = np.linalg.norm(here - share[:, None] * way[span], axis=1)
        axis, angle = axis_angle(start[:, :3, :3], end[:, :3, :3])
        back = np.flatnonzero((np.diff(share) < 0.0) & (np.diff(span) == 0))
        wrong = (square < TINY**2) | (angle > _WIDEST)
        wrong[span[back]] = True
        turned = start[span, :3, :3] @ rotation_about(axis[span], angle[span] * share)
        off = rotation_angle(turned, self.T[row, :3, :3])
        if self.tool_axis is not None:
            ends = turned @ self.tool_axis, self.T[row, :3, :3] @ self.tool_axis
            lean = angle_between(*ends)
            off = np.where(off**2 - lean**2 > ROLL**2, np.inf, lean)
        if self.external.shape[1]:
            moved = self.external[first][span]
            moved = moved + share[:, None] * (self.external[last][span] - moved)
            apart = np.abs(self.external[row] - moved)
            chord = np.maximum(chord, np.where(self.turns, 0.0, apart).max(axis=1))
            off = np.maximum(off, np.where(self.turns, apart, 0.0).max(axis=1))
        chord[wrong[span]] = np.inf
        return span, row, chord, off

    def passed(self, first: IndexArray, last: IndexArray) -> BoolArray:
        """Return which lines (m,) pass all points between within the tolerances."""
        span, _, chord, axis = self.off(first, last)
        fine = np.ones(len(first), dtype=np.bool_)
        fine[span[(chord > self.chord) | (axis > self.axis)]] = False
        return fine


def keep(course: Course, may_go: BoolArray) -> BoolArray:
    """Return which points (k,) of a course are kept, when those that ``may_go`` may be left out."""
    kept = ~may_go
    kept[:1] = kept[-1:] = True
    last_kept = np.maximum.accumulate(np.where(kept, np.arange(len(kept)), 0))
    kept |= (np.arange(len(kept)) - last_kept) % LONGEST == 0
    ends = np.flatnonzero(kept)
    anchor, end = ends[:-1], ends[1:]
    open_ = end - anchor > 1
    anchor, end = anchor[open_], end[open_]
    good, step = anchor + 1, np.ones(len(anchor), dtype=np.int64)
    grows = np.ones(len(anchor), dtype=np.bool_)
    while len(anchor):
        wish = np.minimum(good + step, end)
        fine = course.passed(anchor, wish)
        grows &= fine
        good = np.where(fine, wish, good)
        step = np.where(grows, 2 * step, step // 2)
        settled = (step == 0) & (good < end)
        kept[good[settled]] = True
        anchor = np.where(settled, good, anchor)
        good = np.where(settled, good + 1, good)
        step = np.where(settled, 1, step)
        grows |= settled
        open_ = good < end
        anchor, end, good, step = (column[open_] for column in (anchor, end, good, step))
        grows = grows[open_]
    return kept


def thinned(checker: Checker, table: Moves, stops_before: BoolArray) -> tuple[IndexArray, Left]:
    """Return the rows of moves that are kept, and what leaving out the others costs.

    Args:
        checker: of the toolpath.
        table: all moves in order.
        stops_before: (m,) before which moves the robot stands still.
    """
    problem = checker.problem
    thin, left = problem.cell.motion.thin, Left.none(len(problem))
    if thin is None or len(table) < 3:
        return np.arange(len(table)), left
    axes = problem.cell.external_axes if problem.placement.axes is not None else ()
    course = Course(
        table.T_base_tcp,
        table.external,
        COURSE_SHARE * thin.chord - DIGITS,
        thin.axis - DIGITS_OF_TURN,
        np.array([axis.kind != "rail" for axis in axes], dtype=np.bool_),
        problem.placement.tool_axis if problem.toolpath.rotations is None else None,
    )
    may_go = _may_go(problem, table, followed_speeds(checker, table), stops_before)
    kept = np.flatnonzero(keep(course, may_go))
    kept = _runnable(checker, table, kept)
    _, row, chord, axis = course.off(kept[:-1], kept[1:])
    left.chord[table.tag[row]], left.axis[table.tag[row]] = chord, axis
    return kept, left


def corner_tolerances(problem: Problem, table: Moves, left: Left) -> FloatArray:
    """Return how far (m,) [m] corners at the ends of moves may be passed.

    Beside points that are left out no farther than what the lines leave of the chord tolerance.
    """
    motion = problem.cell.motion
    tolerance = np.full(len(table), motion.corner_tolerance)
    tags = np.flatnonzero(np.isfinite(left.chord))
    if motion.thin is None or not len(tags):
        return tolerance
    worst = np.full(len(table) + 1, -np.inf)
    np.maximum.at(worst, np.searchsorted(table.tag, tags, side="right"), left.chord[tags])
    beside = np.maximum(worst[:-1], worst[1:])
    return np.asarray(np.minimum(tolerance, motion.thin.chord - DIGITS - beside))


def _may_go(
    problem: Problem, table: Moves, speed: FloatArray, stops_before: BoolArray
) -> BoolArray:
    """Return which moves (m,) may be left out: lines that go on as they are, nothing between."""
    is_line = (table.kind == MoveKind.LIN) & (table.role == MoveRole.CUT) & (table.dwell <= 0.0)
    is_line &= table.order != DOWN
    goes_on = is_line[:-1] & is_line[1:] & (np.diff(table.tag) == 1)
    goes_on &= (speed[:-1] == speed[1:]) & ~stops_before[1:]
    goes_on &= may_be_passed(problem.toolpath, problem.cell)[table.tag[:-1]]
    return np.append(goes_on, False)


def _runnable(checker: Checker, table: Moves, kept: IndexArray) -> IndexArray:
    """Return the rows kept, with all between two of them where the arm cannot run the line."""
    first, last = kept[:-1], kept[1:]
    long = np.flatnonzero(last - first > 1)
    first, last = first[long], last[long]
    if not len(long):
        return kept
    lines = Lines(
        table.T_base_tcp[first],
        table.T_base_tcp[last],
        table.q[first],
        table.q[last],
        np.asarray(checker.problem.kinematics.slot(table.q[last]), dtype=np.int64),
        np.ones(len(long), dtype=np.bool_),
        (table.external[first], table.external[last]),
    )
    verdict, track = checker.lines(lines, np.arange(len(long)) // _TOGETHER)
    least = checker.problem.least_feeds[table.tag[last]]
    bad = np.flatnonzero(~verdict.good | is_too_fast(checker.problem, lines, track, least))
    back = [np.arange(first[row] + 1, last[row]) for row in bad.tolist()]
    return np.sort(np.concatenate([kept, *back]))
