"""The cheapest sequence of positions, by dynamic programming.

Every change of position has a price, and inside a moving cut every step on the grid. A cut that is
carried also pays for the way by which the tool stands away from one place before the arm.
"""

from __future__ import annotations

import itertools

import numpy as np

from postproc.arrays import ROUNDING, FloatArray, IndexArray
from postproc.geometry import angle_between
from postproc.planning.external.rating import UNREACHED, Rating, grid_step
from postproc.records import dataclass

CHANGE = 3.0
"""Price of a change of position, in the units of the objectives: 100 % of stiffness is about 1."""
SLIDE = 0.05
"""Price of a step on the grid from knot to knot of a moving cut, likewise; it is the longest."""
STEEP = 1.0
"""What each step more costs that an axis cannot make at the feed, likewise."""
AWAY = (1.0, 4.0)
"""What a metre or a radian costs, likewise, by which the tool stands away from where the axes carry
the work to, at a knot of a carried cut; more where the feed is slowed with less."""
_MOST_STARTS = 24
"""So many places to carry the work to are tried."""


@dataclass(frozen=True, slots=True)
class Row:
    """Tags [low, high) of one unit that share the cost (g,) of each position.

    ``slides``: the axes may move into it.
    """

    low: int
    high: int
    cost: FloatArray
    slides: bool = False


def moving_rows(rating: Rating, unit: int, cost: FloatArray) -> list[Row]:
    """Return a row for every knot of a unit, of costs (m, g)."""
    ends = [*rating.knots[rating.knots_of(unit)].tolist(), rating.units[unit][1]]
    pairs = enumerate(itertools.pairwise(ends))
    return [Row(low, high, cost[i], i > 0) for i, (low, high) in pairs]


def cheapest(rating: Rating, rows: list[Row]) -> tuple[IndexArray, float]:
    """Return the position (u,) of every row that make the cheapest sequence, and what it costs."""
    values, speeds, step = rating.values, rating.speeds, grid_step(rating.cell)
    change = _changes(rating)
    steps = np.abs(values[:, None] - values[None]) / step
    slide = SLIDE * steps.sum(axis=2)
    too_far = (steps > np.where(rating.may_move, 1.0 + ROUNDING, 0.0)).any(axis=2)
    feed = rating.feed
    value, back = rows[0].cost.copy(), []
    for before, row in itertools.pairwise(rows):
        between = change
        if row.slides:
            time = (rating.way[row.low] - rating.way[before.low]) / feed[row.low]
            within = np.nan_to_num(speeds * time, nan=np.inf) / step
            between = slide + STEEP * np.maximum(steps - within, 0.0).sum(axis=2)
            between[too_far] = UNREACHED
        total = value[:, None] + between
        back.append(np.argmin(total, axis=0))
        value = total.min(axis=0) + row.cost
    chosen = [int(np.argmin(value))]
    for pointers in reversed(back):
        chosen.append(int(pointers[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.int64), float(value.min())


def _changes(rating: Rating) -> FloatArray:
    """Return the price (g, g) of each change of position."""
    reach = np.array([axis.q_max - axis.q_min for axis in rating.cell.external_axes])
    gap = np.abs(rating.values[:, None] - rating.values[None]) / reach
    return np.where(gap.max(axis=2) > 0.0, CHANGE + gap.sum(axis=2), 0.0)


def carrying(rating: Rating, unit: int, price: float) -> tuple[FloatArray, IndexArray]:
    """Return what standing away costs a carried unit at its knots (m, g), and its positions (m,).

    Where the tool stands to the arm is held against each of the places at which the unit could
    begin, and the cheapest of these is taken.

    Args:
        rating: of the toolpath.
        unit: that may be cut moving.
        price: of a metre or a radian by which the tool stands away from there at a knot.
    """
    place, tags = rating.checker.problem.placement, rating.knots[rating.knots_of(unit)]
    T, loss = place.base(rating.values), rating.loss_of(unit)
    tips = np.einsum("gij,mj->mgi", T[:, :3, :3], place.p_base_tcp[tags]) + T[:, :3, 3]
    axes = np.einsum("gij,mj->mgi", T[:, :3, :3], place.axis_base(tags))
    starts = np.flatnonzero((loss[0] < UNREACHED) | (loss[0] == loss[0].min()))
    found = []
    for start in starts[:: max(1, -(-len(starts) // _MOST_STARTS))].tolist():
        away = np.linalg.norm(tips - tips[0, start], axis=2)
        away = price * (away + angle_between(axes, axes[0, start]))
        chosen, cost = cheapest(rating, moving_rows(rating, unit, loss + away))
        found.append((cost, away, chosen))
    return min(found, key=lambda way: way[0])[1:]
