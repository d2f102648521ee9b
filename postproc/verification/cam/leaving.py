"""Motions that nothing in the CAM file asks for: rapids out of a cut, cuts too many, ways back.

The tool backs off along its axis before a rapid that begins where a cut ends. It may go on cutting,
or go straight to the point that the CAM file says RAPID to; all else, a joint motion above all, may
run through the part. Not every path motion at a working feed that serves nothing is a cut too many:
the tool backs off along its axis, and it comes back to above where it left, and down.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.controller import MotionType
from postproc.errors import RunKind
from postproc.model import CUTS, MotionKind
from postproc.paths import Paths
from postproc.process import (
    ALONG_AXIS,
    MACHINING_SPEED,
    assign,
    back_off,
    in_material,
    machining_speeds,
)
from postproc.units import MM
from postproc.verification.cam.elements import NEAR
from postproc.verification.cam.match import Match
from postproc.verification.cam.matching import Served
from postproc.verification.report import AT_MOST, Remark, Said, listed
from postproc.verification.run import Run

_SLACK = 0.05 * MM
_DIGIT = 5e-8
"""A shorter motion [m] or turn [rad] is none: program text has 0.1 um."""
_STILL = 1e-6
"""A motion shorter than this [m] goes nowhere, if no joint turns more [rad]."""


def check_leaving(run: Run, match: Match) -> Iterator[Said]:
    """Yield rapids that begin at the end of a cut, beside the tool axis."""
    first, last = match.tags.first, np.maximum(match.tags.first, match.tags.last)
    served, milled = first >= 0, match.uses.milled
    inside = milled.copy()
    inside[first[served]] = False
    inside[last[served]] = in_material(match.tags.toolpath, run.cell)[served]
    fine = milled | _as_asked(run.paths, match.tags)
    inside[:-1] &= ~fine[1:]
    for motion in np.flatnonzero(inside)[:AT_MOST].tolist():
        bad = _first_wrong(run.paths, motion, back_off(run.cell) - _SLACK, fine)
        if bad is not None:
            text = "a rapid begins at the end of a cut: the tool has not backed off along its axis"
            yield Remark(RunKind.RETRACT, bad, text)


def leads_in(paths: Paths, cell: Cell, tags: Served) -> BoolArray:
    """Return (m,) motions that end where the CAM file leads into a cut, or says no way to it."""
    open_ = ~np.isin(np.asarray(tags.toolpath.kind), CUTS)
    open_[[stretch.low for stretch in assign(tags.toolpath, cell).stretches()]] = True
    led = np.zeros(len(paths), dtype=np.bool_)
    for motions in (tags.first, tags.last):
        led[motions[open_ & (motions >= 0)]] = True
    return led


def _as_asked(paths: Paths, tags: Served) -> BoolArray:
    """Return (m,) lines from one point of the CAM file straight to one that it says RAPID to."""
    asked = np.zeros(len(paths), dtype=np.bool_)
    rows = np.flatnonzero(np.asarray(tags.toolpath.kind)[1:] == MotionKind.RAPID) + 1
    if not len(asked):
        return asked
    before = np.maximum(tags.first, tags.last)[rows - 1]
    to = tags.first[rows]
    straight = (to > before) & (before >= 0)
    moved = np.cumsum(~paths.stands)
    straight &= moved[to] - moved[before] == 1
    asked[to[straight]] = True
    return np.asarray(asked & (paths.trace.motion_type == MotionType.LIN))


def _first_wrong(paths: Paths, motion: int, enough: float, fine: BoolArray) -> int | None:
    """Return the first rapid behind ``motion`` that is neither fine nor along the tool axis."""
    height, speed = 0.0, paths.trace.column("speed")
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


def check_unasked(run: Run, match: Match) -> Iterator[Said]:
    """Yield motions that work where the file asks for nothing, or go back to where a cut ended.

    What goes beside a point that is missed is told as that.
    """
    paths, serves, is_cut = run.paths, match.uses.is_judged, match.uses.milled
    if not (match.tags.first >= 0).all():
        return
    near = NEAR * match.path_tolerance + match.shift
    works = paths.trace.is_cp & machining_speeds(paths.trace.column("speed"), run.cell) & ~serves
    works[:1] = False
    motion = np.flatnonzero(works)
    last = np.maximum.accumulate(np.where(serves, np.arange(len(serves)), -1))[motion]
    end, axis = paths.end_point[motion], paths.end_axis[motion]
    step, off = end - paths.end_point[motion - 1], end - paths.end_point[last]
    length, down = np.linalg.norm(step, axis=1), np.einsum("ij,ij->i", step, axis)
    height = -np.einsum("ij,ij->i", off, axis)
    is_above = np.linalg.norm(off + height[:, None] * axis, axis=1) <= near
    is_above &= (last >= 0) & (height >= -near)
    is_along = np.abs(down) >= ALONG_AXIS * length
    fine = (length < _STILL) | (is_along & (down < 0.0))
    fine |= is_above & (is_along | (height > near))
    for number, more in listed(motion[~fine], "motions"):
        text = f"a motion at a working feed that the CAM file does not ask for{more}"
        yield Remark(RunKind.PATH, number, text)
    end_of = np.maximum.accumulate(np.where(is_cut, np.arange(len(is_cut)), -1))
    joint = np.flatnonzero(~paths.trace.is_cp & ~serves & ~paths.stands & (end_of >= 0))
    off = np.linalg.norm(paths.end_point[joint] - paths.end_point[end_of[joint]], axis=1)
    for number in joint[off <= near][:AT_MOST].tolist():
        text = "a joint motion back to where a cut has ended"
        yield Remark(RunKind.PATH, number, text)


def check_still(run: Run, match: Match) -> Iterator[Said]:
    """Yield motions that go nowhere right behind one that cuts: the tool is in the material.

    A sub-program begins with a joint motion to where the one before it ended.
    """
    paths, trace = run.paths, run.paths.trace
    curves = paths.curves
    on_path = trace.is_cp & (curves.length < _DIGIT) & (curves.angle < _DIGIT)
    stands = paths.stands | on_path
    is_head = np.append(True, np.diff(trace.file) != 0)[: len(stands)]
    is_head &= ~trace.is_cp & trace.is_axes & ~trace.is_relative
    before = np.maximum.accumulate(np.where(stands, -1, np.arange(len(stands))))
    cuts = stands & ~is_head & (before >= 0) & match.uses.is_cut[before]
    for motion, more in listed(np.flatnonzero(cuts), "motions"):
        text = f"a motion of no length: the tool dwells where it cuts{more}"
        yield Remark(RunKind.PATH, motion, text)


def check_relative(run: Run, match: Match) -> Iterator[Said]:
    """Yield relative motions that serve nothing: the file has none, and they shift the arm."""
    serves = match.uses.is_cut | (match.uses.on_axis >= 0)
    for motion in np.flatnonzero(run.paths.trace.is_relative & ~serves)[:AT_MOST].tolist():
        text = "a relative motion that serves no point of the CAM file"
        yield Remark(RunKind.PATH, motion, text)
