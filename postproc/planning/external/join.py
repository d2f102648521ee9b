"""The plans of all runs as one, with the moves of the external axes between them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.geometry import inverse
from postproc.kinematics import build
from postproc.model import MoveKind, MoveRole, Plan, ToolPath
from postproc.paths import joint_times
from postproc.planning.checks import Reason
from postproc.planning.external.positions import Run
from postproc.planning.route import MakeChecker, Travel, cell_at, travel_between
from postproc.timing import SPEED_UP_TIME, joint_move_time


def joined(
    toolpath: ToolPath,
    cell: Cell,
    runs: list[Run],
    plans: list[Plan],
    make_checker: MakeChecker,
) -> Plan:
    """Return one plan of all runs, with the moves of the external axes between them.

    Args:
        toolpath: of all runs.
        cell: with its external axes.
        runs: one after the other.
        plans: of each run, in a cell without external axes where they stand.
        make_checker: cell without external axes to the checks of the toolpath in it.
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
            between = travel_moves(cell, before, here, make_checker)
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
