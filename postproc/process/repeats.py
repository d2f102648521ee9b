"""Points that a toolpath repeats: there is nothing to do on the way."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray
from postproc.model import MotionKind, ToolPath

_SAME = 1e-7
"""Points nearer than this [m] and axes nearer than this [rad] are one."""


def repeats(toolpath: ToolPath) -> BoolArray:
    """Return (n,) lines of no length: the point and the axis of the cut before."""
    kind = np.asarray(toolpath.kind)
    cuts = np.isin(kind, (MotionKind.LINEAR, MotionKind.ARC))
    way = np.linalg.norm(np.diff(toolpath.points, axis=0), axis=1)
    turned = np.linalg.norm(np.diff(toolpath.axes, axis=0), axis=1)
    same = (way < _SAME) & (turned < _SAME) & (kind[1:] == MotionKind.LINEAR) & cuts[:-1]
    return np.concatenate([np.zeros(min(1, len(kind)), dtype=np.bool_), same])
