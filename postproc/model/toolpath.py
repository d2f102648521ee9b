"""The toolpath as the CAM system gave it, in columns, so that a million holes fit in memory.

Frame: ``part``, the CAM coordinates, which are those of the workpiece frame ($BASE) of the cell.
Units: SI. Arcs stay arcs, drill cycles stay cycles; nothing here knows a robot.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import field, replace
from enum import IntEnum, StrEnum
from typing import Any

import numpy as np

from postproc.arrays import (
    FloatArray,
    IntArray,
    Rows,
    Table,
    column,
    columns_at,
    columns_joined,
    freeze_columns,
    frozen_floats,
)
from postproc.errors import Finding, SourceRef
from postproc.records import dataclass


class MotionKind(IntEnum):
    """How the tool gets to a tag."""

    RAPID = 0
    LINEAR = 1
    ARC = 2
    """Along ``arcs[arc[i]]`` from the tag before."""
    HOLE = 3
    """Rapid to above the tag, then the stroke of ``cycles[cycle[i]]`` along the tool axis."""
    JOINT = 4
    """Straight in joint space (DELMIA joint moves)."""


CUTS = (MotionKind.LINEAR, MotionKind.ARC)
"""Motions on which the tool follows the path at its feed."""
WORKING = (*CUTS, MotionKind.HOLE)
"""Motions in which the tool works the part."""


class EventKind(StrEnum):
    """What happens between two motions."""

    SPINDLE_ON = "spindle_on"
    SPINDLE_OFF = "spindle_off"
    COOLANT_ON = "coolant_on"
    COOLANT_OFF = "coolant_off"
    DWELL = "dwell"
    STOP = "stop"
    OPTIONAL_STOP = "optional_stop"
    HALT = "halt"
    """The program waits for the operator, without a routine of the integrator."""
    TOOL_CHANGE = "tool_change"
    TAP_REVERSE = "tap_reverse"
    """The spindle turns back at the bottom of a tapped hole."""
    SPINDLE_ORIENT = "spindle_orient"
    """The spindle stops at the bottom of a bore, at the angle ``value``."""
    HOLE = "hole"
    """A step of a hole, ``text`` its name, ``value`` the number of the hole."""
    SIGNAL = "signal"
    """A signal is set: ``text`` its name, ``value`` 1 or 0, ``arguments`` its port."""
    WAIT_SIGNAL = "wait_signal"
    """The program waits for a signal, likewise."""
    MESSAGE = "message"
    UNKNOWN = "unknown"


@dataclass(frozen=True, slots=True)
class Event:
    """Something that happens before the motion to tag ``index`` (``index == n``: after the last).

    ``value``: spindle speed [turns/s] (negative = counterclockwise) or angle [rad], dwell [s], tool
    number, else 0. ``text``: the words of the file (coolant mode, message, unknown statement).
    ``arguments``: of a step of a hole: depth [m], feed [m/s], speed [turns/s], 0 where not given;
    of a signal: its port, 0 where not given.
    """

    index: int
    kind: EventKind
    value: float = 0.0
    text: str = ""
    line: int = 1
    arguments: tuple[float, ...] = ()


class CycleKind(StrEnum):
    """What a drill cycle does at depth and on its way out."""

    DRILL = "drill"
    FACE = "face"
    """Spot facing: as drilling, with a dwell."""
    CSINK = "csink"
    DEEP = "deep"
    """Pecks with full retracts."""
    BRKCHP = "brkchp"
    """Pecks with short retracts that break the chip."""
    REAM = "ream"
    """Feed in and out with the spindle running."""
    BORE = "bore"
    """Feed in, spindle stopped, feed out."""
    BORE_RAPID = "bore_rapid"
    """Feed in, spindle stopped, rapid out."""
    TAP = "tap"
    TAP_LEFT = "tap_left"
    RIGID_TAP = "rigid_tap"
    RIGID_TAP_LEFT = "rigid_tap_left"


@dataclass(frozen=True, slots=True)
class Cycle:
    """A drilling stroke along the tool axis; heights and depths from the hole's tag, all >= 0.

    ``clearance``: height above the tag where the feed starts; ``retract``: height above the tag
    where the tool ends; ``depth``: how far below the tag the tip goes; ``peck_first`` and ``peck``:
    pecking steps, 0 = none; ``break_chip``: short retracts instead of full ones; ``feed`` [m/s]
    or NaN for the modal feed; ``dwell`` [s] at the bottom; ``pitch`` [m] of a thread, NaN = not
    given; ``orient`` [rad] angle at which the spindle is to stand, NaN = any; ``shift`` [m] off the
    wall before the way out; ``repeat``: how often the hole is made; ``feed_per_turn`` [m] where
    the file gives the feed so, NaN else (``feed`` then holds at the speed of that line).
    """

    kind: CycleKind
    depth: float
    clearance: float
    retract: float
    peck_first: float = 0.0
    peck: float = 0.0
    break_chip: bool = False
    dwell: float = 0.0
    feed: float = float("nan")
    diameter: float = float("nan")
    pitch: float = float("nan")
    orient: float = float("nan")
    shift: float = 0.0
    repeat: int = 1
    feed_per_turn: float = float("nan")

    def __post_init__(self) -> None:
        """Take the kind also as text."""
        object.__setattr__(self, "kind", CycleKind(self.kind))


ORIENT = "CYCLE/ORIENT"
"""Word of a spindle that is to stand at an angle at the bottom of a hole."""


class WordClass(StrEnum):
    """What a word of a CAM file can change."""

    GEOMETRY = "geometry"
    COORDINATES = "coordinates"
    TOOL = "tool"
    PROCESS = "process"
    COMMENT = "comment"
    UNKNOWN = "unknown"
    """In no table: it may change anything."""


@dataclass(frozen=True, slots=True)
class WordUse:
    """A word that is not carried out as it stands, with all lines where it stands so.

    ``word``: the word as a user would name it to accept it, ``CUTCOM`` or ``MODE/INCR``;
    ``reason``: what it asks for and why that is not done; ``refused``: whether it forbids a program
    until the user accepts it, else it is a note; ``hint``: the option that would settle it.
    """

    word: str
    word_class: WordClass
    lines: tuple[int, ...]
    reason: str
    refused: bool
    hint: str = ""

    def is_named_by(self, words: Collection[str]) -> bool:
        """Return whether one of these words, in upper case, names it: ``MODE`` is all of MODE."""
        parts = self.word.upper().split("/")
        return any("/".join(parts[: k + 1]) in words for k in range(len(parts)))

    def accepted(self) -> WordUse:
        """Return it as a note: the user knows it to be harmless."""
        return replace(self, refused=False, reason=f"accepted by the user: {self.reason}", hint="")


@dataclass(frozen=True, slots=True)
class CamSetup:
    """A machining coordinate system that the file names, and where the file says it lies.

    ``matrix``: three rows of four numbers, p_part = R p_setup + t [m]; None where the file gives
    only a name. ``carried``: whether the points of the file are in its coordinates and were moved
    to those of the part by the matrix; else they stand as the file gives them. ``aliases``: other
    names that a cell may claim it by.
    """

    name: str
    line: int
    matrix: tuple[tuple[float, ...], ...] | None = None
    carried: bool = False
    aliases: tuple[str, ...] = ()

    @property
    def is_identity(self) -> bool:
        """Whether the file places it where the part's own coordinates lie."""
        return self.matrix is not None and np.allclose(self.matrix, np.eye(3, 4), atol=1e-9)


@dataclass(frozen=True, slots=True)
class CamTool:
    """A tool call of the CAM file; lengths [m], NaN where the file gives none."""

    number: int
    name: str = ""
    diameter: float = float("nan")
    corner_radius: float = float("nan")
    length: float = float("nan")
    line: int = 1


@dataclass(frozen=True, slots=True)
class Operation:
    """A named stretch of the toolpath."""

    name: str
    line: int = 1


@dataclass(frozen=True, slots=True)
class Arcs(Table):
    """Circular and helical arcs; the end point is the tag's, the start the tag before.

    ``centre`` (m, 3) [m]; ``normal`` (m, 3) unit: the motion is COUNTERCLOCKWISE about it, whatever
    the dialect wrote; ``radius`` (m,) [m]; ``sweep`` (m,) [rad] > 0, a full circle is 2 pi, a helix
    that passes its end angle n times before adds 2 pi n. The rise of a helix along ``normal`` is
    that from start to end.
    """

    centre: FloatArray
    normal: FloatArray
    radius: FloatArray
    sweep: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "centre", (None, 3))
        n = len(self.centre)
        frozen_floats(self, "normal", (n, 3))
        frozen_floats(self, "radius", (n,))
        frozen_floats(self, "sweep", (n,))

    @classmethod
    def none(cls) -> Arcs:
        """Return an empty table."""
        return cls(np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, slots=True)
class ToolPath:
    """All tags of one CAM file in columns of length n (one row: one motion end point).

    Args:
        path: input path as given by the user; ``name``: program name proposed by the input.
        format: ``apt``, ``csv``, ``delmia``; ``dialect``: ``nx``, ``solidworks``, ...
        units: unit of length of the file, ``mm``, ``inch`` or ``m``.
        points: (n, 3) tool tip [m], frame part.
        axes: (n, 3) unit tool axis from the tip to the holder, frame part.
        kind: (n,) ``MotionKind``.
        feed: (n,) [m/s]; NaN for rapids and where the file gives none.
        line: (n,) 1-based source line; operation, tool, arc, cycle: (n,) indices into the tables
            below, -1 = none; setup: likewise, None where the file names no coordinate system.
        rotations: (n, 3, 3) full orientation R_part_tcp where the input gave one, else None.
        joints: (n, 6) joint targets [rad] of the input, NaN where none, else None.
        largest_blend: (n,) how far [m] before a tag the next motion may begin, 0 = exact stop; NaN
            where the input leaves it to the cell.
        joint_fraction: (n,) largest share of axis speed, above 0 to 1, of joint motions to a tag;
            NaN where the input leaves it to the cell.
        names: ids of the tags where the input has them, else None.
        extra: further columns by name (diameter, ...), each of length n.
        unknown_words: words that the reader does not know, with their count.
        words: all major words of the file with their count, where the format has words.
        word_uses: words that are not carried out as they stand, refused ones among them.
        setups: coordinate systems that the file names, in the order of their lines.
        assumed: what the file leaves open and the reader took for it, in words.
        start: (3,) where FROM puts the tool before the first motion [m], None where nothing says.
        warnings: findings; ``recovered``: faults that ``--recover`` fixed.
    """

    path: str
    name: str
    format: str
    dialect: str
    units: str
    points: FloatArray = field(metadata=column("tag", 3))
    axes: FloatArray = field(metadata=column("tag", 3))
    kind: IntArray = field(metadata=column("tag", dtype=np.int32))
    feed: FloatArray = field(metadata=column("tag"))
    line: IntArray = field(metadata=column("tag", dtype=np.int32))
    operation: IntArray = field(metadata=column("tag", dtype=np.int32))
    tool: IntArray = field(metadata=column("tag", dtype=np.int32))
    arc: IntArray = field(metadata=column("tag", dtype=np.int32))
    cycle: IntArray = field(metadata=column("tag", dtype=np.int32))
    operations: tuple[Operation, ...] = ()
    tools: tuple[CamTool, ...] = ()
    arcs: Arcs = field(default_factory=Arcs.none)
    cycles: tuple[Cycle, ...] = ()
    events: tuple[Event, ...] = ()
    setup: IntArray | None = field(default=None, metadata=column("tag", dtype=np.int32))
    rotations: FloatArray | None = field(default=None, metadata=column("tag", 3, 3))
    joints: FloatArray | None = field(default=None, metadata=column("tag", 6))
    largest_blend: FloatArray | None = field(default=None, metadata=column("tag"))
    joint_fraction: FloatArray | None = field(default=None, metadata=column("tag"))
    names: tuple[str, ...] | None = field(default=None, metadata=column("tag", dtype=None))
    extra: Mapping[str, Any] = field(default_factory=dict, metadata=column("tag", dtype=None))
    unknown_words: Mapping[str, int] = field(default_factory=dict)
    words: Mapping[str, int] = field(default_factory=dict)
    word_uses: tuple[WordUse, ...] = ()
    setups: tuple[CamSetup, ...] = ()
    assumed: tuple[str, ...] = ()
    start: FloatArray | None = None
    warnings: tuple[Finding, ...] = ()
    recovered: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        for name in ("largest_blend", "joint_fraction"):
            if getattr(self, name) is None:
                object.__setattr__(self, name, np.full(len(self.points), np.nan))
        freeze_columns(self, tag=len(self.points))
        frozen_floats(self, "start", (3,))

    def __len__(self) -> int:
        """Return the number of tags."""
        return len(self.points)

    def accepting(self, words: Collection[str]) -> ToolPath:
        """Return it with the refused words that these name, in any case, as notes.

        Args:
            words: a word accepts all of its forms, ``WORD/FORM`` that one.

        Returns:
            The same toolpath with other ``word_uses``.
        """
        known = {word.strip().upper() for word in words}
        uses = tuple(
            use.accepted() if use.refused and use.is_named_by(known) else use
            for use in self.word_uses
        )
        return replace(self, word_uses=uses)

    def rows(self, index: Rows) -> ToolPath:
        """Return the tags ``index`` (k,) in this order; tables stay whole.

        An event stays before its tag, or before the first that was behind it in another order. Of
        tags that are left out the events are left out too.

        Args:
            index: indices, a slice or a mask of tags.

        Returns:
            A toolpath of these tags.
        """
        n = len(self)
        index = np.arange(n)[index]
        kept = np.append(np.isin(np.arange(n), index), n == 0 or n - 1 in index)
        reached = np.maximum.accumulate(index)
        events = tuple(
            replace(event, index=int(np.searchsorted(reached, event.index)))
            for event in self.events
            if kept[event.index]
        )
        return replace(self, events=events, **columns_at(self, "tag", index))

    @classmethod
    def concat(cls, parts: Sequence[ToolPath]) -> ToolPath:
        """Return the tags of toolpaths behind each other, with the tables of all.

        Path, name, format and units are those of the first.

        Args:
            parts: one toolpath or more.

        Returns:
            One toolpath.

        Raises:
            ValueError: for rotations or joints in some of them only.
        """
        if any(part.names is not None for part in parts):
            parts = [part.named() for part in parts]
        if any(part.setup is not None for part in parts):
            parts = [replace(part, setup=part.setup_of_tags) for part in parts]
        changes = columns_joined(parts, "tag")
        first = np.cumsum([0, *(len(part) for part in parts)]).tolist()
        for name in ("operation", "tool", "setup", "arc", "cycle"):
            if changes[name] is None:
                continue
            tables = [getattr(part, f"{name}s") for part in parts]
            start = np.cumsum([0, *(len(table) for table in tables)])
            own = np.repeat(start[:-1], np.diff(first))
            changes[name] = np.where(changes[name] < 0, -1, changes[name] + own)
            if name != "arc":
                changes[f"{name}s"] = tuple(row for table in tables for row in table)
        changes["arcs"] = Arcs.concat([part.arcs for part in parts])
        for name in ("word_uses", "setups", "warnings", "recovered"):
            changes[name] = tuple(row for part in parts for row in getattr(part, name))
        for name in ("words", "unknown_words"):
            changes[name] = dict(sum((Counter(getattr(part, name)) for part in parts), Counter()))
        changes["events"] = tuple(
            replace(event, index=event.index + low)
            for low, part in zip(first, parts, strict=False)
            for event in part.events
        )
        return replace(parts[0], **changes)

    @property
    def setup_of_tags(self) -> IntArray:
        """(n,) index of each tag's setup, -1 = none."""
        return np.full(len(self), -1, dtype=np.int32) if self.setup is None else self.setup

    def named(self) -> ToolPath:
        """Return the toolpath in which every tag has a name of its own."""
        return replace(self, names=tuple(self.tag_name(tag) for tag in range(len(self))))

    def source(self, tag_index: int, text: str = "") -> SourceRef:
        """Return where a tag stands in the input.

        Args:
            tag_index: from 0.
            text: what stands there, where it is known.

        Returns:
            File and line.
        """
        return SourceRef(self.path, int(self.line[tag_index]), text)

    def tag_name(self, tag_index: int) -> str:
        """Return the input's own name of a tag, else its index.

        Args:
            tag_index: from 0.

        Returns:
            The name as messages show it.
        """
        return self.names[tag_index] if self.names is not None else str(tag_index)
