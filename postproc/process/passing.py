"""Which points of a CAM file a program may pass beside: those at which nothing is asked for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, IndexArray
from postproc.cell import Cell
from postproc.model import MotionKind, ToolPath
from postproc.process.feeds import feeds_of
from postproc.process.repeats import repeats


def may_be_passed(toolpath: ToolPath, cell: Cell) -> BoolArray:
    """Return the tags (n,) that lie within lines of one feed, where nothing else happens.

    The first and the last point of a cut, the ends of arcs, exact stops and every point at which
    feed, blending, operation, tool or coordinates change, or an event stands, are none of them. An
    event stands before a tag, which is at the point of the tag before. A point that repeats the one
    before is no motion: it is passed where that one is.

    Args:
        toolpath: n tags.
        cell: the feed where the file gives none.

    Returns:
        A mask; whether any of them is passed is a question of the tolerances in ``[motion] thin``.
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
    """Return the points that repeat none, and which they are.

    None is blended farther than those that repeat it.

    Args:
        toolpath: n tags.

    Returns:
        The part, and the growing tags (k,) of the whole that it holds.
    """
    again = repeats(toolpath)
    tags = np.flatnonzero(~again)
    if not again.any():
        return toolpath, tags
    blend = np.fmin.reduceat(np.asarray(toolpath.largest_blend), tags)
    return replace(only(toolpath, tags), largest_blend=blend), tags


def only(toolpath: ToolPath, tags: IndexArray) -> ToolPath:
    """Return the growing ``tags`` (k,) under their names, with all events of the toolpath.

    Args:
        toolpath: the whole.
        tags: which of it; an event of another one stands before the next of these.

    Returns:
        The part; its tables stay whole.
    """
    part = replace(toolpath.named(), events=()).rows(tags)
    events = tuple(
        replace(event, index=int(np.searchsorted(tags, event.index))) for event in toolpath.events
    )
    return replace(part, events=events)
