"""Pins from a file: tags whose spin about the tool axis is given, as CSV ``tag,spin_deg``.

UTF-8, comma, header row, ``#`` comment lines. ``tag`` is the name of a tag as messages print it:
the id of the input, else its index from 0.
"""

from __future__ import annotations

import csv
import math
from pathlib import Path

from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes, text_of
from postproc.records import dataclass

HEADER = ("tag", "spin_deg")
_LARGEST = 360.0


@dataclass(frozen=True, slots=True)
class Pin:
    """A tag's name, its spin about the tool axis [deg], and the line that says so."""

    tag: str
    spin_deg: float
    source: SourceRef


def read_pins(path: str | Path) -> tuple[Pin, ...]:
    """Read a file of pins; errors are ``DataError`` with a ``PIN`` code."""
    text = text_of(read_bytes(path), path, "PIN001")
    pins: dict[str, Pin] = {}
    header_seen = False
    for number, row in enumerate(text.splitlines(), start=1):
        if not row.strip() or row.lstrip().startswith("#"):
            continue
        cells = [cell.strip() for cell in next(csv.reader([row], skipinitialspace=True))]
        source = SourceRef(str(path), number, row)
        if not header_seen:
            if tuple(cells) != HEADER:
                raise DataError("PIN002", f"header {row[:40]!r}, expected tag,spin_deg", source)
            header_seen = True
            continue
        pin = _pin(cells, source)
        if pin.tag in pins:
            first = pins[pin.tag].source.line
            raise DataError("PIN005", f"tag {pin.tag} is pinned in line {first} already", source)
        pins[pin.tag] = pin
    if not pins:
        what = "no pin behind the header" if header_seen else "empty, expected tag,spin_deg"
        raise DataError("PIN006", what, SourceRef(str(path)))
    return tuple(pins.values())


def _pin(cells: list[str], source: SourceRef) -> Pin:
    if len(cells) != len(HEADER) or not cells[0]:
        raise DataError("PIN003", f"{source.text[:40]!r}, expected a tag and its turn", source)
    try:
        value = float(cells[1])
    except ValueError:
        value = math.nan
    if not abs(value) <= _LARGEST:
        text = f"spin_deg is {cells[1][:40]!r}, expected a number from -360 to 360"
        raise DataError("PIN004", text, source)
    return Pin(cells[0], value, source)
