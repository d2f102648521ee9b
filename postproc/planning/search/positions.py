"""Where the external axes stand at each tag: the best sequence of positions.

Each tag is rated at each position of a grid by what its best pose costs there. Every change of
position has a price, and inside a moving cut every step on the grid; steps are then made smooth.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.geometry import angle_between
from postproc.model import Plan, ToolPath
from postproc.paths import top_speeds
from postproc.planning.checks import Checker
from postproc.planning.search.between import cubic, slopes
from postproc.planning.search.edges import best_of
from postproc.planning.search.keytags import arc_length, spaced
from postproc.planning.search.refine import tridiagonal
from postproc.planning.search.rungs import FINE, step_rules
from postproc.planning.states import Problem, Rule, Settings, evaluate, sample, spin_values
from postproc.process import AXIS_SHARE, feeds_of
from postproc.units import DEG

RAIL_STEP = 0.25
"""Distance [m] between positions on a rail."""
TURN_STEP = 30.0 * DEG
"""Angle between positions of a positioner."""
MOST_POSITIONS = 400
_FINER = 8
"""Where no position of the grid reaches a tag, one so much finer is looked through for it."""
_MOST_FINER = 1000
_ADDED = 24
"""Positions of the finer grid that are added at most."""
CHANGE = 3.0
"""Price of a change of position, in the units of the objectives: 100 % of stiffness is about 1."""
SLIDE = 0.05
"""Price of a step on the grid from knot to knot of a moving cut, likewise; it is the longest."""
BLOCKED = 10.0
"""What a position costs at which no pose of a coarse grid of spins is free of collision."""
_COARSE = 3
STEEP = 1.0
"""What each step more costs that an axis cannot make at the feed, likewise."""
UNREACHED = 1e6
_MOST_REFUSED = 6
"""A cut that may move is given up after so many plans that all refuse the same tag of it."""
AWAY = (1.0, 4.0)
"""What a metre or a radian costs, likewise, by which the tool stands away from where the axes carry
the work to, at a knot of a carried cut; more where the feed is slowed with less."""
_MOST_STARTS = 24
"""So many places to carry the work to are tried."""
_PATIENCE = 2
"""After so many refusals of a carried cut the axes are held at the places that are left, and of a
held one that cannot be entered or left it is carried."""
KNOT = 0.1
"""On cuts positions are rated this often [m] ..."""
KNOT_TURN = 10.0 * DEG
"""... and as often as the tool axis turns by so much."""
_TURN_LENGTH = 0.1
"""A radian that the tool axis turns counts as so much way [m]."""
_LEAST_CALM, _MOST_CALM = 0.02, 16.0
CALM = 0.5
"""Steps on the grid are smoothed over so much way [m]; less where the arm cannot follow."""
_MICRON = 6
"""Positions are rounded to so many digits [m or rad], as program text can hold them."""
CheckerAt = Callable[[FloatArray], Checker]


def position_grid(cell: Cell, finer: int = 1, most: int = MOST_POSITIONS) -> FloatArray:
    """Return the grid of positions (g, k): 0 among each axis' values where its range holds it.

    Args:
        cell: with its external axes.
        finer: by how much its steps are shorter than usual, as far as ``most`` allows.
        most: about so many positions at most.
    """
    columns = []
    share = most ** (1.0 / len(cell.external_axes))
    for axis, step in zip(cell.external_axes, (_steps(cell) / finer).tolist(), strict=True):
        step = max(step, (axis.q_max - axis.q_min) / max(share - 1.0, 1.0))
        low, high = np.ceil(axis.q_min / step - 1e-9), np.floor(axis.q_max / step + 1e-9)
        inner = np.arange(low, high + 1) * step
        columns.append(np.unique(np.concatenate([[axis.q_min], inner, [axis.q_max]])))
    return np.array(list(itertools.product(*(column.tolist() for column in columns))))


def _steps(cell: Cell) -> FloatArray:
    """Return the step (k,) of the grid of each axis."""
    return np.array(
        [RAIL_STEP if axis.kind == "rail" else TURN_STEP for axis in cell.external_axes]
    )


@dataclass(frozen=True, slots=True)
class _Row:
    """Tags [low, high) of a unit that share a rating; ``slides``: the axes may move into it."""

    unit: int
    low: int
    high: int
    cost: FloatArray
    slides: bool = False


@dataclass(frozen=True, slots=True)
class _State:
    """What is known and chosen for one unit, as columns of ``Positions``."""

    calm: float | None
    carried: FloatArray | None
    is_looked_at: bool
    loss: FloatArray
    shut: BoolArray
    closed: BoolArray


@dataclass(slots=True)
class Run:
    """Tags [low, high) between two moves of the external axes; ``external`` (n, k) at each."""

    low: int
    high: int
    external: FloatArray

    @property
    def moves(self) -> bool:
        """Whether the axes move along the run."""
        return bool((self.external != self.external[0]).any())


@dataclass(slots=True)
class Positions:
    """The search for positions.

    Args:
        checker: of the toolpath in the cell with its external axes.
        values: (g, k) the grid.
        units: [low, high) of tags that are one cut, or one tag.
        knots: (m,) rising, tags at which positions are rated, ends of units among them.
        loss: (m, g) of each knot at each position, ``UNREACHED`` where it has no pose.
        way: (n,) [m] along the path, turns of the tool axis counted, rising.
        may_move: (k,) axes that may move inside cuts.
    """

    checker: Checker
    values: FloatArray
    units: list[tuple[int, int]]
    knots: IndexArray
    loss: FloatArray
    way: FloatArray
    may_move: BoolArray
    closed: BoolArray = field(init=False)
    shut: BoolArray = field(init=False)
    calm: dict[int, float] = field(init=False, default_factory=dict)
    carried: dict[int, FloatArray] = field(init=False, default_factory=dict)
    refused: Counter[int] = field(init=False, default_factory=Counter)
    refusals: Counter[tuple[int, int]] = field(init=False, default_factory=Counter)
    looked_at: set[int] = field(init=False, default_factory=set)
    walled: dict[int, int] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Let cuts move that no single position reaches, as far as any reaches them."""
        self.shut = np.zeros(self.loss.shape, dtype=np.bool_)
        self.closed = np.zeros((len(self.units), len(self.values)), dtype=np.bool_)
        for unit in range(len(self.units)):
            loss = self.loss[self.knots_of(unit)]
            some = (loss < UNREACHED).any(axis=1)
            if not (loss[some] < UNREACHED).all(axis=0).any():
                self._set_moving(unit)

    def may_be_cut_moving(self, unit: int) -> bool:
        """Return whether the axes may move along a unit."""
        low, high = self.units[unit]
        return bool(self.may_move.any()) and high - low > 1

    def is_reached(self, unit: int) -> bool:
        """Return whether every knot of a unit is reached from some position."""
        return bool((self.loss[self.knots_of(unit)] < UNREACHED).any(axis=1).all())

    def _set_moving(self, unit: int) -> bool:
        if not self.may_be_cut_moving(unit) or unit in self.calm:
            return False
        self.calm[unit] = CALM
        self._avoid_collisions(unit)
        return True

    def carry(self, unit: int, price: float) -> bool:
        """Let the axes carry the work of a unit past an arm that keeps about its pose.

        As far as they reach: where the tool stands to the arm is held against each of the places
        at which the unit could begin, and the cheapest of these is taken.

        Args:
            unit: that may be cut moving.
            price: of a metre or a radian by which the tool stands away from there at a knot.
        """
        if not self.may_be_cut_moving(unit):
            return False
        self.calm[unit] = CALM
        self._avoid_collisions(unit)
        self.carried[unit], _ = self._towards(unit, price)
        return True

    def gains(self, unit: int, run: Run, worth: float) -> bool:
        """Return whether the mean loss of a unit may be lower by ``worth`` when carried.

        Than in a run. Collisions are not asked for.
        """
        at = self.knots_of(unit)
        loss, rows = self.loss[at], np.arange(at.stop - at.start)
        there = self._nearest(run.external[self.knots[at] - run.low])
        spare = loss[rows, there].mean() - worth
        return bool(spare > 0.0 and loss[rows, self._towards(unit, AWAY[0])[1]].mean() < spare)

    def _towards(self, unit: int, price: float) -> tuple[FloatArray, IndexArray]:
        """Return what standing away costs (m, g) a carried unit, and its positions (m,)."""
        at = self.knots_of(unit)
        place, T = self.checker.problem.placement, self.checker.problem.placement.base(self.values)
        tags = self.knots[at]
        tips = np.einsum("gij,mj->mgi", T[:, :3, :3], place.p_base_tcp[tags]) + T[:, :3, 3]
        axes = np.einsum("gij,mj->mgi", T[:, :3, :3], place.axis_base(tags))
        first = self.loss[at.start]
        starts = np.flatnonzero((first < UNREACHED) | (first == first.min()))
        found = []
        for start in starts[:: max(1, -(-len(starts) // _MOST_STARTS))].tolist():
            away = np.linalg.norm(tips - tips[0, start], axis=2)
            away = price * (away + angle_between(axes, axes[0, start]))
            chosen, cost = self._cheapest(self._moving_rows(unit, self.loss[at] + away))
            found.append((cost, away, chosen))
        return min(found, key=lambda way: way[0])[1:]

    def state(self, unit: int) -> _State:
        """Return what is known and chosen for a unit."""
        at = self.knots_of(unit)
        return _State(
            self.calm.get(unit),
            self.carried.get(unit),
            unit in self.looked_at,
            self.loss[at].copy(),
            self.shut[at].copy(),
            self.closed[unit].copy(),
        )

    def restore(self, unit: int, state: _State) -> None:
        """Take back what was known and chosen for a unit."""
        at = self.knots_of(unit)
        self._stand(unit)
        if state.calm is not None:
            self.calm[unit] = state.calm
        if state.carried is not None:
            self.carried[unit] = state.carried
        if not state.is_looked_at:
            self.looked_at.discard(unit)
        self.loss[at], self.shut[at], self.closed[unit] = state.loss, state.shut, state.closed

    def _stand(self, unit: int) -> None:
        """Let the axes stand along a unit."""
        self.calm.pop(unit, None)
        self.carried.pop(unit, None)

    def _avoid_collisions(self, unit: int) -> None:
        """Make dear for knots of a unit the positions at which no pose of a coarse grid is free.

        Where that is every position of a knot the finest grid tells whether the unit is walled in.
        """
        if self.checker.scene is None or unit in self.looked_at:
            return
        self.looked_at.add(unit)
        knots = self.knots_of(unit)
        problem, tags = self.checker.problem, self.knots[knots]
        spins = problem.settings.spins[::_COARSE]
        first, of_first = _distinct(problem, self.values)
        for number, g in enumerate(first.tolist()):
            here, same = problem.standing(self.values[g]), np.flatnonzero(of_first == number)
            rows = np.flatnonzero(self.loss[knots, g] < UNREACHED)
            free = self._has_free(here, tags[rows], spins)
            self.loss[np.ix_(knots.start + rows[~free], same)] += BLOCKED
        blocked = (self.loss[knots, first] >= BLOCKED).all(axis=1)
        wishes = problem.cell.optimize
        for row in np.flatnonzero(blocked)[: 0 if wishes.pins else 1].tolist():
            finest = spin_values(wishes.step / FINE, *wishes.range)
            reached = first[self.loss[knots.start + row, first] < UNREACHED]
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

    @property
    def cell(self) -> Cell:
        """The cell with its external axes."""
        return self.checker.problem.cell

    @property
    def speeds(self) -> FloatArray:
        """Largest speeds (k,) of the axes [m/s or rad/s]."""
        return top_speeds(self.cell)[6:]

    @property
    def toolpath(self) -> ToolPath:
        """What is to be done."""
        return self.checker.problem.toolpath

    def knots_of(self, unit: int) -> slice:
        """Return which knots belong to a unit."""
        return slice(*np.searchsorted(self.knots, self.units[unit]).tolist())

    def _rows(self) -> list[_Row]:
        """Return the rows of the search: one of a unit, one of every knot of a moving one."""
        rows = []
        count = np.diff(np.append(self.knots, len(self.toolpath)))[:, None]
        for unit, (low, high) in enumerate(self.units):
            at = self.knots_of(unit)
            if unit in self.calm:
                cost = np.where(self.shut[at], UNREACHED, self.loss[at])
                rows += self._moving_rows(unit, cost + self.carried.get(unit, 0.0))
            else:
                cost = np.minimum((count[at] * self.loss[at]).sum(axis=0), UNREACHED)
                rows.append(_Row(unit, low, high, np.where(self.closed[unit], UNREACHED, cost)))
        return rows

    def _moving_rows(self, unit: int, cost: FloatArray) -> list[_Row]:
        """Return a row for every knot of a unit, of costs (m, g)."""
        ends = [*self.knots[self.knots_of(unit)].tolist(), self.units[unit][1]]
        pairs = enumerate(itertools.pairwise(ends))
        return [_Row(unit, low, high, cost[i], i > 0) for i, (low, high) in pairs]

    def runs(self) -> list[Run]:
        """Return the runs of tags with where the axes stand, at least total cost."""
        rows = self._rows()
        chosen, _ = self._cheapest(rows)
        runs: list[Run] = []
        for number, (row, position) in enumerate(zip(rows, chosen.tolist(), strict=True)):
            place = np.tile(self.values[position], (row.high - row.low, 1))
            if runs and (row.slides or position == chosen[number - 1]):
                last = runs[-1]
                runs[-1] = Run(last.low, row.high, np.concatenate([last.external, place]))
            else:
                runs.append(Run(row.low, row.high, place))
        for run in runs:
            self._smooth(run)
        return runs

    def _smooth(self, run: Run) -> None:
        """Make the steps of moving cuts in a run smooth, in place; their ends stay.

        Less so where the arm would come to positions at which it has no free pose, more so where an
        axis would be too slow for the feed.
        """
        for unit, calm in self.calm.items():
            low, high = self.units[unit]
            if not run.low <= low < run.high:
                continue
            at = self.knots_of(unit)
            knots, rows = self.knots[at], np.arange(at.start, at.stop)
            stepped = run.external[knots - run.low]
            value, fits = self._calmed_way(rows, stepped, calm)
            while not fits and calm >= 2.0 * _LEAST_CALM:
                calm *= 0.5
                value, fits = self._calmed_way(rows, stepped, calm)
            while fits and calm < _MOST_CALM and self._too_fast(knots, value):
                calm *= 2.0
                calmer, fits = self._calmed_way(rows, stepped, calm)
                value = calmer if fits else value
            curve = _curve(self.way[knots], value, self.way[low:high])
            curve[[0, -1]] = stepped[[0, -1]]
            stands = np.ptp(stepped, axis=0) == 0.0  # digits would move it
            curve[:, stands] = stepped[0, stands]
            run.external[low - run.low : high - run.low] = curve

    def _calmed_way(
        self, rows: IndexArray, stepped: FloatArray, length: float
    ) -> tuple[FloatArray, bool]:
        """Return positions (m, k) at knots ``rows`` (m,) smoothed over so much way [m].

        And whether the arm has a free pose there, as far as it has one where they are stepped.
        """
        loss = np.where(self.shut, UNREACHED, self.loss)
        bound = loss[rows, self._nearest(stepped)] + 0.5 * BLOCKED
        value = _calmed(self.way[self.knots[rows]], stepped, length)
        return value, bool((loss[rows, self._nearest(value)] < bound).all())

    def _too_fast(self, knots: IndexArray, value: FloatArray) -> bool:
        """Return whether an axis is too slow for its way (m, k) between knots (m,) at the feed."""
        feed = feeds_of(self.toolpath, self.cell)[knots[1:]]
        rate = np.abs(np.diff(value, axis=0)) / np.diff(self.way[knots])[:, None]
        return bool((np.nan_to_num(feed)[:, None] * rate > AXIS_SHARE * self.speeds).any())

    def _nearest(self, external: FloatArray) -> IndexArray:
        """Return the positions (m,) of the grid nearest to where the axes stand (m, k)."""
        off = np.abs(self.values[None] - external[:, None]) / _steps(self.cell)
        return np.asarray(off.max(axis=2).argmin(axis=1))

    def _cheapest(self, rows: list[_Row]) -> tuple[IndexArray, float]:
        """Return the position (u,) of every row by dynamic programming, and what all cost."""
        change = self._change()
        steps = np.abs(self.values[:, None] - self.values[None]) / _steps(self.cell)
        slide = SLIDE * steps.sum(axis=2)
        too_far = (steps > np.where(self.may_move, 1.0 + 1e-9, 0.0)).any(axis=2)
        feed = feeds_of(self.toolpath, self.cell)
        value, back = rows[0].cost.copy(), []
        for before, row in itertools.pairwise(rows):
            between = change
            if row.slides:
                time = (self.way[row.low] - self.way[before.low]) / feed[row.low]
                within = np.nan_to_num(self.speeds * time, nan=np.inf) / _steps(self.cell)
                between = slide + STEEP * np.maximum(steps - within, 0.0).sum(axis=2)
                between[too_far] = UNREACHED
            total = value[:, None] + between
            back.append(np.argmin(total, axis=0))
            value = total.min(axis=0) + row.cost
        chosen = [int(np.argmin(value))]
        for pointers in reversed(back):
            chosen.append(int(pointers[chosen[-1]]))
        return np.array(chosen[::-1], dtype=np.int64), float(value.min())

    def _change(self) -> FloatArray:
        reach = np.array([axis.q_max - axis.q_min for axis in self.cell.external_axes])
        gap = np.abs(self.values[:, None] - self.values[None]) / reach
        return np.where(gap.max(axis=2) > 0.0, CHANGE + gap.sum(axis=2), 0.0)

    def blame(self, run: Run, result: Plan) -> bool:
        """Close positions to what failed there; return whether there is another way."""
        ways, moving, seen = dict[int, bool](), frozenset(self.calm), set[tuple[int, int]]()
        for finding in result.errors:
            if finding.tag_index is None:
                continue
            tag = run.low + finding.tag_index
            unit = next(i for i, (low, high) in enumerate(self.units) if low <= tag < high)
            low, high = self.units[unit]
            position = int(self._nearest(run.external[tag - run.low][None])[0])
            seen.add((unit, tag))
            again = ways.get(unit, False)
            if unit in moving:
                self.refused[unit] += 1
                again |= self._close_knot(unit, tag, position)
            elif not self.closed[unit, position]:
                self.closed[unit, position] = True
                again |= self._elsewhere(unit, position, tag in (low, high - 1))
            ways[unit] = again
        for unit in moving & self.carried.keys():
            if self.refused[unit] >= _PATIENCE and self._left(unit).any():
                self._stand(unit)
                ways[unit] = True
        self.refusals.update([*seen, *((unit, -1) for unit in ways)])
        hopeless = {
            unit
            for unit, tag in seen
            if self.may_be_cut_moving(unit)
            and self.refusals[unit, tag] == self.refusals[unit, -1] >= _MOST_REFUSED
        }
        return any(way for unit, way in ways.items() if unit not in hopeless | self.walled.keys())

    def _left(self, unit: int) -> BoolArray:
        """Return (g,) the positions at which a unit may still be done held."""
        reached = (self.loss[self.knots_of(unit)] < UNREACHED).all(axis=0)
        return np.asarray(~self.closed[unit] & reached)

    def is_open(self, unit: int) -> bool:
        """Return whether a unit has ways that were not refused: held at a place, or moving."""
        at = self.knots_of(unit)
        can_move = (~self.shut[at] & (self.loss[at] < UNREACHED)).any(axis=1).all()
        if unit in self.walled:
            return False
        return bool(self._left(unit).any() or (self.may_be_cut_moving(unit) and can_move))

    def _elsewhere(self, unit: int, position: int, is_at_end: bool) -> bool:
        """Look for another way for a unit refused at a position; return whether there is one.

        Where the arm had no free pose at some knot, or could not come or go, another place may
        serve. Else it is the way from pose to pose that fails, as it will elsewhere: the axes carry
        the work along it.
        """
        self._avoid_collisions(unit)
        left, loss = self._left(unit), self.loss[self.knots_of(unit)]
        is_blocked = loss.max(axis=0) >= BLOCKED
        may_serve = is_blocked[position] or (is_at_end and self.closed[unit].sum() <= _PATIENCE)
        if may_serve and (left & ~is_blocked).any():
            return True
        if not self.refused[unit] and self.carry(unit, AWAY[0]):
            return True
        return bool(left.any()) or self._set_moving(unit)

    def _close_knot(self, unit: int, tag: int, position: int) -> bool:
        """Close a position to the knot before a tag of a moving cut; it moves less calmly then."""
        knot = int(np.searchsorted(self.knots, tag, side="right")) - 1
        if self.shut[knot, position] or self.loss[knot, position] >= UNREACHED:
            return False
        self.shut[knot, position] = True
        self.calm[unit] = max(0.7 * self.calm[unit], KNOT)
        return bool((~self.shut[knot] & (self.loss[knot] < UNREACHED)).any())


def _calmed(way: FloatArray, value: FloatArray, length: float) -> FloatArray:
    """Return values (m, k) at knots smoothed over a length [m], the first and the last kept.

    Twice the minimum of squared distances to the values plus those from knot to knot.
    """
    link = length**2 / np.diff(way)
    weight = np.gradient(way)
    weight[[0, -1]] = 1e9
    diagonal = weight.copy()
    diagonal[1:] += link
    diagonal[:-1] += link
    for _ in range(2):
        value = np.column_stack([tridiagonal(diagonal, -link, weight * part) for part in value.T])
    return value


def _curve(knots: FloatArray, value: FloatArray, way: FloatArray) -> FloatArray:
    """Return the monotone cubics (n, k) through values (m, k) at knots (m,), at ``way`` (n,)."""
    at = np.clip(np.searchsorted(knots, way, side="right") - 1, 0, len(knots) - 2)
    h = np.diff(knots)[at]
    columns = []
    for part in value.T:
        slope = slopes(knots, part)
        ends = (part[at], part[at + 1], slope[at], slope[at + 1])
        columns.append(np.round(cubic((way - knots[at]) / h, h, ends), _MICRON))
    return np.column_stack(columns)


def rated(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    values: FloatArray,
    checker_at: CheckerAt,
) -> Positions:
    """Return the search, with what every knot loses at every position."""
    n, k = len(toolpath), len(cell.external_axes)
    checker = checker_at(np.zeros((n, k)))
    problem = checker.problem
    chain = step_rules(problem) == Rule.CHAIN
    axis = problem.placement.axis_base(np.arange(n))
    turned = np.concatenate([[0.0], np.cumsum(angle_between(axis[:-1], axis[1:]))])
    is_knot = spaced(arc_length(toolpath), chain, KNOT)
    is_knot[1:] |= np.diff(np.floor(turned / KNOT_TURN)) != 0
    knots = np.flatnonzero(is_knot)
    first, of_first = _distinct(problem, values)
    cost = np.column_stack(
        [_least_cost(problem.standing(value), knots, settings) for value in values[first]]
    )[:, of_first]
    values, cost = _with_finer(problem, values, knots, cost, settings)
    best = cost.min(axis=1, keepdims=True)
    loss = np.where(np.isfinite(cost), cost - np.where(np.isfinite(best), best, 0.0), np.nan)
    starts = np.unique(np.append(0, np.flatnonzero(~chain))) if n else np.zeros(0, np.int64)
    units = list(zip(starts.tolist(), np.append(starts[1:], n).tolist(), strict=True))
    way = arc_length(toolpath) + _TURN_LENGTH * turned + 1e-6 * np.arange(n)
    may_move = np.array([axis.moves_in_cuts for axis in cell.external_axes])
    loss = np.nan_to_num(loss, nan=UNREACHED)
    return Positions(checker, values, units, knots, loss, way, may_move)


def _distinct(problem: Problem, values: FloatArray) -> tuple[IndexArray, IndexArray]:
    """Return the first position (d,) of each kind, and of which kind each (g,) is.

    Whole turns of a positioner bring the work to where it was.
    """
    bases = np.round(problem.placement.base(values).reshape(len(values), 16), 9)
    seen: dict[bytes, int] = {}
    of_kind = np.array([seen.setdefault(row.tobytes(), len(seen)) for row in bases + 0.0])
    return np.unique(of_kind, return_index=True)[1], of_kind


def _with_finer(
    problem: Problem, values: FloatArray, knots: IndexArray, cost: FloatArray, settings: Settings
) -> tuple[FloatArray, FloatArray]:
    """Return the positions (g, k) and costs (m, g) with those added that reach what no other does.

    Args:
        problem: of the toolpath.
        values: (g, k) positions that were rated.
        knots: (m,) tags that were rated there.
        cost: (m, g) infinite where a tag has no pose.
        settings: of the plan.
    """
    left = np.flatnonzero(~np.isfinite(cost).any(axis=1))
    if not len(left):
        return values, cost
    fine = position_grid(problem.cell, _FINER, _MOST_FINER)
    there = np.column_stack(
        [_least_cost(problem.standing(value), knots[left], settings) for value in fine]
    )
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
    more = [_least_cost(problem.standing(value), knots, settings) for value in fine[added]]
    return np.concatenate([values, fine[added]]), np.column_stack([cost, *more])


def _least_cost(problem: Problem, tags: IndexArray, settings: Settings) -> FloatArray:
    """Return what the pose of each tag (n,) costs that a search prefers, infinite without any."""
    states = sample(problem, tags, settings.spins, tilts=problem.tilts)
    row = states.tag_of(np.arange(len(states.q)))
    wish = states.cost + settings.weights.price(1.0 - states.index / best_of(states)[row])
    order = np.lexsort((wish, row))
    row, first = np.unique(row[order], return_index=True)
    chosen = order[first]
    attitude, q = states.attitude_of(chosen), states.q[chosen].astype(np.float64)
    T = problem.placement.tcp(tags[row], attitude)
    cost = np.full(len(tags), np.inf)
    cost[row] = evaluate(problem, tags[row], attitude[:, 0], T, q)[0]
    return cost
