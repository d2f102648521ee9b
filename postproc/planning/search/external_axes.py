"""External axes: where the rail stands and how the positioner is turned for every tag.

The axes are indexed: they stand still while the tool works and move between positions with the
arm in a pose that is free all along. Which position serves which tags is the best sequence over
all of them: stiffness (or reach) of each tag at each position of a grid, and a price for every
change; a cut keeps its position. Each run of tags at one position is then planned as a job of its
own in the cell as it stands there.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.geometry import inverse
from postproc.kinematics import build
from postproc.model import MoveKind, MoveRole, Plan, ToolPath
from postproc.planning.checks import Reason
from postproc.planning.route import MakeChecker, Travel, cell_at, travel_between
from postproc.planning.search.rungs import step_rules
from postproc.planning.states import Rule, Settings, sample
from postproc.timing import joint_move_time
from postproc.units import DEG

RAIL_STEP = 0.25
"""Distance [m] between positions on a rail."""
TURN_STEP = 30.0 * DEG
"""Angle between positions of a positioner."""
MOST_POSITIONS = 400
CHANGE = 3.0
"""Price of a change of position, in the units of the objectives: 100 % of stiffness is about 1."""
UNREACHED = 1e6
SPEED_UP_TIME = 0.5
"""Time [s] in which an external axis reaches its speed; assumed."""
_ROUNDS = 12
PlanHere = Callable[[ToolPath, Cell, bool], Plan]


def position_grid(cell: Cell) -> FloatArray:
    """Return the grid of positions (g, k): 0 among each axis' values where its range holds it."""
    columns = []
    share = MOST_POSITIONS ** (1.0 / len(cell.external_axes))
    for axis in cell.external_axes:
        step = RAIL_STEP if axis.kind == "rail" else TURN_STEP
        step = max(step, (axis.q_max - axis.q_min) / max(share - 1.0, 1.0))
        low, high = np.ceil(axis.q_min / step - 1e-9), np.floor(axis.q_max / step + 1e-9)
        inner = np.arange(low, high + 1) * step
        columns.append(np.unique(np.concatenate([[axis.q_min], inner, [axis.q_max]])))
    return np.array(list(itertools.product(*(column.tolist() for column in columns))))


@dataclass(slots=True)
class _PositionSearch:
    """The search for positions: costs of units (u, g), and what failed."""

    toolpath: ToolPath
    cell: Cell
    values: FloatArray
    units: list[tuple[int, int]]
    cost: FloatArray
    done: dict[tuple[int, int, int], Plan] = field(default_factory=dict)

    def runs(self) -> list[tuple[int, int, int]]:
        """Return runs of tags [low, high) with their position, at least total cost."""
        chosen = _cheapest(self.cost, self._change())
        runs: list[tuple[int, int, int]] = []
        for (low, high), position in zip(self.units, chosen.tolist(), strict=True):
            if runs and runs[-1][2] == position:
                runs[-1] = (runs[-1][0], high, position)
            else:
                runs.append((low, high, position))
        return runs

    def _change(self) -> FloatArray:
        reach = np.array([axis.q_max - axis.q_min for axis in self.cell.external_axes])
        gap = np.abs(self.values[:, None] - self.values[None]) / reach
        return np.where(gap.max(axis=2) > 0.0, CHANGE + gap.sum(axis=2), 0.0)

    def blame(self, run: tuple[int, int, int], result: Plan) -> bool:
        """Close positions to the units that failed there; return whether there is another."""
        low, _, position = run
        again = False
        for finding in result.errors:
            if finding.tag_index is None:
                continue
            tag = low + finding.tag_index
            unit = next(i for i, (a, b) in enumerate(self.units) if a <= tag < b)
            if self.cost[unit, position] < UNREACHED:
                self.cost[unit, position] = UNREACHED
                again |= bool((self.cost[unit] < UNREACHED).any())
        return again


def plan_with_external_axes(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    make_checker: MakeChecker,
    plan_here: PlanHere,
) -> Plan:
    """Return the plan of a toolpath in a cell with external axes.

    Args:
        toolpath: what was read.
        cell: with at least one external axis.
        settings: of the plan.
        make_checker: cell without external axes to the checks of the whole toolpath in it.
        plan_here: part of the toolpath, such a cell, and whether the job goes on behind the part,
            to a plan.
    """
    values = position_grid(cell)
    units, cost, reach = _costs(toolpath, cell, settings, values, make_checker)
    search = _PositionSearch(toolpath, cell, values, units, cost)
    for _ in range(_ROUNDS):
        runs, again = search.runs(), False
        for run in runs:
            if run not in search.done:
                here = cell_at(cell, values[run[2]])
                part = toolpath.rows(np.arange(run[0], run[1]))
                search.done[run] = plan_here(part, here, run[1] < len(toolpath))
            again |= search.blame(run, search.done[run])
        if not again:
            break
    plans = [search.done[run] for run in runs]
    result = _joined(toolpath, cell, values, runs, plans, make_checker)
    return replace(result, findings=_told(result, cell, units, reach))


def _costs(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    values: FloatArray,
    make_checker: MakeChecker,
) -> tuple[list[tuple[int, int]], FloatArray, BoolArray]:
    """Return units of tags that keep a position, their cost (u, g), and the tags' reach (n, g)."""
    n, tags = len(toolpath), np.arange(len(toolpath))
    quality = np.full((n, len(values)), -np.inf)
    rule = np.zeros(n, dtype=np.int64)
    for g in range(len(values)):
        problem = make_checker(cell_at(cell, values[g])).problem
        rule = step_rules(problem)
        states = sample(problem, tags, settings.spins, tilts=problem.tilts)
        rows = states.tag_of(np.arange(len(states.q)))
        index = states.index if settings.weights.main else np.ones(len(rows), dtype=np.float32)
        np.maximum.at(quality[:, g], rows, np.log(np.maximum(index.astype(np.float64), 1e-30)))
    best = quality.max(axis=1, keepdims=True)
    loss = np.where(np.isfinite(quality), np.where(np.isfinite(best), best, 0.0) - quality, np.nan)
    loss = np.nan_to_num(loss, nan=UNREACHED)
    starts = np.nonzero(rule != Rule.CHAIN)[0]
    starts = np.unique(np.concatenate([[0], starts])) if n else starts
    ends = np.append(starts[1:], n)
    cost = np.add.reduceat(loss, starts, axis=0) if n else np.zeros((0, len(values)))
    units = list(zip(starts.tolist(), ends.tolist(), strict=True))
    return units, np.minimum(cost, UNREACHED), np.isfinite(quality)


def _told(
    result: Plan, cell: Cell, units: list[tuple[int, int]], reach: BoolArray
) -> tuple[Finding, ...]:
    """Return the findings; those of a cut that no single position reaches all along say so."""
    names = " or ".join(axis.name for axis in cell.external_axes)
    hint = f"cuts keep their place of {names}: lift the tool somewhere on the way"
    told = list(result.findings)
    for low, high in units:
        part = reach[low:high]
        if high - low == 1 or part.all(axis=0).any() or not part.any(axis=1).all():
            continue
        first, last = (result.toolpath.tag_name(tag) for tag in (low, high - 1))
        text = f"the cut from tag {first} to {last} needs {names} to move within it"
        for i, finding in enumerate(told):
            if finding.severity is Severity.ERROR and finding.tag_index in range(low, high):
                told[i] = replace(finding, message=f"{finding.message}; {text}", hint=hint)
    return tuple(told)


def _cheapest(cost: FloatArray, change: FloatArray) -> IndexArray:
    """Return the position (u,) of every unit by dynamic programming."""
    value, back = cost[0].copy(), []
    for row in cost[1:]:
        steps = value[:, None] + change
        back.append(np.argmin(steps, axis=0))
        value = steps.min(axis=0) + row
    chosen = [int(np.argmin(value))]
    for pointers in reversed(back):
        chosen.append(int(pointers[chosen[-1]]))
    return np.array(chosen[::-1], dtype=np.int64)


def _joined(
    toolpath: ToolPath,
    cell: Cell,
    values: FloatArray,
    runs: list[tuple[int, int, int]],
    plans: list[Plan],
    make_checker: MakeChecker,
) -> Plan:
    """Return one plan of all runs, with the moves of the external axes between them."""
    pieces: list[Plan] = []
    findings: list[Finding] = []
    before: Plan | None = None
    for (low, _, position), part in zip(runs, plans, strict=True):
        external = np.tile(values[position], (len(part), 1))
        here = replace(part.within(toolpath, low), external=external)
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
