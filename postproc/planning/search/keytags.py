"""Which tags are key tags: ends, corners, every so often, or as named.

Between key tags the spin about the tool axis is interpolated (``smooth``), so a stretch ends
wherever that would make no sense: at the ends of operations and where rapids, cuts and holes meet.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import Optimize
from postproc.geometry import angle_between, path_length
from postproc.model import MotionKind, ToolPath


def stretches(toolpath: ToolPath) -> IndexArray:
    """Return the number (n,) of the stretch that each tag belongs to, from 0 upwards."""
    kind = np.asarray(toolpath.kind)
    sort = np.select(
        [kind == MotionKind.HOLE, np.isin(kind, (MotionKind.LINEAR, MotionKind.ARC))], [1, 2], 0
    )
    # The tag before a cut is where the cut starts: it belongs to the cut.
    sort[:-1] = np.where((sort[:-1] == 0) & (sort[1:] == 2), 2, sort[:-1])
    starts = np.zeros(len(kind), dtype=np.bool_)
    starts[1:] = (np.diff(sort) != 0) | (np.diff(np.asarray(toolpath.operation)) != 0)
    starts[1:] |= (kind[1:] == MotionKind.RAPID) & (sort[1:] == 2)
    number: IndexArray = np.cumsum(starts)
    return number


def arc_length(toolpath: ToolPath) -> FloatArray:
    """Return the length (n,) [m] of the path from the first tag to each, arcs along the arc."""
    points = np.asarray(toolpath.points)
    number = np.asarray(toolpath.arc)[1:]
    radius, sweep = np.zeros(len(number)), np.zeros(len(number))
    is_arc = (np.asarray(toolpath.kind)[1:] == MotionKind.ARC) & (number >= 0)
    radius[is_arc] = toolpath.arcs.radius[number[is_arc]]
    sweep[is_arc] = toolpath.arcs.sweep[number[is_arc]]
    steps = path_length(points[:-1], points[1:], radius, sweep)
    return np.concatenate([[0.0], np.cumsum(steps)])


def key_tags(toolpath: ToolPath, wishes: Optimize) -> BoolArray:
    """Return (n,) the key tags of a toolpath.

    Both ends of every stretch and pinned tags; then the tags named in the cell, or, where none are
    named, corners of the path and of the tool axis, and a tag every ``key_every``.
    """
    n = len(toolpath)
    number = stretches(toolpath)
    keys = np.ones(n, dtype=np.bool_)
    keys[1:-1] = (number[1:-1] != number[:-2]) | (number[1:-1] != number[2:])
    named = {*wishes.key_tags, *wishes.pins}
    if named:
        keys |= np.array([toolpath.tag_name(tag) in named for tag in range(n)])
    if wishes.key_tags:
        return keys
    keys[1:-1] |= _corners(np.asarray(toolpath.points), wishes.key_corner)
    way, axes = arc_length(toolpath), np.asarray(toolpath.axes)
    last = 0
    for tag in range(1, n):
        turned = float(angle_between(axes[last], axes[tag])) > wishes.key_corner
        far = way[tag] - way[last] >= wishes.key_every - 1e-9
        if keys[tag] or turned or far:
            keys[tag] = True
            last = tag
    return keys


def _corners(points: FloatArray, angle: float) -> BoolArray:
    """Return (n-2,) whether the path bends by more than ``angle`` at each inner point."""
    step = np.diff(points, axis=0)
    moved = np.linalg.norm(step, axis=1) > 1e-9
    bend = angle_between(step[:-1], step[1:])
    return np.asarray((bend > angle) & moved[:-1] & moved[1:])
