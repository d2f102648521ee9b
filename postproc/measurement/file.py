"""Measurement CSV: commanded joints and measured tool points, with what was logged beside them.

UTF-8, comma, header row, ``#`` comment lines, columns in any order. Unknown columns are kept as
conditions that may explain a gap: numbers where every cell is one, else labels.
"""

from __future__ import annotations

import csv
import difflib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError, SourceRef
from postproc.files import read_bytes
from postproc.measurement.rows import MeasurementSet
from postproc.units import DEG, MM

JOINTS = tuple(f"q{i}_deg" for i in range(1, 7))
POSITION = ("x_mm", "y_mm", "z_mm")
ORIENTATION = ("a_deg", "b_deg", "c_deg")
DIRECTION = tuple(f"dir{i}" for i in range(1, 7))
SPEED = tuple(f"qd{i}_deg_s" for i in range(1, 7))
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
EXPECTED = ("expected_x_mm", "expected_y_mm", "expected_z_mm")
PLANNED = (*EXPECTED, "why")
"""Columns of a table to fill in that say what was planned: not measured, no conditions."""
KNOWN = (
    *("id", "group", "time_s", "temp_C"),
    *(*JOINTS, *POSITION, *ORIENTATION, *DIRECTION, *SPEED, *WRENCH),
    *PLANNED,
)
_LARGEST = {"deg": 7200.0, "mm": 1e6}
"""No reading is beyond these; a value that is has another unit or a lost decimal point."""


def read_measurements(path: str | Path) -> MeasurementSet:
    """Read a measurement file.

    Returns:
        SI units; a column that is absent or empty in every row is None. Components of the wrench
        and directions that are absent count as 0 (no load, direction unknown).

    Raises:
        DataError: MEA001 not text, MEA002 no rows, MEA003 a column twice, MEA004 a required
            column is missing, MEA005 wrong number of cells, MEA006 not a number, MEA007 empty or
            not finite, MEA008 beyond any robot, MEA009 a direction that is not -1, 0, +1,
            MEA010 an incomplete set of columns.
        ReadError: IO001, IO002.
    """
    table = _read_table(path)
    _check_header(table)
    position = _required(table, POSITION) * MM
    q = _required(table, JOINTS) * DEG
    return MeasurementSet(
        path=str(path),
        line=np.asarray(table.line, dtype=np.int32),
        ids=_ids(table),
        q=q,
        position=position,
        group=_labels(table, "group"),
        abc=_orientation(table),
        time=_complete(table, "time_s"),
        temperature=_complete(table, "temp_C"),
        direction=_direction(table),
        qd=_or_zero(table, SPEED, DEG),
        wrench=_or_zero(table, WRENCH, 1.0),
        extra={name: _extra(table, name) for name in table.columns if name not in KNOWN},
    )


@dataclass(frozen=True, slots=True)
class _Table:
    """Cells by column, and the source line of each row."""

    path: str
    header_line: int
    columns: dict[str, Sequence[str]]
    line: list[int]

    def error(self, code: str, message: str, row: int | None = None, hint: str = "") -> DataError:
        """Return an error at a row, or at the header."""
        line = self.header_line if row is None else self.line[row]
        return DataError(code, message, SourceRef(self.path, line), hint)


def _read_table(path: str | Path) -> _Table:
    raw = read_bytes(path)
    try:
        text = raw.decode("utf-8-sig")
    except UnicodeDecodeError as problem:
        line = raw[: problem.start].count(b"\n") + 1
        raise DataError("MEA001", "not a text file in UTF-8", SourceRef(str(path), line)) from None
    if "\0" in text:
        line = text[: text.index("\0")].count("\n") + 1
        raise DataError("MEA001", "not a text file", SourceRef(str(path), line))
    rows, lines = _cells(text)
    if len(rows) < 2:
        raise DataError(
            "MEA002",
            "no measurements, expected a header row and at least one row of numbers",
            SourceRef(str(path), lines[0] if lines else 1),
        )
    header = [name.strip() for name in rows[0]]
    table = _Table(str(path), lines[0], {}, lines[1:])
    for row, cells in enumerate(rows[1:]):
        if len(cells) != len(header):
            raise table.error(
                "MEA005", f"{len(cells)} cells, expected {len(header)} as in the header", row
            )
    for index, name in enumerate(header):
        if name in table.columns:
            raise table.error("MEA003", f"column {name!r} is there twice")
        if name:
            table.columns[name] = [cells[index] for cells in rows[1:]]
    return table


def _cells(text: str) -> tuple[list[list[str]], list[int]]:
    rows: list[list[str]] = []
    lines: list[int] = []
    quoted = '"' in text
    for number, line in enumerate(text.split("\n"), start=1):
        content = line.strip()
        if not content or content.startswith("#"):
            continue
        rows.append(
            next(csv.reader([content], skipinitialspace=True)) if quoted else content.split(",")
        )
        lines.append(number)
    return rows, lines


def _check_header(table: _Table) -> None:
    for name in (*JOINTS, *POSITION):
        if name in table.columns:
            continue
        close = difflib.get_close_matches(
            name, [c for c in table.columns if c not in KNOWN], 1, 0.6
        )
        hint = f"the column {close[0]!r} has another name or unit" if close else ""
        only = next(iter(table.columns), "")
        if len(table.columns) == 1 and (";" in only or "\t" in only):
            hint = "columns are separated by commas, decimals by a point"
        raise table.error("MEA004", f"no column {name!r}, which every measurement needs", hint=hint)


def _numbers(table: _Table, name: str) -> FloatArray:
    """Return a column as numbers; an empty cell is NaN."""
    cells = table.columns[name]
    try:
        return np.array(cells, dtype=np.float64)
    except ValueError:
        pass
    values = np.full(len(cells), np.nan)
    for row, cell in enumerate(cells):
        text = cell.strip()
        if not text:
            continue
        try:
            values[row] = float(text)
        except ValueError:
            raise table.error(
                "MEA006", f"{name} is {text[:40]!r}, expected a number", row
            ) from None
    return values


def _finite(table: _Table, name: str, values: FloatArray) -> FloatArray:
    bad = np.flatnonzero(~np.isfinite(values))
    if len(bad):
        row = int(bad[0])
        shown = table.columns[name][row].strip() or "empty"
        raise table.error("MEA007", f"{name} is {shown}, expected a finite number", row)
    return values


def _required(table: _Table, names: tuple[str, ...]) -> FloatArray:
    columns = []
    for name in names:
        values = _finite(table, name, _numbers(table, name))
        largest = _LARGEST[name.rsplit("_", 1)[1]]
        far = np.flatnonzero(np.abs(values) > largest)
        if len(far):
            row = int(far[0])
            raise table.error(
                "MEA008", f"{name} is {values[row]:g}, beyond {largest:g}: wrong unit?", row
            )
        columns.append(values)
    return np.stack(columns, axis=-1)


def _complete(table: _Table, name: str) -> FloatArray | None:
    """Return a column that is either there in every row or None."""
    if name not in table.columns:
        return None
    values = _numbers(table, name)
    return None if bool(np.all(np.isnan(values))) else _finite(table, name, values)


def _orientation(table: _Table) -> FloatArray | None:
    columns = [_complete(table, name) for name in ORIENTATION]
    present = [column for column in columns if column is not None]
    if not present:
        return None
    if len(present) < len(ORIENTATION):
        missing = ", ".join(n for n, c in zip(ORIENTATION, columns, strict=True) if c is None)
        raise table.error("MEA010", f"the orientation lacks {missing}")
    return np.stack(present, axis=-1) * DEG


def _or_zero(table: _Table, names: tuple[str, ...], factor: float) -> FloatArray | None:
    """Return a set of columns; an absent one and an empty cell count as 0."""
    if not any(name in table.columns for name in names):
        return None
    columns = []
    for name in names:
        values = np.zeros(len(table.line))
        if name in table.columns:
            read = _numbers(table, name)
            empty = np.array([not cell.strip() for cell in table.columns[name]]) & np.isnan(read)
            values = _finite(table, name, np.where(empty, 0.0, read))
        columns.append(values)
    return np.stack(columns, axis=-1) * factor


def _direction(table: _Table) -> FloatArray | None:
    values = _or_zero(table, DIRECTION, 1.0)
    if values is None:
        return None
    bad = np.argwhere(~np.isin(values, (-1.0, 0.0, 1.0)))
    if len(bad):
        row, joint = (int(i) for i in bad[0])
        shown = f"{DIRECTION[joint]} is {values[row, joint]:g}"
        raise table.error("MEA009", f"{shown}, expected -1, 0 or +1", row)
    return values


def _labels(table: _Table, name: str) -> tuple[str, ...] | None:
    cells = table.columns.get(name)
    return None if cells is None else tuple(cell.strip() for cell in cells)


def _ids(table: _Table) -> tuple[str, ...]:
    labels = _labels(table, "id")
    return labels if labels else tuple(str(row + 1) for row in range(len(table.line)))


def _extra(table: _Table, name: str) -> Any:  # noqa: ANN401 - numbers or labels
    try:
        values = _numbers(table, name)
    except DataError:
        return _labels(table, name)
    values.flags.writeable = False
    return values
