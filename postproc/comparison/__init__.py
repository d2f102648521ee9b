"""What two programs do differently."""

from postproc.comparison.accept import accept
from postproc.comparison.diff import DiffReport, diff, diff_files
from postproc.comparison.difference import Difference, DiffTolerance

__all__ = [
    "DiffReport",
    "DiffTolerance",
    "Difference",
    "accept",
    "diff",
    "diff_files",
]
