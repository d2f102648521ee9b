"""What cuts cost with the axes standing, or with the work carried past the arm.

Standing is the quieter way: carrying has to be better by as much as is worth it.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from postproc.arrays import ROUNDING
from postproc.model import MoveRole, Plan
from postproc.planning.external.positions import Positions, Run, run_of
from postproc.planning.search import arc_length

WORTH = 0.5
"""What carrying has to gain, in the units of the objectives: as much as 5 % of the time of the cut.
An axis that moves adds its errors."""
_SLOW = 10.0
"""What the time of a cut at full feed costs likewise, as long again as it takes: 1 % of it is as
bad as 1 % of stiffness beyond the loss that `balanced` takes for nothing."""


def cut_costs(places: Positions, runs: list[Run], plans: Sequence[Plan]) -> dict[int, float]:
    """Return what each unit that may be cut moving costs beyond its best, infinite if refused.

    Its time, with what the axes take to come and to go on, against that at full feed; its stiffness
    against the best that any position gives; and what carrying has to be worth.

    Args:
        places: the search.
        runs: in order.
        plans: of each run.
    """
    rating, weights = places.rating, places.rating.checker.problem.settings.weights
    way, feed, costs = arc_length(rating.toolpath), rating.feed, dict[int, float]()
    for unit, (low, high) in enumerate(rating.units):
        if not places.may_be_cut_moving(unit):
            continue
        number = run_of(runs, low)
        run, plan = runs[number], plans[number]
        tags, at = range(low - run.low, high - run.low), rating.knots_of(unit)
        if any(finding.tag_index in tags for finding in plan.errors):
            costs[unit] = np.inf
            continue
        beside = itertools.pairwise(runs[max(number - 1, 0) : number + 2])
        slides = [np.abs(b.external[0] - a.external[-1]) / rating.speeds for a, b in beside]
        cuts = np.flatnonzero((plan.role == MoveRole.CUT) & np.isin(plan.tag, tags))
        end = plan.tag[cuts] + run.low
        full = np.nansum(np.diff(way[end], prepend=way[low]) / feed[end])
        time = plan.duration[cuts].sum() + sum(slide.max() for slide in slides)
        knots = rating.knots[at]
        share = np.gradient(rating.way[knots])
        kept = plan.stiffness[knots - run.low] / rating.best[at]
        loss = weights.price(1.0 - kept) - np.log(kept)
        costs[unit] = (
            _SLOW * (float(time) / max(float(full), ROUNDING) - 1.0)
            + float(np.nansum(share * loss)) / float(share.sum())
            + (WORTH if unit in places.carried else 0.0)
        )
    return costs
