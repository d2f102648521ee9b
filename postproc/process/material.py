"""Where a tool stands in material, and how it gets out before it moves in rapid.

A cut ends in material. From there the tool goes on cutting, or straight where the CAM file says
RAPID; before any other motion it backs off along its axis.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray
from postproc.cell import Cell
from postproc.model import MotionKind, ToolPath
from postproc.process.repeats import repeats
from postproc.units import DEG

ALONG_AXIS = float(np.cos(2.0 * DEG))
"""Cosine to the tool axis from which on a motion is one along it."""

MACHINING_SPEED = 0.25
"""Up to this path speed [m/s] a motion counts as machining where no CAM file tells."""


def back_off(cell: Cell) -> float:
    """Return how far [m] the tool backs off: as far as where a point is approached from."""
    return cell.motion.approach


def in_material(toolpath: ToolPath, cell: Cell) -> BoolArray:
    """Return (n,) tags at which a cut ends in material.

    A cut that itself backs off along the tool axis does not; a repeated point is the first of them.
    """
    kind = np.asarray(toolpath.kind)
    ends = np.isin(kind, (MotionKind.LINEAR, MotionKind.ARC))
    if not ends.any():
        return ends
    way = np.diff(toolpath.points, axis=0, prepend=toolpath.points[:1])
    length = np.linalg.norm(way, axis=1)
    out = np.einsum("ij,ij->i", way, toolpath.axes) >= ALONG_AXIS * length
    ends &= ~(out & (length >= back_off(cell)) & (kind == MotionKind.LINEAR))
    first = np.maximum.accumulate(np.where(repeats(toolpath), 0, np.arange(len(kind))))
    return np.asarray(ends[first])
