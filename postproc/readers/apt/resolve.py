"""Points of a CL file that are computed from the point before them, in file coordinates."""

from __future__ import annotations

import numpy as np

from postproc.arrays import TINY, FloatArray, IntArray
from postproc.readers.apt.arctext import WrittenArc
from postproc.readers.apt.motion import Motions
from postproc.readers.text import Faults
from postproc.units import TURN

_TOUCHES = 1e-4
"""How far, relative to the radius, a plane may miss the circle that it is to touch."""


def resolve_points(
    motions: Motions, axes: FloatArray, last: FloatArray | None, lines: IntArray, faults: Faults
) -> None:
    """Fill in increments, lifts to a plane and ends of arcs in planes, in the order of the file.

    Changes the motions of one block, whose points have tool axes (k, 3), behind the point ``last``
    (6,); also turns the points that arcs go towards into start directions.
    """
    points = motions.points
    arc_at = dict(zip(motions.arcs.tag.tolist(), range(len(motions.arcs)), strict=True))
    relative = set(motions.relative)
    for i in sorted({*relative, *motions.lifted, *motions.written}):
        before = points[i - 1, :3] if i > 0 else last
        if before is None:
            text = "a motion with no point before it to start from"
            raise faults.error("APT025", text, int(lines[i]))
        start = before[:3]
        arc = motions.written.get(i)
        if arc is not None and arc.towards is not None:
            motions.arcs.tangent[arc_at[i]] = np.array(arc.towards) - start
        if i in relative:
            step = points[i, :3]
            points[i, :3] = start + (step[2] * axes[i] if np.isnan(step[0]) else step)
        elif i in motions.lifted:
            points[i, :3] = _lifted(start, axes[i], motions.lifted[i])
        elif arc is not None and arc.plane is not None:
            end = _crossing(start, arc, motions.arcs.tangent[arc_at[i]])
            if end is None:
                text = "an arc that does not meet the plane in which it is to end"
                raise faults.error("APT087", text, int(lines[i]))
            points[i, :3] = end


def _lifted(start: FloatArray, axis: FloatArray, plane: list[float]) -> FloatArray:
    """Return where the tool axis through a point meets a plane; the point if it lies above."""
    normal, offset = np.array(plane[:3]), plane[3]
    slope = float(normal @ axis)
    way = (offset - float(normal @ start)) / slope if slope > 0.0 else 0.0
    lifted: FloatArray = start + max(way, 0.0) * axis
    return lifted


def _crossing(start: FloatArray, arc: WrittenArc, tangent: FloatArray) -> FloatArray | None:
    """Return where an arc that starts along a tangent meets its plane, None if it never does."""
    centre, axis = np.array(arc.numbers[:3]), np.array(arc.numbers[3:6])
    length = float(np.linalg.norm(axis))
    if arc.plane is None or length == 0.0:
        return None
    axis = axis / length
    rise = float((start - centre) @ axis) * axis
    u = start - centre - rise
    v = np.cross(axis, u)
    v = v if v @ tangent >= 0.0 else -v
    normal = np.array(arc.plane[:3])
    along, across = float(normal @ u), float(normal @ v)
    reach = float(np.hypot(along, across))
    wanted = arc.plane[3] - float(normal @ (centre + rise))
    if reach == 0.0 or abs(wanted) > reach * (1.0 + _TOUCHES):
        return None
    middle, half = np.arctan2(across, along), np.arccos(np.clip(wanted / reach, -1.0, 1.0))
    angles = np.sort((np.array([middle - half, middle + half]) - TINY) % TURN + TINY)
    angle = angles[arc.crossing - 1]
    end: FloatArray = centre + rise + np.cos(angle) * u + np.sin(angle) * v
    return end
