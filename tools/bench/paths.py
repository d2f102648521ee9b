"""Toolpaths without a file."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from postproc.model import MotionKind, ToolPath


def bare_path(
    name: str,
    points: npt.NDArray[np.float64],
    axes: npt.ArrayLike,
    *,
    feed: float,
    kind: npt.ArrayLike = MotionKind.LINEAR,
) -> ToolPath:
    """Return a path without tools, operations, arcs and cycles.

    Args:
        name: of the program.
        points: (n, 3) [m].
        axes: (n, 3) or (3,) unit vectors from the tip into the holder.
        feed: [m/s].
        kind: (n,) or one for all.
    """
    n = len(points)
    none = np.full(n, -1)
    return ToolPath(
        path=f"{name}.cls",
        name=name,
        format="apt",
        dialect="nx",
        units="mm",
        points=points,
        axes=np.broadcast_to(np.asarray(axes), (n, 3)),
        kind=np.broadcast_to(np.asarray(kind), (n,)),
        feed=np.full(n, feed),
        line=np.arange(1, n + 1),
        operation=none,
        tool=none,
        arc=none,
        cycle=none,
    )
