"""Keys of ``[motion]`` and ``[process]``."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Annotated, Literal, Self, cast

import numpy as np
from pydantic import Field

from postproc.arrays import FloatArray, frozen_floats
from postproc.cell.choices import ArcMotion, PathEntry, PointService, SpindleStart
from postproc.cell.schema.table import CHOICE, Options, Read, Table, Text, entry, key
from postproc.records import dataclass

SixAngles = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=6, max_length=6)
]

Loads = Annotated[list[float], Field(min_length=3, max_length=3)]
HoleStep = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,20}$")]

UNIT_STEPS = ("clamp", "drill", "unclamp")
"""What is called at each hole that the end effector drills, where the cell does not say."""


class OperationLoadTable(Table):
    """The load on the tool in one operation of the CAM file."""

    name: Text = entry(..., "name of the operation, as in the CAM file")
    force_N: Loads = entry([0.0, 0.0, 0.0], "force ON the tool, TCP axes [N]")  # noqa: N815
    moment_Nm: Loads = entry([0.0, 0.0, 0.0], "moment ON the tool at the TCP, TCP axes [N*m]")  # noqa: N815


@dataclass(frozen=True, slots=True)
class Process(Options):
    """The load on the tool while it works, and how holes are made."""

    force: FloatArray = key((0.0, 0.0, 0.0), "force ON the tool, TCP axes [N]", "N", form=Loads)
    moment: FloatArray = key(
        (0.0, 0.0, 0.0), "moment ON the tool at the TCP, TCP axes [N*m]", "Nm", form=Loads
    )
    operations: Mapping[str, FloatArray] = key(
        (),
        "loads of single operations; all others take the load above",
        form=list[OperationLoadTable],
    )
    """The wrench (6,) of single operations of the CAM file, by name."""
    least_feed: float = key(
        None,
        "lowest share of the feed asked for that the process takes where an axis "
        "cannot follow; cuts that need less are led another way, else refused [%]; default: any",
        "percent",
        gt=0.0,
        le=100.0,
        missing=0.0,
    )
    feed_by: str = key(
        "robot",
        "who feeds the tool into a hole: robot, or unit: the robot stands where the "
        "feed begins, the end effector drills",
        form=Literal["robot", "unit"],
    )
    spindle: SpindleStart | None = key(
        None,
        "who starts the spindle: program: what drills or mills without a speed is "
        "refused; unit: the end effector itself; hand: a person; default: unit with feed_by = "
        "unit, program with spindle_rpm, else not known, and the answer says so first",
        form=Annotated[SpindleStart, CHOICE],
    )
    spindle_turns: float = key(
        None,
        "speed that the program starts the spindle with where the CAM data gives "
        "none, the way round that the tool cuts [1/min]; default: none",
        "rpm",
        called="spindle_rpm",
        gt=0.0,
        missing=0.0,
    )
    hole: tuple[str, ...] = key(
        None,
        "routines called at each hole, in order, with its number, depth [mm], feed "
        "[mm/min] and speed [1/min]; with feed_by = robot those up to drill (else all but the "
        "last) come before the stroke; default: none, clamp, drill, unclamp with feed_by = unit",
        form=list[HoleStep],
    )

    def __post_init__(self) -> None:
        """Check shapes and freeze; take what the file says of operations and holes, or leaves."""
        frozen_floats(self, "force", (3,))
        frozen_floats(self, "moment", (3,))
        if isinstance(self.operations, tuple):
            tables = cast("Sequence[OperationLoadTable]", self.operations)
            loads = {load.name: np.array([*load.force_N, *load.moment_Nm]) for load in tables}
            object.__setattr__(self, "operations", loads)
        if self.hole is None:
            object.__setattr__(self, "hole", UNIT_STEPS if self.unit_feeds else ())

    def checked(self) -> Self:
        """Return who starts the spindle where the key is left out; ValueError as ``Options``."""
        start = self.spindle
        if start is None and self.unit_feeds:
            start = SpindleStart.UNIT
        elif start is None and self.spindle_turns:
            start = SpindleStart.PROGRAM
        if self.spindle_turns and start is not SpindleStart.PROGRAM:
            text = 'spindle_rpm: the program starts no spindle but with spindle = "program"'
            raise ValueError(text)
        return replace(self, spindle=start)

    @property
    def unit_feeds(self) -> bool:
        """Whether the end effector drills while the robot stands."""
        return self.feed_by == "unit"

    @property
    def wrench_tcp(self) -> FloatArray:
        """(6,) [N, N*m] ON the tool while it works, at and in axes of the TCP."""
        return np.concatenate([self.force, self.moment])

    def wrench_of(self, operation: str) -> FloatArray:
        """Return the wrench (6,) of an operation of the CAM file."""
        return np.asarray(self.operations.get(operation, self.wrench_tcp), dtype=np.float64)


@dataclass(frozen=True, slots=True)
class Thin(Options):
    """How far the tool may pass points of a cut that are left out of the program."""

    chord: float = key(
        0.01, "from a point left out to the line that is driven [mm]", "mm", ge=0.001, le=1.0
    )
    axis: float = key(
        0.05,
        "between the tool axis there and the one driven, or between the orientations "
        "where the file gives whole ones [deg]",
        "deg",
        ge=0.001,
        le=0.5,
    )


@dataclass(frozen=True, slots=True)
class Motion(Options):
    """Speeds and blending."""

    rapid: float = key(50.0, "axis speed of rapid moves [%]", "percent", gt=0.0, le=100.0)
    feed: float = key(
        None,
        "feed where the CAM data gives none [mm/min]; default: there is none",
        "mm_min",
        gt=0.0,
        missing=math.nan,
    )
    approximation: float = key(
        1.0, "largest blending distance at points that need no exact stop [mm]", "mm", ge=0.0
    )
    corner_tolerance: float = key(
        0.2,
        "how far the tool point may pass a corner at feed because of blending [mm]; "
        "where it could be more, the distance is lowered",
        "mm",
        gt=0.0,
    )
    home: FloatArray | None = key(
        None,
        "A1..A6 where programs start and end [deg]; default: no home move",
        "deg",
        form=SixAngles,
    )
    approach: float = key(
        50.0, "height above a point without a depth where it is approached [mm]", "mm", ge=0.0
    )
    points: PointService = key(
        PointService.AUTO,
        "points of a list without a depth: touch: each is approached along the tool "
        "axis and left again; path: a line through all; auto: path where they have a feed",
    )
    chord: float = key(
        0.01, "how far the lines that stand in for an arc may leave it [mm]", "mm", ge=0.001
    )
    thin: Thin | None = key(
        None,
        "leave out points of cuts where the lines between the others pass them within "
        "this; default: every point is written",
        form=Read[Thin],
    )
    arcs: ArcMotion = key(
        ArcMotion.CIRC, "circ: arcs as circular motions where possible; lin: as lines"
    )
    rapid_speed: float = key(
        2.0,
        "path speed of straight rapid moves at rapid_percent = 100 [m/s]",
        "m_s",
        gt=0.0,
        le=3.0,
    )
    retract_in_cuts: bool = key(
        False,
        "leave a cut that no single arm configuration serves by approach_mm along the "
        "tool axis, and enter it there again in another one, with a warning; false: refuse it",
    )
    path_entry: PathEntry = key(
        PathEntry.AXIS,
        "into a cut that the CAM file does not lead into, and out of one at its end: "
        "axis: by approach_mm straight along the tool axis, with the feed; none: by joint moves",
    )

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "home", (6,))

    def checked(self) -> Self:
        """Return the options with the speed of rapids; ValueError for no way out of a cut."""
        if self.retract_in_cuts and not self.approach:
            raise ValueError("retract_in_cuts: needs an approach_mm above 0")
        return replace(self, rapid_speed=self.rapid_speed * self.rapid)
