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
  does;
- ``advance``: what the advance run lets happen too early; ``entry``: a joint or rapid motion that
  ends in a cut; ``spindle``: it stands or turns the wrong
  way in a cut, or still turns at the end.

With a model of the arm (``displacement``) it is the real tool that is compared with the CAM file.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell, require_numbers
from postproc.controller import MotionType, Trace
from postproc.errors import RunKind, Severity
from postproc.geometry import rotation_angle
from postproc.kinematics import build
from postproc.krl import KrlModule, require_sound
from postproc.model import ToolPath
from postproc.paths import Displacement, Paths, cycle_time, durations, joint_paths, run_in_cell
from postproc.process import (
    as_served,
    claimed,
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
from postproc.verification.between import Cuts, check_advance, check_between
from postproc.verification.cam import (
    Comparison,
    Tolerances,
    check_events,
    check_profiles,
    compare_served,
    in_program_order,
    leads_in,
)
from postproc.verification.capacity import check_capacity
from postproc.verification.checks import (
    check_blending,
    check_externals,
    check_held,
    check_joints,
    check_speeds,
)
from postproc.verification.collisions import check_collisions
from postproc.verification.corners import blended, check_corners, corners_of
from postproc.verification.coverage import coverage_of
from postproc.verification.entries import check_entries
from postproc.verification.report import Remark, Result, Run, VerifyReport, in_order
from postproc.verification.settings import check_rapids, check_settings
from postproc.verification.spindle import check_spindle
from postproc.verification.torques import check_torques

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
    kinematics = build(cell.robot)
    report(0, 4, "run")
    trace = run_in_cell(modules, name, cell, kinematics)
    report(1, 4, "kinematics")
    paths = joint_paths(trace, cell, kinematics)
    result = Result(paths, [*trace.findings, *paths.findings])
    _check_frames(result, trace, cell)
    check_settings(result, cell, modules)
    _check_circles(result)
    check_joints(result, cell, kinematics)
    check_externals(result, cell)
    check_blending(result)
    check_capacity(result, cell, modules)
    report(2, 4, "comparison")
    comparison, asked, needs_start = None, None, True
    if toolpath is not None:
        toolpath, needs_start = _asked_of(result, toolpath, cell)
        comparison = compare_served(
            result, cell, toolpath, tolerances or Tolerances(), displacement
        )
        check_profiles(result, toolpath, comparison)
        asked = check_events(result, cell, *in_program_order(toolpath, cell, comparison))
    is_cut = comparison.is_cut if comparison is not None else None
    cuts = _cuts_of(trace, cell) if is_cut is None else is_cut
    check_speeds(result, cell, cuts)
    check_torques(result, cell, kinematics, cuts)
    if is_cut is not None:
        check_rapids(result, cell, is_cut)
        check_held(result, cell, is_cut)
    number = np.where(cuts, 0, -1) if comparison is None else comparison.cut_of
    led = None
    if comparison is not None and toolpath is not None:
        led = leads_in(paths, cell, toolpath, comparison.served, comparison.latest)
    result.add(_within(cell, Cuts.of(paths, number, asked), paths, led))
    accepted = may_stand(toolpath, cell)
    check_spindle(result, cell, is_cut, accepted=accepted, needs_start=needs_start)
    report(3, 4, "collisions")
    at = blended(paths)
    corners = corners_of(paths, kinematics, at)
    check_corners(result, cell, corners, at, is_cut)
    slack = 0.0 if comparison is None else comparison.largest_shift()
    checked = collisions and check_collisions(result, cell, kinematics, cuts, slack, corners, at)
    violations = in_order(result.findings, Severity.ERROR)
    covered = coverage_of(modules, trace, violations)
    return replace(_report(name, result, cell, comparison, checked), coverage=covered)


def _asked_of(result: Result, toolpath: ToolPath, cell: Cell) -> tuple[ToolPath, bool]:
    """Return what a CAM file asks of the program, and whether that has to start the spindle."""
    claims = claimed(toolpath, cell)
    toolpath = claims.toolpath
    words = (*word_findings(toolpath), *claims.findings, *unit_findings(toolpath, cell))
    result.findings += refusals(words)
    toolpath = as_served(toolpath, cell)
    needs_start = len(started_by_none(toolpath)) > 0
    toolpath = driven(toolpath, cell)
    found = machining_findings(toolpath, cell)
    result.findings += [replace(item, code=RunKind.SPINDLE, tag_index=None) for item in found]
    return holes_served(toolpath, cell), needs_start


def _within(cell: Cell, cuts: Cuts, paths: Paths, led: BoolArray | None) -> Iterator[Remark]:
    """Yield what is said of a run and its cuts alone."""
    yield from check_entries(paths, cell, cuts, led)
    yield from check_between(paths, cuts)
    yield from check_advance(paths, cell)


def _report(
    name: str, result: Result, cell: Cell, comparison: Comparison | None, checked: bool
) -> VerifyReport:
    paths = result.paths
    times = durations(paths, cell)
    position = axis = tilt = tags = matched = real = None
    if comparison is not None:
        position = float(np.max(comparison.position_error, initial=0.0))
        real = comparison.expectation()
        axis = float(np.max(comparison.axis_error, initial=0.0))
        tilt = float(np.max(comparison.tilt, initial=0.0))
        tags, matched = len(comparison.served), int((comparison.served >= 0).sum())
    return VerifyReport(
        program=name,
        points=len(paths),
        violations=in_order(result.findings, Severity.ERROR),
        warnings=in_order(result.findings, Severity.WARNING),
        cycle_time=cycle_time(paths, times),
        worst=result.worst,
        position_error=position,
        axis_error=axis,
        tilt=tilt,
        tags=tags,
        matched=matched,
        passed=None if comparison is None else result.passed,
        expectation=real,
        collisions_checked=checked,
        run=Run(
            paths,
            times,
            None if comparison is None else comparison.served,
            None if comparison is None else comparison.position_error,
        ),
    )


def _cuts_of(trace: Trace, cell: Cell) -> BoolArray:
    """Return the motions (m,) that cut for all that the text says."""
    return np.asarray(trace.is_cp & machining_speeds(trace.column("speed"), cell))


def _check_frames(result: Result, trace: Trace, cell: Cell) -> None:
    """Compare tool and base of every path motion with those of the cell."""
    station = result.paths.station
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
                result.finding(RunKind.FRAME, first, text)
            elif off > _SAME_FRAME or turned > _SAME_TURN:
                result.finding(
                    RunKind.FRAME,
                    first,
                    f"{name} is {off / MM:.3f} mm and {turned / DEG:.3f} deg off {what} {number} "
                    "of the cell",
                )


def _check_circles(result: Result) -> None:
    """Report motions whose curve the text does not fix: bad circles, half turns of the tool."""
    curves = result.paths.curves
    half = np.flatnonzero(result.paths.trace.is_cp & (curves.angle > HALF_TURN))
    for row in half[:20].tolist():
        result.finding(
            RunKind.HALF_TURN,
            row,
            "the tool turns by 180 deg: the controller may turn it either way",
        )
    for row in curves.bad_circles[:20].tolist():
        result.finding(RunKind.CIRCLE, int(row), "start, auxiliary point and end are on no circle")
    missing = np.flatnonzero(
        (result.paths.trace.motion_type == MotionType.CIRC) & (curves.circle < 0)
    )
    for row in np.setdiff1d(missing, curves.bad_circles)[:20].tolist():
        result.finding(RunKind.CIRCLE, int(row), "a circular motion without an auxiliary point")
