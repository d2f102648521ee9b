"""Poses moved off the grid, and the spin between key tags made smooth, where that can be run."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.checks import NEAR_BY, Checker
from postproc.planning.search.between import Interpolation, cubic, slopes
from postproc.planning.search.cuts import Spans, fill, judge, judge_rows
from postproc.planning.search.edges import Edges
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.refine import Bounds, TagPoses, refine, within
from postproc.planning.search.rungs import Parted, same_posture, tolls_of, yardstick
from postproc.planning.states import Chosen, Problem, evaluate
from postproc.process import feeds_of

_SHARES = (0.5, 0.25)
"""Shares of the way off the grid that are tried where the whole of it fails, at tags by
themselves ..."""
_TO_EDGES = (0.875, 0.75, *_SHARES)
"""... and of that to the edge of reach, where a stroke or a way out often just fails."""
_SPREADS = 12
_HEAVIER = (1.5, 8.0)
"""By how much the weight of travel on a step that is too fast is raised at once: by more than it is
too fast, and the tool turns on a long way where the pose is far from the best."""
_HEAVIEST = 3e5
_PATIENT = 5
"""After so many rounds tags that fail take those linked to them back to the grid as well, one more
to each side every round: else each lets the next one move, and fail, in a round of its own."""


def moved_off_grid(
    search: PoseSearch, chosen: Chosen, *, at_edges: bool = False, steady: int = 0
) -> Chosen:
    """Return the chosen poses moved off the grid, where that stands the checks.

    Args:
        search: what the poses were chosen by.
        chosen: poses of the grid.
        at_edges: whether tags by themselves begin at the edge of reach where that is stiffer.
        steady: bits of the branch with which they stay there.
    """
    checker, between = search.checker, search.between
    problem = checker.problem
    kept = chosen.good[search.tags]
    tags = search.tags[kept]
    if len(tags) == 0:
        return chosen
    follows = np.append(False, np.diff(np.flatnonzero(kept)) == 1) & ~chosen.entry[tags]
    linked = np.where(follows, search.weight[kept], 0.0)
    grid = TagPoses(
        tags,
        chosen.attitude[tags],
        chosen.branch[tags],
        chosen.q[tags],
        linked,
        search.share[kept],
        yardstick(problem, search.states, search.edges)[kept],
    )
    runs = np.cumsum(linked == 0.0)
    free = np.isnan(problem.pins[tags])
    bounds = _bounds(problem, between, grid, free)
    known, passed = grid, np.zeros(len(tags), dtype=np.bool_)
    cuts = _cuts(between, grid)
    alone = np.bincount(cuts)[cuts] == 1
    poses, awake, reach = grid, np.ones(len(tags), dtype=np.bool_), 0
    if at_edges:
        rows, may = np.flatnonzero(kept), alone & bounds.free[:, 0]
        may &= same_posture(search.edges.branch[rows], grid.branch, steady)
        poses = _at_edges(problem, grid, search.edges, rows, may, search.wish.parted)
    for count in itertools.count():
        poses = refine(problem, poses, bounds, awake)
        poses = _slowed(problem, between, poses, bounds, _HEAVIEST * linked)
        passed &= (poses.attitude == known.attitude).all(axis=1)
        passed &= (poses.q == known.q).all(axis=1)
        free = np.asarray(bounds.free.any(axis=1))
        bad = failing(checker, between, poses, free, passed)
        bad |= free & _faster(problem, between, poses, grid)
        if not bad.any():
            break
        known, passed = poses, ~bad
        shares = _TO_EDGES if at_edges else _SHARES
        nearer = _nearer(checker, bounds, grid, poses, np.flatnonzero(bad & alone), shares)
        alone &= ~bad
        bad = within(bad, reach, cuts) | within(bad, count - _PATIENT, runs)
        bounds.free &= ~bad[:, None]
        bounds.free[nearer, 0] = True
        poses, awake, reach = poses.standing_as(grid, bad), within(bad, 1), 2 * reach + 1
    return _filled(checker, between, poses, chosen)


def _at_edges(
    problem: Problem,
    grid: TagPoses,
    edges: Edges,
    rows: IndexArray,
    may: BoolArray,
    parted: tuple[Parted, ...],
) -> TagPoses:
    """Return poses of tags (n,), rows of ``edges``, at these where that gains more than it costs.

    The ways to and from the tags beside count as they stand on the grid, with what those cost that
    are ``parted``. Joints take the turns nearest to those of the grid.
    """
    T = problem.placement.tcp(grid.tags, grid.attitude)
    own = evaluate(problem, grid.tags, grid.attitude[:, 0], T, grid.q)[1]
    index = np.where(edges.is_between, edges.index, np.nan)[rows]
    q = problem.kinematics.nearest(edges.q[rows], grid.q)
    price, is_stiffer = problem.settings.weights.price, (index > own) & problem.within(q)
    gain = np.log(np.where(is_stiffer, index / own, 1.0))
    gain += np.where(is_stiffer, price(1.0 - own / grid.best) - price(1.0 - index / grid.best), 0.0)
    gain *= grid.share
    dearer = np.zeros(len(rows))
    for joints, sign in ((q, 1.0), (grid.q, -1.0)):
        for side, before, after in (
            (slice(1, None), grid.q[:-1], joints[1:]),
            (slice(None, -1), joints[:-1], grid.q[1:]),
        ):
            way = grid.weight[1:] * ((after - before) ** 2).sum(axis=1)
            dearer[side] += sign * (way + tolls_of(problem, parted, before, after))
    there = may & edges.is_between[rows] & (gain > dearer)
    attitude = grid.attitude.copy()
    attitude[there] = np.column_stack([edges.spin[rows], np.zeros((len(rows), 2))])[there]
    return replace(
        grid,
        attitude=attitude,
        branch=np.where(there, edges.branch[rows], grid.branch),
        q=np.where(there[:, None], q, grid.q),
    )


def _nearer(
    checker: Checker,
    bounds: Bounds,
    grid: TagPoses,
    poses: TagPoses,
    rows: IndexArray,
    shares: tuple[float, ...],
) -> IndexArray:
    """Bound tags (m,) to a part of their way off the grid that runs, in place; return which.

    With more clearance than is asked for: the best pose is often the one that only just is free.
    """
    problem, found = checker.problem, np.zeros(len(rows))
    if checker.scene is not None:
        checker = replace(checker, scene=checker.scene.kept(NEAR_BY))
    for share in shares:
        left = np.flatnonzero(found == 0.0)
        part = grid.rows(rows[left])
        attitude = part.attitude + share * (poses.attitude[rows[left]] - part.attitude)
        T = problem.placement.tcp(part.tags, attitude)
        q, good = problem.solve(T, problem.placement.external[part.tags], part.branch, part.q)
        good &= problem.within(q) & problem.regular(q)
        own = np.flatnonzero(good)
        verdict = checker.states(part.tags[own], q[own], attitude[own], part.branch[own])
        found[left[own[verdict.good]]] = share
    rows, found = rows[found > 0.0], found[found > 0.0]
    start = grid.attitude[rows]
    end = start + found[:, None] * (poses.attitude[rows] - start)
    bounds.low[rows], bounds.high[rows] = np.minimum(start, end), np.maximum(start, end)
    return rows


def _filled(checker: Checker, between: Interpolation, poses: TagPoses, chosen: Chosen) -> Chosen:
    """Return the poses of all tags, the spin between key tags as a smooth curve where it runs."""
    attitude, q = chosen.attitude.copy(), chosen.q.copy()
    attitude[poses.tags], q[poses.tags] = poses.attitude, poses.q
    branch = chosen.branch.copy()
    branch[poses.tags] = poses.branch
    result = Chosen(attitude, branch, q, chosen.good.copy(), chosen.entry)
    spans = spans_of(between, poses)
    spans = spans.rows(np.flatnonzero(spans.last - spans.first > 1))
    if len(spans):
        fill(checker.problem, between, spans, result)
        _smoothed(checker, between, poses, spans, result)
    return result


def _smoothed(
    checker: Checker, between: Interpolation, poses: TagPoses, spans: Spans, chosen: Chosen
) -> None:
    """Let the twist run as a monotone cubic between key tags, in place, where that can be run."""
    cut = (poses.weight > 0.0) & between.is_cut[poses.tags]
    slope = np.zeros(len(poses.tags))
    twist = poses.attitude[:, 0] + between.carried[poses.tags]
    starts = np.flatnonzero(~cut)
    for low, high in zip(starts.tolist(), np.append(starts[1:], len(cut)).tolist(), strict=True):
        at = poses.tags[low:high]
        twist[low:high] = between.twists(at, poses.attitude[low:high, 0])
        if high - low > 1 and (np.diff(between.way[at]) > 1e-9).all():
            slope[low:high] = slopes(between.way[at], twist[low:high])
    rows = between.rows(spans.first, spans.last)
    tags, ends = (spans.first, spans.last), (spans.attitude_first, spans.attitude_last)
    attitude = between.attitudes(rows, tags, ends)
    a = np.searchsorted(poses.tags, spans.first)[rows.span]
    b = np.searchsorted(poses.tags, spans.last)[rows.span]
    length = between.way[poses.tags[b]] - between.way[poses.tags[a]]
    curve = cubic(rows.share, length, (twist[a], twist[b], slope[a], slope[b]))
    inner = rows.share < 1.0
    attitude[inner, 0] = between.spin_of(rows.tag[inner], curve[inner])
    judged = judge_rows(checker, between, spans, rows, attitude)
    good = judged.good(len(spans))[rows.span] & inner
    chosen.attitude[rows.tag[good]], chosen.q[rows.tag[good]] = attitude[good], judged.q[good]


def spans_of(between: Interpolation, poses: TagPoses) -> Spans:
    """Return the spans between successive key tags that are linked and hold a cut or tags."""
    b = np.flatnonzero(poses.weight > 0.0)
    b = b[b > 0]
    last, first = poses.tags[b], poses.tags[b - 1]
    b = b[between.is_cut[last] | (last - first > 1)]
    a = b - 1
    return Spans(
        poses.tags[a],
        poses.tags[b],
        poses.attitude[a],
        poses.attitude[b],
        poses.q[a],
        poses.q[b],
        poses.branch[b],
    )


def _bounds(problem: Problem, between: Interpolation, grid: TagPoses, free: BoolArray) -> Bounds:
    """Return where the tags may move: ``free`` (n,) in spin, and in tilt where a cut has any."""
    low, high = problem.cell.optimize.range
    if high - low >= 2.0 * np.pi - 1e-9:
        low, high = -np.inf, np.inf
    allowed = problem.cell.optimize.tilt
    limits = np.array([(low, high), allowed.lead, allowed.side])
    cut = _cuts(between, grid)
    tilted = np.isin(cut, cut[(grid.attitude[:, 1:] != 0.0).any(axis=1)])
    tilted &= problem.placement.may_tilt[grid.tags]
    return Bounds(
        np.column_stack([free, tilted & any(allowed.lead), tilted & any(allowed.side)]),
        np.minimum(limits[:, 0], grid.attitude),
        np.maximum(limits[:, 1], grid.attitude),
    )


def _cuts(between: Interpolation, poses: TagPoses) -> IndexArray:
    """Return the number (n,) of the cut that each tag belongs to; a hole is one by itself."""
    return np.cumsum(~(between.is_cut[poses.tags] & (poses.weight > 0.0)))


def _slowed(
    problem: Problem, between: Interpolation, poses: TagPoses, bounds: Bounds, most: FloatArray
) -> TagPoses:
    """Return the poses with their spins spread where an axis would be too fast at the feed.

    The weight of travel is raised on the steps that are too fast, up to ``most`` (n,), so that the
    spin spreads over the tags around them.
    """
    time = _feed_times(problem, between, poses)
    for _ in range(_SPREADS):
        share = np.append(0.0, _least_times(problem, poses) / np.maximum(time, 1e-12))
        fast = (share > 1.0) & (poses.weight < most)
        if not fast.any():
            break
        heavier = np.where(fast, np.clip(share, *_HEAVIER), 1.0) * poses.weight
        poses = refine(problem, poses.weighted(heavier), bounds, within(fast, 1))
    return poses


def _faster(problem: Problem, between: Interpolation, poses: TagPoses, grid: TagPoses) -> BoolArray:
    """Return the tags (n,) at steps too fast for an axis at the feed, more so than on the grid."""
    need, known = _least_times(problem, poses), _least_times(problem, grid)
    fast = (need > _feed_times(problem, between, poses)) & (need > known + 1e-9)
    return np.asarray(np.append(False, fast) | np.append(fast, False))


def _least_times(problem: Problem, poses: TagPoses) -> FloatArray:
    """Return how long (n-1,) the axes take at least for the steps between tags [s]."""
    speed = np.asarray(problem.cell.robot.qd_max)
    need: FloatArray = np.abs(np.diff(poses.q, axis=0) / speed).max(axis=1, initial=0.0)
    return need


def _feed_times(problem: Problem, between: Interpolation, poses: TagPoses) -> FloatArray:
    """Return how long (n-1,) the steps into cuts take at the feed [s], infinite for others."""
    b = poses.tags[1:]
    feed = feeds_of(problem.toolpath, problem.cell)[b]
    step = np.diff(between.way[poses.tags])
    is_cut = between.is_cut[b] & (poses.weight[1:] > 0.0)
    timed = is_cut & np.isfinite(feed) & (step > 1e-6)
    return np.where(timed, step / np.where(timed, feed, 1.0), np.inf)


def failing(
    checker: Checker,
    between: Interpolation,
    poses: TagPoses,
    free: BoolArray,
    passed: BoolArray,
) -> BoolArray:
    """Return (n,) the key tags that fail, by themselves or by a cut into or out of them.

    ``free`` (n,): tags that may have been moved off the grid; ``passed`` (n,): tags that stand as
    they did when they were found good, as were the cuts between two of them.
    """
    moved = np.nonzero(free & ~passed)[0]
    bad = np.zeros(len(poses.tags), dtype=np.bool_)
    verdict = checker.states(
        poses.tags[moved], poses.q[moved], poses.attitude[moved], poses.branch[moved]
    )
    bad[moved[~verdict.good]] = True
    leaves = moved[checker.problem.ways_out[poses.tags[moved]] > 0.0]
    at = (poses.tags[leaves], poses.attitude[leaves], poses.branch[leaves], poses.q[leaves])
    bad[leaves[~checker.problem.way_out(*at)[2]]] = True
    spans = spans_of(between, poses)
    b = np.searchsorted(poses.tags, spans.last)
    changed = (free[b] | free[b - 1]) & ~(passed[b] & passed[b - 1])
    b, spans = b[changed], spans.rows(np.flatnonzero(changed))
    fails = b[~judge(checker, between, spans).good(len(spans))]
    bad[fails - 1] = True
    bad[fails] = True
    return bad & free
