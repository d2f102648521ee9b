"""Points that a toolpath repeats: there is nothing to do on the way."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.model import CUTS, MotionKind, ToolPath

SAME_POINT = 1e-7
"""Points nearer than this [m] and axes nearer than this [rad] are one."""


def repeats(toolpath: ToolPath) -> BoolArray:
    """Return (n,) lines and rapids of no length: the point, axis and tool of the motion before."""
    kind = np.asarray(toolpath.kind)
    again = np.isin(kind[1:], (MotionKind.RAPID, MotionKind.LINEAR))
    again &= np.isin(kind[:-1], (MotionKind.RAPID, *CUTS))
    for column in (np.asarray(toolpath.tool), toolpath.setup_of_tags):
        again &= np.diff(column) == 0
    again &= ~apart(np.hstack([toolpath.points, toolpath.axes]))[1:]
    return np.concatenate([np.zeros(min(1, len(kind)), dtype=np.bool_), again])


def repeated_tags(toolpath: ToolPath) -> IndexArray:
    """Return the tag (n,) that each one repeats; itself where it repeats none."""
    own = np.arange(len(toolpath))
    return np.asarray(np.maximum.accumulate(np.where(repeats(toolpath), 0, own)))


def apart(points: FloatArray) -> BoolArray:
    """Return (n,) which points (n, d) differ from the last one that did: a slow drift counts."""
    n = len(points)
    new = np.ones(n, dtype=np.bool_)
    near = np.linalg.norm(np.diff(points, axis=0), axis=1) <= SAME_POINT
    last = -1
    for row in (np.flatnonzero(near) + 1).tolist():
        last = row - 1 if new[row - 1] else last
        new[row] = np.linalg.norm(points[row] - points[last]) > SAME_POINT
    return new
