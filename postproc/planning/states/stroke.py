"""Strokes: the way along the tool axis by which a hole or a point is reached and left."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.model import MotionKind, ToolPath
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Strokes:
    """Heights above the tag along the tool axis, (n,) [m]; 0 for tags without a stroke.

    ``top``: where the tool arrives and leaves; ``clear``: where the feed starts; ``depth``: how
    far below the tag the tip goes.
    """

    is_stroke: BoolArray
    top: FloatArray
    clear: FloatArray
    depth: FloatArray

    def levels(self, tags: IndexArray) -> list[FloatArray]:
        """Return the heights (m,) [m] at which strokes of tags (m,) end, but for the tag's own."""
        found: list[FloatArray] = []
        for height in (self.top[tags], self.clear[tags], -self.depth[tags]):
            if height.any() and not any(np.array_equal(height, known) for known in found):
                found.append(height)
        return found


def strokes_of(toolpath: ToolPath, approach: float) -> Strokes:
    """Return the strokes of a toolpath.

    A hole takes them from its cycle: the tool arrives at the higher of clearance and retract
    height. A hole without a cycle (a point of a list without a depth) is a point to touch: the
    tool comes down from ``approach`` [m] above it and goes back there.
    """
    n = len(toolpath)
    is_stroke = np.asarray(toolpath.kind) == MotionKind.HOLE
    heights = np.zeros((len(toolpath.cycles) + 1, 3))
    for i, cycle in enumerate(toolpath.cycles):
        heights[i] = max(cycle.clearance, cycle.retract), cycle.clearance, cycle.depth
    heights[-1] = approach, approach, 0.0
    rows = heights[np.asarray(toolpath.cycle)] if n else np.zeros((0, 3))
    rows = np.where(is_stroke[:, None], rows, 0.0)
    return Strokes(is_stroke, rows[:, 0], rows[:, 1], rows[:, 2])
