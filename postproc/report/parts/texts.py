"""Texts of CAM file and program, as pages embed them, and the line of every move in them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.files import read_bytes
from postproc.records import dataclass

if TYPE_CHECKING:
    from postproc.model import ToolPath

_CONTEXT = 2
"""Lines of the CAM file shown around that of a tag."""
_WIDEST = 200


def cam_lines(toolpath: ToolPath) -> str:
    """Return the lines at and around all tags as ``NUMBER<tab>TEXT`` lines."""
    cam = read_bytes(toolpath.path).decode("latin-1").splitlines()
    wanted = np.unique(toolpath.line[:, None] + np.arange(-_CONTEXT, _CONTEXT + 1))
    shown = [int(i) for i in wanted if 0 < i <= len(cam)]
    return "\n".join(f"{i}\t{cam[i - 1].rstrip()[:_WIDEST]}" for i in shown)


def unix_text(content: bytes) -> str:
    """Return a program text with plain line ends."""
    return "\n".join(content.decode("latin-1").splitlines())


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
