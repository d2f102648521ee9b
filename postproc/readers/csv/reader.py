"""Reader of point and hole lists: CSV in the dialects found in the wild.

Separator, decimal sign, header and encoding are found from the content; columns by their names
(``csv_columns``), by ``ReadOptions.columns``, or without either by their number: x, y, z or
x, y, z, i, j, k, with or without a name first. Lengths are mm unless the header or the option says
otherwise. A row with a depth is a hole. An empty field of any column but x, y, z repeats the row
before. Where no orientation is given, the normals come from the workpiece's mesh.

Heights of a hole without columns of its own: the feed starts 2 mm above the point, the tool ends
10 mm above it.
"""

from __future__ import annotations

from dataclasses import field
from itertools import accumulate
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.model import MotionKind, ToolPath
from postproc.readers.base import HEAD_BYTES, LENGTH_UNITS, READERS, ReadOptions
from postproc.readers.csv.calls import operation_runs, setup_calls, tool_calls
from postproc.readers.csv.columns import (
    LENGTH_ROLES,
    NORMAL,
    ORIENTATIONS,
    POSITION,
    TEXT_ROLES,
    Column,
    column_of,
    columns_of,
)
from postproc.readers.csv.holes import HoleColumns, motion_kinds
from postproc.readers.csv.orientation import rotations_from, unit_rows
from postproc.readers.csv.repeats import merged_repeats
from postproc.readers.csv.table import (
    Layout,
    Rows,
    decoded,
    is_number,
    layout_of,
    parse_rows,
    split_row,
)
from postproc.readers.text import Faults, text_blocks
from postproc.records import dataclass
from postproc.units import INCH_PER_MIN, MM, MM_PER_MIN

FAR_AWAY = 50.0
"""Farther from the origin than this [m] no workpiece of a robot cell lies."""
SEPARATORS = (";", "\t", ",", " ")
MODAL_TEXTS = frozenset({"motion", "tool", "base"})
"""An empty field of these repeats the row before."""
KEYS = ("operation", "tool", "base")
"""Rows of one name that differ in these are not repeated measurements."""
SURE = 0.45
"""Below what a reader says that knows its own words."""


@dataclass(slots=True)
class _Columns:
    """All rows: line (n,), numeric columns by role (n,) as written, texts by role."""

    line: IntArray
    numbers: dict[str, FloatArray] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)


class CsvReader:
    """Reader of point and hole lists."""

    suffixes = (".csv",)

    def sniff(self, head: bytes) -> float:
        """Return how much of the first rows is numbers; a header of a point list counts too."""
        lines = decoded(head).splitlines()
        whole = lines[:-1] if len(head) == HEAD_BYTES and len(lines) > 1 else lines
        rows = [line.strip() for line in whole if line.strip() and not line.startswith("#")][:20]
        if not rows or rows[0].startswith("<"):
            return 0.0
        if len(rows) == 1 and _names_a_point(rows[0]):
            return SURE
        return SURE * sum(_looks_like_a_row(row) for row in rows[-10:]) / len(rows[-10:])

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the points of a list.

        Raises:
            ReadError: with a ``CSV`` code and the line.
        """
        faults = Faults(path, options.recover)
        layout: Layout | None = None
        columns: list[Column] = []
        parts: list[Rows] = []
        for block in text_blocks(path):
            if layout is None:
                layout = layout_of(block, faults)
                columns = columns_of(layout, options.columns, faults)
            numeric, texts = _used(columns)
            parts.append(parse_rows(block, layout, numeric, texts, faults))
        if layout is None:
            raise faults.error("CSV002", "no row of data", 1)
        return _toolpath(path, options, layout, columns, _joined(columns, parts, faults), faults)


def _names_a_point(text: str) -> bool:
    return any(
        set(POSITION) <= {column_of(name).role for name in split_row(text, separator)}
        for separator in SEPARATORS
    )


def _looks_like_a_row(text: str) -> bool:
    return any(
        sum(is_number(part, decimal_comma=True) for part in split_row(text, separator)) >= 3
        for separator in SEPARATORS
    )


def _used(columns: list[Column]) -> tuple[list[int], list[int]]:
    numeric = [i for i, c in enumerate(columns) if c.role and c.role not in TEXT_ROLES]
    texts = [i for i, c in enumerate(columns) if c.role in TEXT_ROLES]
    return numeric, texts


def _joined(columns: list[Column], parts: list[Rows], faults: Faults) -> _Columns:
    """Return the columns of all blocks, empty fields filled from the row before."""
    numeric, texts = _used(columns)
    line = np.concatenate([part.line for part in parts]).astype(np.int32)
    joined = _Columns(line)
    for at, column in enumerate(numeric):
        role = columns[column].role
        values = np.concatenate([part.numbers[:, at] for part in parts])
        empty = np.flatnonzero(np.concatenate([part.empty[:, at] for part in parts]))
        if len(empty):
            if role in POSITION:
                faults.fix(
                    "CSV005", f"{columns[column].name} is empty",
                    "it is that of the row before", int(line[empty[0]]),
                )  # fmt: skip
            values = _filled(values, empty, role, line, faults)
        joined.numbers[role] = values
    for column in texts:
        joined.texts[columns[column].role] = [text for part in parts for text in part.texts[column]]
    for role in MODAL_TEXTS & set(joined.texts):
        joined.texts[role] = list(accumulate(joined.texts[role], _last_given))
    return joined


def _last_given(before: str, text: str) -> str:
    return text or before


def _filled(
    values: FloatArray, empty: IndexArray, role: str, line: IntArray, faults: Faults
) -> FloatArray:
    if empty[0] == 0:
        if role in POSITION:
            raise faults.error("CSV005", f"{role} of the first row is empty", int(line[0]))
        if len(empty) == len(values):
            return values
    source = np.arange(len(values))
    source[empty] = 0
    source = np.maximum.accumulate(source)
    faults.warn(
        "CSV121", f"empty fields of column {role}: taken from the row before", int(line[empty[0]])
    )
    filled: FloatArray = values[source]
    return filled


def _toolpath(
    path: str,
    options: ReadOptions,
    layout: Layout,
    columns: list[Column],
    data: _Columns,
    faults: Faults,
) -> ToolPath:
    units, scale = _units(columns, options, faults, layout)
    factors = {c.role: c.factor for c in columns}
    lengths = {
        role: values * (factors[role] or scale)
        for role, values in data.numbers.items()
        if role in LENGTH_ROLES
    }
    points = np.column_stack([lengths[role] for role in POSITION])
    names, operations = data.texts.get("id"), data.texts.get("operation")
    rows: IndexArray | slice = slice(None)
    others = [data.texts[role] for role in KEYS if role in data.texts]
    merged = merged_repeats(names, others, points, data.line, faults) if names else None
    if merged is not None:
        points, rows = merged
    line = data.line[rows]
    _warn_if_far(points, line, faults)
    axes, rotations = _orientation(data, factors, points, rows, options, faults)
    holes = _hole_columns(data, lengths, rows)
    kind, cycle, cycles = motion_kinds(holes, line, faults)
    operation, runs = operation_runs(_texts_of(operations, rows), line)
    tool, tools, events = tool_calls(_texts_of(data.texts.get("tool"), rows), line, faults)
    setup, setups = setup_calls(_texts_of(data.texts.get("base"), rows), line)
    kept_names = _texts_of(names, rows)
    return ToolPath(
        path=path,
        name=Path(path).stem,
        format="csv",
        dialect="csv",
        units=units,
        points=points,
        axes=axes,
        kind=kind,
        feed=_feeds(data, factors, rows, units, kind, faults),
        line=line,
        operation=operation,
        tool=tool,
        arc=np.full(len(points), -1, dtype=np.int32),
        cycle=cycle,
        operations=runs,
        tools=tools,
        cycles=cycles,
        events=events,
        setup=setup,
        setups=setups,
        rotations=rotations,
        names=tuple(kept_names) if kept_names else None,
        extra={} if holes.diameter is None else {"diameter": holes.diameter},
        warnings=faults.warnings,
        recovered=faults.fixes,
    )


def _texts_of(texts: list[str] | None, rows: IndexArray | slice) -> list[str] | None:
    if texts is None or isinstance(rows, slice):
        return texts
    return [texts[row] for row in rows.tolist()]


def _hole_columns(
    data: _Columns, lengths: dict[str, FloatArray], rows: IndexArray | slice
) -> HoleColumns:
    def of(columns: dict[str, FloatArray], role: str) -> FloatArray | None:
        return columns[role][rows] if role in columns else None

    return HoleColumns(
        depth=of(lengths, "depth"),
        diameter=of(lengths, "diameter"),
        clearance=of(lengths, "clearance"),
        retract=of(lengths, "retract"),
        peck=of(lengths, "peck"),
        dwell=of(data.numbers, "dwell"),
        motion=_texts_of(data.texts.get("motion"), rows),
    )


def _units(
    columns: list[Column], options: ReadOptions, faults: Faults, layout: Layout
) -> tuple[str, float]:
    """Return name and factor of the unit of length for columns without one of their own."""
    factors = {column.factor for column in columns if column.role in POSITION}
    named = {name for name, factor in LENGTH_UNITS.items() if factor in factors}
    if options.units is not None and named and named != {options.units}:
        raise faults.error(
            "CSV015",
            f"the header says {' and '.join(sorted(named))}, but --units says {options.units}",
            layout.header_line,
        )
    units = options.units or (min(named) if len(named) == 1 and None not in factors else "mm")
    return units, LENGTH_UNITS[units]


def _warn_if_far(points: FloatArray, line: IntArray, faults: Faults) -> None:
    far = np.flatnonzero(np.abs(points).max(axis=1, initial=0.0) > FAR_AWAY)
    if len(far):
        reach = float(np.abs(points[far]).max()) / MM
        faults.warn(
            "CSV110",
            f"{len(far)} points lie up to {reach:.0f} mm from the origin: these are coordinates of "
            "another frame (an aircraft's, a site's) than the workpiece's",
            int(line[far[0]]),
        )


def _orientation(
    data: _Columns,
    factors: dict[str, float | None],
    points: FloatArray,
    rows: IndexArray | slice,
    options: ReadOptions,
    faults: Faults,
) -> tuple[FloatArray, FloatArray | None]:
    """Return the tool axes (n, 3), and the rotations (n, 3, 3) where the file gives them."""
    line = data.line[rows]
    forms = [form for form in (NORMAL, *ORIENTATIONS) if set(form) <= set(data.numbers)]
    if len(forms) > 1:
        raise faults.error(
            "CSV024",
            f"two orientations, {','.join(forms[0])} and {','.join(forms[1])}",
            1,
            hint="choose with --columns, - leaves a column out",
        )
    if not forms:
        return _normals_of_surface(data, points, rows, options, faults), None
    form = forms[0]
    values = np.column_stack([data.numbers[role][rows] for role in form])
    empty = np.flatnonzero(np.isnan(values).any(axis=1))
    if len(empty):
        raise faults.error("CSV025", "no orientation in this row", int(line[empty[0]]))
    if form == NORMAL:
        return unit_rows(values, "normal", line, faults), None
    R = rotations_from(form, values, [factors[role] for role in form], line, faults)
    axes: FloatArray = -(R @ np.asarray(options.tool_axis)) + 0.0
    return axes, R


def _normals_of_surface(
    data: _Columns,
    points: FloatArray,
    rows: IndexArray | slice,
    options: ReadOptions,
    faults: Faults,
) -> FloatArray:
    partial = [role for role in (*NORMAL, "a", "b", "c") if role in data.numbers]
    if options.points_only and not partial and options.surface_normals is None:
        faults.warn("CSV112", "no orientation in this file: it needs i,j,k or a workpiece mesh", 1)
        return np.full_like(points, np.nan)
    if options.surface_normals is None or partial:
        what = f"only {','.join(partial)} of an orientation" if partial else "no orientation"
        raise faults.error(
            "CSV020",
            f"{what} in this file, expected columns i,j,k (from the tip to the holder) or a,b,c",
            1,
            hint="add the columns, or give the cell a workpiece mesh to take the normals from",
        )
    bases = _texts_of(data.texts.get("base"), rows)
    found = options.surface_normals(points, bases) if bases else options.surface_normals(points)
    normals = np.asarray(found, dtype=np.float64)
    faults.warn("CSV111", "no orientation in this file: normals are those of the workpiece mesh", 1)
    return unit_rows(normals, "normal of the mesh", data.line[rows], faults)


def _feeds(
    data: _Columns,
    factors: dict[str, float | None],
    rows: IndexArray | slice,
    units: str,
    kind: IntArray,
    faults: Faults,
) -> FloatArray:
    """Return the feed (n,) [m/s], NaN for rapids and where none is given."""
    if "feed" not in data.numbers:
        return np.full(len(kind), np.nan)
    factor = factors["feed"]
    if factor is None:
        factor = INCH_PER_MIN if units == "inch" else MM_PER_MIN
    feed: FloatArray = data.numbers["feed"][rows] * factor
    wrong = np.flatnonzero(feed <= 0.0)
    if len(wrong):
        raise faults.error("CSV034", "a feed must be above zero", int(data.line[rows][wrong[0]]))
    feed[kind == MotionKind.RAPID] = np.nan
    return feed


READERS.register("csv")(CsvReader())
