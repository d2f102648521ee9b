"""Whether the tool backs off along its axis before a rapid that begins where a cut ends.

It may go on cutting, or go straight to the point that the CAM file says RAPID to; all else, a
joint motion above all, may run through the part.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray
from postproc.cell import Cell
from postproc.controller import MotionType
from postproc.errors import RunKind
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.paths import Paths
from postproc.process import ALONG_AXIS, MACHINING_SPEED, back_off, claimed, in_material
from postproc.units import MM
from postproc.verification.report import Result

_LISTED = 20
_SLACK = 0.05 * MM
_STILL = 1e-6
"""A motion shorter than this [m] goes nowhere, if no joint turns more [rad]."""


def check_leaving(
    result: Result,
    cell: Cell,
    toolpath: ToolPath,
    served: AnyIntArray,
    latest: AnyIntArray,
    is_cut: BoolArray,
) -> None:
    """Check the motions behind every cut.

    Args:
        result: the program; collects the findings.
        cell: how far a tool backs off.
        toolpath: what was asked for, n tags.
        served: (n,) motion that goes to each tag, -1 for none.
        latest: (n,) the last motion that may be meant.
        is_cut: (m,) motions that serve lines and arcs.
    """
    inside = is_cut.copy()
    last = np.maximum(served, latest)[served >= 0]
    inside[served[served >= 0]] = False
    inside[last] = in_material(toolpath, cell)[served >= 0]
    fine = is_cut | _as_asked(result, toolpath, served, latest)
    inside[:-1] &= ~fine[1:]
    for motion in np.flatnonzero(inside)[:_LISTED].tolist():
        bad = _first_wrong(result, motion, back_off(cell) - _SLACK, fine)
        if bad is not None:
            text = "a rapid begins at the end of a cut: the tool has not backed off along its axis"
            result.finding(RunKind.RETRACT, bad, text)


def leads_in(
    paths: Paths, cell: Cell, toolpath: ToolPath, served: AnyIntArray, latest: AnyIntArray
) -> BoolArray:
    """Return (m,) motions that end where the CAM file leads into a cut, or says no way to it.

    Args:
        paths: what is run.
        cell: which tool and base each tag means.
        toolpath: what was asked for, n tags.
        served: (n,) motion that goes to each tag, -1 for none.
        latest: (n,) the last motion that may be meant.
    """
    kind = np.asarray(toolpath.kind)
    open_ = ~np.isin(kind, CUTS)
    open_[[stretch.low for stretch in claimed(toolpath, cell).stretches()]] = True
    led = np.zeros(len(paths), dtype=np.bool_)
    for motions in (served, latest):
        led[motions[open_ & (motions >= 0)]] = True
    return led


def _as_asked(
    result: Result, toolpath: ToolPath, served: AnyIntArray, latest: AnyIntArray
) -> BoolArray:
    """Return (m,) lines from one point of the CAM file straight to one that it says RAPID to."""
    asked = np.zeros(len(result.paths), dtype=np.bool_)
    rows = np.flatnonzero(np.asarray(toolpath.kind)[1:] == MotionKind.RAPID) + 1
    if not len(asked):
        return asked
    before = np.maximum(served, latest)[rows - 1]
    straight = (served[rows] > before) & (before >= 0)
    moved = np.cumsum(~result.paths.stands)
    straight &= moved[served[rows]] - moved[before] == 1
    rows = rows[straight]
    asked[served[rows]] = True
    return np.asarray(asked & (result.paths.trace.motion_type == MotionType.LIN))


def _first_wrong(result: Result, motion: int, enough: float, fine: BoolArray) -> int | None:
    """Return the first rapid behind ``motion`` that is neither fine nor along the tool axis."""
    paths, height = result.paths, 0.0
    speed = paths.trace.column("speed")
    for number in range(motion + 1, len(paths)):
        if fine[number] or height >= enough:
            return None
        step = paths.end_point[number] - paths.end_point[number - 1]
        length = float(np.linalg.norm(step))
        turned = float(np.abs(paths.q[number] - paths.q[number - 1]).max())
        if length < _STILL and turned < _STILL:
            continue
        out = float(step @ -paths.end_axis[number])
        is_along = bool(out >= ALONG_AXIS * length)
        if not paths.trace.is_cp[number] or (speed[number] > MACHINING_SPEED and not is_along):
            return number
        if not is_along:
            return None
        height += out
    return None
