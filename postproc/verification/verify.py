"""Verify a program from its text: run it on the robot model, compare it with the CAM file.

Nothing of the planner or the emitter is used: text in, answer out. Kinds of violations:

- ``structure``, ``endless``: the program does not run; ``unjudged``, ``condition``: what it does is
  not known from the text; ``setup``, ``load``, ``orientation``, ``speed``, ``wait``: what is in
  force, or is not set at all; ``frame``: tool or base unknown or not the
  cell's; ``target``, ``start``, ``turn``, ``unreachable``, ``circle``, ``half_turn``: a motion
  that cannot be run, or not in one way only;
- ``joint_limit``, ``singularity``, ``axis_speed``, ``corner``, ``collision``: on the way;
  ``blend_end``; ``torque``: what the joints have; ``block_rate``, ``look_ahead``, ``memory``: what
  the controller can take;
- against a CAM file ``position``, ``missed``, ``order``, ``depth``, ``axis``, ``path``, ``feed``,
  ``plunge``, ``peck``, ``blended_plunge``, ``retract``, ``dwell``, ``event``; ``approximation``,
  ``speed``: what the file says of single motions; ``tool``: another tool or base is selected than
  the file means; ``word``: what the CAM file asks for and no program
  does; ``model``: the program is compensated, and no model is given;
- ``advance``: what the advance run lets happen too early; ``entry``: a joint or rapid motion that
  ends in a cut; ``spindle``: it stands or turns the wrong
  way in a cut, or still turns at the end.

With a model of the arm (``displacement``) it is the real tool that is compared with the CAM file.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from postproc.cell import Cell, require_numbers
from postproc.controller import MotionType
from postproc.errors import Finding, RunKind, Severity
from postproc.geometry import rotation_angle
from postproc.kinematics import Kinematics, build
from postproc.krl import Comment, KrlModule, require_sound
from postproc.model import ToolPath
from postproc.paths import Displacement, Paths, cycle_time, durations, joint_paths, run_in_cell
from postproc.process import (
    as_served,
    assign,
    driven,
    holes_served,
    machining_findings,
    machining_speeds,
    may_stand,
    refusals,
    started_by_none,
    unit_findings,
    word_findings,
)
from postproc.progress import Progress
from postproc.units import DEG, MM
from postproc.verification.between import check_advance, check_between
from postproc.verification.cam import CHECKS as CAM_CHECKS
from postproc.verification.cam import Match, leads_in, match_of
from postproc.verification.capacity import check_capacity, check_torques
from postproc.verification.checks import (
    check_blending,
    check_externals,
    check_held,
    check_joints,
    check_speeds,
)
from postproc.verification.corners import blended, check_collisions, check_corners, corners_of
from postproc.verification.coverage import coverage_of
from postproc.verification.entries import check_entries
from postproc.verification.report import (
    Played,
    Remark,
    Said,
    Tolerances,
    VerifyReport,
    collected,
    in_order,
)
from postproc.verification.run import Cuts, Run
from postproc.verification.settings import check_rapids, check_settings
from postproc.verification.spindle import check_spindle

_SAME_FRAME = 0.005 * MM
_SAME_TURN = 0.002 * DEG
HALF_TURN = 179.5 * DEG
"""From here on digits decide which way round the orientation turns."""


def verify(
    modules: Sequence[KrlModule],
    name: str,
    cell: Cell,
    toolpath: ToolPath | None = None,
    tolerances: Tolerances | None = None,
    collisions: bool = True,
    progress: Progress | None = None,
    *,
    displacement: Displacement | None = None,
) -> VerifyReport:
    """Verify a program.

    Args:
        modules: the program and what it calls.
        name: the module to start.
        cell: robot, tool, workpiece, solids, margins.
        toolpath: the CAM file it was made from; None: only what the program says by itself.
        tolerances: of the comparison.
        collisions: search for collisions along the motions, if the cell has solids.
        progress: called with (done, total, what).
        displacement: of the real tool point against the commanded one; with it the CAM file is
            compared with where the real tool is expected to go.

    Raises:
        CellError: CEL030 for an arm with unknown limits or speeds.
        KrlError: if a module could not be loaded by a controller.
        DataError: VER001 if a tag of the CAM file has no point.
    """
    require_numbers(cell)
    require_sound(modules)
    report = progress or (lambda done, total, what: None)
    limits = tolerances or Tolerances()
    kinematics = build(cell.robot)
    report(0, 4, "run")
    trace = run_in_cell(modules, name, cell, kinematics)
    report(1, 4, "kinematics")
    paths = joint_paths(trace, cell, kinematics)
    findings = [*trace.findings, *paths.findings]
    report(2, 4, "comparison")
    match, needs_start = None, True
    if toolpath is not None:
        asked, needs_start, refused = _asked_of(toolpath, cell)
        findings += refused
        match = match_of(paths, cell, asked, limits, displacement)
    run = _run_of(paths, cell, kinematics, modules, match)
    run = replace(run, may_stand=may_stand(toolpath, cell), needs_start=needs_start)
    said = [remark for check in CHECKS for remark in check(run)]
    if match is not None:
        against = [remark for check in CAM_CHECKS for remark in check(run, match)]
        said += [*against, *([] if match.is_real else _without_model(modules, against))]
    report(3, 4, "collisions")
    said += check_collisions(run) if collisions else ()
    found, worst = collected(said, paths)
    findings += found
    violations = in_order(findings, Severity.ERROR)
    whole = VerifyReport(
        program=name,
        points=len(paths),
        violations=violations,
        warnings=in_order(findings, Severity.WARNING),
        worst=worst,
        collisions_checked=collisions and bool(cell.solids),
        coverage=coverage_of(modules, trace, violations),
    )
    return _with_run(whole, run, match, limits)


def _run_of(
    paths: Paths,
    cell: Cell,
    kinematics: Kinematics,
    modules: Sequence[KrlModule],
    match: Match | None,
) -> Run:
    """Return the run, with what cuts as the CAM file or, without one, the speeds tell."""
    trace, bent = paths.trace, blended(paths)
    is_cut = np.asarray(trace.is_cp & machining_speeds(trace.column("speed"), cell))
    cuts, slack = Cuts.of(paths, np.where(is_cut, 0, -1)), 0.0
    if match is not None:
        is_cut, slack = match.uses.is_cut, match.shift
        led = leads_in(paths, cell, match.every)
        cuts = Cuts.of(paths, match.uses.cut_of, match.calls.asked, led)
    return Run(
        paths=paths,
        cell=cell,
        kinematics=kinematics,
        modules=modules,
        is_cut=is_cut,
        cuts=cuts,
        bent=bent,
        corners=corners_of(paths, kinematics, bent),
        slack=slack,
        may_stand=False,
        needs_start=True,
    )


def _asked_of(toolpath: ToolPath, cell: Cell) -> tuple[ToolPath, bool, list[Finding]]:
    """Return what a CAM file asks of the program, whether that has to start the spindle, faults."""
    assigned = assign(toolpath, cell)
    toolpath = assigned.toolpath
    words = (*word_findings(toolpath), *assigned.findings, *unit_findings(toolpath, cell))
    toolpath = as_served(toolpath, cell)
    needs_start = len(started_by_none(toolpath)) > 0
    toolpath = driven(toolpath, cell)
    found = machining_findings(toolpath, cell)
    own = [replace(item, code=RunKind.SPINDLE, tag_index=None) for item in found]
    return holes_served(toolpath, cell), needs_start, [*refusals(words), *own]


_COMPENSATED = re.compile(r"\s*compensated \((.+)\): ")
"""How the comment at the head of a program names the model that its points are shifted by."""


def _without_model(modules: Sequence[KrlModule], said: Sequence[Said]) -> Iterator[Remark]:
    """Say that a program is compensated, whose points and feeds are those of the real tool."""
    module = modules[0]
    for statement in module.main.statements:
        found = _COMPENSATED.match(statement.text) if isinstance(statement, Comment) else None
        if found is None:
            continue
        wrong = any(isinstance(s, Remark) and s.severity is Severity.ERROR for s in said)
        text = (
            f"points and feeds are compensated by {found[1]}: without --model {found[1]} the "
            "commanded tool is compared with the CAM file, not the real one"
        )
        severity = Severity.ERROR if wrong else Severity.WARNING
        place = module.src_path, statement.line
        yield Remark(RunKind.MODEL, place, text, severity, headline=True)
        return


def _with_run(
    report: VerifyReport, run: Run, match: Match | None, tolerances: Tolerances
) -> VerifyReport:
    """Return the report with its times, and how near the program is to the CAM file."""
    times = durations(run.paths, run.cell)
    report = replace(report, cycle_time=cycle_time(run.paths, times))
    if match is None:
        return replace(report, run=Played(run.paths, times, tolerances))
    off, served = match.off_every, match.every.first
    place = np.argsort(match.order)
    return replace(
        report,
        position_error=float(np.max(off.position, initial=0.0)),
        axis_error=float(np.max(off.axis, initial=0.0)),
        tilt=float(np.max(off.tilt, initial=0.0)),
        tags=len(served),
        matched=int((served >= 0).sum()),
        passed=len(match.passed.tag),
        expectation=match.expectation,
        run=Played(run.paths, times, tolerances, served[place], off.position[place]),
    )


def _check_frames(run: Run) -> Iterator[Said]:
    """Compare tool and base of every path motion with those of the cell."""
    trace, cell, station = run.paths.trace, run.cell, run.paths.station
    tools = [(tool.number, tool.T_flange_tcp) for tool in cell.tools]
    bases = [(base.number, base.T_robroot_base) for base in cell.bases]
    expected = (
        ("tool", trace.tools, station.tool, tools),
        ("base", trace.bases, station.base, bases),
    )
    cartesian = ~trace.is_axes
    for what, frames, own, entries in expected:
        rows = trace.column(what).astype(np.int64)
        used = trace.column(f"{what}_number").astype(np.int64)
        # what is selected is a matter of the settings: one motion of each tells
        some = np.unique(trace.setting[cartesian], return_index=True)[1]
        told = np.stack([rows, used, own])[:, np.flatnonzero(cartesian)[some]]
        for row, selected, index in np.unique(told, axis=1).T.tolist():
            number, T = entries[index]
            off = float(np.linalg.norm(frames[row][:3, 3] - T[:3, 3]))
            turned = float(rotation_angle(frames[row][:3, :3], T[:3, :3]))
            same = (rows == row) & (used == selected) & (own == index)
            first = int(np.flatnonzero(cartesian & same)[0])
            name = f"{what} {selected if selected >= 0 else 'frame'}"
            if len(entries) > 1 and selected != number:
                text = f"{name} is selected, and the cell has no such {what}"
                yield Remark(RunKind.FRAME, first, text)
            elif off > _SAME_FRAME or turned > _SAME_TURN:
                yield Remark(
                    RunKind.FRAME,
                    first,
                    f"{name} is {off / MM:.3f} mm and {turned / DEG:.3f} deg off {what} {number} "
                    "of the cell",
                )


def _check_circles(run: Run) -> Iterator[Said]:
    """Report motions whose curve the text does not fix: bad circles, half turns of the tool."""
    curves = run.paths.curves
    half = np.flatnonzero(run.paths.trace.is_cp & (curves.angle > HALF_TURN))
    for row in half[:20].tolist():
        text = "the tool turns by 180 deg: the controller may turn it either way"
        yield Remark(RunKind.HALF_TURN, row, text)
    for row in curves.bad_circles[:20].tolist():
        yield Remark(RunKind.CIRCLE, int(row), "start, auxiliary point and end are on no circle")
    missing = np.flatnonzero((run.paths.trace.motion_type == MotionType.CIRC) & (curves.circle < 0))
    for row in np.setdiff1d(missing, curves.bad_circles)[:20].tolist():
        yield Remark(RunKind.CIRCLE, int(row), "a circular motion without an auxiliary point")


CHECKS: tuple[Callable[[Run], Iterator[Said]], ...] = (
    _check_frames,
    _check_circles,
    check_settings,
    check_rapids,
    check_joints,
    check_externals,
    check_held,
    check_blending,
    check_capacity,
    check_speeds,
    check_torques,
    check_corners,
    check_spindle,
    check_entries,
    check_between,
    check_advance,
)
"""What is asked of any program; none reads what another found."""
