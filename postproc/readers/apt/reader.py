"""The reader of APT and CL files: what tells them, and nothing more until one is read."""

from __future__ import annotations

import re

from postproc.model import ToolPath
from postproc.readers.base import READERS, ReadOptions

_SNIFFED = re.compile(
    rb"^[ \t]*(GOTO|CIRCLE|FEDRAT|RAPID|TOOL PATH|PARTNO|UNITS?|LOADTL|TLAXIS|CUTTER|SPINDL"
    rb"|\$\$\*|\$\$->)[ \t]*(/|\r?$)",
    re.MULTILINE | re.IGNORECASE,
)


class AptReader:
    """Reader of APT and CL data."""

    suffixes = (".apt", ".aptsource", ".cl", ".cls", ".clsf", ".clt", ".ncl")

    def sniff(self, head: bytes) -> float:
        """Return how many of the first lines begin with an APT word."""
        found = len(_SNIFFED.findall(head))
        return min(1.0, 0.4 + 0.1 * found) if found else 0.0

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the toolpath of a CL file; errors as ``read_file``."""
        from postproc.readers.apt.file import read_file

        return read_file(path, options)


READERS.register("apt")(AptReader())
