"""The feed that each tag asks for."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.model import MotionKind, ToolPath


def feeds_of(toolpath: ToolPath, cell: Cell) -> FloatArray:
    """Return the feed (n,) [m/s] of each tag: its cycle's, its own, the cell's; NaN without."""
    feed = np.asarray(toolpath.feed)
    feed = np.where(np.isfinite(feed), feed, cell.motion.feed)
    own = np.array([*(cycle.feed for cycle in toolpath.cycles), np.nan])
    cycle = own[np.asarray(toolpath.cycle)]
    is_hole = np.asarray(toolpath.kind) == MotionKind.HOLE
    return np.where(is_hole & np.isfinite(cycle), cycle, feed)
