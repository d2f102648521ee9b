"""Spans of a byte buffer, many at once: their blanks trimmed."""

from __future__ import annotations

import numpy as np

from postproc.arrays import ByteArray, IndexArray

BLANK = 32
"""Space; every byte up to it counts as blank."""


def trim_start(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> IndexArray:
    """Return starts (n,) moved past the blanks of each span ``buffer[starts:ends]``."""
    if len(buffer) == 0:
        return starts
    moved = np.array(starts)
    last = len(buffer) - 1
    rows = np.flatnonzero((buffer[np.minimum(moved, last)] <= BLANK) & (moved < ends))
    while len(rows):
        moved[rows] += 1
        at = moved[rows]
        rows = rows[(buffer[np.minimum(at, last)] <= BLANK) & (at < ends[rows])]
    return moved


def trim_end(buffer: ByteArray, starts: IndexArray, ends: IndexArray) -> IndexArray:
    """Return ends (n,) moved before the blanks of each span ``buffer[starts:ends]``."""
    if len(buffer) == 0:
        return ends
    moved = np.array(ends)
    rows = np.flatnonzero((buffer[np.maximum(moved - 1, 0)] <= BLANK) & (moved > starts))
    while len(rows):
        moved[rows] -= 1
        at = moved[rows]
        rows = rows[(buffer[np.maximum(at - 1, 0)] <= BLANK) & (at > starts[rows])]
    return moved
