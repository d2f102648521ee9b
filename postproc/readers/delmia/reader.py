"""The reader of DELMIA's OLP XML: what tells it, and nothing more until a file is read."""

from __future__ import annotations

from postproc.model import ToolPath
from postproc.readers.base import READERS, ReadOptions


class DelmiaReader:
    """Reader of OLP XML."""

    suffixes = (".xml",)

    def sniff(self, head: bytes) -> float:
        """Return 1 for OLPData, little for any other XML."""
        if b"<OLPData" in head:
            return 1.0
        return 0.2 if head.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"<") else 0.0

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the motions of the tasks; errors as ``read_file``."""
        from postproc.readers.delmia.file import read_file

        return read_file(path, options)


READERS.register("delmia")(DelmiaReader())
