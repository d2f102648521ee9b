"""APT/CL text in blocks of whole statements, so that memory does not grow with the file."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from postproc.errors import ReadError, SourceRef
from postproc.files import open_input
from postproc.readers.base import LONGEST_LINE, check_text

BLOCK_BYTES = 1 << 22
_BOM = b"\xef\xbb\xbf"


@dataclass(frozen=True, slots=True)
class TextBlock:
    """Whole lines, each ended by a line feed; ``first_line`` is the number of the first one."""

    data: bytes
    first_line: int


def text_blocks(path: str) -> Iterator[TextBlock]:
    """Yield the lines of a file in blocks that end between two statements.

    CR LF stays as it is (the CR counts as a blank); files with CR alone are translated.

    Raises:
        ReadError: IO001, IO002; IO012 if it is no text; IO015 if a line is too long.
    """
    line = 1
    rest = b""
    with open_input(path) as stream:
        while chunk := stream.read(BLOCK_BYTES):
            check_text(path, chunk, line)
            if line == 1 and not rest:
                chunk = chunk.removeprefix(_BOM)
            data = rest + _line_feeds(chunk)
            cut = _cut(data)
            if len(data) - cut > BLOCK_BYTES // 2 or cut == 0:
                _check_length(path, data, line)
            if cut:
                yield TextBlock(data[:cut], line)
                line += data.count(b"\n", 0, cut)
            rest = data[cut:]
    if rest.strip():
        _check_length(path, rest, line)
        yield TextBlock(rest if rest.endswith(b"\n") else rest + b"\n", line)


def _line_feeds(chunk: bytes) -> bytes:
    """Translate the line ends of files that have carriage returns only."""
    return chunk.replace(b"\r", b"\n") if b"\n" not in chunk else chunk


def _cut(data: bytes) -> int:
    """Return where the last statement that is surely whole ends."""
    cut = data.rfind(b"\n") + 1
    while cut:
        previous = data.rfind(b"\n", 0, cut - 1) + 1
        if not is_continued(data[previous:cut]):
            break
        cut = previous
    return cut


def is_continued(line: bytes) -> bool:
    """Return whether a single ``$`` asks for the next line to be appended."""
    text = line.strip()
    if text.startswith(b"$$"):
        return text.startswith(b"$$->") and text.endswith(b"$")
    at = text.find(b"$")
    return at >= 0 and text[at : at + 2] != b"$$"


def _check_length(path: str, data: bytes, line: int) -> None:
    end = data.find(b"\n")
    if (end if end >= 0 else len(data)) > LONGEST_LINE:
        raise ReadError(
            "IO015",
            f"a line of more than {LONGEST_LINE} characters, expected one statement a line",
            SourceRef(path, line),
        )
