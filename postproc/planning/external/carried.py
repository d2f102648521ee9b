"""Cuts run with the axes standing or with the work carried past the arm, whichever is better.

Standing is the quieter way: carrying is looked at where a cut is refused, slowed, or gives away
stiffness that it could have, and has to be better by as much as is worth it.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from postproc.arrays import ROUNDING, FloatArray
from postproc.model import MoveRole, Plan
from postproc.planning.external.positions import Positions, Run, run_of
from postproc.planning.external.rating import AWAY, UNREACHED, Rating, carrying
from postproc.planning.search import arc_length
from postproc.planning.states import Weights
from postproc.records import dataclass

WORTH = 0.5
"""What carrying has to gain, in the units of the objectives: as much as 5 % of the time of the cut.
An axis that moves adds its errors."""
_HOPE = 0.1
"""Carrying is looked at where single poses, chosen free of each other, gain this share of it."""
SLOWED = 0.01
"""A feed lowered by more than this share is looked at."""
_SLOW = 10.0
"""What the time of a cut at full feed costs likewise, as long again as it takes: 1 % of it is as
bad as 1 % of stiffness beyond the loss that `balanced` takes for nothing."""
_ROUNDS = 2
"""So often a carried cut is planned again where it was refused."""
PlanRun = Callable[[Run], Plan]


class Ask(NamedTuple):
    """What a toolpath asks for: the way to each tag (n,) [m], and the feed there (n,) [m/s]."""

    way: FloatArray
    feed: FloatArray


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one cut in a plan.

    Args:
        errors: how many findings refuse it.
        is_slowed: whether a feed was lowered.
        time: how long it takes, with what the axes take to come and to go on, against the time at
            full feed.
        share: (n,) of the way that belongs to each tag, 1 in all.
        index, best: (n,) [N/m] stiffness of each tag, and the best it could have where the axes
            stand; NaN without.
    """

    errors: int
    is_slowed: bool
    time: float
    share: FloatArray
    index: FloatArray
    best: FloatArray

    @classmethod
    def of(cls, rating: Rating, unit: int, runs: list[Run], planned: PlanRun, ask: Ask) -> Outcome:
        """Return what became of a unit in the plan of its run, one of ``runs`` in order."""
        low, high = rating.units[unit]
        number = run_of(runs, low)
        run, plan = runs[number], planned(runs[number])
        beside = itertools.pairwise(runs[max(number - 1, 0) : number + 2])
        ways = [np.abs(b.external[0] - a.external[-1]) / rating.speeds for a, b in beside]
        rows, tags = np.arange(low, high), range(low - run.low, high - run.low)
        cuts = np.flatnonzero(plan.role == MoveRole.CUT)
        cuts = cuts[np.isin(plan.tag[cuts], tags)]
        end = plan.tag[cuts] + run.low
        feed = ask.feed[end]
        at_feed = np.diff(ask.way[end], prepend=ask.way[low]) / feed
        share = np.gradient(ask.way[rows])
        best = plan.stiffness if plan.stiffness_best is None else plan.stiffness_best
        return cls(
            sum(finding.tag_index in tags for finding in plan.errors),
            bool((plan.speed[cuts] < (1.0 - SLOWED) * feed).any()),
            float(
                (plan.duration[cuts].sum() + sum(way.max() for way in ways))
                / max(np.nansum(at_feed), ROUNDING)
            ),
            share / max(share.sum(), ROUNDING),
            plan.stiffness[tags.start : tags.stop],
            best[tags.start : tags.stop],
        )

    @property
    def worst_loss(self) -> float:
        """The largest loss of stiffness at a tag, as a share of its best; 0 without stiffness."""
        return float(np.nan_to_num(1.0 - self.index / self.best).max(initial=0.0))

    def cost(self, weights: Weights, best: FloatArray) -> float:
        """Return what the cut costs: its time, its stiffness, and its losses of the best (n,)."""
        loss = weights.price(1.0 - self.index / best) - np.log(self.index)
        return _SLOW * self.time + float(np.nansum(self.share * loss))

    def is_better(self, other: Outcome, weights: Weights) -> bool:
        """Return whether this is clearly better: it can be run and the other not, or is cheaper."""
        if self.errors or other.errors:
            return self.errors < other.errors
        best = np.fmax(self.best, other.best)
        return self.cost(weights, best) < other.cost(weights, best) - WORTH


def carried_where_better(places: Positions, runs: list[Run], planned: PlanRun) -> list[Run]:
    """Return the runs with every cut carried that is clearly better off so.

    Args:
        places: the search, brought to what is returned.
        runs: found so far.
        planned: run to its plan, the same for the same run.
    """
    weights = places.rating.checker.problem.settings.weights
    for price in AWAY:
        before = _outcomes(places, runs, planned)
        units = [
            unit
            for unit, now in before.items()
            if _is_worth_a_look(places, unit, now, runs[run_of(runs, places.rating.units[unit][0])])
        ]
        if not units:
            break
        kept = {unit: places.state(unit) for unit in units}
        for unit in units:
            places.carry(unit, price)
        for _ in range(_ROUNDS):
            trial = places.runs()
            if not any([places.blame(run, planned(run)) for run in trial]):
                break
        after = _outcomes(places, trial, planned)
        worse = {unit for unit in units if not after[unit].is_better(before[unit], weights)}
        for unit in worse:
            places.restore(unit, kept[unit])
        trial = places.runs()
        if worse != kept.keys() and _errors(trial, planned) <= _errors(runs, planned):
            runs = trial
        else:
            for unit in units:
                places.restore(unit, kept[unit])
    return runs


def _is_worth_a_look(places: Positions, unit: int, now: Outcome, run: Run) -> bool:
    """Return whether a unit in a run may be better off carried, or more so than it is."""
    if now.errors:
        is_reached = (places.rating.loss_of(unit) < UNREACHED).any(axis=1).all()
        return bool(is_reached) and not places.refused[unit]
    bound = places.rating.cell.optimize.loss_bound
    if now.is_slowed or (bound is not None and now.worst_loss > bound):
        return True
    return unit not in places.carried and _gains(places.rating, unit, run, _HOPE * WORTH)


def _gains(rating: Rating, unit: int, run: Run, worth: float) -> bool:
    """Return whether the mean loss of a unit may be lower by ``worth`` when carried.

    Than in a run. Collisions are not asked for.
    """
    knots, loss = rating.knots[rating.knots_of(unit)], rating.loss_of(unit)
    rows, there = np.arange(len(knots)), rating.nearest(run.external[knots - run.low])
    spare = loss[rows, there].mean() - worth
    return bool(spare > 0.0 and loss[rows, carrying(rating, unit, AWAY[0])[1]].mean() < spare)


def _outcomes(places: Positions, runs: list[Run], planned: PlanRun) -> dict[int, Outcome]:
    """Return what became of each unit that may be cut moving."""
    rating = places.rating
    ask = Ask(arc_length(rating.toolpath), rating.feed)
    return {
        unit: Outcome.of(rating, unit, runs, planned, ask)
        for unit in range(len(rating.units))
        if places.may_be_cut_moving(unit)
    }


def _errors(runs: list[Run], planned: PlanRun) -> int:
    return sum(len(planned(run).errors) for run in runs)
