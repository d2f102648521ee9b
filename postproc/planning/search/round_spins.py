"""Poses on round spins about those of the grid.

The grid finds the right valley; inside it the best sequence is searched once more, on round spins
within a step of the grid around every pose, in its branch. What is round stays where it is when
something near it changes. The checks are those of any search.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import TINY, FloatArray, IndexArray
from postproc.errors import Finding, Severity
from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import FINER_PRICE
from postproc.planning.search.laps import searched
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.rungs import Window, is_round, yardstick
from postproc.planning.states import Chosen, Problem, entered_anew
from postproc.process import feeds_of
from postproc.units import PERCENT


def on_round_spins(search: PoseSearch, chosen: Chosen, *, at_edges: bool) -> Chosen:
    """Return the chosen poses moved to round spins near by, where that costs no more.

    Args:
        search: what the poses were chosen by.
        at_edges: whether tags by themselves may stand at edges of reach, wherever these are.
        chosen: poses of the grid; where a tag or a cut fails these are returned.
    """
    problem, between, tags = search.checker.problem, search.between, search.tags
    broken = chosen.entry & ~entered_anew(problem.toolpath)
    if not chosen.good[tags].all() or broken[tags[1:]].any():
        return chosen
    best = np.full(len(problem), np.nan)
    known = search.options.window
    best[tags] = (
        yardstick(problem, search.states, search.keys.edges) if known is None else known.best[tags]
    )
    chain, edge = np.cumsum(~between.is_cut), chosen.spin.copy()
    alone = np.bincount(chain)[chain[tags]] == 1
    edges = search.keys.edges
    alone &= edges.is_between & (edges.branch == chosen.branch[tags])
    edge[tags[alone]] = edges.spin[alone]
    window = Window.around(problem, chosen, best, edge if at_edges else None)
    shut = np.zeros(len(problem), dtype=np.bool_)
    while True:
        near = searched(search.checker, tags, replace(search.options, window=window), between)
        near.ladder.reach = _reach(near, chosen)
        moved = near.chosen
        bad = np.union1d(np.flatnonzero(chosen.good & ~moved.good), sorted(near.failing.wanted))
        bad = np.union1d(bad, np.flatnonzero(moved.entry & ~chosen.entry)).astype(np.int64)
        if not len(bad):
            return moved
        if shut[bad].all():
            return chosen
        shut |= np.isin(chain, chain[bad])
        window = window.shut(shut)


def between_round(problem: Problem, tags: IndexArray, chosen: Chosen) -> list[Finding]:
    """Return how many of key tags (m,) stand between round spins, if any does."""
    tags = tags[chosen.good[tags] & np.isnan(problem.pins[tags])]
    fine = tags[~is_round(problem, chosen.spin[tags])]
    if not len(fine):
        return []
    text = (
        f"{len(fine)} of {len(tags)} holes and key tags have no round spin: nearby ones cannot be "
        f"run, or lose more than {FINER_PRICE / PERCENT:g} % of stiffness"
    )
    tag = int(fine[0])
    return [Finding(Severity.NOTE, "PLN313", text, tag, problem.toolpath.source(tag))]


def _reach(near: PoseSearch, chosen: Chosen) -> FloatArray:
    """Return how far (n, k) the axes may move into each tag [rad].

    Into a cut no farther than at the feed they can, or than they do on the grid.
    """
    problem, between, tags = near.checker.problem, near.between, near.tags
    seconds = _feed_times(problem, between, tags)
    known = np.abs(np.diff(chosen.q[tags], axis=0, prepend=chosen.q[tags][:1]))
    fast = seconds[:, None] * np.asarray(problem.cell.robot.qd_max)
    reach = np.full((len(tags), near.ladder.position.shape[1]), np.inf)
    reach[:, :6] = np.maximum(fast, known + TINY)
    return reach if near.ladder.reach is None else np.minimum(reach, near.ladder.reach)


def _feed_times(problem: Problem, between: Interpolation, tags: IndexArray) -> FloatArray:
    """Return how long (n,) the steps into tags take at the feed [s], infinite off cuts."""
    feed = feeds_of(problem.toolpath, problem.cell)[tags]
    step = np.diff(between.way[tags], prepend=between.way[tags[:1]])
    timed = between.is_cut[tags] & np.isfinite(feed) & (step > TINY)
    return np.where(timed, step / np.where(timed, feed, 1.0), np.inf)
