"""What a list of points without depths asks for."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.cell import Cell, PointService
from postproc.model import MotionKind, ToolPath


def as_served(toolpath: ToolPath, cell: Cell) -> ToolPath:
    """Return the toolpath as a robot serves it: points to touch become holes without a cycle.

    A list of points says nothing about the way between them. By ``[motion] points`` = ``touch``
    each is approached along the tool axis and left the same way; ``path`` takes them as a line to
    follow; ``auto`` follows where a feed is given, which only a cut has. Other formats say
    themselves what is a cut: they come back unchanged.
    """
    choice = cell.motion.points
    kind = np.asarray(toolpath.kind)
    touch = kind == MotionKind.LINEAR
    if choice is PointService.AUTO:
        touch = touch & ~np.isfinite(toolpath.feed)
    if toolpath.format != "csv" or choice is PointService.PATH or not touch.any():
        return toolpath
    return replace(toolpath, kind=np.where(touch, MotionKind.HOLE, kind).astype(np.int32))
