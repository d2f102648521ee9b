"""Measurement CSV: commanded joints and measured tool points, with what was logged beside them.

UTF-8, header row, ``#`` comment lines, columns in any order. Commas separate columns; where the
header has none, semicolons or tabs do, and decimals may have a comma: all of them or none. Unknown
columns are kept as conditions that may explain a gap: numbers where every cell is one, else labels.
"""

from __future__ import annotations

import difflib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import DataError
from postproc.measurement.columns import (
    DIRECTION,
    KNOWN,
    LABELS,
    NAMED_CONDITIONS,
    POSITION,
    QUANTITIES,
    READINGS,
    Empty,
    Quantity,
)
from postproc.measurement.rows import MeasurementSet, Remark
from postproc.measurement.table import Table, numbers, read_table

MOST = 0.5
"""Share of empty cells from which a quantity was not logged: most would be guessed."""


def read_measurements(path: str | Path, set_aside: bool = False) -> MeasurementSet:
    """Read a measurement file.

    Args:
        path: the file.
        set_aside: leave rows out that lack a joint angle or any reading, with a remark.

    Returns:
        SI units; a column that is absent or empty in every row is None. Components of the wrench
        and directions that are absent count as 0 (no load, direction unknown).

    Raises:
        DataError: MEA001 not text, MEA002 no rows, MEA003 a column twice, MEA004 a required
            column is missing, MEA005 wrong number of cells, MEA006 not a number, MEA007 empty or
            not finite, MEA008 beyond any robot, MEA009 a direction that is not -1, 0, +1,
            MEA010 an incomplete set of columns or cells.
        ReadError: IO001, IO002.
    """
    table = read_table(path)
    _check_header(table)
    ids = _labels(table, "id") or tuple(str(row + 1) for row in range(len(table.line)))
    remarks: list[Remark] = []
    if set_aside:
        table, ids = _without_gaps(table, ids, remarks)
    values: dict[str, Any] = {name: _labels(table, name) for name in LABELS}
    for part in QUANTITIES:
        values[part.field] = _quantity(table, part, ids, remarks, values.get("time"))
    if values["position"] is None:
        values["position"] = np.full((len(ids), 3), np.nan)
    _check_direction(table, values["direction"])
    _check_readings(table, values)
    return MeasurementSet(
        path=str(path),
        line=np.asarray(table.line, dtype=np.int32),
        ids=ids,
        extra={name: _extra(table, name) for name in table.columns if name not in KNOWN},
        remarks=tuple(remarks),
        **values,
    )


def _is_empty(cell: str) -> bool:
    return cell.strip().lower() in ("", "nan")


def _without_gaps(
    table: Table, ids: tuple[str, ...], remarks: list[Remark]
) -> tuple[Table, tuple[str, ...]]:
    """Return the rows with all joint angles and a reading; all of them where none has."""
    needed = [n for part in QUANTITIES if part.empty is Empty.ERROR for n in part.names]
    read = [
        name
        for name in ("plane", *(n for p in QUANTITIES if p.field in READINGS for n in p.names))
        if name in table.columns
    ]
    lacking = [
        any(_is_empty(table.columns[name][row]) for name in needed)
        or all(_is_empty(table.columns[name][row]) for name in read)
        for row in range(len(table.line))
    ]
    if not any(lacking) or all(lacking):
        return table, ids
    kept = [row for row, out in enumerate(lacking) if not out]
    gone = tuple(ids[row] for row, out in enumerate(lacking) if out)
    text = "a joint angle is empty or nothing was read; the rows are left out"
    remarks.append(Remark("blank", gone, text))
    columns: dict[str, Sequence[str]] = {
        name: [cells[row] for row in kept] for name, cells in table.columns.items()
    }
    line = [table.line[row] for row in kept]
    return Table(table.path, table.header_line, columns, line), tuple(ids[row] for row in kept)


def _filled(
    name: str,
    values: FloatArray,
    ids: tuple[str, ...],
    remarks: list[Remark],
    time: FloatArray | None,
) -> FloatArray | None:
    """Return a column with empty cells filled from those around, None where most are empty."""
    empty = np.isnan(values)
    if not empty.any():
        return values
    if empty.all():
        return None
    gone = tuple(ids[k] for k in np.flatnonzero(empty))
    if empty.mean() > MOST:
        remarks.append(Remark("blank", gone, f"{name} is empty in most rows; not used"))
        return None
    course = np.arange(len(values)) if time is None else time
    order = np.argsort(course, kind="stable")
    known = order[~empty[order]]
    remarks.append(Remark("blank", gone, f"{name} is empty; taken between the rows around"))
    return np.where(empty, np.interp(course, course[known], values[known]), values)


def _check_header(table: Table) -> None:
    needed = [n for part in QUANTITIES if part.empty is Empty.ERROR for n in part.names]
    others = any(name in table.columns for name in ("u_mm", "length_mm", "plane"))
    if not others or any(name in table.columns for name in POSITION):
        needed += POSITION
    for name in needed:
        if name in table.columns:
            continue
        close = difflib.get_close_matches(
            name, [c for c in table.columns if c not in KNOWN], 1, 0.6
        )
        hint = f"the column {close[0]!r} has another name or unit" if close else ""
        raise table.error("MEA004", f"no column {name!r}, which every measurement needs", hint=hint)


def _check_readings(table: Table, values: dict[str, Any]) -> None:
    """Refuse rows that read nothing, and readings that lack what they are of."""
    n = len(table.line)
    blank = np.full((n, 3), np.nan)

    def there(name: str) -> BoolArray:
        rows = values[name]
        if name in LABELS:
            return np.array([bool(label) for label in rows or ("",) * n])
        read = np.reshape(blank if rows is None else rows, (n, -1))
        return np.asarray(np.isfinite(read).any(axis=1))

    def whole(name: str) -> BoolArray:
        read = blank if values[name] is None else values[name]
        return np.asarray(np.isfinite(read).all(axis=1))

    way = np.nan_to_num(blank if values["way"] is None else values["way"])
    lacks = {
        "reads nothing, expected a coordinate, u_mm, length_mm or plane": ~np.any(
            [there(name) for name in READINGS], axis=0
        ),
        "has u_mm without ux, uy, uz": there("along") & ~(whole("way") & way.any(axis=1)),
        "has length_mm without from_x_mm, from_y_mm, from_z_mm or from_id": there("length")
        & ~(whole("origin") | (there("from_id") & ~there("origin"))),
    }
    for what, rows in lacks.items():
        if rows.any():
            code = "MEA007" if "nothing" in what else "MEA010"
            raise table.error(code, f"the row {what}", int(np.argmax(rows)))


def _quantity(
    table: Table,
    part: Quantity,
    ids: tuple[str, ...],
    remarks: list[Remark],
    time: FloatArray | None,
) -> FloatArray | None:
    """Return (n, k) or (n,) in SI; None where the file does not have it."""
    columns = {name: numbers(table, name) for name in part.names if name in table.columns}
    if part.empty is Empty.BETWEEN:
        filled = {name: _filled(name, v, ids, remarks, time) for name, v in columns.items()}
        columns = {name: values for name, values in filled.items() if values is not None}
    if part.empty in (Empty.COLUMN, Empty.PART):
        columns = {name: v for name, v in columns.items() if not np.all(np.isnan(v))}
    if not columns:
        return None
    missing = [name for name in part.names if name not in columns]
    if missing and part.empty is Empty.COLUMN:
        raise table.error("MEA010", f"{', '.join(columns)} without {', '.join(missing)}")
    for name, values in columns.items():
        _check(table, name, values, part)
    nothing = np.full(len(table.line), np.nan if part.empty is Empty.PART else 0.0)
    stacked = np.stack([columns.get(name, nothing) for name in part.names], axis=-1) * part.unit
    return stacked if len(part.names) > 1 else stacked[:, 0]


def _check(table: Table, name: str, values: FloatArray, part: Quantity) -> None:
    """Refuse numbers that no reading has; empty cells become 0 where they mean nothing."""
    cells = table.columns[name]
    if part.empty is Empty.ZERO:
        values[[not cell.strip() for cell in cells]] = 0.0
    read = [part.empty is not Empty.PART or bool(cell.strip()) for cell in cells]
    for row in np.flatnonzero(~np.isfinite(values) & read).tolist():
        shown = cells[row].strip() or "empty"
        raise table.error("MEA007", f"{name} is {shown}, expected a finite number", row)
    if part.field in ("sigma", "sigmas", "length"):
        for row in np.flatnonzero(values <= 0.0).tolist():
            raise table.error("MEA008", f"{name} is {values[row]:g}, expected above 0", row)
    for row in np.flatnonzero(np.abs(values) > part.largest).tolist():
        shown = f"{values[row]:g}, beyond {part.largest:g}"
        raise table.error("MEA008", f"{name} is {shown}: wrong unit?", row)


def _check_direction(table: Table, values: FloatArray | None) -> None:
    if values is None:
        return
    for row, joint in np.argwhere(~np.isin(values, (-1.0, 0.0, 1.0))).tolist():
        shown = f"{DIRECTION[joint]} is {values[row, joint]:g}"
        raise table.error("MEA009", f"{shown}, expected -1, 0 or +1", row)


def _labels(table: Table, name: str) -> tuple[str, ...] | None:
    cells = table.columns.get(name)
    return None if cells is None else tuple(cell.strip() for cell in cells)


def _extra(table: Table, name: str) -> Any:  # noqa: ANN401 - numbers or labels
    if name in NAMED_CONDITIONS:
        return _labels(table, name)
    try:
        values = numbers(table, name)
    except DataError:
        return _labels(table, name)
    values[~np.isfinite(values)] = np.nan
    values.flags.writeable = False
    return values
