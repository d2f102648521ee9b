"""What each tag loses at each position of the external axes.

A tag is rated by what its best pose costs there; collisions are asked for only of the cuts along
which the axes may move, or that were refused.
"""

from __future__ import annotations

import itertools
from dataclasses import field, replace

import numpy as np

from postproc.arrays import ROUNDING, TINY, BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.geometry import angle_between
from postproc.ladder import Rule
from postproc.model import ToolPath
from postproc.paths import top_speeds
from postproc.planning.checks import Checker
from postproc.planning.job import Job, checker_of
from postproc.planning.search import arc_length, best_of, spaced, step_rules
from postproc.planning.states import Problem, evaluate, sample
from postproc.process import feeds_of
from postproc.records import dataclass
from postproc.units import DEG

_FINER = 8
"""Where no position of the grid reaches a tag, one so much finer is looked through for it."""
_MOST_FINER = 1000
_ADDED = 24
"""Positions of the finer grid that are added at most."""
BLOCKED = 1e4
"""What a position costs at which no pose of a coarse grid of spins is free of collision: more than
objectives can differ by, what a model of the arm leaves among them, and less than ``UNREACHED``."""
_COARSE = 3
UNREACHED = 1e6
KNOT = 0.1
"""On cuts positions are rated this often [m] ..."""
KNOT_TURN = 10.0 * DEG
"""... and as often as the tool axis turns by so much."""
_TURN_LENGTH = 0.1
"""A radian that the tool axis turns counts as so much way [m]."""
RAIL_STEP = 0.25
"""Distance [m] between positions on a rail."""
TURN_STEP = 30.0 * DEG
"""Angle between positions of a positioner."""
MOST_POSITIONS = 400
CHANGE = 3.0
"""Price of a change of position, in the units of the objectives: 100 % of stiffness is about 1."""
SLIDE = 0.05
"""Price of a step on the grid from knot to knot of a moving cut, likewise; it is the longest."""
STEEP = 1.0
"""What each step more costs that an axis cannot make at the feed, likewise."""
AWAY = 1.0
"""What a metre or a radian costs, likewise, by which the tool stands away from where the axes carry
the work to, at a knot of a carried cut."""
_MOST_STARTS = 24
"""So many places to carry the work to are tried."""


@dataclass(slots=True)
class Rating:
    """What the knots of a toolpath lose at the positions of a grid.

    Args:
        checker: of the toolpath in the cell with its external axes.
        values: (g, k) the grid.
        units: [low, high) of tags that are one cut, or one tag.
        knots: (m,) rising, tags at which positions are rated, ends of units among them.
        loss: (m, g) of each knot at each position, ``UNREACHED`` where it has no pose.
        best: (m,) [N/m] stiffness of the best pose of each knot at any position, NaN without.
        way: (n,) [m] along the path, turns of the tool axis counted, rising.

    Attributes:
        looked_at: units whose collisions are in ``loss``.
        walled: unit to a tag of it that has no free pose at any position.
    """

    checker: Checker
    values: FloatArray
    units: list[tuple[int, int]]
    knots: IndexArray
    loss: FloatArray
    best: FloatArray
    way: FloatArray
    looked_at: set[int] = field(init=False, default_factory=set)
    walled: dict[int, int] = field(init=False, default_factory=dict)

    @property
    def cell(self) -> Cell:
        """The cell with its external axes."""
        return self.checker.problem.cell

    @property
    def toolpath(self) -> ToolPath:
        """What is to be done."""
        return self.checker.problem.toolpath

    @property
    def feed(self) -> FloatArray:
        """The feed (n,) [m/s] that is asked for at each tag, NaN without."""
        return feeds_of(self.toolpath, self.cell)

    @property
    def speeds(self) -> FloatArray:
        """Largest speeds (k,) of the axes [m/s or rad/s]."""
        return top_speeds(self.cell)[6:]

    @property
    def may_move(self) -> BoolArray:
        """Which axes (k,) may move inside cuts."""
        return np.array([axis.moves_in_cuts for axis in self.cell.external_axes])

    def knots_of(self, unit: int) -> slice:
        """Return which knots belong to a unit."""
        return slice(*np.searchsorted(self.knots, self.units[unit]).tolist())

    def loss_of(self, unit: int) -> FloatArray:
        """Return what the knots of a unit lose (m, g), to be changed in place."""
        return self.loss[self.knots_of(unit)]

    def nearest(self, external: FloatArray) -> IndexArray:
        """Return the positions (m,) of the grid nearest to where the axes stand (m, k)."""
        off = np.abs(self.values[None] - external[:, None]) / grid_step(self.cell)
        return np.asarray(off.max(axis=2).argmin(axis=1))

    def avoid_collisions(self, unit: int) -> None:
        """Make dear for knots of a unit the positions at which no pose of a coarse grid is free.

        Where that is every position of a knot the finest grid tells whether the unit is walled in.
        """
        if self.checker.scene is None or unit in self.looked_at:
            return
        self.looked_at.add(unit)
        tags, loss = self.knots[self.knots_of(unit)], self.loss_of(unit)
        problem = self.checker.problem
        spins = problem.settings.spins[::_COARSE]
        first, of_first = distinct(problem, self.values)
        for number, g in enumerate(first.tolist()):
            here, same = problem.standing(self.values[g]), np.flatnonzero(of_first == number)
            rows = np.flatnonzero(loss[:, g] < UNREACHED)
            free = self._has_free(here, tags[rows], spins)
            loss[np.ix_(rows[~free], same)] += BLOCKED
        blocked = (loss[:, first] >= BLOCKED).all(axis=1)
        wishes, finest = problem.cell.optimize, problem.finest_spins
        for row in np.flatnonzero(blocked)[: 0 if wishes.pins else 1].tolist():
            reached = first[loss[row, first] < UNREACHED]
            if not any(
                self._has_free(problem.standing(value), tags[row : row + 1], finest)[0]
                for value in self.values[reached]
            ):
                self.walled[unit] = int(tags[row])

    def _has_free(self, here: Problem, tags: IndexArray, spins: FloatArray) -> BoolArray:
        """Return at which tags (m,) the arm has a free pose, the axes standing as they do."""
        states = sample(here, tags, spins)
        each = np.flatnonzero(np.diff(states.config, prepend=-1))
        of, q = states.tag_of(each), states.q[each].astype(np.float64)
        good = replace(self.checker, problem=here).poses(tags[of], q).good
        free = np.zeros(len(tags), dtype=np.bool_)
        free[of[good]] = True
        return free


def rated(job: Job, toolpath: ToolPath, cell: Cell) -> Rating:
    """Return what every knot loses at every position, collisions left out.

    Args:
        job: of the call.
        toolpath: what was read.
        cell: with at least one external axis.
    """
    n, k = len(toolpath), len(cell.external_axes)
    checker = checker_of(toolpath, cell, job.settings, np.zeros((n, k)))
    problem, values = checker.problem, position_grid(cell)
    chain = step_rules(problem) == Rule.CHAIN
    axis = problem.placement.axis_base(np.arange(n))
    turned = np.concatenate([[0.0], np.cumsum(angle_between(axis[:-1], axis[1:]))])
    is_knot = spaced(arc_length(toolpath), chain, KNOT)
    is_knot[1:] |= np.diff(np.floor(turned / KNOT_TURN)) != 0
    knots = np.flatnonzero(is_knot)
    first, of_first = distinct(problem, values)
    cost, index = _least_costs(problem, values[first], knots)[..., of_first]
    values, cost = _with_finer(problem, values, knots, cost)
    least = cost.min(axis=1, keepdims=True)
    loss = np.where(np.isfinite(cost), cost - np.where(np.isfinite(least), least, 0.0), UNREACHED)
    best = np.fmax.reduce(index, axis=1)
    starts = np.unique(np.append(0, np.flatnonzero(~chain))) if n else np.zeros(0, np.int64)
    units = list(zip(starts.tolist(), np.append(starts[1:], n).tolist(), strict=True))
    way = arc_length(toolpath) + _TURN_LENGTH * turned + TINY * np.arange(n)
    return Rating(checker, values, units, knots, loss, best, way)


def _with_finer(
    problem: Problem, values: FloatArray, knots: IndexArray, cost: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return positions (g, k) and costs (m, g) with those that reach what no other does."""
    left = np.flatnonzero(~np.isfinite(cost).any(axis=1))
    if not len(left):
        return values, cost
    fine = position_grid(problem.cell, _FINER, _MOST_FINER)
    there = _least_costs(problem, fine, knots[left])[0]
    reached = np.isfinite(there)
    added: list[int] = []
    while reached.any() and len(added) < _ADDED:
        count = reached.sum(axis=0)
        total = np.where(reached, there, 0.0).sum(axis=0)
        best = int(np.lexsort((total, -count))[0])
        added.append(best)
        reached[reached[:, best]] = False
    if not added:
        return values, cost
    more = _least_costs(problem, fine[added], knots)[0]
    return np.concatenate([values, fine[added]]), np.column_stack([cost, more])


def _least_costs(problem: Problem, values: FloatArray, tags: IndexArray) -> FloatArray:
    """Return as ``_least_cost`` for each position (2, n, g)."""
    return np.stack([_least_cost(problem.standing(value), tags) for value in values], axis=-1)


def _least_cost(problem: Problem, tags: IndexArray) -> FloatArray:
    """Return cost and index (2, n) of the pose of each tag (n,) that a search prefers.

    Infinite and NaN without any.
    """
    settings = problem.settings
    states = sample(problem, tags, settings.spins, tilts=problem.tilts)
    row = states.tag_of(np.arange(len(states.q)))
    wish = states.cost + settings.weights.price(1.0 - states.index / best_of(states)[row])
    order = np.lexsort((wish, row))
    row, first = np.unique(row[order], return_index=True)
    chosen = order[first]
    attitude, q = states.attitude_of(chosen), states.q[chosen].astype(np.float64)
    T = problem.placement.tcp(tags[row], attitude)
    found = np.repeat([[np.inf], [np.nan]], len(tags), axis=1)
    found[:, row] = evaluate(problem, tags[row], attitude[:, 0], T, q)
    return found


def position_grid(cell: Cell, finer: int = 1, most: int = MOST_POSITIONS) -> FloatArray:
    """Return the grid of positions (g, k): 0 among each axis' values where its range holds it.

    Args:
        cell: with its external axes.
        finer: by how much its steps are shorter than usual, as far as ``most`` allows.
        most: about so many positions at most.
    """
    columns = []
    share = most ** (1.0 / len(cell.external_axes))
    for axis, step in zip(cell.external_axes, (grid_step(cell) / finer).tolist(), strict=True):
        step = max(step, (axis.q_max - axis.q_min) / max(share - 1.0, 1.0))
        low, high = np.ceil(axis.q_min / step - ROUNDING), np.floor(axis.q_max / step + ROUNDING)
        inner = np.arange(low, high + 1) * step
        columns.append(np.unique(np.concatenate([[axis.q_min], inner, [axis.q_max]])))
    return np.array(list(itertools.product(*(column.tolist() for column in columns))))


def grid_step(cell: Cell) -> FloatArray:
    """Return the usual step (k,) of the grid of each axis."""
    return np.array(
        [RAIL_STEP if axis.kind == "rail" else TURN_STEP for axis in cell.external_axes]
    )


def distinct(problem: Problem, values: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the first position (d,) of each kind, and of which kind each (g,) is.

    Whole turns of a positioner bring the work to where it was.
    """
    bases = np.round(problem.placement.base(values).reshape(len(values), 16), 9)
    seen: dict[bytes, int] = {}
    of_kind = np.array([seen.setdefault(row.tobytes(), len(seen)) for row in bases + 0.0])
    return np.unique(of_kind, return_index=True)[1], of_kind


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


def carrying(rating: Rating, unit: int) -> tuple[FloatArray, IndexArray]:
    """Return what standing away costs a carried unit at its knots (m, g), and its positions (m,).

    Where the tool stands to the arm is held against each of the places at which the unit could
    begin, and the cheapest of these is taken.
    """
    place, tags = rating.checker.problem.placement, rating.knots[rating.knots_of(unit)]
    T, loss = place.base(rating.values), rating.loss_of(unit)
    tips = np.einsum("gij,mj->mgi", T[:, :3, :3], place.p_base_tcp[tags]) + T[:, :3, 3]
    axes = np.einsum("gij,mj->mgi", T[:, :3, :3], place.axis_base(tags))
    starts = np.flatnonzero((loss[0] < UNREACHED) | (loss[0] == loss[0].min()))
    found = []
    for start in starts[:: max(1, -(-len(starts) // _MOST_STARTS))].tolist():
        away = np.linalg.norm(tips - tips[0, start], axis=2)
        away = AWAY * (away + angle_between(axes, axes[0, start]))
        chosen, cost = cheapest(rating, moving_rows(rating, unit, loss + away))
        found.append((cost, away, chosen))
    return min(found, key=lambda way: way[0])[1:]
