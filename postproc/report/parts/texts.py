"""Lines of the CAM file and of programs, as pages embed them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from postproc.files import read_bytes

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
