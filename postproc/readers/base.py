"""What all readers share: options, the registry, sniffing, and ``read``.

A reader is one class with a ``sniff`` and a ``read``, registered by ``READERS.register(name)``;
foreign readers come by the entry-point group ``postproc.readers``. Every file is shown to every
reader, so a large one loads what it reads with in its ``read``.
"""

from __future__ import annotations

import re
from collections.abc import Hashable, Iterable, Sequence
from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from postproc.arrays import NONE, AnyIntArray, FloatArray, IntArray
from postproc.cell import Reading
from postproc.errors import Finding, PluginError, ReadError, Severity, SourceRef, UsageError
from postproc.files import open_input, spooled
from postproc.model import CamTool, Event, EventKind, ToolPath
from postproc.readers.text import AS_CSV, check_text, line_feeds
from postproc.records import dataclass
from postproc.registry import Registry
from postproc.units import MM, SINGLE

LENGTH_UNITS = {name: SINGLE[name].factor for name in ("mm", "inch", "m")}
"""Metres per unit of length, by the names that ``--units`` takes."""
ARC_SENSES = {"ccw": 1, "cw": -1}
"""About the written vector, by the names that ``--arc-sense`` takes."""
FULL_CIRCLE_GAP = 1e-4 * MM
"""Start and end of an arc closer than this are a full circle [m]."""
RADIUS_GAP = 0.02 * MM
"""How far [m] the radii of an arc at start, at end and as written may differ: rounding of files,"""
_RELATIVE_GAP = 1e-4
"""and more by this share of the radius."""
DEFAULT_CLEARANCE = 2.0 * MM
"""Height [m] above a hole where the feed starts if the file does not say."""
CYCLE_WORDS = (
    "depth", "clearance", "retract", "peck", "peck_first", "dwell", "feed", "shift", "-",
)  # fmt: skip
"""What a number of a positional drill cycle can mean."""
CATIA_WORDS = ("depth", "clearance", "feed", "dwell")
HEAD_BYTES = 1 << 16
_POST = "post the operation as APT/CL, G-code or CSV; --format names one that is not recognised"
_SOLID = "a solid belongs into the cell: meshes of [workpiece], [tool] or [[obstacles]]; " + _POST
_PROGRAM = "lint, verify and diff read programs; convert, inspect and stiffness read CAM files"
Numbers = TypeVar("Numbers", float, FloatArray)


def radius_gap(radius: Numbers) -> Numbers:
    """Return how far the radii of an arc may differ [m]."""
    return RADIUS_GAP + _RELATIVE_GAP * radius


class SurfaceNormals(Protocol):
    """Outward unit normals of the workpiece's mesh."""

    def __call__(self, points: FloatArray, bases: Sequence[str] = (), /) -> FloatArray:
        """Return normals (n, 3) nearest to points (n, 3) [m], both in the base of their row.

        ``bases`` (n,): what the file calls the base of each row, empty where it says nothing.
        """
        ...


@dataclass(frozen=True, slots=True)
class ReadOptions(Reading):
    """How a file is to be read: ``[import]`` of a cell, and what is no key of a cell.

    Args:
        recover: fix what has one possible meaning and list it, instead of an error.
        tool_axis: (3,) axis of the TCP frame that points out of the tool into the part; turns a
            full orientation of the input into a tool axis: ``axes = -(R_part_tcp @ tool_axis)``.
        surface_normals: points of the part to outward normals of the workpiece's mesh; stands in
            where a CSV file gives no orientation.
        points_only: only to look at: a list without orientations is read all the same, with axes
            NaN and a warning, and what is not understood is listed.
        chord_tolerance: how far [m] the chords of a discretised spline may leave the curve.
    """

    recover: bool = False
    tool_axis: tuple[float, ...] = (1.0, 0.0, 0.0)
    surface_normals: SurfaceNormals | None = None
    points_only: bool = False
    chord_tolerance: float = 1e-5

    def __post_init__(self) -> None:
        """Check the names: UsageError IO020, IO021."""
        if self.units is not None and self.units not in LENGTH_UNITS:
            known = ", ".join(LENGTH_UNITS)
            raise UsageError("IO020", f"no unit of length {self.units!r}, known are {known}")
        if self.feed_units not in (None, "mm", "inch"):
            raise UsageError("IO020", f"no unit of feed {self.feed_units!r}, known are mm, inch")
        if self.arc_sense not in (None, *ARC_SENSES):
            raise UsageError("IO020", f"no sense of arcs {self.arc_sense!r}, known are ccw, cw")
        wrong = [word for word in self.cycle_numbers if word not in CYCLE_WORDS]
        if wrong:
            known = ", ".join(CYCLE_WORDS)
            raise UsageError("IO021", f"no cycle word {wrong[0]!r}, known are {known}")

    @property
    def cycle_numbers(self) -> tuple[str, ...]:
        """Meaning of the positional numbers of a drill cycle, in order."""
        words = self.cycle_words
        return CATIA_WORDS if words is None else tuple(words.replace(",", " ").split())


def distinct(keys: Iterable[Hashable]) -> tuple[IntArray, dict[Any, int]]:
    """Return which of the distinct keys each of n rows has, and the first row of each key.

    Indices (n,) in the order of first rows, -1 for a key that is false: the row names nothing.
    """
    first: dict[Any, int] = {}
    index: dict[Any, int] = {}
    column = []
    for row, key in enumerate(keys):
        if key and key not in index:
            index[key], first[key] = len(index), row
        column.append(index[key] if key else NONE)
    return np.array(column, dtype=np.int32), first


def tool_changes(
    tool: AnyIntArray, tools: Sequence[CamTool], line: AnyIntArray, *, with_first: bool
) -> list[Event]:
    """Return an event with number and name wherever another tool works than before.

    ``tool`` (n,): indices into ``tools``, -1 where none is called: the one before stays.
    ``with_first``: whether the first tool is changed to, too; else it is in the spindle already.
    """
    called = np.flatnonzero(tool >= 0)
    changed = called[np.diff(tool[called], prepend=-1) != 0]
    return [
        Event(i, EventKind.TOOL_CHANGE, float(new.number), new.name, int(line[i]))
        for i in changed[0 if with_first else 1 :].tolist()
        for new in [tools[tool[i]]]
    ]


def read_options(reading: Reading, **more: Any) -> ReadOptions:  # noqa: ANN401 - fields of the options
    """Return how a file is to be read: as a cell says, and ``more`` fields of the options."""
    keys = {key.name: getattr(reading, key.name) for key in fields(Reading)}
    return ReadOptions(**keys, **more)


@runtime_checkable
class Reader(Protocol):
    """What a reader offers.

    It may also have ``suffixes``: file name endings, with the point and in lower case, of files
    that ``batch`` takes from a folder.
    """

    def sniff(self, head: bytes) -> float:
        """Return how sure (0 to 1) the reader is that the file is its own, from its head."""

    def read(self, path: str, options: ReadOptions) -> ToolPath:
        """Return the toolpath.

        Raises:
            PostprocError: if the file cannot be read as this format.
        """


READERS: Registry[Reader] = Registry("readers", "postproc.readers", Reader)


def read(path: str | Path, options: ReadOptions | None = None) -> ToolPath:
    """Return the toolpath of a CAM file.

    Args:
        path: the file.
        options: see ``ReadOptions``; its ``format`` is ``auto`` or the name of a registered reader.

    Raises:
        ReadError: IO001 missing, IO002 unreadable, IO010 no format fits, IO011 empty, IO012 not a
            text file, IO014 no motion in it; and the codes of the reader.
        UsageError: IO013 if two formats fit equally well.
        PluginError: PLG001 for an unknown format, PLG006 if a foreign reader fails.
    """
    with spooled(path):
        return _read(str(path), options or ReadOptions())


def _read(name: str, options: ReadOptions) -> ToolPath:
    head = _head(name)
    is_named = options.format != "auto"
    chosen, left_out = (options.format, ()) if is_named else _sniffed(name, head)
    reader = READERS.get(chosen)
    with READERS.blame(chosen):
        toolpath = reader.read(name, options).accepting(options.accept_words)
    if len(toolpath) == 0:
        text = "no motion in this file, expected at least one point"
        raise ReadError("IO014", text, SourceRef(name))
    if left_out:
        return replace(toolpath, warnings=(*left_out, *toolpath.warnings))
    return toolpath


def _head(path: str) -> bytes:
    """Return the first bytes of a text file."""
    with open_input(path) as stream:
        head = line_feeds(stream.read(HEAD_BYTES))
    if not head.strip():
        raise ReadError("IO011", "empty file, expected a toolpath", SourceRef(path))
    check_text(path, head, 1)
    return head


_FOREIGN = (
    (re.compile(rb"ISO-10303-21;"), "a STEP solid", _SOLID),
    (re.compile(rb"solid |\s*facet "), "an STL solid", _SOLID),
    (re.compile(rb".{72}S {6}1", re.DOTALL), "an IGES model", _SOLID),
    (re.compile(rb"\s*0\r?\nSECTION"), "a DXF drawing", _POST),
    (re.compile(rb"%PDF-"), "a PDF document", _POST),
    (re.compile(rb"(?:&\w+.*\s+)*(?:GLOBAL )?DEF(?:DAT|FCT)? ", re.I), "a KUKA program", _PROGRAM),
    (re.compile(rb"MODULE \w+"), "a RAPID program of ABB", _POST),
    (re.compile(rb"/PROG "), "a TP program of Fanuc", _POST),
)
"""How files begin that people take for a toolpath: what each is, and what to do with it."""


_SHEETS = (".xlsx", ".xlsm", ".xls", ".ods")


def _unknown(path: str, head: bytes) -> ReadError:
    """Return the error of a file that no reader takes."""
    known = ", ".join(name for name, _ in READERS)
    for pattern, what, hint in _FOREIGN:
        if pattern.match(head.removeprefix(b"\xef\xbb\xbf").lstrip()):
            return ReadError("IO010", f"{what}, expected {known}", SourceRef(path), hint)
    text, hint = f"this is none of the formats {known}", _POST
    ending = Path(path).suffix.lower()
    if ending in _SHEETS:
        text = f"a damaged spreadsheet or another file named {ending}, expected {known}"
        hint = f"open it {AS_CSV}"
    for name, reader in READERS:
        if ending in getattr(reader, "suffixes", ()):
            text = f"named {ending} as {name} is, but nothing in it looks like {name}"
            hint = f"--format {name} reads it as {name} all the same and says what is wrong with it"
    return ReadError("IO010", text, SourceRef(path), hint)


def _sniffed(path: str, head: bytes) -> tuple[str, tuple[Finding, ...]]:
    """Return the name of the reader that is surest, and plug-ins that failed to say."""
    scores, failed = [], []
    for name, reader in READERS:
        try:
            with READERS.blame(name):
                scores.append((reader.sniff(head), name))
        except PluginError as problem:
            failed.append(Finding(Severity.WARNING, "PLG007", f"not asked: {problem.message}"))
    best, runner_up = sorted([(0.0, ""), (0.0, ""), *scores])[:-3:-1]
    if best[0] <= 0.0:
        raise _unknown(path, head)
    if best[0] == runner_up[0]:
        text = f"this may be {best[1]} or {runner_up[1]}, say which with --format"
        raise UsageError("IO013", text, SourceRef(path))
    return best[1], tuple(failed)
