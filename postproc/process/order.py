"""The order of a toolpath: which holes may be drilled in any order, and tags put in another one."""

from __future__ import annotations

import itertools

import numpy as np

from postproc.arrays import AnyIntArray
from postproc.model import MotionKind, ToolPath


def hole_runs(toolpath: ToolPath) -> list[tuple[int, int]]:
    """Return stretches [low, high) of two or more holes whose order nothing but the file binds.

    They are of one operation and tool, and no event stands between them.
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
    pairs = itertools.pairwise(np.nonzero(parted)[0].tolist())
    return [(low, high) for low, high in pairs if hole[low] and high - low > 1]


def reordered(toolpath: ToolPath, order: AnyIntArray) -> ToolPath:
    """Return the toolpath with its tags (n,) in another order, each with the name it had."""
    return toolpath.named().rows(order)
