"""The feed that each tag asks for."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.model import MotionKind, ToolPath

AXIS_SHARE = 0.95 * 0.98
"""Share of an axis's speed that a feed may need; a higher feed is lowered to it. The rest is for
what an axis needs between two samples of the way."""
LOWERED_FROM = 0.85
"""A feed is rightly lowered if it would need more than this share: the samples of whoever judges
a program are others than those of whoever made it."""
LOWERED_TO = 0.75
"""A lowered feed still needs this share at least, by the same reason; else it is too low."""


def feeds_of(toolpath: ToolPath, cell: Cell) -> FloatArray:
    """Return the feed (n,) [m/s] of each tag: its cycle's, its own, the cell's; NaN without."""
    feed = np.asarray(toolpath.feed)
    feed = np.where(np.isfinite(feed), feed, cell.motion.feed)
    own = np.array([*(cycle.feed for cycle in toolpath.cycles), np.nan])
    cycle = own[np.asarray(toolpath.cycle)]
    is_hole = np.asarray(toolpath.kind) == MotionKind.HOLE
    return np.where(is_hole & np.isfinite(cycle), cycle, feed)
