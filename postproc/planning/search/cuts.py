"""Whether cuts between key tags can be run, tag by tag and between the tags.

A span from one key tag to the next is judged along its whole inside: every tag between, with its
own tip and axis at the interpolated spin and tilt, is solved in the branch of the span and followed
from turn to turn; reach, limits and singularity first, then the straight motions between the tags,
then collisions, the whole span as one sweep.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from postproc.arrays import ROUNDING, TINY, BoolArray, FloatArray, IndexArray, Table, taken
from postproc.planning.checks import Checker, Lines, Reason
from postproc.planning.route import is_too_fast
from postproc.planning.search.between import Interpolation, Rows
from postproc.planning.search.tilt_steps import as_arcs, exceeds_tilt
from postproc.planning.states import Chosen, Problem
from postproc.records import dataclass
from postproc.units import TURN

_ROWS = 16384
"""So many tags are judged at once."""
_SAME = 0.1
"""Joints [rad] that differ by less at the end of a span are those of its end."""


@dataclass(slots=True)
class Spans(Table):
    """Cuts from key tag to key tag.

    Args:
        first, last: (m,) tags.
        attitude_first, attitude_last: (m, 3) [rad].
        q_first, q_last: (m, 6) [rad], good to tell the turn.
        branch: (m,).
    """

    first: IndexArray
    last: IndexArray
    attitude_first: FloatArray
    attitude_last: FloatArray
    q_first: FloatArray
    q_last: FloatArray
    branch: IndexArray


@dataclass(frozen=True, slots=True)
class Judged:
    """The inside of spans: rows as ``Interpolation.rows`` gives them, with what was found.

    ``attitude`` (k, 3), ``q`` (k, 6); ``reason``, ``pair`` (k,): of the tag or of the motion to it.
    """

    rows: Rows
    attitude: FloatArray
    q: FloatArray
    reason: IndexArray
    pair: IndexArray

    def good(self, spans: int) -> BoolArray:
        """Return (m,) which spans can be run."""
        bad = np.zeros(spans, dtype=np.bool_)
        bad[self.rows.span[self.reason != Reason.NONE]] = True
        return ~bad


def judge(checker: Checker, between: Interpolation, spans: Spans) -> Judged:
    """Return what stands against spans (m,), all along."""
    count = np.cumsum(spans.last - spans.first)
    edges = np.unique(np.searchsorted(count, np.arange(0, count[-1:].sum(), _ROWS), side="left"))
    bounds = np.unique([0, *edges, len(spans)]).tolist()
    parts = [
        (low, _judge(checker, between, spans.rows(np.arange(low, high))))
        for low, high in itertools.pairwise(bounds if len(spans) else [0, 0])
    ]
    rows = Rows.concat([replace(part.rows, span=low + part.rows.span) for low, part in parts])
    columns = ("attitude", "q", "reason", "pair")
    joined = (np.concatenate([getattr(part, name) for _, part in parts]) for name in columns)
    return Judged(rows, *joined)


def _judge(checker: Checker, between: Interpolation, spans: Spans) -> Judged:
    rows = between.rows(spans.first, spans.last)
    tags, ends = (spans.first, spans.last), (spans.attitude_first, spans.attitude_last)
    attitude = between.attitudes(rows, tags, ends)
    problem, is_cut = checker.problem, between.is_cut[rows.tag]
    place = problem.placement
    lift = checker.strokes.top[spans.first]
    T_first = place.tcp(spans.first, spans.attitude_first, lift)
    external = place.external[spans.first]
    q_first, reached_first = problem.solve(T_first, external, spans.branch, spans.q_first)
    q, reached, T = joints_of(problem, between, spans, rows, attitude)
    reason = np.full(len(rows.tag), int(Reason.NONE), dtype=np.int64)
    _refuse(reason, ~reached | ~place.given[rows.tag], Reason.UNREACHABLE)
    _refuse(reason, ~problem.within(q), Reason.JOINT_LIMIT)
    _refuse(reason, ~problem.regular(q), Reason.SINGULAR)
    _refuse(reason, ~_in_range(problem, rows, attitude), Reason.SINGULAR)
    at_end = np.flatnonzero(rows.share == 1.0)
    off = np.abs(q[at_end] - spans.q_last[rows.span[at_end]]).max(axis=1, initial=0.0)
    _refuse(reason, at_end[(off > _SAME) & is_cut[at_end]], Reason.SINGULAR)
    starts = np.flatnonzero(np.diff(rows.span, prepend=-1))
    _refuse(reason, starts[~reached_first], Reason.UNREACHABLE)
    pair = np.full(len(reason), -1, dtype=np.int64)
    judged = Judged(rows, attitude, q, reason, pair)
    open_ = judged.good(len(spans))[rows.span]
    _check_motions(checker, judged, np.flatnonzero(open_ & is_cut), (T_first, q_first, T), spans)
    _check_poses(checker, judged, np.flatnonzero(open_ & ~is_cut & (rows.share < 1.0)), spans)
    return judged


def _near_line(spans: Spans, rows: Rows, q: FloatArray) -> FloatArray:
    """Return joints (k, 6) turned to be near to the straight joint motion of their span."""
    line = spans.q_first[rows.span]
    line = line + rows.share[:, None] * (spans.q_last[rows.span] - line)
    return np.asarray(q + TURN * np.round((line - q) / TURN))


def fill(problem: Problem, between: Interpolation, spans: Spans, chosen: Chosen) -> None:
    """Write the poses of the tags inside spans that were found good, in place."""
    rows = between.rows(spans.first, spans.last)
    tags, ends = (spans.first, spans.last), (spans.attitude_first, spans.attitude_last)
    attitude = between.attitudes(rows, tags, ends)
    q = joints_of(problem, between, spans, rows, attitude)[0]
    inner = rows.share < 1.0
    at = rows.tag[inner]
    chosen.attitude[at], chosen.q[at] = attitude[inner], q[inner]
    chosen.branch[at], chosen.good[at] = spans.branch[rows.span[inner]], True


def joints_of(
    problem: Problem, between: Interpolation, spans: Spans, rows: Rows, attitude: FloatArray
) -> tuple[FloatArray, BoolArray, FloatArray]:
    """Return joints (k, 6) of rows, which (k,) are reached, and the poses (k, 4, 4)."""
    T = problem.placement.tcp(rows.tag, attitude)
    flange = problem.placement.flange(T, problem.placement.external[rows.tag])
    q, reached = problem.kinematics.ik_in(flange, spans.branch[rows.span])
    q = np.where(reached[:, None], q, 0.0)
    is_cut = between.is_cut[rows.tag]
    if is_cut.all():
        return _followed(rows, q, reached, spans.q_first), reached, T
    followed = _followed(rows, q, reached, spans.q_first)
    return np.where(is_cut[:, None], followed, _near_line(spans, rows, q)), reached, T


def _refuse(reason: IndexArray, rows: IndexArray | BoolArray, why: Reason) -> None:
    fresh = np.zeros(len(reason), dtype=np.bool_)
    fresh[rows] = True
    reason[fresh & (reason == Reason.NONE)] = why


def _in_range(problem: Problem, rows: Rows, attitude: FloatArray) -> BoolArray:
    """Return (k,) whether the spin of the tags inside spans is one that the cell allows."""
    low, high = problem.cell.optimize.range
    if high - low >= TURN - ROUNDING:
        return np.ones(len(rows.tag), dtype=np.bool_)
    spin = low + np.mod(attitude[:, 0] - low + TINY, TURN) - TINY
    return np.asarray((spin <= high + TINY) | (rows.share == 1.0))


def _followed(rows: Rows, q: FloatArray, reached: BoolArray, q_first: FloatArray) -> FloatArray:
    """Return joints (k, 6) turned to follow those before them in their span.

    Where a pose is not reached, what comes behind it follows the last one that is.
    """
    if not len(q):
        return q
    starts = np.flatnonzero(np.diff(rows.span, prepend=-1))
    last = np.maximum.accumulate(np.where(reached, np.arange(len(q)), -1))
    start_of = starts[rows.span]
    before = np.empty_like(q)
    before[1:] = taken(q, np.maximum(last[:-1], 0))
    none = np.append(-1, last[:-1]) < start_of
    before[none] = q_first[rows.span[none]]
    step = q - before
    step -= TURN * np.round(step / TURN)
    step[~reached] = 0.0
    total = np.cumsum(step, axis=0)
    base = taken(np.vstack([np.zeros((1, 6)), total]), start_of)
    near: FloatArray = taken(q_first, rows.span) + total - base
    return np.where(reached[:, None], q + TURN * np.round((near - q) / TURN), near)


def _check_motions(
    checker: Checker,
    judged: Judged,
    open_: IndexArray,
    known: tuple[FloatArray, FloatArray, FloatArray],
    spans: Spans,
) -> None:
    """Note what stands against the motions to rows ``open_`` of spans that are good so far."""
    if not len(open_):
        return
    rows, (T_first, q_first, T) = judged.rows, known
    is_first = np.diff(rows.span, prepend=-1)[open_] != 0
    span, before = rows.span[open_], np.maximum(open_ - 1, 0)
    T_from = np.where(is_first[:, None, None], taken(T_first, span), taken(T, before))
    q_from = np.where(is_first[:, None], taken(q_first, span), taken(judged.q, before))
    a_from = np.where(is_first[:, None], spans.attitude_first[span], judged.attitude[before])
    tags = rows.tag[open_] - 1, rows.tag[open_]
    external = checker.problem.placement.external
    lines = Lines(
        T_from,
        taken(T, open_),
        q_from,
        taken(judged.q, open_),
        spans.branch[span],
        np.ones(len(open_), dtype=np.bool_),
        (external[tags[0]], external[tags[1]]),
    )
    as_arcs(checker.problem, tags[1], lines)
    place, ends = checker.problem.placement, (a_from, judged.attitude[open_])
    tilts = place.tilts(tags[0], ends[0]), place.tilts(tags[1], ends[1])
    leaves = exceeds_tilt(checker.problem, tags[1], tilts, lines)
    verdict, track = checker.lines(lines, span)
    # As for a turn that could go either way round: the tool cannot turn so on this way.
    verdict.refuse(np.flatnonzero(leaves), Reason.SINGULAR)
    least = checker.problem.least_feeds
    if least.any():
        asked = np.where(verdict.good, least[tags[1]], 0.0)
        verdict.refuse(is_too_fast(checker.problem, lines, track, asked), Reason.SPEED)
    judged.reason[open_], judged.pair[open_] = verdict.reason, verdict.pair


def _check_poses(checker: Checker, judged: Judged, open_: IndexArray, spans: Spans) -> None:
    """Note what stands against poses and strokes at rows ``open_`` that no cut enters."""
    if not len(open_):
        return
    tags, branch = judged.rows.tag[open_], spans.branch[judged.rows.span[open_]]
    verdict = checker.states(tags, judged.q[open_], judged.attitude[open_], branch)
    judged.reason[open_], judged.pair[open_] = verdict.reason, verdict.pair
