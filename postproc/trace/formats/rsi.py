"""Telegrams of RobotSensorInterface, as a receiver logged them: one XML element for each cycle.

``ASPos`` and ``AIPos`` are set and actual axis angles [deg], ``IPOC`` the cycle stamp [ms]: the
clock. The receiver's own stamps jitter and are not read. Under a correction the set-point does not
contain it; what is then called a gap may be wanted.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import open_input
from postproc.trace.reading import ACTUAL, COMMAND, CURRENT, TRACES, Block, numbered
from postproc.trace.recording import BLOCK
from postproc.units import MS

_CHUNK = 1 << 22
_END = re.compile(rb"</Rob\s*>")
_STAMP = re.compile(rb"<IPOC>\s*(\d+)\s*</IPOC>")
_VALUE = re.compile(rb'\bA([1-6])\s*=\s*"([^"]*)"')
_ELEMENTS = {"ASPos": COMMAND, "AIPos": ACTUAL, "MACur": CURRENT}


class RsiFormat:
    """A log of telegrams ``<Rob ...> ... </Rob>``."""

    name = "rsi"

    def sniff(self, head: bytes, path: Path) -> bool:
        """Return whether telegrams with a stamp stand at the beginning."""
        del path
        return b"<Rob" in head and b"IPOC" in head

    def blocks(self, path: Path) -> Iterator[Block]:
        """Yield the angles by the stamps of the cycles."""
        return numbered(_blocks(path))


def _blocks(path: Path) -> Iterator[Block]:
    rows: list[FloatArray] = []
    names = ("time_s", *COMMAND, *ACTUAL, *CURRENT)
    for number, telegram in _telegrams(path):
        rows.append(_row(path, number, telegram))
        if len(rows) == BLOCK:
            yield dict(zip(names, np.array(rows).T, strict=True))
            rows = []
    if rows:
        yield dict(zip(names, np.array(rows).T, strict=True))


def _telegrams(path: Path) -> Iterator[tuple[int, bytes]]:
    """Yield the line at which each telegram ends, and its text."""
    line, rest = 1, b""
    with open_input(path) as stream:
        while data := stream.read(_CHUNK):
            *whole, rest = _END.split(rest + data)
            for telegram in whole:
                line += telegram.count(b"\n")
                yield line, telegram


def _row(path: Path, line: int, telegram: bytes) -> FloatArray:
    """Return stamp [s], set, actual [deg] and currents [A], NaN where not sent."""
    row = np.full(1 + 18, np.nan)
    stamp = _STAMP.search(telegram)
    if stamp is None:
        raise DataError("TRC003", "a telegram without IPOC", SourceRef(str(path), line))
    row[0] = float(stamp[1]) * MS
    for place, element in enumerate(_ELEMENTS):
        found = re.search(rb"<" + element.encode() + rb"\b([^>]*)>", telegram)
        for axis, value in _VALUE.findall(found[1] if found else b""):
            try:
                row[1 + 6 * place + int(axis) - 1] = float(value)
            except ValueError:
                text = f"{value.decode('latin-1')[:40]!r} is no number"
                raise DataError("TRC003", text, SourceRef(str(path), line)) from None
    return row


TRACES.register("rsi")(RsiFormat())
