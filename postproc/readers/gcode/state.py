"""What holds while a G-code program runs, and the rows of the toolpath that it has made."""

from __future__ import annotations

from dataclasses import field
from math import nan
from typing import NamedTuple

import numpy as np

from postproc.arrays import ROUNDING, FloatArray
from postproc.model import CamSetup, CamTool, Cycle, Event, EventKind, MotionKind, Operation
from postproc.readers.base import LENGTH_UNITS, ReadOptions
from postproc.readers.gcode.arcs import ArcRow
from postproc.readers.gcode.blocks import Block
from postproc.readers.gcode.head import UPRIGHT, head_of
from postproc.readers.text import Faults, shortened
from postproc.readers.uses import AtLine
from postproc.records import dataclass

NONE = -1


class Tag(NamedTuple):
    """A row of the toolpath: feed [m/s], ``arc`` and ``cycle`` as indices, ``blend`` [m]."""

    point: FloatArray
    axis: FloatArray
    kind: MotionKind
    feed: float
    line: int
    operation: int
    tool: int
    arc: int
    cycle: int
    setup: int
    blend: float


@dataclass(slots=True)
class Modes:
    """Codes that hold, by their group; ``motion`` empty after G80."""

    motion: str = ""
    plane: str = "G17"
    distance: str = ""
    centre: str = "G91.1"
    feed: str = "G94"
    retract: str = ""
    path: str = "G64"
    units: str = ""


@dataclass(slots=True)
class Drill:
    """A series of holes: the level [m] it began at, and words that hold until G80."""

    initial: float = float("nan")
    words: dict[str, float] = field(default_factory=dict)


class Machine(AtLine):
    """The control that the program believes to run on; lengths [m], NaN where not known."""

    def __init__(self, options: ReadOptions, faults: Faults, dialect: str) -> None:
        super().__init__(faults)
        self.options, self.dialect = options, dialect
        self.modes = Modes()
        self.tags: list[Tag] = []
        self.block: Block
        """The one at hand."""
        self.drill = Drill()
        self.position: FloatArray = np.full(3, np.nan)
        self.homed_line = 0
        """Line of a reference move along z since the last tag, 0 for none."""
        self.feed = float("nan")
        """As written: [m/min], [m/turn] with G95."""
        self.speed, self.turning = float("nan"), 0.0
        """Spindle speed [turns/s] as S says; 1 clockwise, -1 counterclockwise, 0 standing."""
        self.selected, self.tool, self.base = NONE, NONE, NONE
        self.tools: list[CamTool] = []
        self.setups: list[CamSetup] = []
        self.cycles: dict[Cycle, int] = {}
        self.arcs: list[ArcRow] = []
        self.events: list[Event] = []
        self.operations: list[Operation] = []
        self.remark = ""
        self.ended = False
        self.head = head_of(options.head)
        self.turned: dict[str, float] = {}
        """Angles [deg] of the head's words, NaN behind a reference move."""
        self.turned_at_last: dict[str, float] = {}
        """These at the last tag."""
        self.of_tip = self.head is not None and self.head.of_tip
        """Whether X, Y, Z are of the tool tip, however the head stands."""

    @property
    def absolute(self) -> bool:
        """Whether coordinates count from the origin."""
        return self.modes.distance != "G91"

    @property
    def axis(self) -> FloatArray:
        """Tool axis (3,) from tip to holder, NaN where the head's place is not known."""
        return UPRIGHT if self.head is None else self.head.axis(self.turned)

    @property
    def leans(self) -> bool:
        """Whether the tool axis is known to be another one than z."""
        axis = self.axis
        return bool(np.isfinite(axis).all() and np.abs(axis - UPRIGHT).max() > ROUNDING)

    def scale(self) -> float:
        """Return metres per unit of length, which the file or the call must say."""
        stated = {"G20": "inch", "G70": "inch", "G21": "mm", "G71": "mm"}.get(self.modes.units)
        asked = self.options.units
        if stated is None and asked is None:
            text = "neither G20 nor G21 before the first length, expected one"
            raise self.error("GCD005", text, "say it with --units mm or --units inch")
        if stated is not None and asked not in (None, stated):
            raise self.error("GCD006", f"the file is in {stated}, but --units says {asked}")
        return LENGTH_UNITS[stated or str(asked)]

    def event(self, kind: EventKind, value: float = 0.0, text: str = "") -> None:
        """Keep what happens before the next tag."""
        self.events.append(Event(len(self.tags), kind, value, text, self.line))

    def tag(
        self,
        kind: MotionKind,
        point: FloatArray,
        line: int = 0,
        *,
        feed: float = nan,
        arc: int = NONE,
        cycle: int = NONE,
        blend: float = nan,
    ) -> None:
        """Add a tag, see ``Tag``; ``line``: its own, 0 for that of the block at hand."""
        line, axis = line or self.line, self.axis
        if self.remark:
            self.operations.append(Operation(shortened(self.remark), line))
            self.remark = ""
        if np.isnan(axis).any():
            text = "a motion while it is not known how the head stands"
            hint = "say it before: B0 C0; a file of three axes needs no [import] head"
            raise self.faults.error("GCD019", text, line, hint=hint)
        self.turned_at_last = dict(self.turned)
        operation, blend = len(self.operations) - 1, 0.0 if self.modes.path == "G61" else blend
        place = (feed, line, operation, self.tool, arc, cycle, self.base, blend)
        self.tags.append(Tag(point.copy(), axis, kind, *place))

    def path_feed(self) -> float:
        """Return the feed of a cut [m/s], NaN where the file gives none."""
        if self.modes.feed != "G95":
            return self.feed / 60.0
        if not self.speed > 0.0:
            raise self.error("GCD014", "a feed per turn without a spindle speed")
        return self.feed * self.speed
