"""A reader: lines ``PROBE x y z`` in mm, touched from above at 300 mm/min.

What a reader owes: SI units, a source line for every tag, one clear error with file and line, and
an honest ``sniff``. ``postproc.testing.check_reader`` holds it to that.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from postproc.errors import ReadError, SourceRef
from postproc.files import read_bytes
from postproc.model import MotionKind, ToolPath
from postproc.readers import ReadOptions
from postproc.units import MM, MM_PER_MIN

FEED = 300.0 * MM_PER_MIN


class ProbeReader:
    """Reads touch points."""

    suffixes = (".probe",)

    def sniff(self, head: bytes) -> float:
        """Return how sure the reader is from the first bytes of the file."""
        return 1.0 if head.lstrip().startswith(b"PROBE ") else 0.0

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the toolpath.

        Raises:
            ReadError: PRB001 for a line that is not ``PROBE x y z``.
        """
        del options
        points, lines = [], []
        content = read_bytes(path).decode("ascii", errors="replace")
        for number, text in enumerate(content.splitlines(), 1):
            if text.strip():
                points.append(_point(path, number, text))
                lines.append(number)
        n = len(points)
        none = np.full(n, -1)
        return ToolPath(
            path=path,
            name=Path(path).stem,
            format="probe",
            dialect="probe",
            units="mm",
            points=np.array(points).reshape(-1, 3) * MM,
            axes=np.tile([0.0, 0.0, 1.0], (n, 1)),
            kind=np.full(n, MotionKind.LINEAR),
            feed=np.full(n, FEED),
            line=np.array(lines),
            operation=none,
            tool=none,
            arc=none,
            cycle=none,
        )


def _point(path: str, number: int, text: str) -> list[float]:
    try:
        word, *values = text.split()
        x, y, z = (float(value) for value in values)
    except ValueError:
        word, x, y, z = "", 0.0, 0.0, 0.0
    if word != "PROBE":
        place = SourceRef(path, number, text.strip())
        raise ReadError("PRB001", "expected PROBE x y z", place)
    return [x, y, z]


PROBE = ProbeReader()
