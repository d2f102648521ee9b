"""The order of a toolpath: which holes may be drilled in any order, and tags put in another one."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

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
        )
    for event in toolpath.events:
        parted[event.index] = True
    pairs = itertools.pairwise(np.nonzero(parted)[0].tolist())
    return [(low, high) for low, high in pairs if hole[low] and high - low > 1]


def reordered(toolpath: ToolPath, order: NDArray[np.int32] | NDArray[np.int64]) -> ToolPath:
    """Return the toolpath with its tags (n,) in another order; events stay at their place."""
    columns = ("points", "axes", "kind", "feed", "line", "operation", "tool", "arc", "cycle")
    changes: dict[str, object] = {name: getattr(toolpath, name)[order] for name in columns}
    for name in ("rotations", "joints"):
        value = getattr(toolpath, name)
        if value is not None:
            changes[name] = value[order]
    changes["extra"] = {
        name: [values[tag] for tag in order.tolist()] if len(values) == len(order) else values
        for name, values in toolpath.extra.items()
    }
    names = [toolpath.tag_name(tag) for tag in order.tolist()]
    return replace(toolpath, names=tuple(names), **changes)  # type: ignore[arg-type]
