"""What two programs do differently."""

from postproc.comparison.accept import accept
from postproc.comparison.diff import Difference, DiffReport, DiffTolerance, diff, diff_files

__all__ = [
    "DiffReport",
    "DiffTolerance",
    "Difference",
    "accept",
    "diff",
    "diff_files",
]
