"""Where statements of APT/CL text end: a single ``$`` asks for the next line."""

from __future__ import annotations

from collections.abc import Iterator

from postproc.readers.text import TextBlock, last_line_end, text_blocks


def statement_blocks(path: str) -> Iterator[TextBlock]:
    """Yield the lines of a file in blocks that end between two statements."""
    return text_blocks(path, _cut)


def _cut(data: bytes) -> int:
    """Return where the last statement that is surely whole ends."""
    end = last_line_end(data)
    while end:
        previous = data.rfind(b"\n", 0, end - 1) + 1
        if not is_continued(data[previous:end]):
            break
        end = previous
    return end


def is_continued(line: bytes) -> bool:
    """Return whether a single ``$`` asks for the next line to be appended."""
    text = line.strip()
    if text.startswith(b"$$"):
        return text.startswith(b"$$->") and text.endswith(b"$")
    at = text.find(b"$")
    return at >= 0 and text[at : at + 2] != b"$$"
