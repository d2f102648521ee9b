"""The one loop of planning: make a plan, and where it fails repair what there is evidence for.

``REPAIRS`` says what may be tried, level by level: on a search, on the places of the external axes,
on cuts that are left. Each looks at what its level made, and where it serves changes how that is
made and returns True. The first of the table that serves is taken. Those without a price let the
search look closer until what fails is refuted; the others cost a plan each, and are tried so often
in vain. Every plan is compared with the best so far; what was tried, and how often, is the record
that users get.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Any, NamedTuple, Protocol, TypeVar, cast

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.ladder import NONE
from postproc.model import Plan
from postproc.planning.attempt import Attempt, Rank
from postproc.planning.route import HOME
from postproc.planning.search import (
    Parted,
    grown,
    loss_of,
    main_spins,
    more_keys,
    with_gaps,
    with_options,
)
from postproc.planning.states import Problem, sample, tilt_grid

MOST_PLANS = 12
"""So many plans of a level are made at most, the first one with them."""
M = TypeVar("M")
M_co = TypeVar("M_co", covariant=True)


class State(Protocol[M_co]):
    """What repairs of a level change."""

    def make(self) -> tuple[Rank, M_co]:
        """Return what comes of it as it is, and how good that is."""


class Level(Enum):
    """What a repair changes."""

    SEARCH = "the search for poses of one toolpath where the axes stand or follow a course"
    PLACES = "where the external axes stand at each tag"
    CUTS = "where cuts are left and entered again"


class Repair(NamedTuple):
    """What may be tried: its name, the evidence that it serves, its price in plans made in vain."""

    level: Level
    name: str
    evidence: str
    serve: Callable[[Any], bool]
    price: int = 0


def _turn_faster(attempt: Attempt) -> bool:
    """Let cuts without a way turn the tool as fast as it takes."""
    search, joins = attempt.search, attempt.search.joins
    chain = np.cumsum(~search.between.is_cut)[search.tags]
    rungs = np.isin(chain, chain[search.broken]) & (joins.turn < np.pi)
    if search.failing.wanted or not rungs.any():
        return False
    search.keys.fast_turns[rungs], joins.turn[rungs] = True, np.pi
    search.ladder.renew(np.flatnonzero(rungs))
    attempt.use(replace(search))
    return True


def _look_closer(attempt: Attempt) -> bool:
    search, n = attempt.search, len(attempt.checker.problem)
    tags, stride = attempt.refinement.next(search)
    if not len(tags):
        return False
    attempt.clock.step(min(len(search.tags), n - 1), n, "search")
    attempt.use(grown(search, tags, stride))
    return True


def _roll_less(attempt: Attempt) -> bool:
    main = main_spins(attempt.search)
    if main is None:
        return False
    attempt.use(with_options(attempt.search, replace(attempt.search.options, main=main)))
    return True


def _lose_less(attempt: Attempt) -> bool:
    search, problem = attempt.search, attempt.checker.problem
    if attempt.best is None:
        return False
    is_key: BoolArray = np.isin(np.arange(len(problem)), search.tags)
    more = more_keys(is_key, loss_of(problem, search.chosen, attempt.best) - attempt.bound)
    if not len(more):
        return False
    attempt.use(grown(search, more, np.full(len(more), problem.fine)))
    return True


def _avoid_gap(attempt: Attempt) -> bool:
    """Let no step lead where no free path was found for.

    A solid that parts the reach of the arm lets it stand on either side of a hole pattern, and
    leads nowhere between: steps from the one side to the other are out of the question then.
    """
    if not attempt.runs:
        return False
    choice, routed = attempt.choice, attempt.routed
    home, good = attempt.checker.problem.cell.motion.home, np.flatnonzero(choice.chosen.good)
    q, is_break = choice.q_grid, np.zeros(len(choice.q_grid), dtype=np.bool_)
    is_break[[finding.tag_index or 0 for finding in routed.findings if finding.is_error]] = True
    part = np.cumsum(is_break)

    def side(tag: int) -> FloatArray:
        if tag == HOME:
            return np.asarray(home)[None]
        joined = good[(part[good] == part[tag]) & (good != tag)]
        return np.asarray(q[np.append(tag, joined)])

    gaps = [Parted.by(side(gap.before), side(gap.behind)) for gap in routed.gaps]
    options = attempt.search.options
    parted = with_gaps(options.parted, gaps)
    if len(parted) == len(options.parted):
        return False
    attempt.use(with_options(attempt.search, replace(options, parted=parted)))
    attempt.begin()
    return True


def _tilt_more(attempt: Attempt) -> bool:
    problem, every = attempt.checker.problem, (*attempt.choice.findings, *attempt.routed.findings)
    if len(problem.tilts) == 1 or not any(finding.is_error for finding in every):
        return False
    tags, allowed = int(problem.placement.may_tilt.sum()), problem.cell.optimize.tilt
    more = tilt_grid(allowed, len(problem.settings.spins), tags, few=False)
    checker = replace(attempt.checker, problem=replace(problem, tilts=more))
    if len(more) == len(problem.tilts) or _is_out_of_reach(attempt, checker.problem):
        return False
    attempt.begin(checker)
    return True


def _is_out_of_reach(attempt: Attempt, problem: Problem) -> bool:
    """Return whether a tag without a pose is out of reach at every tilt of a problem."""
    lost = attempt.search.tags[attempt.search.found.path == NONE]
    spins, tilts = problem.settings.spins, problem.tilts
    return any(not len(sample(problem, lost[[k]], spins, tilts=tilts).q) for k in range(len(lost)))


REPAIRS = (
    Repair(Level.SEARCH, "faster turns", "a cut has no path at steady turns", _turn_faster),
    Repair(
        Level.SEARCH,
        "more key tags and finer spins",
        "a cut fails, a tag has no pose",
        _look_closer,
    ),
    Repair(Level.SEARCH, "less roll", "a cut rolls the tool far", _roll_less),
    Repair(Level.SEARCH, "key tags for less loss", "tags lose more than the bound", _lose_less),
    Repair(
        Level.SEARCH,
        "poses on one side of a gap",
        "no free path joins two poses",
        _avoid_gap,
        3,
    ),
    Repair(Level.SEARCH, "more tilts", "tags fail that are in reach", _tilt_more, 1),
    Repair(
        Level.PLACES,
        "another place",
        "a cut is refused where they stand",
        lambda axes: axes.change(),
        11,
    ),
    Repair(
        Level.PLACES,
        "work carried past the arm",
        "a cut may gain by it",
        lambda axes: axes.carry(),
        2,
    ),
    Repair(
        Level.CUTS,
        "a cut left and entered again",
        "no arm configuration serves a cut",
        lambda cuts: cuts.change(),
        11,
    ),
)


def repaired(state: State[M], level: Level) -> tuple[M, Counter[str]]:
    """Return the best that comes of repairs of a level, and how often each was tried."""
    rows = [repair for repair in REPAIRS if repair.level is level]
    best: tuple[Rank, M] | None = None
    in_vain, tried, plans = Counter[str](), Counter[str](), 0
    while True:
        for repair in rows:
            if not repair.price and repair.serve(state):
                break
        else:
            plans += 1
            now = state.make()
            if best is None or now[0][0] < best[0][0]:
                in_vain.clear()
            best = now if best is None or now[0] < best[0] else best
            left = rows if plans < MOST_PLANS else ()
            found = next((r for r in left if in_vain[r.name] < r.price and r.serve(state)), None)
            if found is None:
                return best[1], tried
            repair = found
            in_vain[repair.name] += 1
        tried[repair.name] += 1


def tried_for(plan: Plan) -> Counter[str]:
    """Return how often each repair was tried for a plan."""
    return Counter(cast("dict[str, int]", plan.settings.get("tried", {})))


def with_tried(plan: Plan, tried: Counter[str]) -> Plan:
    """Return a plan with more repairs that were tried in its record."""
    total = dict(tried_for(plan) + tried)
    return replace(plan, settings={**plan.settings, "tried": total})


def repairs_tried(plan: Plan) -> list[dict[str, object]]:
    """Return what was tried for a plan, as documents say it: each repair, why, and how often."""
    tried = tried_for(plan)
    return [
        {"repair": row.name, "because": row.evidence, "times": tried[row.name]}
        for row in REPAIRS
        if row.name in tried
    ]
