"""External axes: where the rail stands and how the positioner is turned for every tag.

Where one position serves a cut the axes stand still while the tool works, and move between
positions with the arm in a pose that is free all along. A cut that no single position serves runs
with the axes moving: where they stand is a smooth function of the way along it.

Which position serves which tags is the best sequence over all of them: stiffness (or reach) of each
tag at each position of a grid, a price for every change, and inside a moving cut one for every step
on the grid; the steps are then made smooth. Each run of tags that needs no other move of the axes
is planned as a job of its own.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.geometry import angle_between, inverse
from postproc.kinematics import build
from postproc.model import MoveKind, MoveRole, Plan, ToolPath
from postproc.planning.checks import Checker, Reason
from postproc.planning.route import MakeChecker, Travel, cell_at, travel_between
from postproc.planning.search.between import cubic, slopes
from postproc.planning.search.keytags import arc_length, spaced
from postproc.planning.search.refine import tridiagonal
from postproc.planning.search.rungs import step_rules
from postproc.planning.states import Rule, Settings, sample
from postproc.process import feeds_of
from postproc.timing import SPEED_UP_TIME, joint_move_time
from postproc.units import DEG, MM

RAIL_STEP = 0.25
"""Distance [m] between positions on a rail."""
TURN_STEP = 30.0 * DEG
"""Angle between positions of a positioner."""
MOST_POSITIONS = 400
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
KNOT = 0.1
"""On cuts positions are rated this often [m] ..."""
KNOT_TURN = 10.0 * DEG
"""... and as often as the tool axis turns by so much."""
_TURN_LENGTH = 0.1
"""A radian that the tool axis turns counts as so much way [m]."""
_LEAST_CALM = 0.02
CALM = 0.5
"""Steps on the grid are smoothed over so much way [m]; less where the arm cannot follow."""
_MICRON = 6
"""Positions are rounded to so many digits [m or rad], as program text can hold them."""
_ROUNDS = 12
PlanHere = Callable[[ToolPath, Cell, bool, FloatArray | None], Plan]
CheckerAt = Callable[[FloatArray], Checker]


def position_grid(cell: Cell) -> FloatArray:
    """Return the grid of positions (g, k): 0 among each axis' values where its range holds it."""
    columns = []
    share = MOST_POSITIONS ** (1.0 / len(cell.external_axes))
    for axis, step in zip(cell.external_axes, _steps(cell).tolist(), strict=True):
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


@dataclass(slots=True)
class _Run:
    """Tags [low, high) between two moves of the external axes; ``external`` (n, k) at each."""

    low: int
    high: int
    external: FloatArray

    @property
    def moves(self) -> bool:
        """Whether the axes move along the run."""
        return bool((self.external != self.external[0]).any())


@dataclass(slots=True)
class _Places:
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
    calm: dict[int, float] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Let cuts move that no single position reaches, as far as any reaches them."""
        self.closed = np.zeros((len(self.units), len(self.values)), dtype=np.bool_)
        for unit in range(len(self.units)):
            loss = self.loss[self.knots_of(unit)]
            some = (loss < UNREACHED).any(axis=1)
            if not (loss[some] < UNREACHED).all(axis=0).any():
                self._set_moving(unit)

    def _set_moving(self, unit: int) -> bool:
        low, high = self.units[unit]
        if not self.may_move.any() or high - low < 2 or unit in self.calm:
            return False
        self.calm[unit] = CALM
        self._avoid_collisions(self.knots_of(unit))
        return True

    def _avoid_collisions(self, knots: slice) -> None:
        """Make dear for knots the positions at which no pose of a coarse grid is free."""
        if self.checker.scene is None:
            return
        problem, tags = self.checker.problem, self.knots[knots]
        spins = problem.settings.spins[::_COARSE]
        for g, value in enumerate(self.values):
            here = problem.standing(value)
            rows = np.flatnonzero(self.loss[knots, g] < UNREACHED)
            states = sample(here, tags[rows], spins)
            first = np.flatnonzero(np.diff(states.config, prepend=-1))
            of, q = states.tag_of(first), states.q[first].astype(np.float64)
            good = replace(self.checker, problem=here).poses(tags[rows[of]], q).good
            free = np.zeros(len(rows), dtype=np.bool_)
            free[of[good]] = True
            self.loss[np.arange(knots.start, knots.stop)[rows[~free]], g] += BLOCKED

    @property
    def cell(self) -> Cell:
        """The cell with its external axes."""
        return self.checker.problem.cell

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
                ends = [*self.knots[at].tolist(), high]
                rows += [
                    _Row(unit, ends[i], ends[i + 1], self.loss[at][i], i > 0)
                    for i in range(len(ends) - 1)
                ]
            else:
                cost = np.minimum((count[at] * self.loss[at]).sum(axis=0), UNREACHED)
                rows.append(_Row(unit, low, high, np.where(self.closed[unit], UNREACHED, cost)))
        return rows

    def runs(self) -> list[_Run]:
        """Return the runs of tags with where the axes stand, at least total cost."""
        rows = self._rows()
        chosen = self._cheapest(rows)
        runs: list[_Run] = []
        for number, (row, position) in enumerate(zip(rows, chosen.tolist(), strict=True)):
            place = np.tile(self.values[position], (row.high - row.low, 1))
            if runs and (row.slides or position == chosen[number - 1]):
                last = runs[-1]
                runs[-1] = _Run(last.low, row.high, np.concatenate([last.external, place]))
            else:
                runs.append(_Run(row.low, row.high, place))
        for run in runs:
            self._smooth(run)
        return runs

    def _smooth(self, run: _Run) -> None:
        """Make the steps of moving cuts in a run smooth, in place; their ends stay.

        Less so where the arm would come to positions at which it has no free pose.
        """
        for unit, calm in self.calm.items():
            low, high = self.units[unit]
            if not run.low <= low < run.high:
                continue
            at = self.knots_of(unit)
            knots, rows = self.knots[at], np.arange(at.start, at.stop)
            stepped = run.external[knots - run.low]
            bound = self.loss[rows, self._nearest(stepped)] + 0.5 * BLOCKED
            while True:
                value = _calmed(self.way[knots], stepped, calm)
                calm *= 0.5
                if calm < _LEAST_CALM or (self.loss[rows, self._nearest(value)] < bound).all():
                    break
            curve = _curve(self.way[knots], value, self.way[low:high])
            curve[[0, -1]] = stepped[[0, -1]]
            run.external[low - run.low : high - run.low] = curve

    def _nearest(self, external: FloatArray) -> IndexArray:
        """Return the positions (m,) of the grid nearest to where the axes stand (m, k)."""
        off = np.abs(self.values[None] - external[:, None]) / _steps(self.cell)
        return np.asarray(off.max(axis=2).argmin(axis=1))

    def _cheapest(self, rows: list[_Row]) -> IndexArray:
        """Return the position (u,) of every row by dynamic programming."""
        change, gap = self._change(), np.abs(self.values[:, None] - self.values[None])
        feed = feeds_of(self.toolpath, self.cell)
        speed = np.array([axis.qd_max for axis in self.cell.external_axes])
        value, back = rows[0].cost.copy(), []
        for before, row in itertools.pairwise(rows):
            between = change
            if row.slides:
                time = (self.way[row.low] - self.way[before.low]) / feed[row.low]
                within = np.maximum(
                    np.nan_to_num(speed * time, nan=np.inf) / _steps(self.cell), 1.0
                )
                steps = gap / _steps(self.cell)
                between = SLIDE * steps.sum(axis=2)
                between += STEEP * np.maximum(steps - within, 0.0).sum(axis=2)
                most = np.where(self.may_move, 1.0 + 1e-9, 0.0)
                between[(steps > most).any(axis=2)] = UNREACHED
            total = value[:, None] + between
            back.append(np.argmin(total, axis=0))
            value = total.min(axis=0) + row.cost
        chosen = [int(np.argmin(value))]
        for pointers in reversed(back):
            chosen.append(int(pointers[chosen[-1]]))
        return np.array(chosen[::-1], dtype=np.int64)

    def _change(self) -> FloatArray:
        reach = np.array([axis.q_max - axis.q_min for axis in self.cell.external_axes])
        gap = np.abs(self.values[:, None] - self.values[None]) / reach
        return np.where(gap.max(axis=2) > 0.0, CHANGE + gap.sum(axis=2), 0.0)

    def blame(self, run: _Run, result: Plan) -> bool:
        """Close positions to what failed there; return whether there is another way."""
        again = False
        for finding in result.errors:
            if finding.tag_index is None:
                continue
            tag = run.low + finding.tag_index
            unit = next(i for i, (a, b) in enumerate(self.units) if a <= tag < b)
            position = int(self._nearest(run.external[tag - run.low][None])[0])
            if unit in self.calm:
                again |= self._close_knot(unit, tag, position)
            elif not self.closed[unit, position]:
                self.closed[unit, position] = True
                at = self.knots_of(unit)
                left = ~self.closed[unit] & (self.loss[at] < UNREACHED).all(axis=0)
                again |= bool(left.any()) or self._set_moving(unit)
        return again

    def _close_knot(self, unit: int, tag: int, position: int) -> bool:
        """Close a position to the knot before a tag of a moving cut; it moves less calmly then."""
        knot = int(np.searchsorted(self.knots, tag, side="right")) - 1
        if self.loss[knot, position] >= UNREACHED:
            return False
        self.loss[knot, position] = UNREACHED
        self.calm[unit] = max(0.7 * self.calm[unit], KNOT)
        return bool((self.loss[knot] < UNREACHED).any())


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


def plan_with_external_axes(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    checker_at: CheckerAt,
    make_checker: MakeChecker,
    plan_here: PlanHere,
) -> Plan:
    """Return the plan of a toolpath in a cell with external axes.

    Args:
        toolpath: what was read.
        cell: with at least one external axis.
        settings: of the plan.
        checker_at: where the axes stand at each tag (n, k) to the checks in the whole cell.
        make_checker: cell without external axes to the checks of the whole toolpath in it.
        plan_here: part of the toolpath, a cell without external axes, whether the job goes on
            behind the part, and None, to a plan; or the whole cell, and where its axes stand at
            each tag of the part.
    """
    values = position_grid(cell)
    places = _rated(toolpath, cell, settings, values, checker_at)
    reach = places.loss < UNREACHED
    done: dict[tuple[int, int, bytes], Plan] = {}
    for _ in range(_ROUNDS):
        runs, again = places.runs(), False
        for run in runs:
            key = (run.low, run.high, run.external.tobytes())
            if key not in done:
                part = toolpath.rows(np.arange(run.low, run.high))
                here = cell if run.moves else cell_at(cell, run.external[0])
                external = run.external if run.moves else None
                done[key] = plan_here(part, here, run.high < len(toolpath), external)
            again |= places.blame(run, done[key])
        if not again:
            break
    plans = [done[run.low, run.high, run.external.tobytes()] for run in runs]
    result = _joined(toolpath, cell, runs, plans, make_checker)
    return replace(result, findings=_told(result, places, runs, reach))


def _rated(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    values: FloatArray,
    checker_at: CheckerAt,
) -> _Places:
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
    quality = np.full((len(knots), len(values)), -np.inf)
    for g in range(len(values)):
        here = problem.standing(values[g])
        states = sample(here, knots, settings.spins, tilts=here.tilts)
        rows = states.tag_of(np.arange(len(states.q)))
        index = states.index if settings.weights.main else np.ones(len(rows), dtype=np.float32)
        np.maximum.at(quality[:, g], rows, np.log(np.maximum(index.astype(np.float64), 1e-30)))
    best = quality.max(axis=1, keepdims=True)
    loss = np.where(np.isfinite(quality), np.where(np.isfinite(best), best, 0.0) - quality, np.nan)
    starts = np.unique(np.append(0, np.flatnonzero(~chain))) if n else np.zeros(0, np.int64)
    units = list(zip(starts.tolist(), np.append(starts[1:], n).tolist(), strict=True))
    way = arc_length(toolpath) + _TURN_LENGTH * turned + 1e-6 * np.arange(n)
    may_move = np.array([axis.moves_in_cuts for axis in cell.external_axes])
    loss = np.nan_to_num(loss, nan=UNREACHED)
    return _Places(checker, values, units, knots, loss, way, may_move)


def _told(result: Plan, places: _Places, runs: list[_Run], reach: BoolArray) -> tuple[Finding, ...]:
    """Return the findings: cuts that run with moving axes, and why others cannot be run."""
    name = places.toolpath.tag_name
    names = " or ".join(axis.name for axis in places.cell.external_axes)
    told = list(result.findings)
    for unit, (low, high) in enumerate(places.units):
        part = reach[places.knots_of(unit)]
        text, hint = "", ""
        if not part.any(axis=1).all():
            text = f"no place of {names} within its range reaches all of this"
        elif unit in places.calm:
            run = next(run for run in runs if run.low <= low < run.high)
            told.append(_moving(places, run.external[low - run.low : high - run.low], low, high))
        elif not part.all(axis=0).any():
            text = (
                f"the cut from tag {name(low)} to {name(high - 1)} needs {names} to move within it"
            )
            hint = f"allow moves_in_cuts of {names}, or lift the tool somewhere on the way"
        for i, finding in enumerate(told):
            if text and finding.is_error and finding.tag_index in range(low, high):
                message = f"{finding.message}; {text}"
                told[i] = replace(finding, message=message, hint=hint or finding.hint)
    return tuple(told)


def _moving(places: _Places, external: FloatArray, low: int, high: int) -> Finding:
    """Return the note of a cut [low, high) along which the external axes move (n, k)."""
    ways = []
    for axis, column in zip(places.cell.external_axes, external.T, strict=True):
        size, unit = (MM, "mm") if axis.kind == "rail" else (DEG, "deg")
        if np.ptp(column):
            low_end, high_end = column.min() / size, column.max() / size
            ways.append(f"{axis.name} moves between {low_end:.0f} and {high_end:.0f} {unit}")
    name = places.toolpath.tag_name
    text = f"in the cut from tag {name(low)} to {name(high - 1)} {', '.join(ways)}"
    return Finding(Severity.NOTE, "PLN307", text, low, places.toolpath.source(low))


def _joined(
    toolpath: ToolPath,
    cell: Cell,
    runs: list[_Run],
    plans: list[Plan],
    make_checker: MakeChecker,
) -> Plan:
    """Return one plan of all runs, with the moves of the external axes between them."""
    pieces: list[Plan] = []
    findings: list[Finding] = []
    before: Plan | None = None
    for run, part in zip(runs, plans, strict=True):
        standing = np.tile(run.external[0], (len(part), 1))
        external = part.external if run.moves else standing
        here = replace(part.within(toolpath, run.low), external=external)
        findings += here.findings
        if before is not None and len(here):
            between = travel_moves(cell, before, here, make_checker)
            findings += between.findings
            pieces.append(between)
        pieces.append(here)
        before = here if len(here) else before
    whole = Plan.concat(pieces)
    settings = {**whole.settings, "stations": len(plans)}
    return replace(whole, findings=tuple(dict.fromkeys(findings)), settings=settings)


def travel_moves(cell: Cell, before: Plan, after: Plan, make_checker: MakeChecker) -> Plan:
    """Return the moves from one position to the next: to a travel pose, the axes, and on.

    What stands in their way is among the findings of the plan.
    """
    findings: list[Finding] = []
    places = before.external[-1], after.external[0]
    q_from, q_to, tag = before.q[-1], after.q[0], int(after.tag[0])
    travel = travel_between(cell, q_from, q_to, places, make_checker)
    if travel is None:
        findings.append(
            Finding(
                Severity.ERROR,
                f"PLN{int(Reason.COLLISION)}",
                "no pose was found in which the arm is free while the external axes move to here",
                tag,
                after.toolpath.source(tag),
                hint="give [motion] home_deg, a pose that is free at every station",
            )
        )
        travel = Travel(np.zeros((0, 6)), q_from, np.zeros((0, 6)))
    q = np.concatenate([travel.leave, [travel.pose, travel.pose], travel.arrive])
    k, at_start = len(q), len(travel.leave) + 1
    where = np.concatenate(
        [np.tile(places[0], (at_start, 1)), np.tile(places[1], (k - at_start, 1))]
    )
    share = float(after.ptp_fraction[0])
    robot = cell.robot
    external = np.array([axis.qd_max for axis in cell.external_axes])
    steps = np.vstack([q_from[None], q])
    speed = np.asarray(robot.qd_max) * share
    duration = joint_move_time(steps[:-1], steps[1:], speed, robot.qdd_max)
    slide = np.stack(places)
    duration[at_start] = joint_move_time(
        slide[:1], slide[1:], external * share, external / SPEED_UP_TIME
    )[0]
    return replace(
        after.rows(np.zeros(k, dtype=np.int64)),
        kind=np.full(k, MoveKind.PTP),
        role=np.full(k, MoveRole.RAPID),
        T_base_tcp=np.array(
            [_pose(cell, row, values) for row, values in zip(q, where, strict=True)]
        ),
        q=q,
        blend=np.zeros(k),
        dwell=np.zeros(k),
        speed=np.full(k, np.nan),
        ptp_fraction=np.full(k, share),
        duration=duration,
        branch=np.asarray(build(robot).slot(q)),
        aux=np.full((k, 3), np.nan),
        external=where,
        events=(),
        findings=tuple(findings),
    )


def _pose(cell: Cell, q: FloatArray, values: FloatArray) -> FloatArray:
    here = cell_at(cell, values)
    T_robroot_tcp = build(cell.robot).fk(q) @ cell.tool.T_flange_tcp
    return np.asarray(inverse(here.T_robroot_base) @ T_robroot_tcp)
