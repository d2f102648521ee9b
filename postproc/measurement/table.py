"""Tables of numbers as text: read, and made to be filled in.

UTF-8, header row, ``#`` comment lines, columns in any order. Commas separate columns; where the
header has none, semicolons or tabs do, and decimals may have a comma: all of them or none.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes, text_of
from postproc.measurement.columns import LABELS
from postproc.records import dataclass

LARGEST = 1e15
"""No reading in any unit of the columns comes near this."""
_DECIMAL = re.compile(r"\s*[+-]?\d*[.,]\d+([eE][+-]?\d+)?\s*")


@dataclass(frozen=True, slots=True)
class Table:
    """Cells by column, and the source line of each row."""

    path: str
    header_line: int
    columns: dict[str, Sequence[str]]
    line: list[int]

    def error(self, code: str, message: str, row: int | None = None, hint: str = "") -> DataError:
        """Return an error at a row, or at the header."""
        line = self.header_line if row is None else self.line[row]
        return DataError(code, message, SourceRef(self.path, line), hint)


def read_table(path: str | Path) -> Table:
    """Read a table.

    Raises:
        DataError: MEA001 not text, MEA002 no rows, MEA003 a column twice, MEA005 wrong number of
            cells, MEA006 decimals with a point and with a comma.
        ReadError: IO001, IO002.
    """
    text = text_of(read_bytes(path), path, "MEA001")
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise DataError("MEA001", "not a text file", SourceRef(str(path), line))
    rows, lines, separator = _cells(text)
    if len(rows) < 2:
        raise DataError(
            "MEA002",
            "no measurements, expected a header row and at least one row of numbers",
            SourceRef(str(path), lines[0] if lines else 1),
        )
    header = [name.strip() for name in rows[0]]
    table = Table(str(path), lines[0], {}, lines[1:])
    for row, cells in enumerate(rows[1:]):
        if len(cells) != len(header):
            raise table.error(
                "MEA005", f"{len(cells)} cells, expected {len(header)} as in the header", row
            )
    for index, name in enumerate(header):
        if name in table.columns:
            raise table.error("MEA003", f"column {name!r} appears twice")
        if name:
            table.columns[name] = [cells[index] for cells in rows[1:]]
    if separator != ",":
        _decimals_by_point(table)
    return table


def _decimals_by_point(table: Table) -> None:
    """Write the decimals of a file with a point, where all of them have a comma."""
    columns = {n: cells for n, cells in table.columns.items() if n not in ("id", *LABELS)}
    found = {
        mark: (row, name, cell)
        for name, cells in columns.items()
        for row, cell in enumerate(cells)
        for mark in ",."
        if mark in cell and _DECIMAL.fullmatch(cell)
    }
    if len(found) > 1:
        (_, of_comma, comma), (row, of_point, point) = found[","], found["."]
        raise table.error(
            "MEA006",
            f"{of_point} is {point.strip()} and {of_comma} is {comma.strip()}: decimals with a "
            "point and with a comma",
            row,
            hint="write all decimals of the file alike",
        )
    if "," in found:
        for name, cells in columns.items():
            table.columns[name] = [
                cell.replace(",", ".") if _DECIMAL.fullmatch(cell) else cell for cell in cells
            ]


def _cells(text: str) -> tuple[list[list[str]], list[int], str]:
    """Return rows of cells, their lines, and what separates the cells."""
    rows: list[list[str]] = []
    separator = ""
    lines: list[int] = []
    quoted = '"' in text
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip(" \r")  # a tab may stand between cells
        if not content.strip() or content.startswith("#"):
            continue
        if not separator:
            separator = next((mark for mark in ",;\t" if mark in content), ",")
        rows.append(
            next(csv.reader([content], delimiter=separator, skipinitialspace=True))
            if quoted
            else content.split(separator)
        )
        lines.append(number)
    return rows, lines, separator


def numbers(table: Table, name: str) -> FloatArray:
    """Return a column as numbers; an empty cell is NaN."""
    values = _parsed(table, name)
    bad = np.flatnonzero(np.isfinite(values) & (np.abs(values) > LARGEST))
    if len(bad):
        row = int(bad[0])
        text = table.columns[name][row].strip()[:40]
        raise table.error("MEA006", f"{name} is {text}, expected at most {LARGEST:g}", row)
    return values


def _parsed(table: Table, name: str) -> FloatArray:
    cells = table.columns[name]
    is_plain = not any("_" in cell for cell in cells)  # digits of a program, not of a file
    try:
        if is_plain:
            return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            continue
        try:
            values[row] = float("none" if "_" in text else text)
        except ValueError:
            raise table.error(
                "MEA006", f"{name} is {text[:40]!r}, expected a number", row
            ) from None
    return values


def finite(table: Table, name: str) -> FloatArray:
    """Return a column as numbers, every cell of it filled in."""
    values = numbers(table, name)
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        row = int(bad[0])
        shown = table.columns[name][row].strip() or "empty"
        raise table.error("MEA007", f"{name} is {shown}, expected a finite number", row)
    return values


def cells(names: Sequence[str], values: FloatArray, digits: int) -> dict[str, str]:
    """Return the cells of numbers (k,) under their names; -0 is 0."""
    return {name: f"{v:z.{digits}f}" for name, v in zip(names, values, strict=True)}


def table_to_fill_in(notes: Sequence[str], rows: Sequence[Mapping[str, str]]) -> bytes:
    """Return the CSV of rows with the same columns, below notes as comment lines."""
    lines = [
        *(f"# {note}" for note in notes),
        ",".join(rows[0]),
        *(",".join(row.values()) for row in rows),
    ]
    return ("\n".join(lines) + "\n").encode()
