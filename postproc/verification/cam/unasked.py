"""Motions into the part that nothing in the CAM file asks for: cuts too many, ways back to one.

Not every path motion at a working feed that serves nothing is one: the tool backs off along its
axis, and it comes back to above where it left, and down.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.errors import RunKind
from postproc.process import ALONG_AXIS, machining_speeds
from postproc.verification.cam.feeds import AT_MOST
from postproc.verification.report import Result

_STILL = 1e-6
"""A motion shorter than this [m] goes nowhere."""


def check_unasked(
    result: Result, cell: Cell, serves: BoolArray, is_cut: BoolArray, near: float
) -> None:
    """Report motions that work where the file asks for nothing, or go back to where a cut ended.

    Args:
        result: the program; collects the findings.
        cell: says which speed is that of rapids.
        serves: (m,) motions that serve something of the file, or are judged already.
        is_cut: (m,) motions that serve lines and arcs.
        near: a tool that comes down so near [m] to where it left goes on there.
    """
    paths = result.paths
    works = paths.trace.is_cp & machining_speeds(paths.trace.column("speed"), cell) & ~serves
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
    bad = motion[~fine]
    more = f", {len(bad)} such motions" if len(bad) > AT_MOST else ""
    for number in bad[:AT_MOST].tolist():
        text = f"a motion at a working feed that the CAM file does not ask for{more}"
        result.finding(RunKind.PATH, number, text)
    end_of = np.maximum.accumulate(np.where(is_cut, np.arange(len(is_cut)), -1))
    joint = np.flatnonzero(~paths.trace.is_cp & ~serves & ~paths.stands & (end_of >= 0))
    off = np.linalg.norm(paths.end_point[joint] - paths.end_point[end_of[joint]], axis=1)
    for number in joint[off <= near][:AT_MOST].tolist():
        text = "a joint motion back to where a cut has ended"
        result.finding(RunKind.PATH, number, text)
