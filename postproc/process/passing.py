"""Points that ask for nothing: repeated ones, and those that a program may pass beside."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Cell
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.process.feeds import feeds_of

SAME_POINT = 1e-7
"""Points nearer than this [m] and axes nearer than this [rad] are one."""


def repeats(toolpath: ToolPath) -> BoolArray:
    """Return (n,) lines and rapids of no length: the point, axis and tool of the motion before."""
    kind = np.asarray(toolpath.kind)
    again = np.isin(kind[1:], (MotionKind.RAPID, MotionKind.LINEAR))
    again &= np.isin(kind[:-1], (MotionKind.RAPID, *CUTS))
    for column in (np.asarray(toolpath.tool), toolpath.setup_of_tags):
        again &= np.diff(column) == 0
    again &= ~apart(np.hstack([toolpath.points, toolpath.axes]))[1:]
    return np.concatenate([np.zeros(min(1, len(kind)), dtype=np.bool_), again])


def repeated_tags(toolpath: ToolPath) -> IndexArray:
    """Return the tag (n,) that each one repeats; itself where it repeats none."""
    own = np.arange(len(toolpath))
    return np.asarray(np.maximum.accumulate(np.where(repeats(toolpath), 0, own)))


def apart(points: FloatArray) -> BoolArray:
    """Return (n,) which points (n, d) differ from the last one that did: a slow drift counts."""
    n = len(points)
    new = np.ones(n, dtype=np.bool_)
    near = np.linalg.norm(np.diff(points, axis=0), axis=1) <= SAME_POINT
    last = -1
    for row in (np.flatnonzero(near) + 1).tolist():
        last = row - 1 if new[row - 1] else last
        new[row] = np.linalg.norm(points[row] - points[last]) > SAME_POINT
    return new


def may_be_passed(toolpath: ToolPath, cell: Cell) -> BoolArray:
    """Return the tags (n,) that lie within lines of one feed, where nothing else happens.

    The first and the last point of a cut, the ends of arcs, exact stops and every point at which
    feed, blending, operation, tool or coordinates change, or an event stands, are none of them. An
    event stands before a tag, which is at the point of the tag before. A point that repeats the one
    before is no motion: it is passed where that one is. Whether any of them is passed is a question
    of the tolerances in ``[motion] thin``.
    """
    if not len(toolpath):
        return np.zeros(0, dtype=np.bool_)
    part, tags = without_repeats(toolpath)
    if len(tags) < len(toolpath):
        may = may_be_passed(part, cell)
        return np.asarray(may[np.searchsorted(tags, np.arange(len(toolpath)), side="right") - 1])
    is_line = np.asarray(toolpath.kind) == MotionKind.LINEAR
    inner = is_line[:-1] & is_line[1:]
    blend = np.asarray(toolpath.largest_blend)
    for asked in (feeds_of(toolpath, cell), blend):
        inner &= (asked[:-1] == asked[1:]) | (np.isnan(asked[:-1]) & np.isnan(asked[1:]))
    inner &= blend[:-1] != 0.0
    for name in ("operation", "tool", "setup_of_tags"):
        inner &= np.diff(np.asarray(getattr(toolpath, name))) == 0
    inner = np.append(inner, False)
    happens = np.array([event.index - 1 for event in toolpath.events], dtype=np.int64)
    inner[happens[happens >= 0]] = False
    return inner


def without_repeats(toolpath: ToolPath) -> tuple[ToolPath, IndexArray]:
    """Return the points that repeat none, and which (k,) they are, growing.

    None is blended farther than those that repeat it.
    """
    again = repeats(toolpath)
    tags = np.flatnonzero(~again)
    if not again.any():
        return toolpath, tags
    blend = np.fmin.reduceat(np.asarray(toolpath.largest_blend), tags)
    return replace(only(toolpath, tags), largest_blend=blend), tags


def only(toolpath: ToolPath, tags: IndexArray) -> ToolPath:
    """Return the growing ``tags`` (k,) under their names, with all events of the toolpath.

    An event of another tag stands before the next of these; tables stay whole.
    """
    part = replace(toolpath.named(), events=()).rows(tags)
    events = tuple(
        replace(event, index=int(np.searchsorted(tags, event.index))) for event in toolpath.events
    )
    return replace(part, events=events)
