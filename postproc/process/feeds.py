"""The feed that each tag asks for."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity, SourceRef
from postproc.model import WORKING, MotionKind, ToolPath
from postproc.units import MM_PER_MIN

AXIS_SHARE = 0.95 * 0.98
"""Share of an axis's speed that a feed may need; a higher feed is lowered to it. The rest is for
what samples of the way miss, and for the digits of the text."""
LEAST_SHARE = 0.1
"""Where the real tool would leave the path of a cut the feed is lowered to this share at least."""
LOWERED_FROM = 0.88
"""A feed is rightly lowered if it would need more than this share: whoever judges a program samples
it elsewhere than whoever made it, and reads rounded points."""
LOWERED_TO = 0.78
"""A lowered feed still needs this share at least, by the same reason and as lowered feeds are
rounded down by up to 9 %; else it is too low."""


def feeds_of(toolpath: ToolPath, cell: Cell) -> FloatArray:
    """Return the feed (n,) [m/s] of each tag: its cycle's, its own, the cell's; NaN without."""
    feed = np.asarray(toolpath.feed)
    feed = np.where(np.isfinite(feed), feed, cell.motion.feed)
    own = np.array([*(cycle.feed for cycle in toolpath.cycles), np.nan])
    cycle = own[np.asarray(toolpath.cycle)]
    is_hole = np.asarray(toolpath.kind) == MotionKind.HOLE
    return np.where(is_hole & np.isfinite(cycle), cycle, feed)


def assumptions(toolpath: ToolPath, cell: Cell) -> tuple[str, ...]:
    """Return in words what is taken where the file says nothing: units, and the cell's feed."""
    assumed = toolpath.assumed
    is_list = toolpath.format == "csv" and toolpath.rotations is None
    if is_list and not any(base.meshes for base in cell.bases):
        assumed = (*assumed, "normals from the tip of the tool to its holder")
    own = np.array([*(cycle.feed for cycle in toolpath.cycles), np.nan])
    silent = np.isnan(toolpath.feed) & np.isnan(own[np.asarray(toolpath.cycle)])
    if not (silent & np.isin(toolpath.kind, WORKING)).any() or np.isnan(cell.motion.feed):
        return assumed
    feed = f"feed {cell.motion.feed / MM_PER_MIN:g} mm/min of the cell where the file gives none"
    return (*assumed, feed)


def least_feeds(toolpath: ToolPath, cell: Cell) -> FloatArray:
    """Return the lowest feed (n,) [m/s] that the process takes at each tag, 0 where any will do."""
    least = np.nan_to_num(cell.process.least_feed * feeds_of(toolpath, cell))
    return np.where(np.isin(toolpath.kind, WORKING), least, 0.0)


def feed_findings(toolpath: ToolPath, cell: Cell) -> list[Finding]:
    """Return one error (PRC003) for each feed that no program may ask for, at its first tag."""
    most = cell.krl.path_speed_max
    feed = np.where(np.isin(toolpath.kind, WORKING), feeds_of(toolpath, cell), np.nan)
    found = []
    for asked in np.unique(feed[feed > most * (1.0 + 1e-9)]).tolist():
        rows = np.flatnonzero(feed == asked)
        text = f"a feed of {asked:g} m/s at {len(rows)} tags, expected at most {most:g} m/s"
        source = SourceRef(toolpath.path, int(toolpath.line[rows[0]]))
        hint = "lower the feed in the CAM system; krl.path_speed_max_m_s sets this limit"
        found.append(Finding(Severity.ERROR, "PRC003", text, int(rows[0]), source, hint=hint))
    return found
