"""CSV with the columns of a recording: a header row, ``#`` comments, comma or semicolon or tab."""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from typing import BinaryIO

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import open_input
from postproc.trace.reading import COLUMNS, TRACES, Block, check_columns, numbered
from postproc.trace.recording import BLOCK

LARGEST = 1e12
"""No number of a recording comes near this, whatever its unit; a count of milliseconds may."""
_NUMBER = re.compile(rb"(?:[+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?|nan|NaN|NAN)?")
_EMPTY = re.compile(rb"(?m)(?:(?<=,)|^)[ \t]*(?=,|\r?$)")


class ContractFormat:
    """Plain CSV; a tag is a name, the tool works where there is one."""

    name = "csv"

    def sniff(self, head: bytes, path: Path) -> bool:
        """Return whether the header names the time and a commanded joint."""
        del path
        first = _header(io.BytesIO(head))[0]
        return b"time_s" in first and b"q1_cmd_deg" in first

    def blocks(self, path: Path) -> Iterator[Block]:
        """Yield the known columns; unknown ones are left out."""
        return numbered(_blocks(path))


def _header(stream: BinaryIO) -> tuple[bytes, int]:
    """Return the first line that is no comment, and its number."""
    for number, line in enumerate(stream, 1):
        text = line.lstrip(b"\xef\xbb\xbf").strip()
        if text and not text.startswith(b"#"):
            return text, number
    return b"", 1


def _blocks(path: Path) -> Iterator[Block]:
    with open_input(path) as stream:
        header, number = _header(stream)
        mark = next((m for m in (b",", b";", b"\t") if m in header), b",")
        names = [name.strip().strip('"') for name in header.decode("latin-1").split(mark.decode())]
        check_columns(str(path), names, number)
        known = [name for name in names if name in COLUMNS]
        places = [names.index(name) for name in known if name != "tag"]
        tag = names.index("tag") if "tag" in names else None
        while lines := list(islice(stream, BLOCK)):
            data = b"".join(lines)
            if mark != b",":
                data = data.replace(b",", b".").replace(mark, b",")
            kept = [line for line in data.splitlines() if line.strip() and line[:1] != b"#"]
            if not kept:
                number += len(lines)
                continue
            flags = None
            if tag is not None:
                kept, flags = _tags(kept, tag)
            table = _numbers(path, kept, places, len(names), number, lines)
            number += len(lines)
            block = dict(zip([n for n in known if n != "tag"], table.T, strict=True))
            if flags is not None:
                block["tag"] = flags
            yield block


def _tags(lines: list[bytes], place: int) -> tuple[list[bytes], FloatArray]:
    """Return the lines with their tag left empty, and 1 where there was one."""
    cut, flags = [], np.zeros(len(lines))
    for row, line in enumerate(lines):
        cells = line.split(b",")
        if place < len(cells):
            flags[row] = float(cells[place].strip().strip(b'"') not in (b"", b"-1", b"nan"))
            cells[place] = b""
        cut.append(b",".join(cells))
    return cut, flags


def _numbers(
    path: Path, kept: list[bytes], places: list[int], width: int, before: int, lines: list[bytes]
) -> FloatArray:
    """Return the cells of some columns as numbers (k, c); TRC003 names the first that is none."""
    text = b"\n".join(kept)
    if b",," in text or text.startswith(b",") or b"\n," in text or b",\n" in text + b"\n":
        text = _EMPTY.sub(b"nan", text)
    try:
        table = np.loadtxt(io.BytesIO(text), delimiter=",", usecols=places, ndmin=2, comments="#")
    except ValueError:
        raise _fault(path, places, width, before, lines) from None
    if (np.abs(table) > LARGEST).any():
        raise _fault(path, places, width, before, lines)
    return table


def _fault(path: Path, places: list[int], width: int, before: int, lines: list[bytes]) -> DataError:
    """Return what is wrong with the first faulty line of a block."""
    mark = b"," if any(line.count(b",") >= width - 1 for line in lines) else b";"
    for number, line in enumerate(lines, before + 1):
        cells = line.strip(b"\r\n").split(mark)
        if not line.strip() or line.startswith(b"#"):
            continue
        place = SourceRef(str(path), number)
        if len(cells) != width:
            text = f"{len(cells)} cells, expected {width} as in the header"
            return DataError("TRC003", text, place)
        for at in places:
            cell = cells[at].strip().replace(b",", b".")
            if not _NUMBER.fullmatch(cell) or abs(float(cell or b"nan")) > LARGEST:
                shown = cell.decode("latin-1")[:40]
                return DataError("TRC003", f"{shown!r} is no number of a recording", place)
    return DataError("TRC003", "not readable as numbers", SourceRef(str(path), before + 1))


TRACES.register("csv")(ContractFormat())
