"""The reader of G-code: what tells it, and nothing more until a file is read."""

from __future__ import annotations

import re

from postproc.model import ToolPath
from postproc.readers.base import READERS, ReadOptions

_BLOCK = re.compile(
    rb"^[ \t]*/?[ \t]*(?:[NO]\d+[ \t]*)?(?:[GMT]\d|[XYZ][ \t]*[-+.\d])",
    re.MULTILINE | re.IGNORECASE,
)
_CODE = re.compile(rb"^[^(;\n]*\bG0*[0-3]\b|^[ \t]*(?:N\d+)?[ \t]*G0*[0-3][XYZ]", re.M | re.I)
_OTHER = re.compile(rb"^[ \t]*(?:\d+[ \t]+)?BEGIN PGM\b|^%_N_|^;\$PATH=", re.MULTILINE)
"""Heidenhain and Sinumerik programs, which are refused by their names."""


class GcodeReader:
    """Reader of G-code."""

    suffixes = (".nc", ".ngc", ".tap", ".eia", ".mpf")

    def sniff(self, head: bytes) -> float:
        """Return how sure it is by the blocks that begin as G-code does."""
        if _OTHER.search(head):
            return 0.9
        blocks = len(_BLOCK.findall(head))
        return min(1.0, 0.4 + 0.1 * blocks) if blocks and _CODE.search(head) else 0.0

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the toolpath; errors as ``read_file``."""
        from postproc.readers.gcode.file import read_file

        return read_file(path, options)


READERS.register("gcode")(GcodeReader())
