"""Text files in blocks of whole lines, so that memory does not grow with the file."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from postproc.errors import ReadError, SourceRef
from postproc.files import open_input
from postproc.records import dataclass

BLOCK_BYTES = 1 << 22
LONGEST_LINE = 1 << 16
"""No statement or row of a real file comes near this many bytes, continued or not."""
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class TextBlock:
    """Whole lines, each ended by a line feed; ``first_line`` is the number of the first one."""

    data: bytes
    first_line: int


def last_line_end(data: bytes) -> int:
    """Return where the last whole line ends."""
    return data.rfind(b"\n") + 1


def text_blocks(path: str, cut: Callable[[bytes], int] = last_line_end) -> Iterator[TextBlock]:
    """Yield the lines of a file in blocks; ``cut`` tells where the last whole unit of data ends.

    CR LF stays as it is (the CR counts as a blank); files with CR alone are translated.
    """
    line = 1
    rest = b""
    with open_input(path) as stream:
        while chunk := stream.read(BLOCK_BYTES):
            check_text(path, chunk, line)
            if line == 1 and not rest:
                chunk = chunk.removeprefix(_BOM)
            data = rest + line_feeds(chunk)
            end = cut(data)
            check_line_length(path, len(data) - end, line + data.count(b"\n", 0, end))
            if end:
                yield TextBlock(data[:end], line)
                line += data.count(b"\n", 0, end)
            rest = data[end:]
    if rest.strip():
        yield TextBlock(rest if rest.endswith(b"\n") else rest + b"\n", line)


def line_feeds(chunk: bytes) -> bytes:
    """Translate the line ends of files that have carriage returns only."""
    return chunk.replace(b"\r", b"\n") if b"\n" not in chunk else chunk


def check_line_length(path: str, length: int, line: int) -> None:
    """Raise ReadError IO015 for a line or statement of more characters than any real one has."""
    if length > LONGEST_LINE:
        text = (
            f"a line of more than {LONGEST_LINE} characters, with those that continue it, "
            "expected one statement or row a line"
        )
        raise ReadError("IO015", text, SourceRef(path, line))


AS_CSV = "in Excel or LibreOffice: Save As, type CSV (UTF-8)"


_ZIP, _OLE = b"PK\3\4", b"\xd0\xcf\x11\xe0"
"""How packed files and files of old Office programs begin."""


def check_text(path: str, data: bytes, first_line: int) -> None:
    """Raise ReadError IO012 if ``data``, which begins at ``first_line``, is no text."""
    at = data.find(b"\0")
    packed = first_line == 1 and data[:4] in (_ZIP, _OLE)
    if at < 0 and not packed:
        return
    line = first_line + data.count(b"\n", 0, max(at, 0))
    if data[:2] in (b"\xff\xfe", b"\xfe\xff"):
        message = "UTF-16 text, expected ASCII, Latin-1 or UTF-8; save the file in one of these"
    elif not packed:
        message = "NUL byte, so this is a binary or damaged file; expected text"
    elif data[:4] == _OLE:
        message = f"an old Excel workbook (.xls) or another Office file, expected text; {AS_CSV}"
    elif b"vnd.oasis" in data[:200]:
        message = f"a LibreOffice sheet (.ods), expected text; {AS_CSV}"
    else:
        message = f"an Excel workbook (.xlsx) or ZIP archive, expected text; {AS_CSV}"
    raise ReadError("IO012", message, SourceRef(path, line))
