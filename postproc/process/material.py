"""Where a tool stands in material, what it may touch there, and how it gets out.

A cut ends in material. From there the tool goes on cutting, or straight where the CAM file says
RAPID; before any other motion it backs off along its axis.

The cutting solid may touch the workpiece on motions that cut, and on the straight way along the
tool axis out of the end of the last cut, and back in by it: what the cutter takes up there it, or
what carries it, has taken up before. Nowhere else, and nothing but the cutting solid.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Cell
from postproc.model import CUTS, WORKING, MotionKind, ToolPath
from postproc.process.passing import repeated_tags
from postproc.units import DEG, MM

ALONG_AXIS = float(np.cos(2.0 * DEG))
"""Cosine to the tool axis from which on a motion is one along it."""

MACHINING_SPEED = 0.25
"""Up to this path speed [m/s] a motion counts as machining where no CAM file tells."""

_AS_RAPID = 0.01
"""A motion whose speed differs from that of straight rapids by less than this share is one."""
_BESIDE = 0.05 * MM
"""A tool tip this near [m] to the way out of a cut is on it."""
_LEANING = 0.05 * DEG
"""A tool axis that leans by no more than this [rad] against that of the cut is along it."""


def back_off(cell: Cell) -> float:
    """Return how far [m] the tool backs off: as far as where a point is approached from."""
    return cell.motion.approach


def out_of_cut(toolpath: ToolPath, cell: Cell) -> FloatArray:
    """Return how high (n,) [m] above each tag a tool is out of a cut that the file goes on with.

    As far as it backs off, and as high as the file itself comes to the cut from: a pocket may be
    deeper than that. Not where the tool stands another way than there.
    """
    kind, points, axes = np.asarray(toolpath.kind), toolpath.points, toolpath.axes
    above = np.maximum.accumulate(np.where(np.isin(kind, CUTS), -1, np.arange(len(kind))))
    rise = np.einsum("ij,ij->i", points[above] - points, axes)
    known = (above >= 0) & (np.einsum("ij,ij->i", axes[above], axes) >= ALONG_AXIS)
    return np.maximum(np.where(known, rise, 0.0), back_off(cell))


def in_material(toolpath: ToolPath, cell: Cell) -> BoolArray:
    """Return (n,) tags at which a cut ends in material.

    A cut that itself backs off along the tool axis does not; a repeated point is the first of them.
    """
    kind = np.asarray(toolpath.kind)
    ends = np.isin(kind, CUTS)
    if not ends.any():
        return ends
    ends &= ~(feeds_out(toolpath) & (_lengths(toolpath)[0] >= back_off(cell)))
    return np.asarray(ends[repeated_tags(toolpath)])


def feeds_out(toolpath: ToolPath) -> BoolArray:
    """Return (n,) the lines by which the tool backs off along its axis with the feed."""
    length, rise = _lengths(toolpath)
    out = (rise >= ALONG_AXIS * length) & (length > 0.0)
    return np.asarray(out & (np.asarray(toolpath.kind) == MotionKind.LINEAR))


def _lengths(toolpath: ToolPath) -> tuple[FloatArray, FloatArray]:
    """Return how long (n,) the straight way to each tag is [m], and how much of it leads out."""
    way = np.diff(toolpath.points, axis=0, prepend=toolpath.points[:1])
    return np.linalg.norm(way, axis=1), np.einsum("ij,ij->i", way, toolpath.axes)


def in_the_cut(toolpath: ToolPath) -> BoolArray:
    """Return (n,) the rapid tags on the way by which the tool came into what it cut last.

    A drill that comes back in rapid to its last peck stands at one. Above a cut that was entered
    from the side there may be material.
    """
    kind, points, axes = np.asarray(toolpath.kind), toolpath.points, toolpath.axes
    works = np.isin(kind, WORKING) & ~feeds_out(toolpath)
    last = np.maximum.accumulate(np.where(works, np.arange(len(kind)), -1))
    rapid = np.flatnonzero((kind == MotionKind.RAPID) & (last >= 0))
    last = last[rapid]
    of_cycle = np.array([*((c.depth, c.clearance) for c in toolpath.cycles), (0.0, 0.0)])
    is_hole = (kind[last] == MotionKind.HOLE) & (np.asarray(toolpath.cycle)[last] >= 0)
    of_hole = np.where(is_hole[:, None], of_cycle[np.asarray(toolpath.cycle)[last]], 0.0)
    bottom = points[last] - of_hole[:, :1] * axes[last]
    length, rise = (values[last] for values in _lengths(toolpath))
    is_plunge = (kind[last] == MotionKind.LINEAR) & (-rise >= ALONG_AXIS * length)
    swept = np.where(is_hole, of_hole.sum(axis=1), np.where(is_plunge, -rise, 0.0))
    height = np.einsum("ij,ij->i", points[rapid] - bottom, axes[last])
    out = on_the_way_out(bottom, -axes[last], points[rapid], -axes[rapid])
    found = np.zeros(len(kind), dtype=np.bool_)
    found[rapid] = out & (height <= swept + _BESIDE)
    return found


def rapid_speeds(speed: FloatArray, cell: Cell) -> BoolArray:
    """Return which path speeds (n,) [m/s] are that of straight rapids."""
    rapid = cell.motion.rapid_speed
    return np.asarray(np.abs(speed - rapid) <= _AS_RAPID * rapid)


def machining_speeds(speed: FloatArray, cell: Cell) -> BoolArray:
    """Return which path speeds (n,) [m/s] mean a cut where no CAM file tells what cuts."""
    return np.asarray((speed <= MACHINING_SPEED) & ~rapid_speeds(speed, cell))


def on_the_way_out(
    cut: FloatArray, cut_axis: FloatArray, point: FloatArray, axis: FloatArray, slack: float = 0.0
) -> BoolArray:
    """Return which tools (n,) stand on the way out of a cut: the cutting solid may touch there.

    On a straight motion between two such poses it may touch all along. ``cut`` (n, 3) [m]: where
    the cut has ended, NaN without one; ``cut_axis`` (n, 3): tool axis there, into the part;
    ``slack``: how far [m] the points may be off what they stand for.
    """
    off = point - cut
    height = -np.einsum("ni,ni->n", off, cut_axis)
    beside = np.linalg.norm(off + height[:, None] * cut_axis, axis=1)
    along = np.linalg.norm(np.cross(axis, cut_axis), axis=1) <= np.sin(_LEANING)
    along &= np.einsum("ni,ni->n", axis, cut_axis) > 0.0
    near = _BESIDE + slack
    return np.asarray(along & (beside <= near) & (height >= -near))
