"""What two programs do differently."""

from postproc.comparison.diff import DiffReport, diff, diff_files
from postproc.comparison.difference import Difference, DiffTolerance
from postproc.comparison.manifest import about, accept
from postproc.comparison.settings import cam_lines
