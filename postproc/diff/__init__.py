"""What two programs do differently."""

from postproc.diff.accept import accept
from postproc.diff.diff import Difference, DiffReport, DiffTolerance, diff, diff_files

__all__ = [
    "DiffReport",
    "DiffTolerance",
    "Difference",
    "accept",
    "diff",
    "diff_files",
]
