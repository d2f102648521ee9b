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

from collections.abc import Sequence
from itertools import accumulate
from pathlib import Path

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.model import MotionKind, ToolPath, WordUse
from postproc.readers.base import HEAD_BYTES, READERS, ReadOptions
from postproc.readers.csv.columns import (
    NORMAL,
    ORIENTATIONS,
    POSITION,
    Column,
    column_of,
    columns_of,
    understood,
)
from postproc.readers.csv.holes import motion_kinds
from postproc.readers.csv.orientation import rotations_from, unit_rows
from postproc.readers.csv.quantities import Columns, assumptions, check_sizes, in_si, length_unit
from postproc.readers.csv.roles import BY_NAME
from postproc.readers.csv.rows import (
    doubted,
    merged_repeats,
    operation_runs,
    setup_calls,
    spindle_events,
    tool_calls,
    turns_of,
)
from postproc.readers.csv.table import (
    Layout,
    Rows,
    decoded,
    is_comment,
    is_number,
    layout_of,
    parse_rows,
    split_row,
)
from postproc.readers.text import Faults, text_blocks
from postproc.units import MM

FAR_AWAY = 50.0
"""Farther from the origin than this [m] no workpiece of a robot cell lies."""
WORK = frozenset({"depth", "diameter", "feed", "spindle", "peck", "dwell"})
"""nor those that differ in these numbers, which say what is done there."""
SEPARATORS = (";", "\t", ",", " ")
MODAL_TEXTS = frozenset({"motion", "tool", "base", "sense"})
"""An empty field of these repeats the row before."""
KEYS = ("operation", "tool", "base")
"""Rows of one name that differ in these names are not repeated measurements,"""
MOST_COLUMNS = 256
"""So many names of a header are looked at to find a point."""
SURE = 0.45
"""Below what a reader says that knows its own words."""


class CsvReader:
    """Reader of point and hole lists."""

    suffixes = (".csv",)

    def sniff(self, head: bytes) -> float:
        """Return how much of the first rows is numbers; a header of a point list counts too."""
        lines = decoded(head).splitlines()
        whole = lines[:-1] if len(head) == HEAD_BYTES and len(lines) > 1 else lines
        stripped = (line.strip() for line in whole)
        rows = [line for line in stripped if line and not is_comment(line)][:20]
        if not rows or rows[0].startswith("<"):
            return 0.0
        if len(rows) == 1 and _names_a_point(rows[0]):
            return SURE
        return SURE * sum(_looks_like_a_row(row) for row in rows[-10:]) / len(rows[-10:])

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the points of a list; errors have a ``CSV`` code and the line."""
        faults = Faults(path, options.recover)
        layout: Layout | None = None
        columns: list[Column] = []
        uses: tuple[WordUse, ...] = ()
        parts: list[Rows] = []
        for block in text_blocks(path):
            if layout is None:
                layout = layout_of(block, faults)
                header = layout.header_line or layout.first_row_line
                columns = columns_of(layout, options, faults)
                columns, uses = understood(columns, options, faults, header)
            numeric, texts = _used(columns)
            parts.append(parse_rows(block, layout, numeric, texts, faults))
        if layout is None:
            raise faults.error("CSV002", "no row of data", 1)
        units = length_unit(columns, options, faults, layout)
        data = _joined(columns, parts, faults)
        at = next((i for i, column in enumerate(columns) if column.role == "spindle"), None)
        if at is not None:
            columns[at] = doubted(columns[at], data.numbers["spindle"])
            columns, more = understood(columns, options, faults, header)
            uses = (*uses, *more)
        data = in_si(columns, data, units)
        return toolpath_of(path, options, layout.header, units, uses, data, faults)


def _names_a_point(text: str) -> bool:
    return any(
        set(POSITION)
        <= {column_of(name).role for name in split_row(text, separator)[:MOST_COLUMNS]}
        for separator in SEPARATORS
    )


def _looks_like_a_row(text: str) -> bool:
    return any(
        sum(is_number(part, decimal_comma=True) for part in split_row(text, separator)) >= 3
        for separator in SEPARATORS
    )


def _used(columns: list[Column]) -> tuple[list[int], list[int]]:
    known = [(i, BY_NAME[column.role]) for i, column in enumerate(columns) if column.role]
    return [i for i, role in known if not role.is_text], [i for i, role in known if role.is_text]


def _joined(columns: list[Column], parts: list[Rows], faults: Faults) -> Columns:
    """Return the columns of all blocks, empty fields filled from the row before."""
    numeric, texts = _used(columns)
    line = np.concatenate([part.line for part in parts]).astype(np.int32)
    joined = Columns(line)
    is_said = any(column.role == "motion" for column in columns)  # which rows are holes
    for at, column in enumerate(numeric):
        role = columns[column].role
        values = np.concatenate([part.numbers[:, at] for part in parts])
        empty = np.flatnonzero(np.concatenate([part.empty[:, at] for part in parts]))
        if len(empty):
            if role in POSITION:
                message = f"{columns[column].name} is empty"
                faults.fix("CSV005", message, "it is that of the row before", int(line[empty[0]]))
            elif role == "depth" and not is_said:
                holes = empty[np.cumsum(~np.isnan(values))[empty] > 0]
                if len(holes):
                    faults.fix(
                        "CSV123", f"{columns[column].name} is empty in {len(holes)} rows behind a "
                        "hole: as deep as the row before, or no hole?",
                        "as deep as the row before", int(line[holes[0]]),
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
    if empty[0] == 0 and role in POSITION:
        raise faults.error("CSV005", f"{role} of the first row is empty", int(line[0]))
    leading = int(np.sum(empty == np.arange(len(empty))))
    if leading < len(values) or role == "depth":
        unknown = "no hole is drilled there" if role == "depth" else "nothing is known there"
        told = ((empty[:leading], unknown), (empty[leading:], "taken from the row before"))
        for rows, said in told:
            if len(rows):
                text = f"{len(rows)} empty fields of column {role}: {said}"
                faults.warn("CSV121", text, int(line[rows[0]]))
    source = np.arange(len(values))
    source[empty] = 0
    source = np.maximum.accumulate(source)
    filled: FloatArray = values[source]
    return filled


def toolpath_of(
    path: str,
    options: ReadOptions,
    header: Sequence[str] | None,
    units: str,
    uses: tuple[WordUse, ...],
    data: Columns,
    faults: Faults,
) -> ToolPath:
    """Return the toolpath of rows in SI; ``header``: the words of the file's own, None without."""
    points = np.column_stack([data.numbers[role] for role in POSITION])
    names = data.texts.get("id")
    others: list[Sequence[object]] = [data.texts[role] for role in KEYS if role in data.texts]
    others += [np.nan_to_num(v, nan=-1.0).tolist() for r, v in data.numbers.items() if r in WORK]
    merged = merged_repeats(names, others, points, data.line, faults) if names else None
    read = data
    if merged is not None:
        points, data = merged[0], data.kept(merged[1])
    line, texts = data.line, data.texts
    if not options.points_only:
        check_sizes(points, line, read, options, faults)
    _warn_if_far(points, line, faults)
    axes, rotations = _orientation(data, points, options, faults)
    kind, cycle, cycles = motion_kinds(data, faults)
    operation, runs = operation_runs(texts.get("operation"), line)
    tool, tools, changes = tool_calls(texts.get("tool"), line, faults)
    setup, setups = setup_calls(texts.get("base"), line)
    turns = turns_of(data.numbers.get("spindle"), texts.get("sense"), line, faults)
    events = sorted((*changes, *spindle_events(turns, line)), key=lambda event: event.index)
    diameter = data.numbers.get("diameter")
    return ToolPath(
        path=path,
        name=Path(path).stem,
        format="csv",
        dialect="csv",
        units=units,
        points=points,
        axes=axes,
        kind=kind,
        feed=_feeds(data, turns, kind, faults),
        line=line,
        operation=operation,
        tool=tool,
        arc=np.full(len(points), -1, dtype=np.int32),
        cycle=cycle,
        operations=runs,
        tools=tools,
        cycles=cycles,
        events=tuple(events),
        setup=setup,
        setups=setups,
        rotations=rotations,
        names=tuple(texts["id"]) if texts.get("id") else None,
        words={} if header is None else dict.fromkeys(header, 1),
        extra={} if diameter is None else {"diameter": diameter},
        unknown_words={use.word: 1 for use in uses},
        word_uses=uses,
        assumed=assumptions(data.bare, options),
        warnings=faults.warnings,
        recovered=faults.fixes,
    )


def _warn_if_far(points: FloatArray, line: IntArray, faults: Faults) -> None:
    far = np.flatnonzero(np.abs(points).max(axis=1, initial=0.0) > FAR_AWAY)
    if len(far):
        reach = float(np.abs(points[far]).max()) / MM
        text = (
            f"{len(far)} points lie up to {reach:.0f} mm from the origin: these are coordinates of "
            "another frame (an aircraft's, a site's) than the workpiece's"
        )
        faults.warn("CSV110", text, int(line[far[0]]))


def _orientation(
    data: Columns, points: FloatArray, options: ReadOptions, faults: Faults
) -> tuple[FloatArray, FloatArray | None]:
    """Return the tool axes (n, 3), and the rotations (n, 3, 3) where the file gives them."""
    line = data.line
    forms = [form for form in (NORMAL, *ORIENTATIONS) if set(form) <= set(data.numbers)]
    if len(forms) > 1:
        text = f"two orientations, {','.join(forms[0])} and {','.join(forms[1])}"
        raise faults.error("CSV024", text, 1, hint="choose with --columns, - leaves a column out")
    if not forms:
        return _normals_of_surface(data, points, options, faults), None
    form = forms[0]
    values = np.column_stack([data.numbers[role] for role in form])
    empty = np.flatnonzero(np.isnan(values).any(axis=1))
    if len(empty):
        raise faults.error("CSV025", "no orientation in this row", int(line[empty[0]]))
    if form == NORMAL:
        return unit_rows(values, "normal", line, faults), None
    R = rotations_from(form, values, line, faults)
    axes: FloatArray = -(R @ np.asarray(options.tool_axis)) + 0.0
    return axes, R


def _normals_of_surface(
    data: Columns, points: FloatArray, options: ReadOptions, faults: Faults
) -> FloatArray:
    partial = [role for role in (*NORMAL, "a", "b", "c") if role in data.numbers]
    if options.points_only and not partial and options.surface_normals is None:
        faults.warn("CSV112", "no orientation in this file: it needs i,j,k or a workpiece mesh", 1)
        return np.full_like(points, np.nan)
    if options.surface_normals is None or partial:
        what = f"only {','.join(partial)} of an orientation" if partial else "no orientation"
        text = f"{what} in this file, expected columns i,j,k (from the tip to the holder) or a,b,c"
        hint = "add the columns, or give the cell a workpiece mesh to take the normals from"
        raise faults.error("CSV020", text, 1, hint=hint)
    bases = data.texts.get("base")
    found = options.surface_normals(points, bases) if bases else options.surface_normals(points)
    normals = np.asarray(found, dtype=np.float64)
    faults.warn("CSV111", "no orientation in this file: normals are those of the workpiece mesh", 1)
    return unit_rows(normals, "normal of the mesh", data.line, faults)


def _feeds(data: Columns, turns: FloatArray | None, kind: IntArray, faults: Faults) -> FloatArray:
    """Return the feed (n,) [m/s], NaN for rapids and where none is given."""
    if "feed" not in data.numbers:
        return np.full(len(kind), np.nan)
    feed: FloatArray = data.numbers["feed"] * 1.0
    if data.feeds_per_turn:
        feed *= np.abs(np.nan_to_num(turns)) if turns is not None else 0.0
    wrong = np.flatnonzero(feed <= 0.0)
    if len(wrong):
        here = int(data.line[wrong[0]])
        text = "a feed, and the turns that one is per, must be above zero"
        raise faults.error("CSV034", text, here)
    feed[kind == MotionKind.RAPID] = np.nan
    return feed


READERS.register("csv")(CsvReader())
