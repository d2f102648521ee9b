"""External axes: where the rail stands and how the positioner is turned for every tag.

Where one position serves a cut the axes stand still while the tool works, and move between
positions with the arm in a pose that is free all along. A cut that no single position serves runs
with the axes moving: where they stand is a smooth function of the way along it. So does one that
is refused, slowed or less stiff where they stand, if it is better off with the work carried past
the arm. Each run of tags that needs no other move of the axes is planned as a job of its own.

Their plans are joined as one, with the moves of the external axes between them.
"""

from __future__ import annotations

import itertools
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.geometry import inverse
from postproc.kinematics import build
from postproc.model import MoveKind, MoveRole, Plan, ToolPath
from postproc.paths import joint_times
from postproc.planning.attempt import Rank, rank
from postproc.planning.checks import Reason, given_up
from postproc.planning.external.carried import WORTH, cut_costs
from postproc.planning.external.positions import Positions, Run, run_of
from postproc.planning.external.rating import UNREACHED, Rating, rated
from postproc.planning.job import Job, checker_of, planned
from postproc.planning.repairs import Level, repaired, tried_for, with_tried
from postproc.planning.route import Travel, cell_at, travel_between
from postproc.timing import SPEED_UP_TIME, joint_move_time
from postproc.units import DEG, MM


def plan_with_external_axes(job: Job, toolpath: ToolPath, cell: Cell) -> Plan:
    """Return the plan of a toolpath in a cell with external axes.

    Args:
        job: of the call.
        toolpath: what was read.
        cell: with at least one external axis.
    """
    stands = _Stands(job, toolpath, cell)
    reach = stands.places.rating.loss < UNREACHED
    made, tried = repaired(stands, Level.PLACES)
    places, runs = stands.places, made.runs
    places.calm, places.carried = made.calm, made.carried
    plans = [stands.planned(run) for run in runs]
    result = _joined(job, toolpath, cell, runs, plans)
    result = with_tried(result, sum(map(tried_for, plans[1:]), tried))
    return replace(result, findings=_findings_of(result, places, runs, reach))


class _Made(NamedTuple):
    """The runs of tags between moves of the axes, and which units move, by ``Positions``."""

    runs: list[Run]
    calm: dict[int, float]
    carried: dict[int, FloatArray]


class _Stands:
    """Where the axes stand for each tag of a toolpath, and the plans of the arm there."""

    def __init__(self, job: Job, toolpath: ToolPath, cell: Cell) -> None:
        self._job, self._path, self._cell = job, toolpath, cell
        self.places = Positions(rated(job, toolpath, cell))
        self._done: dict[tuple[int, int, bytes], Plan] = {}
        self._runs: list[Run] = []
        self._costs: dict[int, float] = {}
        self._held: dict[int, float] | None = None

    def planned(self, run: Run) -> Plan:
        """Return the plan of a run, a job of its own."""
        key = (run.low, run.high, run.external.tobytes())
        if key not in self._done:
            part = self._path.rows(np.arange(run.low, run.high))
            here = self._cell if run.moves else cell_at(self._cell, run.external[0])
            external, goes_on = run.external if run.moves else None, run.high < len(self._path)
            self._done[key] = planned(self._job, part, here, external, goes_on=goes_on)
        return self._done[key]

    def make(self) -> tuple[Rank, _Made]:
        """Return the runs at least total cost, and how good their plans are together."""
        places = self.places
        runs = self._runs = places.runs()
        plans = [self.planned(run) for run in runs]
        self._costs = cut_costs(places, runs, plans)
        made = _Made(runs, dict(places.calm), dict(places.carried))
        findings = itertools.chain.from_iterable(plan.findings for plan in plans)
        return rank(findings, sum(self._costs.values())), made

    def change(self) -> bool:
        """Close places to what failed there; return whether there is another way."""
        if self._held:
            return False
        return any([self.places.blame(run, self.planned(run)) for run in self._runs])

    def carry(self) -> bool:
        """Carry cuts that may gain by it, once; then hold those again that did not."""
        places, costs, held = self.places, self._costs, self._held
        if held is None:
            stand = [unit for unit in costs if not (unit in places.calm or places.refused[unit])]
            self._held = {unit: costs[unit] for unit in stand if costs[unit] > WORTH}
            return any([places.carry(unit) for unit in self._held])
        self._held, worse = {}, [unit for unit, cost in held.items() if costs[unit] >= cost]
        for unit in worse:
            del places.calm[unit], places.carried[unit]
        return 0 < len(worse) < len(held)


def _findings_of(
    result: Plan, places: Positions, runs: list[Run], reach: BoolArray
) -> tuple[Finding, ...]:
    """Return the findings: cuts that run with moving axes, and why others cannot be run.

    Where a cut is refused and other places were not tried that is told as well.
    """
    rating = places.rating
    name = rating.toolpath.tag_name
    names = " or ".join(axis.name for axis in rating.cell.external_axes)
    told = list(result.findings)
    failing = result.failing_tags
    for unit, (low, high) in enumerate(rating.units):
        part = reach[rating.knots_of(unit)]
        text, hint = "", ""
        if not part.any(axis=1).all():
            text = f"no position of {names} that was tried reaches all of this"
        elif unit in rating.walled:
            text = f"tag {name(rating.walled[unit])} fails at every position of {names} tried"
        elif unit in places.calm:
            run = runs[run_of(runs, low)]
            told.append(_moving(rating, run.external[low - run.low : high - run.low], low, high))
        elif not part.all(axis=0).any():
            text = (
                f"the cut from tag {name(low)} to {name(high - 1)} needs {names} to move within it"
            )
            hint = f"allow moves_in_cuts of {names}, or lift the tool somewhere on the way"
        first = failing[np.searchsorted(failing, low) :][:1]
        if (first < high).any() and not text and places.is_open(unit):
            what = f"no path was found here with {names} at the positions tried"
            told.append(given_up(rating.checker.problem, int(first[0]), what))
        for i, finding in enumerate(told):
            if text and finding.is_error and finding.tag_index in range(low, high):
                message = f"{finding.message}; {text}"
                told[i] = replace(finding, message=message, hint=hint or finding.hint)
    return tuple(told)


def _moving(rating: Rating, external: FloatArray, low: int, high: int) -> Finding:
    """Return the note of a cut [low, high) along which the external axes move (n, k)."""
    ways = []
    for axis, column in zip(rating.cell.external_axes, external.T, strict=True):
        size, unit = (MM, "mm") if axis.kind == "rail" else (DEG, "deg")
        if np.ptp(column):
            low_end, high_end = column.min() / size, column.max() / size
            ways.append(f"{axis.name} moves between {low_end:.0f} and {high_end:.0f} {unit}")
    name = rating.toolpath.tag_name
    text = f"in the cut from tag {name(low)} to {name(high - 1)} {', '.join(ways)}"
    return Finding(Severity.NOTE, "PLN307", text, low, rating.toolpath.source(low))


def _joined(job: Job, toolpath: ToolPath, cell: Cell, runs: list[Run], plans: list[Plan]) -> Plan:
    """Return one plan of all runs, with the moves of the external axes between them.

    Args:
        job: of the call.
        toolpath: of all runs.
        cell: with its external axes.
        runs: one after the other.
        plans: of each run, in a cell without external axes where they stand.
    """
    pieces: list[Plan] = []
    findings: list[Finding] = []
    before: Plan | None = None
    for run, part in zip(runs, plans, strict=True):
        standing = np.tile(run.external[0], (len(part), 1))
        external = part.external if run.moves else standing
        here = replace(part.within(toolpath, run.low), external=external)
        findings += here.findings
        if before is not None and len(here):
            between = travel_moves(job, toolpath, cell, before, here)
            findings += between.findings
            if _ends_where(between, here):  # the first move is that of the axes
                here = replace(here, duration=np.r_[between.duration[-1:], here.duration[1:]])
                between = between.rows(np.arange(len(between) - 1))
            pieces.append(between)
        pieces.append(here)
        before = here if len(here) else before
    whole = Plan.concat(pieces)
    settings = {**whole.settings, "stations": len(plans)}
    return replace(whole, findings=tuple(dict.fromkeys(findings)), settings=settings)


def _ends_where(between: Plan, after: Plan) -> bool:
    """Return whether a travel ends in the very joint pose to which the moves behind it go first."""
    same = np.array_equal(between.q[-1], after.q[0])
    return same and bool(after.kind[0] == MoveKind.PTP)


def travel_moves(job: Job, toolpath: ToolPath, cell: Cell, before: Plan, after: Plan) -> Plan:
    """Return the moves from one position to the next: to a travel pose, the axes, and on.

    What stands in their way is among the findings of the plan.
    """
    findings: list[Finding] = []
    make_checker = partial(checker_of, toolpath, settings=job.settings)
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
    leave = np.vstack([travel.leave, travel.pose[None]])
    if np.array_equal(leave[0], q_from):  # it stands there
        leave = leave[1:]
    q = np.vstack([leave, travel.pose[None], travel.arrive])
    k, at_start = len(q), len(leave)
    where = np.concatenate(
        [np.tile(places[0], (at_start, 1)), np.tile(places[1], (k - at_start, 1))]
    )
    share = float(after.ptp_fraction[0])
    external = np.array([axis.qd_max for axis in cell.external_axes])
    steps = np.vstack([q_from[None], q])
    duration = joint_times(cell, share, steps[:-1], steps[1:])
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
        branch=np.asarray(build(cell.robot).slot(q)),
        aux=np.full((k, 3), np.nan),
        external=where,
        events=(),
        findings=tuple(findings),
    )


def _pose(cell: Cell, q: FloatArray, values: FloatArray) -> FloatArray:
    here = cell_at(cell, values)
    T_robroot_tcp = build(cell.robot).fk(q) @ cell.tool.T_flange_tcp
    return np.asarray(inverse(here.T_robroot_base) @ T_robroot_tcp)
