"""APT and CL files to a toolpath: NX, SolidWorks CAM, Creo, CATIA, CAMWorks and plain APT.

A file is read in blocks. In each block the points, arcs and rapids are taken in bulk
(``statement``, ``motion``), every other statement acts in order on the modal state (``words``), and
the columns of the block are cut from both (``state``). At the end splines are put in their places
and arcs computed.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np

from postproc.arrays import NONE, FloatArray, IndexArray, IntArray
from postproc.model import Arcs, Cycle, Event, MotionKind, ToolPath, WordClass
from postproc.readers.apt.arcs import ArcRecords, Around, arcs_between, settled_senses, tangency
from postproc.readers.apt.dialect import ArcSense, Dialect, dialect_of
from postproc.readers.apt.feed import settle_turn_feed
from postproc.readers.apt.levels import check_resumed, check_standing, settle_levels, settle_turns
from postproc.readers.apt.motion import MotionReader
from postproc.readers.apt.nurbs import MOST_SEGMENTS, close_spline, discretised
from postproc.readers.apt.state import AptState, Tags
from postproc.readers.apt.statement import (
    CIRCLE,
    COMMENT,
    GOTO,
    RAPID,
    Scan,
    scan,
    statement_blocks,
)
from postproc.readers.apt.words import check_homes, comment, handle, settle_tools, unit_name
from postproc.readers.base import ARC_SENSES, HEAD_BYTES, LENGTH_UNITS, ReadOptions
from postproc.readers.text import Faults, TextBlock


def finished_toolpath(state: AptState, path: str) -> ToolPath:
    """Return the toolpath of a state that has seen the whole file."""
    settle_turn_feed(state)
    table, records = Tags.concat(state.blocks), ArcRecords.concat(state.arcs)
    table.tool = state.tools.column(len(table))
    state.blocks, state.arcs = [], []
    check_resumed(state, table)
    settle_turns(state, table)
    settle_levels(state, table)
    shift: IndexArray = np.zeros(len(state.splines) + 1, dtype=np.int64)
    if state.splines:
        table, shift = _with_splines(state, table)
        before = np.searchsorted([s.tag for s in state.splines], records.tag, side="right")
        records = replace(records, tag=(records.tag + shift[before]).astype(np.int32))
    arcs = _arcs(state, table, records)
    arc_column = np.full(len(table), NONE, dtype=np.int32)
    arc_column[records.tag] = np.arange(len(records.tag))
    _settle_feeds(table, state.cycles)
    events = _events(state, shift)
    check_standing(state, events, table.kind, table.line)
    return ToolPath(
        path=path,
        name=Path(path).stem,
        format="apt",
        dialect=state.dialect.name,
        units=state.units,
        assumed=tuple(
            f"lengths in {w.message.partition('read in ')[2]}"
            for w in state.faults.warnings
            if w.code == "APT110"
        ),
        points=table.points,
        axes=table.axes,
        kind=table.kind,
        feed=table.feed,
        line=table.line,
        operation=table.operation,
        tool=table.tool,
        arc=arc_column,
        cycle=table.cycle,
        operations=tuple(state.operations),
        tools=tuple(state.tools.tools),
        arcs=arcs,
        cycles=tuple(state.cycles),
        events=events,
        unknown_words=dict(sorted(state.unknown.items())),
        words=dict(sorted(state.words.items())),
        word_uses=state.uses.all(),
        setup=state.setups.column(table.line),
        setups=tuple(state.setups.setups),
        start=state.start,
        warnings=state.faults.warnings,
        recovered=state.faults.fixes,
    )


def _with_splines(state: AptState, table: Tags) -> tuple[Tags, IndexArray]:
    """Return the table with the points of the splines, and how many stand before each spline."""
    shift = np.zeros(len(state.splines) + 1, dtype=np.int64)
    parts: list[Tags] = []
    at = 0
    current: FloatArray | None = state.start
    for i, spline in enumerate(state.splines):
        parts.append(table.rows(np.arange(at, spline.tag)))
        if spline.tag > at:
            current = _end_point(table, state.cycles, spline.tag - 1)
        at = spline.tag
        if current is None:
            text = "a NURBS with no point before it to start from"
            raise state.faults.error("APT083", text, spline.line)
        points = discretised(spline, current, state.options.chord_tolerance)
        if points is None:
            text = f"a NURBS takes more than {MOST_SEGMENTS} straight pieces within the chord "
            raise state.faults.error("APT088", text + "tolerance", spline.line)
        current = points[-1]
        shift[i + 1] = shift[i] + len(points)
        axis = table.axes[at - 1] if at else np.array([0.0, 0.0, 1.0])
        m = len(points)
        parts.append(
            Tags(
                points,
                np.tile(axis, (m, 1)),
                np.full(m, MotionKind.LINEAR, dtype=np.int32),
                np.full(m, spline.feed),
                np.full(m, spline.line, dtype=np.int32),
                np.full(m, spline.operation, dtype=np.int32),
                np.full(m, state.tools.of_spline(i, at), dtype=np.int32),
                np.full(m, NONE, dtype=np.int32),
            )
        )
        state.faults.warn(
            "APT131", "NURBS run as straight pieces within the chord tolerance", spline.line
        )
    parts.append(table.rows(np.arange(at, len(table))))
    return Tags.concat(parts), shift


def _end_point(table: Tags, cycles: list[Cycle], i: int) -> FloatArray:
    """Return where the tool stands after tag i: after a hole at its retract height."""
    point: FloatArray = table.points[i]
    if table.kind[i] == MotionKind.HOLE:
        point = point + cycles[table.cycle[i]].retract * table.axes[i]
    return point


def _arcs(state: AptState, table: Tags, records: ArcRecords) -> Arcs:
    starts = np.full((len(records.tag), 3), np.nan)
    later = records.tag > 0
    before = records.tag[later] - 1
    starts[later] = table.points[before]
    holes = np.flatnonzero(table.kind[before] == MotionKind.HOLE)
    if len(holes):
        rows = np.flatnonzero(later)[holes]
        starts[rows] = [_end_point(table, state.cycles, int(i)) for i in before[holes]]
    if state.start is not None:
        starts[~later] = state.start
    ends = table.points[records.tag]
    arcs, closes = arcs_between(records, starts, ends, state.faults)
    cuts = straight_neighbours(table.points, table.kind, records.tag)
    if (records.free & (closes == 0)).any():
        joined = np.diff(records.tag, prepend=-1) == 1
        joined[:1] = False
        own_end = table.line[records.tag] == records.line
        around = Around((starts, ends), cuts, joined, own_end)
        user = ARC_SENSES[state.options.arc_sense] if state.options.arc_sense else 0
        told = (user or int(state.dialect.turned_vectors), user)
        arcs = settled_senses(arcs, closes, records, around, told, state.faults, state.uses)
    if state.dialect.arc_sense in (ArcSense.WORD, ArcSense.OPEN):
        against = tangency(arcs, starts, ends, *cuts).sum(axis=1) == -2
        for row in np.flatnonzero(against).tolist():
            text = "the sense of an arc is against the straight cuts at both of its ends"
            state.faults.warn("APT132", text, int(records.line[row]))
    return arcs


def straight_neighbours(
    points: FloatArray, kind: IntArray, tags: IntArray
) -> tuple[FloatArray, FloatArray]:
    """Return directions (m, 3) [m] of the straight cuts before and after motions, NaN for none."""
    n = len(points)
    before = np.full((len(tags), 3), np.nan)
    after = np.full((len(tags), 3), np.nan)
    rows = np.flatnonzero((tags >= 2) & (kind[tags - 1] == MotionKind.LINEAR))
    rows = rows[kind[tags[rows] - 2] != MotionKind.HOLE]
    before[rows] = points[tags[rows] - 1] - points[tags[rows] - 2]
    rows = np.flatnonzero(tags + 1 < n)
    rows = rows[kind[tags[rows] + 1] == MotionKind.LINEAR]
    after[rows] = points[tags[rows] + 1] - points[tags[rows]]
    return before, after


def _settle_feeds(table: Tags, cycles: list[Cycle]) -> None:
    """Rapids have no feed; a hole has its cycle's feed, else the modal one."""
    table.feed[table.kind == MotionKind.RAPID] = np.nan
    if cycles:
        of_cycle = np.array([cycle.feed for cycle in cycles])[table.cycle]
        own = (table.cycle >= 0) & ~np.isnan(of_cycle)
        table.feed[own] = of_cycle[own]


def _events(state: AptState, shift: IndexArray) -> tuple[Event, ...]:
    if not state.splines:
        return tuple(record.event for record in state.events)
    return tuple(
        replace(record.event, index=record.event.index + int(shift[record.splines]))
        for record in state.events
    )


_UNITS = re.compile(rb"^[ \t]*UNITS?[ \t]*/[ \t]*([A-Z]*)", re.MULTILINE | re.IGNORECASE)
_INCH_FEEDS = re.compile(rb"\b(IPM|IPR)\b", re.IGNORECASE)
_MM_FEEDS = re.compile(rb"\b(MMPM|MMPR)\b", re.IGNORECASE)


def read_file(path: str, options: ReadOptions) -> ToolPath:
    """Return the toolpath of a CL file; errors have an ``APT`` code and the line."""
    faults = Faults(path, options.recover)
    state: AptState | None = None
    motion_reader: MotionReader | None = None
    last_motion = 0
    for block in statement_blocks(path):
        if state is None or motion_reader is None:
            state = _new_state(block, options, faults)
            motion_reader = MotionReader(state.dialect, faults, state.uses)
        last_motion = _read_block(block, state, motion_reader) or last_motion
    if state is None or motion_reader is None:
        raise faults.error("APT001", "no statement in this file", 1)
    motion_reader.finish()
    close_spline(state)
    check_homes(state)
    settle_tools(state)
    if 0 < state.first_fini < last_motion:
        state.uses.refuse(
            "FINI", WordClass.GEOMETRY, state.first_fini,
            f"the part ends here, but motions follow down to line {last_motion}; they are "
            "read as more of it",
        )  # fmt: skip
    last_open = max(last_motion, state.last_open)
    if last_open > state.last_end:
        ends = " or ".join(sorted(state.dialect.ends))
        text = f"the file ends without {ends}, it may be cut off"
        faults.fix("APT009", text, "it is taken as complete", last_open)
    return finished_toolpath(state, path)


def _new_state(block: TextBlock, options: ReadOptions, faults: Faults) -> AptState:
    dialect = dialect_of(block.data[:HEAD_BYTES], options.dialect)
    units = _units_of(block.data, dialect, options, faults)
    return AptState(dialect, options, faults, LENGTH_UNITS[units], units)


def _read_block(block: TextBlock, state: AptState, motion_reader: MotionReader) -> int:
    """Read one block; return the line of its last motion, 0 if it has none."""
    scanned = scan(block, state.faults)
    motions = motion_reader.read(scanned)
    lines = np.array([index for index, _ in scanned.others], dtype=np.int64)
    for (index, statement), at in zip(
        scanned.others, np.searchsorted(motions.lines, lines).tolist(), strict=True
    ):
        state.at, state.line, state.text = at, scanned.line(index), statement.text
        (comment if statement.word == COMMENT else handle)(state, statement)
    state.close_block(motions, block.first_line)
    _count_words(state, scanned)
    return block.first_line + int(motions.lines[-1]) if len(motions.lines) else 0


def _count_words(state: AptState, scanned: Scan) -> None:
    counts = Counter(statement.word for _, statement in scanned.others)
    del counts[COMMENT]
    counts |= {
        "GOTO": int((scanned.code == GOTO).sum()),
        "CIRCLE": int((scanned.code == CIRCLE).sum()),
        "RAPID": int((scanned.code == RAPID).sum()),
        "PAINT": scanned.displayed,
    }
    state.words.update(+counts)


def _units_of(data: bytes, dialect: Dialect, options: ReadOptions, faults: Faults) -> str:
    """Return the unit of length: as written, as asked for, as the feeds say, as the system does."""
    stated = _UNITS.search(data)
    if stated:
        line = data.count(b"\n", 0, stated.start()) + 1
        text = stated.group(1).decode("ascii").upper()
        name = unit_name(text)
        if name is None:
            raise faults.error("APT012", "unknown unit of length", line, text)
        if options.units not in (None, name):
            text = f"the file is in {name}, but --units says {options.units}"
            raise faults.error("APT013", text, line)
        return name
    if options.units is not None:
        return options.units
    inch, mm = _INCH_FEEDS.search(data) is not None, _MM_FEEDS.search(data) is not None
    if inch != mm:
        name = "inch" if inch else "mm"
        faults.warn("APT110", f"no UNITS record: read in {name}, as the feeds say", 1)
        return name
    if dialect.implied_units is not None:
        name = dialect.implied_units
        faults.warn("APT110", f"no UNITS record: read in {name}, as {dialect.name} does", 1)
        return name
    message = "no unit of length: neither a UNITS record nor a feed unit"
    raise faults.error("APT010", message, 1, hint="give it with --units mm or --units inch")
