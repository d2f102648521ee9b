"""What is in force while a CL file is read, and the columns of the toolpath that grow from it."""

from __future__ import annotations

from collections import Counter
from dataclasses import field, replace
from typing import Generic, TypeVar

import numpy as np

from postproc.arrays import NONE, FloatArray, IndexArray, IntArray, Table
from postproc.model import Cycle, Event, EventKind, MotionKind, Operation
from postproc.readers.apt.arcs import ArcRecords
from postproc.readers.apt.dialect import Dialect
from postproc.readers.apt.heights import ByTurns, Heights
from postproc.readers.apt.motion import Motions
from postproc.readers.apt.resolve import resolve_points
from postproc.readers.apt.setup import (
    AXIS_NORM_GAP,
    MatrixComment,
    Place,
    Said,
    SetupTable,
    TiltedTable,
    ToolTable,
)
from postproc.readers.apt.statement import Statement
from postproc.readers.base import ReadOptions
from postproc.readers.text import Faults
from postproc.readers.uses import AtLine, Key
from postproc.records import dataclass

T = TypeVar("T", int, float)


class Modal(Generic[T]):
    """A value that holds from one point of a block to the next change.

    ``value`` is the one in force now. ``set`` takes the index in the block of the next point.
    """

    def __init__(self, value: T) -> None:
        self.value: T = value
        self._first: T = value
        self._at: list[int] = []
        self._values: list[T] = []

    def set(self, at: int, value: T) -> None:
        """Let ``value`` hold from point ``at`` of the block on."""
        if value == self.value:
            return
        self.value = value
        self._at.append(at)
        self._values.append(value)

    def mark(self, at: int, value: T) -> None:
        """Set even an equal value, for what must be told apart by where it was set."""
        self.value = value
        self._at.append(at)
        self._values.append(value)

    def column(self, n: int) -> FloatArray:
        """Return the values (n,) at the block's points and begin the next block."""
        values, _ = self.column_with_origin(n)
        return values

    def column_with_origin(self, n: int) -> tuple[FloatArray, IndexArray]:
        """Return also the point (n,) from which on each value holds, -1 for the carried one."""
        counts = np.diff(np.array([0, *self._at, n]))
        values = np.repeat(np.array([self._first, *self._values], dtype=np.float64), counts)
        origin = np.repeat(np.array([-1, *self._at], dtype=np.int64), counts)
        self._at, self._values, self._first = [], [], self.value
        return values, origin


NAN = float("nan")


@dataclass(frozen=True, slots=True)
class SplineRecord:
    """A NURBS of the file: the tag it stands before, its numbers [m], and what is in force."""

    tag: int
    line: int
    knots: tuple[float, ...]
    points: FloatArray
    feed: float
    operation: int


@dataclass(slots=True)
class SplineDraft:
    """A NURBS whose KNOT and CNTRL lines are still coming, numbers as written."""

    line: int
    tag: int
    R: FloatArray
    t: FloatArray
    feed: float
    operation: int
    knots: list[float] = field(default_factory=list)
    points: list[list[float]] = field(default_factory=list)


@dataclass(frozen=True, slots=True)
class EventRecord:
    """An event with the number of splines read before it, so that it keeps its place."""

    event: Event
    splines: int


@dataclass(slots=True)
class Tags(Table):
    """Tags in columns of length n, as in ``ToolPath``; the tools are known at the end."""

    points: FloatArray
    axes: FloatArray
    kind: IntArray
    feed: FloatArray
    line: IntArray
    operation: IntArray
    tool: IntArray
    cycle: IntArray


@dataclass(slots=True)
class KnownCycles:
    """Drill cycles by what a statement may refer to.

    ``words``, ``last``: parameters and index of the last one, for CYCLE/ON; ``index`` by all that a
    cycle says (as text: NaN is not equal to itself); ``memo``: index, parameters and what was said
    about it, by the text; ``heights``: levels, word and lines by index; ``turned``: what depends on
    the spindle, by index; ``void``: tag and line of each CYCLE/ON without a cycle before it.
    """

    words: dict[str, float] = field(default_factory=dict)
    last: int = -1
    index: dict[str, int] = field(default_factory=dict)
    memo: dict[str, tuple[int, dict[str, float], list[Key]]] = field(default_factory=dict)
    heights: dict[int, tuple[Heights, str, list[int]]] = field(default_factory=dict)
    turned: dict[int, ByTurns] = field(default_factory=dict)
    void: list[tuple[int, int]] = field(default_factory=list)


class AptState(AtLine):
    """Modal state of one reading; ``scale``: metres per unit of length of the file."""

    def __init__(
        self, dialect: Dialect, options: ReadOptions, faults: Faults, scale: float, units: str
    ) -> None:
        super().__init__(faults)
        self.dialect, self.options = dialect, options
        self.scale, self.units = scale, units
        self.blocks: list[Tags] = []
        self.arcs: list[ArcRecords] = []
        """Finished blocks of tags and their arcs, to be joined at the end."""
        self.done = 0
        """Tags in finished blocks."""
        self.at = 0
        """Index in the block of the next point."""
        self.operations: list[Operation] = []
        self.tools = ToolTable()
        self.cycles: list[Cycle] = []
        self.events: list[EventRecord] = []
        self.splines: list[SplineRecord] = []
        self.unknown: dict[str, int] = {}
        self.centre_points = False
        """Whether the file says that its points are those of the tool centre."""
        self.setups = SetupTable()
        self.homes: list[tuple[int, int]] = []
        """Tag before which, and line where, GOHOME stands."""
        self.words: Counter[str] = Counter()
        self.feed = Modal(NAN)
        self.operation = Modal(-1)
        self.cycle = Modal(-1)
        self.frame = Modal(0)
        self.axis = Modal(0)
        self.frames: list[tuple[FloatArray, FloatArray]] = [(np.eye(3), np.zeros(3))]
        self.axis_table: list[tuple[float, float, float]] = [(0.0, 0.0, 1.0)]
        self.start: FloatArray | None = None
        """Where FROM put the tool before the first motion [m], part frame."""
        self.spindle = NAN
        """Turns per second, unsigned."""
        self.spindle_sign, self.spindle_signed = 1.0, False
        """-1 counterclockwise; whether the sign of a speed says so."""
        self.revolution_feed: float | None = None
        self.waiting_feed: tuple[int, str, int] | None = None
        """A feed per turn that waits for the spindle's speed: points before it, unit, line."""
        """Feed per turn [m] in force, None if the feed is per time."""
        self.drill = KnownCycles()
        self.feed_memo: dict[str, float] = {}
        """Feed by text, of feeds that depend on nothing else."""
        self.table = TiltedTable()
        self.matrix = MatrixComment()
        self.last_point: FloatArray | None = None
        """The last point in file coordinates and units, for increments."""
        self.last_open = self.last_end = self.first_fini = 0
        """Lines of the last TOOL PATH, which an end word must close; of the last word that may end
        a file; of the first FINI, behind which nothing belongs to the part."""
        self.spline: SplineDraft | None = None

    @property
    def tag(self) -> int:
        """Index of the next tag in the whole file, splines not counted."""
        return self.done + self.at

    @property
    def place(self) -> Place:
        """Where the next statement stands."""
        return Place(self.tag, len(self.splines), len(self.events))

    def add_event(self, kind: EventKind, value: float = 0.0, text: str = "") -> None:
        """Keep an event before the next motion."""
        event = Event(self.tag, kind, value, text, self.line)
        self.events.append(EventRecord(event, len(self.splines)))

    def add_operation(self, name: str) -> None:
        """Begin an operation at the next point."""
        self.operations.append(Operation(name, self.line))
        self.operation.set(self.at, len(self.operations) - 1)

    def add_tool(self, statement: Statement, said: Said, *, loads: bool = False) -> None:
        """Begin or complete the tool at the next point."""
        self.tools.update(self.place, statement, self.line, said, loads=loads)

    def set_feed(self, value: float) -> None:
        """Let a feed [m/s] hold from the next point on."""
        self.feed.set(self.at, value)

    def set_axis(self, i: float, j: float, k: float) -> None:
        """Let a tool axis hold for points that give none, from the next point on."""
        self.axis_table.append((i, j, k))
        self.axis.mark(self.at, len(self.axis_table) - 1)

    def set_frame(self, R: FloatArray, t: FloatArray) -> None:
        """Let ``p_part = R p_file + t`` [m] hold from the next point on."""
        self.frames.append((R, t))
        self.frame.set(self.at, len(self.frames) - 1)
        self.last_point = None

    def close_block(self, motions: Motions, first_line: int) -> None:
        """Append a block's points, with what was in force at each, to the columns."""
        k = len(motions.lines)
        lines = (motions.lines + first_line).astype(np.int32)
        axes = self._axes(motions.points, lines)
        resolve_points(motions, axes, self.last_point, lines, self.faults)
        if k:
            self.last_point = motions.points[-1].copy()
        points = motions.points[:, :3] * self.scale
        frame = self.frame.column(k).astype(np.int32)
        cycle = self.cycle.column(k).astype(np.int32)
        arcs = self._in_part(motions.arcs, frame)
        for index in np.unique(frame[frame > 0]).tolist():
            R, t = self.frames[index]
            rows = frame == index
            points[rows] = points[rows] @ R.T + t
            axes[rows] = axes[rows] @ R.T
        kind = np.full(k, MotionKind.LINEAR, dtype=np.int32)
        kind[motions.rapid] = MotionKind.RAPID
        kind[arcs.tag] = MotionKind.ARC
        cycle[motions.suspends] = -1
        kind[cycle >= 0] = MotionKind.HOLE
        self._check_kinds(motions, kind, arcs)
        feed, operation = self.feed.column(k), self.operation.column(k).astype(np.int32)
        tool = np.full(k, NONE, dtype=np.int32)
        self.blocks.append(Tags(points, axes, kind, feed, lines, operation, tool, cycle))
        self.arcs.append(replace(arcs, tag=arcs.tag + self.done))
        self.done += k
        self.at = 0

    def _axes(self, points: FloatArray, lines: IntArray) -> FloatArray:
        """Return the unit tool axis (k, 3) in file coordinates, by the dialect's rule."""
        k = len(points)
        index, origin = self.axis.column_with_origin(k)
        axes: FloatArray = np.array(self.axis_table)[index.astype(np.int64)]
        given = ~np.isnan(points[:, 3])
        if given.any():
            axes[given] = self.unit_axes(points[given, 3:6], lines[given])
            if not self.dialect.axis_of_setup:
                last = np.maximum.accumulate(np.where(given, np.arange(k), -1))
                kept = (last >= origin) & (last >= 0)
                axes = np.where(kept[:, None], axes[last], axes)
                if kept[-1]:
                    self.axis_table.append(tuple(axes[-1].tolist()))
                    self.axis = Modal(len(self.axis_table) - 1)
        return axes

    def unit_axes(self, axes: FloatArray, lines: IntArray) -> FloatArray:
        """Return tool axes (k, 3) of length one; errors APT026 and APT027."""
        length = np.linalg.norm(axes, axis=1)
        zero = np.flatnonzero(length < AXIS_NORM_GAP)
        if len(zero):
            raise self.faults.error("APT026", "the tool axis is a zero vector", int(lines[zero[0]]))
        for i in np.flatnonzero(np.abs(length - 1.0) > AXIS_NORM_GAP)[:20].tolist():
            text = f"the tool axis has length {length[i]:.4f}, expected 1"
            self.faults.fix("APT027", text, "its direction is taken", int(lines[i]))
        unit: FloatArray = axes / length[:, None] + 0.0
        return unit

    def _in_part(self, arcs: ArcRecords, frame: IntArray) -> ArcRecords:
        """Return the arcs of a block in the part frame [m]; ``frame`` (k,) of its points."""
        centre, normal, tangent = arcs.centre * self.scale, arcs.normal, arcs.tangent
        of_arc = frame[arcs.tag]
        for index in np.unique(of_arc[of_arc > 0]).tolist():
            R, t = self.frames[index]
            rows = of_arc == index
            centre[rows] = centre[rows] @ R.T + t
            normal[rows] = normal[rows] @ R.T
            tangent[rows] = tangent[rows] @ R.T
        radius, rise = arcs.radius * self.scale, arcs.rise * self.scale
        return replace(arcs, centre=centre, radius=radius, rise=rise)

    def _check_kinds(self, motions: Motions, kind: IntArray, arcs: ArcRecords) -> None:
        """An arc inside a drill cycle or driven as a rapid has no single meaning."""
        wrong = np.flatnonzero(kind[arcs.tag] != MotionKind.ARC)
        if len(wrong):
            raise self.faults.error(
                "APT039", "an arc inside a drill cycle", int(arcs.line[wrong[0]])
            )
        rapid = np.flatnonzero(motions.rapid[arcs.tag])
        if len(rapid):
            text = "RAPID before an arc: the arc is run at feed"
            self.faults.warn("APT130", text, int(arcs.line[rapid[0]]))
