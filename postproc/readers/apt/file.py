"""APT and CL files to a toolpath: NX, SolidWorks CAM, Creo, CATIA, CAMWorks and plain APT.

A file is read in blocks. In each block the points, arcs and rapids are taken in bulk
(``scan``, ``motion``), every other statement acts in order on the modal state (``words``), and the
columns of the block are cut from both (``state``).
"""

from __future__ import annotations

import re
from collections import Counter

import numpy as np

from postproc.model import ToolPath, WordClass
from postproc.readers.apt.dialect import Dialect
from postproc.readers.apt.finish import finished_toolpath
from postproc.readers.apt.motion import MotionReader, Motions
from postproc.readers.apt.nurbs import close_spline
from postproc.readers.apt.scan import CIRCLE, COMMENT, GOTO, RAPID, Scan, scan, statement_blocks
from postproc.readers.apt.seats import dialect_of
from postproc.readers.apt.state import AptState
from postproc.readers.apt.words import check_homes, comment, handle, settle_tools, unit_name
from postproc.readers.base import HEAD_BYTES, LENGTH_UNITS, ReadOptions
from postproc.readers.text import Faults, TextBlock

_UNITS = re.compile(rb"^[ \t]*UNITS?[ \t]*/[ \t]*([A-Z]*)", re.MULTILINE | re.IGNORECASE)
_INCH_FEEDS = re.compile(rb"\b(IPM|IPR)\b", re.IGNORECASE)
_MM_FEEDS = re.compile(rb"\b(MMPM|MMPR)\b", re.IGNORECASE)


def read_file(path: str, options: ReadOptions) -> ToolPath:
    """Return the toolpath of a CL file.

    Raises:
        ReadError: with an ``APT`` code and the line, see ``words`` and its neighbours.
    """
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
        faults.fix(
            "APT009",
            f"the file ends without {ends}, it may be cut off",
            "it is taken as complete",
            last_open,
        )
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
        state.at = at
        if statement.word == COMMENT:
            comment(state, statement.text, scanned.line(index))
        else:
            handle(state, statement, scanned.line(index))
    state.close_block(motions, block.first_line)
    _count_words(state, scanned)
    return _last_motion(motions, block)


def _last_motion(motions: Motions, block: TextBlock) -> int:
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
            raise faults.error(
                "APT013", f"the file is in {name}, but --units says {options.units}", line
            )
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
    raise faults.error(
        "APT010",
        "no unit of length: neither a UNITS record nor a feed unit",
        1,
        hint="give it with --units mm or --units inch",
    )
