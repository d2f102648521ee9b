"""Which tags are key tags: ends, corners, every so often, or as named.

Between key tags the spin about the tool axis is interpolated (``smooth``), so a stretch ends
wherever that would make no sense: at the ends of operations and where rapids, cuts and holes meet.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray
from postproc.cell import Optimize
from postproc.geometry import angle_between, path_length
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.planning.search.constants import KEY_STEP, KEY_TURN
from postproc.planning.states import Problem, cut_into, entered_anew


def stretches(toolpath: ToolPath) -> IndexArray:
    """Return the number (n,) of the stretch that each tag belongs to, from 0 upwards."""
    kind = np.asarray(toolpath.kind)
    sort = np.select([kind == MotionKind.HOLE, np.isin(kind, CUTS)], [1, 2], 0)
    # The tag before a cut is where the cut starts: it belongs to the cut.
    sort[:-1] = np.where((sort[:-1] == 0) & (sort[1:] == 2), 2, sort[:-1])
    starts = np.zeros(len(kind), dtype=np.bool_)
    starts[1:] = (np.diff(sort) != 0) | (np.diff(np.asarray(toolpath.operation)) != 0)
    starts[1:] |= (kind[1:] == MotionKind.RAPID) & (sort[1:] == 2)
    starts |= entered_anew(toolpath)
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
    return keys | _every(keys, arc_length(toolpath), toolpath, wishes)


def _every(keys: BoolArray, way: FloatArray, toolpath: ToolPath, wishes: Optimize) -> BoolArray:
    """Return (n,) the tags that follow the last key tag at the distance or turn of axis asked."""
    result = np.zeros_like(keys)
    least = float(np.cos(wishes.key_corner))
    lengths, axes, known = way.tolist(), np.asarray(toolpath.axes).tolist(), keys.tolist()
    last, (x, y, z) = 0, axes[0]
    for tag in range(1, len(lengths)):
        i, j, k = axes[tag]
        turned = x * i + y * j + z * k < least
        if known[tag] or turned or lengths[tag] - lengths[last] >= wishes.key_every - ROUNDING:
            result[tag] = True
            last, (x, y, z) = tag, axes[tag]
    return result


def spaced(way: FloatArray, is_inner: BoolArray, step: float) -> BoolArray:
    """Return (n,) the tags beside ``is_inner`` runs, and inside them one every ``step`` [m]."""
    keys = ~is_inner
    keys[:-1] |= keys[1:]
    keys[:1] = keys[-1:] = True
    number = np.floor(way / step)
    keys[1:] |= np.diff(number) != 0
    return keys


def dense_key_tags(problem: Problem) -> BoolArray:
    """Return (n,) the tags that a search sees: all but those close together inside cuts.

    Inside cuts a tag every ``KEY_STEP`` of path and every ``KEY_TURN`` that the tool axis turns;
    corners, pinned and named tags, and those where a tilt begins or ends.
    """
    toolpath, wishes, place = problem.toolpath, problem.cell.optimize, problem.placement
    n = len(toolpath)
    is_cut = cut_into(toolpath)
    keys = spaced(arc_length(toolpath), is_cut, KEY_STEP)
    axis = place.axis_base(np.arange(n))
    turned = np.concatenate([[0.0], np.cumsum(angle_between(axis[:-1], axis[1:]))])
    keys[1:] |= np.diff(np.floor(turned / KEY_TURN)) != 0
    operation = np.diff(np.asarray(toolpath.operation)) != 0
    keys[1:] |= operation
    keys[:-1] |= operation
    if wishes.tilt:
        edge = np.diff(place.may_tilt.astype(np.int8)) != 0
        keys[1:] |= edge
        keys[:-1] |= edge
    named = {*wishes.key_tags, *wishes.pins}
    if named:
        keys |= np.array([toolpath.tag_name(tag) in named for tag in range(n)])
    return keys


def _corners(points: FloatArray, angle: float) -> BoolArray:
    """Return (n-2,) whether the path bends by more than ``angle`` at each inner point."""
    step = np.diff(points, axis=0)
    moved = np.linalg.norm(step, axis=1) > ROUNDING
    bend = angle_between(step[:-1], step[1:])
    return np.asarray((bend > angle) & moved[:-1] & moved[1:])
