"""The program text beside the plan: for every move its line, and where the text itself goes."""

from __future__ import annotations

from postproc.arrays import FloatArray, IntArray
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class ProgramText:
    """Motions of a program in the order in which they are run.

    Args:
        files: names of the files in which motions stand.
        texts: whole text per file, plain line ends.
        file: (m,) row of ``files``; line: (m,) 1-based line.
        point: (m, 3) TCP at the end of each motion as the text says it, workpiece frame [m].
    """

    files: tuple[str, ...]
    texts: tuple[str, ...]
    file: IntArray
    line: IntArray
    point: FloatArray

    def __len__(self) -> int:
        """Return the number of motions."""
        return len(self.line)
