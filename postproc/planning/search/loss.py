"""How much stiffness every tag loses against its own optimum, and key tags that win it back."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import TINY, BoolArray, FloatArray, IndexArray
from postproc.errors import Finding, Severity
from postproc.ladder import NONE, Rule
from postproc.planning.checks import Checker
from postproc.planning.search.between import Interpolation
from postproc.planning.search.constants import LOSS_SPACING
from postproc.planning.search.keytags import spaced
from postproc.planning.search.pose_search import PoseSearch
from postproc.planning.search.rungs import SearchOptions
from postproc.planning.states import Chosen, Problem, Weights, evaluate

LOST = "PLN305"
"""More stiffness is lost than the bound allows."""


def best_index(checker: Checker, between: Interpolation) -> FloatArray:
    """Return the best stiffness index (n,) [N/m] that each tag could have by itself, collisions in.

    The index of the stiffest state that is free, whatever else speaks for or against it.
    """
    problem = checker.problem
    n = len(problem)
    main = problem.settings.weights.main
    if main is None or not n:
        return np.full(n, np.nan)
    alone = Weights(((main[0], 1.0, main[1]),), 0.0)
    checker = replace(
        checker, problem=replace(problem, settings=replace(problem.settings, weights=alone))
    )
    tags = np.flatnonzero(spaced(between.way, between.is_cut, LOSS_SPACING))
    search = PoseSearch.of(checker, tags, SearchOptions(each=True), between)
    search.ladder.rule[:] = Rule.FREE
    path = search.standing()
    good = path != NONE
    best = np.full(len(tags), np.nan)
    best[good] = search.states.index[path[good]]
    return along(between, tags, best)


def along(between: Interpolation, tags: IndexArray, best: FloatArray) -> FloatArray:
    """Return values (n,) of all tags from those (k,) of tags (k,) along the way."""
    n = len(between.way)
    if len(tags) == n or not len(tags):
        return best if len(tags) else np.full(n, np.nan)
    behind = np.clip(np.searchsorted(tags, np.arange(n)), 0, len(tags) - 1)
    ahead = np.where(tags[behind] == np.arange(n), behind, np.maximum(behind - 1, 0))
    length = between.way[tags[behind]] - between.way[tags[ahead]]
    share = (between.way - between.way[tags[ahead]]) / np.where(length > 0.0, length, 1.0)
    return np.asarray(best[ahead] + share * (best[behind] - best[ahead]))


def loss_of(problem: Problem, chosen: Chosen, best: FloatArray) -> FloatArray:
    """Return the loss (n,) of the index against each tag's own optimum; below 0 for a gain."""
    loss = np.full(len(best), np.nan)
    tags = np.nonzero(chosen.good & np.isfinite(best))[0]
    if len(tags):
        T = problem.placement.tcp(tags, chosen.attitude[tags])
        index = evaluate(problem, tags, chosen.spin[tags], T, chosen.q[tags])[1]
        loss[tags] = 1.0 - index / best[tags]
    return loss


def least_index(best: FloatArray, bound: float) -> FloatArray:
    """Return the index (n,) [N/m] at a bound of loss, ``best`` (n,) without any."""
    return np.asarray((1.0 - bound - TINY) * best)


def more_keys(keys: BoolArray, over: FloatArray) -> IndexArray:
    """Return tags to make key: between two ``keys`` (n,) the one most ``over`` (n,) the bound."""
    lossy = np.flatnonzero((np.nan_to_num(over, nan=0.0) > 0.0) & ~keys)
    span = np.cumsum(keys)[lossy]
    order = np.lexsort((-over[lossy], span))
    return np.sort(lossy[order[np.unique(span[order], return_index=True)[1]]])


def loss_report(problem: Problem, loss: FloatArray, tags: IndexArray, bound: float) -> Finding:
    """Return the note of what is lost, a warning if that is more than the bound."""
    loss = np.maximum(loss, 0.0)
    text = f"{len(tags)} of {len(problem)} tags are key tags"
    if np.isfinite(loss).any():
        worst = int(np.nanargmax(loss))
        text += (
            f"; loss against each tag's own optimum: mean {100.0 * float(np.nanmean(loss)):.2f} %, "
            f"largest {100.0 * float(loss[worst]):.2f} % at tag {problem.toolpath.tag_name(worst)}"
        )
    if not np.nan_to_num(loss, nan=0.0).max(initial=0.0) > bound + TINY:
        return Finding(Severity.NOTE, "PLN304", text)
    return Finding(
        Severity.WARNING,
        "PLN305",
        f"{text}; what was found does not keep it under the bound of {100.0 * bound:g} %",
        hint='the preset "stiffest" loses least; more key tags or a finer step_deg may help',
    )
