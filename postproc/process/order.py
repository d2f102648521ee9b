"""The order of a toolpath: which holes may be drilled in any order, and tags put in another one."""

from __future__ import annotations

import itertools
from collections.abc import Iterator

import numpy as np

from postproc.arrays import AnyIntArray, IntArray
from postproc.model import MotionKind, ToolPath
from postproc.units import MM

_PLACE = 0.1 * MM
"""Size [m] of the cells in which tops, bottoms and axes of holes are one place."""
_WAY = 1e-3
"""The same of the directions of axes."""
_OFF_GRID = 0.317
"""Numbers as files write them do not lie on the border of two cells."""


def hole_runs(toolpath: ToolPath) -> list[tuple[int, int]]:
    """Return stretches [low, high) of holes whose order nothing but the file binds.

    They are of one operation and tool, and no event stands between them. A hole at the place of one
    before it, which is bored, reamed or drilled again, begins a new stretch.
    """
    n = len(toolpath)
    hole = np.asarray(toolpath.kind) == MotionKind.HOLE
    parted = np.ones(n + 1, dtype=np.bool_)
    if n:
        parted[1:n] = (
            (hole[1:] != hole[:-1])
            | (np.diff(np.asarray(toolpath.operation)) != 0)
            | (np.diff(np.asarray(toolpath.tool)) != 0)
            | (np.diff(toolpath.setup_of_tags) != 0)
        )
    for event in toolpath.events:
        parted[event.index] = True
    places = hole_places(toolpath)
    pairs = itertools.pairwise(np.nonzero(parted)[0].tolist())
    return [run for low, high in pairs if hole[low] for run in _once_each(places, low, high)]


def hole_places(toolpath: ToolPath) -> IntArray:
    """Return numbers (n, 3) of the top, the bottom and the axis of each tag."""
    top, axis = toolpath.points, toolpath.axes
    depths = np.array([*(cycle.depth for cycle in toolpath.cycles), 0.0])
    bottom = top - depths[np.asarray(toolpath.cycle)][:, None] * axis
    foot = top - np.einsum("ij,ij->i", top, axis)[:, None] * axis
    found = []
    for columns in (top / _PLACE, bottom / _PLACE, np.hstack([foot / _PLACE, axis / _WAY])):
        cells = np.rint(np.nan_to_num(columns) + _OFF_GRID).astype(np.int64)
        found.append(np.unique(cells, axis=0, return_inverse=True)[1].reshape(-1))
    return np.stack(found, axis=1).astype(np.int32) if len(top) else np.zeros((0, 3), np.int32)


def _once_each(places: IntArray, low: int, high: int) -> Iterator[tuple[int, int]]:
    """Yield the stretches of [low, high) in which no place (n, 3) comes twice."""
    met: set[tuple[int, int]] = set()
    begin = low
    for row, found in enumerate(places[low:high].tolist(), start=low):
        own = set(enumerate(found))
        if met & own:
            yield begin, row
            begin, met = row, set()
        met |= own
    yield begin, high


def reordered(toolpath: ToolPath, order: AnyIntArray) -> ToolPath:
    """Return the toolpath with its tags (n,) in another order, each with the name it had."""
    return toolpath.named().rows(order)
