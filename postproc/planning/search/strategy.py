"""Which pose every tag gets: the strategies ``global``, ``each`` and ``smooth``."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Strategy
from postproc.errors import Finding
from postproc.planning.checks import Checker, explained
from postproc.planning.search.keytags import arc_length
from postproc.planning.search.pose_search import PoseSearch, check_chain, step_rules, travel
from postproc.planning.search.refine import Bounds, TagPoses, refine
from postproc.planning.states import Chosen, Problem, Rule
from postproc.process import feeds_of

Step = Callable[[int, int, str], None]
_REVERTS = 6
_SPREADS = 6
_HEAVIER = 8.0


def choose(checker: Checker, step: Step) -> tuple[Chosen, list[Finding], dict[str, object]]:
    """Return the pose of every tag, the findings, and a record of the work."""
    if checker.problem.cell.optimize.strategy is Strategy.SMOOTH:
        from postproc.planning.search.smooth import smooth

        return smooth(checker, step)
    tags = np.arange(len(checker.problem))
    step(0, len(tags), "search")
    wishes = checker.problem.cell.optimize
    search = PoseSearch.of(checker, tags, each=wishes.strategy is Strategy.EACH)
    found = search.run()
    chosen = search.chosen(found)
    record = search.record(found, chosen)
    if wishes.refine and wishes.strategy is Strategy.GLOBAL:
        step(0, len(tags), "refine")
        chosen = refined(checker, chosen, search.weight)
        record |= {"travel_rad2_grid": record["travel_rad2"], "travel_rad2": travel(chosen)}
    step(len(tags), len(tags), "search")
    return chosen, explained(checker, search.evidence(chosen)), record


def refined(checker: Checker, chosen: Chosen, weight: FloatArray) -> Chosen:
    """Return the chosen poses moved off the grid, where that stands the checks."""
    problem, pins = checker.problem, checker.problem.cell.optimize.pins
    tags = np.nonzero(chosen.good)[0]
    if len(tags) == 0:
        return chosen
    linked = np.where(chosen.entry[tags] | np.append(True, np.diff(tags) > 1), 0.0, weight[tags])
    grid = TagPoses(tags, chosen.attitude[tags], chosen.branch[tags], chosen.q[tags], linked)
    names = problem.toolpath.tag_name
    free = np.array([names(tag) not in pins for tag in tags.tolist()])
    bounds = _bounds(problem, grid, free)
    known, passed = grid, np.zeros(len(tags), dtype=np.bool_)
    for _ in range(_REVERTS):
        poses = _slowed(problem, refine(problem, grid, bounds), bounds)
        passed &= (poses.attitude == known.attitude).all(axis=1)
        passed &= (poses.q == known.q).all(axis=1)
        bad = _failing(checker, poses, np.asarray(bounds.free.any(axis=1)), passed)
        if not bad.any():
            break
        bounds.free &= ~bad[:, None]
        known, passed = poses, ~bad
    else:
        poses = grid
    attitude, q = chosen.attitude.copy(), chosen.q.copy()
    attitude[tags], q[tags] = poses.attitude, poses.q
    return Chosen(attitude, chosen.branch, q, chosen.good, chosen.entry)


def _bounds(problem: Problem, grid: TagPoses, free: BoolArray) -> Bounds:
    """Return where the tags may move: ``free`` (n,) in spin, and in tilt where a cut has any."""
    low, high = problem.cell.optimize.range
    if high - low >= 2.0 * np.pi - 1e-9:
        low, high = -np.inf, np.inf
    allowed = problem.cell.optimize.tilt
    limits = np.array([(low, high), allowed.lead, allowed.side])
    chain = (step_rules(problem)[grid.tags] == Rule.CHAIN) & (grid.weight > 0.0)
    cut = np.cumsum(~chain)
    tilted = np.isin(cut, cut[(grid.attitude[:, 1:] != 0.0).any(axis=1)])
    tilted &= problem.placement.may_tilt[grid.tags]
    return Bounds(
        np.column_stack([free, tilted & any(allowed.lead), tilted & any(allowed.side)]),
        np.minimum(limits[:, 0], grid.attitude),
        np.maximum(limits[:, 1], grid.attitude),
    )


def _slowed(problem: Problem, poses: TagPoses, bounds: Bounds) -> TagPoses:
    """Return the poses with their spins spread where an axis would be too fast at the feed.

    The weight of travel is raised on the steps that are too fast, so that the spin spreads over
    the tags around them.
    """
    time = _feed_times(problem, poses)
    speed = np.asarray(problem.cell.robot.qd_max)
    for _ in range(_SPREADS):
        need = np.abs(np.diff(poses.q, axis=0) / speed).max(axis=1, initial=0.0)
        fast = np.append(False, need > time)
        if not fast.any():
            break
        heavier = np.where(fast, _HEAVIER * poses.weight, poses.weight)
        heavy = TagPoses(poses.tags, poses.attitude, poses.branch, poses.q, heavier)
        poses = refine(problem, heavy, bounds)
    return poses


def _feed_times(problem: Problem, poses: TagPoses) -> FloatArray:
    """Return how long (n-1,) the steps into cuts take at the feed [s], infinite for others."""
    toolpath, b = problem.toolpath, poses.tags[1:]
    feed = feeds_of(toolpath, problem.cell)[b]
    step = np.diff(arc_length(toolpath)[poses.tags])
    is_cut = (step_rules(problem)[b] == Rule.CHAIN) & (poses.weight[1:] > 0.0)
    timed = is_cut & np.isfinite(feed) & (step > 1e-6)
    return np.where(timed, step / np.where(timed, feed, 1.0), np.inf)


def _failing(checker: Checker, poses: TagPoses, free: BoolArray, passed: BoolArray) -> BoolArray:
    """Return (n,) the tags that fail, by themselves or by a cut into or out of them.

    ``free`` (n,): tags that may have been moved off the grid; ``passed`` (n,): tags that stand as
    they did when they were found good, as were the cuts between two of them.
    """
    moved = np.nonzero(free & ~passed)[0]
    bad = np.zeros(len(poses.tags), dtype=np.bool_)
    verdict = checker.states(
        poses.tags[moved], poses.q[moved], poses.attitude[moved], poses.branch[moved]
    )
    bad[moved[~verdict.good]] = True
    rule = step_rules(checker.problem)[poses.tags]
    b = np.nonzero((rule == Rule.CHAIN) & (poses.weight > 0.0))[0]
    b = b[(b > 0)]
    b = b[(free[b] | free[b - 1]) & ~(passed[b] & passed[b - 1])]
    if len(b):
        a = b - 1
        verdict = check_chain(
            checker,
            (poses.tags[a], poses.tags[b]),
            (poses.attitude[a], poses.attitude[b]),
            (poses.q[a], poses.q[b]),
            poses.branch[b],
        )
        fails = ~verdict.good
        bad[a[fails]] = True
        bad[b[fails]] = True
    return bad & free
