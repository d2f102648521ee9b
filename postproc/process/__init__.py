"""What the process asks of planning and verification alike: order of holes, points served, tilt."""

from postproc.process.order import hole_runs, reordered
from postproc.process.pointlist import as_served
from postproc.process.tilt import PLUNGING, SHARPEST

__all__ = [
    "PLUNGING",
    "SHARPEST",
    "as_served",
    "hole_runs",
    "reordered",
]
