"""The bytes of a KRL file: decoded to lines, with the facts that only the bytes tell.

Controllers write ASCII or Windows-1252 with CR LF; a file that was edited elsewhere may be UTF-8,
may carry a byte order mark, bare line feeds or, in comments, what an editor made of letters of
another code page. Those are facts for lint, not reasons to refuse. What cannot be text at all (NUL
bytes, control characters in code, endless lines) is one clear error.
"""

from __future__ import annotations

import re

from postproc.errors import KrlError, SourceRef
from postproc.records import dataclass

MAX_BYTES = 256 * 1024 * 1024
"""No controller holds more than a few megabytes; beyond this it is another kind of file."""
MAX_LINE = 20_000
"""Longest line that is read; the longest seen on controllers has 1,248 characters."""
LONG_LINE = 250
"""Lines from this length on are facts for lint."""

_CONTROL = re.compile(rb"[\x00-\x08\x0b\x0e-\x19\x1b-\x1f\x7f]")
_MARKS = {b"\xff\xfe": "UTF-16", b"\xfe\xff": "UTF-16", b"PK": "a zip archive"}
_FACTS_AT_MOST = 20


@dataclass(frozen=True, slots=True)
class TextFacts:
    """How a file is written.

    Args:
        path: as given by the caller.
        size: bytes; lines: number of lines.
        crlf, lf: line ends of each kind (a bare CR counts as LF).
        has_bom: whether a UTF-8 byte order mark stands in front.
        ends_with_newline: whether the last line is closed.
        long_lines: (line, length) of lines of ``LONG_LINE`` characters and more, the first few.
        non_ascii: (line, whether it stands behind a ``;``), the first few.
    """

    path: str
    size: int
    lines: int
    crlf: int
    lf: int
    has_bom: bool
    ends_with_newline: bool
    long_lines: tuple[tuple[int, int], ...] = ()
    non_ascii: tuple[tuple[int, bool], ...] = ()


def decode(data: bytes, path: str) -> tuple[list[str], TextFacts]:
    """Return the lines of a KRL file (without line ends) and the facts of its writing."""
    _refuse_binary(data, path)
    has_bom = data.startswith(b"\xef\xbb\xbf")
    body = data[3:] if has_bom else data
    crlf = body.count(b"\r\n")
    # A DOS end-of-file mark may close a file; it is no text.
    body = body.rstrip(b"\x1a")
    text = text_of(body).replace("\r\n", "\n").replace("\r", "\n")
    lines = text.split("\n")
    closed = lines[-1] == ""
    if closed:
        lines.pop()
    long_lines: tuple[tuple[int, int], ...] = ()
    if max(map(len, lines), default=0) >= LONG_LINE:
        long_lines = tuple(
            (number, len(line)) for number, line in enumerate(lines, 1) if len(line) >= LONG_LINE
        )
    if long_lines and max(length for _, length in long_lines) > MAX_LINE:
        worst = max(long_lines, key=lambda item: item[1])
        message = f"a line of {worst[1]} characters, expected KRL text (at most {MAX_LINE})"
        raise KrlError("KRL001", message, SourceRef(path, worst[0]))
    facts = TextFacts(
        path=path,
        size=len(data),
        lines=len(lines),
        crlf=crlf,
        lf=max(len(lines) - (0 if closed else 1) - crlf, 0),
        has_bom=has_bom,
        ends_with_newline=closed,
        long_lines=long_lines[:_FACTS_AT_MOST],
        non_ascii=_non_ascii(lines) if not data.isascii() else (),
    )
    return lines, facts


def check_size(size: int, path: str) -> None:
    """Refuse a file by its size, before it is read."""
    if size > MAX_BYTES:
        text = f"{size} bytes is no robot program, expected at most {MAX_BYTES}"
        raise KrlError("KRL003", text, SourceRef(path))


def _refuse_binary(data: bytes, path: str) -> None:
    check_size(len(data), path)
    if not data.strip(b" \t\r\n\x1a"):
        raise KrlError("KRL002", "the file is empty, expected a KRL program", SourceRef(path))
    for mark, name in _MARKS.items():
        if data.startswith(mark):
            raise KrlError("KRL001", f"this is {name}, expected plain KRL text", SourceRef(path))
    found = next(filter(_is_code, _CONTROL.finditer(data.rstrip(b"\x1a"))), None)
    if found:
        line = data.count(b"\n", 0, found.start()) + 1
        text = f"byte 0x{found.group()[0]:02X}: a binary file, expected KRL text"
        raise KrlError("KRL001", text, SourceRef(path, line))


def _is_code(found: re.Match[bytes]) -> bool:
    """Whether a control character stands where a controller reads it: not in a comment."""
    begin = found.string.rfind(b"\n", 0, found.start()) + 1
    return found.group() == b"\0" or b";" not in found.string[begin : found.start()]


def text_of(data: bytes) -> str:
    """Return text of a controller: UTF-8 where it is, else the code page of Western Windows."""
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace")


def _non_ascii(lines: list[str]) -> tuple[tuple[int, bool], ...]:
    found = []
    for number, line in enumerate(lines, 1):
        if not line.isascii():
            code, _, _ = line.partition(";")
            found.append((number, code.isascii()))
    return tuple(found[:_FACTS_AT_MOST])
