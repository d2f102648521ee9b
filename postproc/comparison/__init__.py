"""What two programs do differently."""

from postproc.comparison.diff import DiffReport, diff, diff_files
from postproc.comparison.difference import Difference, DiffTolerance
from postproc.comparison.manifest import accept

__all__ = [
    "DiffReport",
    "DiffTolerance",
    "Difference",
    "accept",
    "diff",
    "diff_files",
]
