"""Keys of ``[motion]`` and ``[process]``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from postproc.cell.choices import ArcMotion, PathEntry, PointService, SpindleStart
from postproc.cell.schema.table import CHOICE, NotNegative, Positive, Table, Text

SixAngles = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=6, max_length=6)
]

Loads = Annotated[list[float], Field(min_length=3, max_length=3)]
HoleStep = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,20}$")]


class OperationLoadTable(Table):
    """The load on the tool in one operation of the CAM file."""

    name: Text = Field(description="name of the operation, as in the CAM file")
    force_N: Loads = Field(default=[0.0, 0.0, 0.0], description="force ON the tool, TCP axes [N]")  # noqa: N815
    moment_Nm: Loads = Field(  # noqa: N815
        default=[0.0, 0.0, 0.0], description="moment ON the tool at the TCP, TCP axes [N*m]"
    )


class ProcessTable(Table):
    """The load on the tool while it works, and how holes are made."""

    force_N: Loads = Field(default=[0.0, 0.0, 0.0], description="force ON the tool, TCP axes [N]")  # noqa: N815
    moment_Nm: Loads = Field(  # noqa: N815
        default=[0.0, 0.0, 0.0], description="moment ON the tool at the TCP, TCP axes [N*m]"
    )
    operations: list[OperationLoadTable] = Field(
        default=[], description="loads of single operations; all others take the load above"
    )
    least_feed_percent: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        default=None,
        description="lowest share of the feed asked for that the process takes where an axis "
        "cannot follow; cuts that need less are led another way, else refused [%]; default: any",
    )
    feed_by: Literal["robot", "unit"] = Field(
        default="robot",
        description="who feeds the tool into a hole: robot, or unit: the robot stands where the "
        "feed begins, the end effector drills",
    )
    spindle: Annotated[SpindleStart, CHOICE] | None = Field(
        default=None,
        description="who starts the spindle: program: what drills or mills without a speed is "
        "refused; unit: the end effector itself; hand: a person; default: unit with feed_by = "
        "unit, program with spindle_rpm, else not known, and the answer says so first",
    )
    spindle_rpm: Positive | None = Field(
        default=None,
        description="speed that the program starts the spindle with where the CAM data gives "
        "none, the way round that the tool cuts [1/min]; default: none",
    )
    hole: list[HoleStep] | None = Field(
        default=None,
        description="routines called at each hole, in order, with its number, depth [mm], feed "
        "[mm/min] and speed [1/min]; with feed_by = robot those up to drill (else all but the "
        "last) come before the stroke; default: none, clamp, drill, unclamp with feed_by = unit",
    )

    @model_validator(mode="after")
    def _speed_of_a_program(self) -> ProcessTable:
        if self.spindle_rpm is not None and self.started_by is not SpindleStart.PROGRAM:
            raise ValueError(
                'spindle_rpm: the program starts no spindle but with spindle = "program"'
            )
        return self

    @property
    def started_by(self) -> SpindleStart | None:
        """Who starts the spindle, None where nothing says it."""
        if self.spindle is not None:
            return self.spindle
        if self.feed_by == "unit":
            return SpindleStart.UNIT
        return None if self.spindle_rpm is None else SpindleStart.PROGRAM


class ThinTable(Table):
    """How far the tool may pass points of a cut that are left out of the program."""

    chord_mm: Annotated[float, Field(ge=0.001, le=1.0)] = Field(
        default=0.01, description="from a point left out to the line that is driven [mm]"
    )
    axis_deg: Annotated[float, Field(ge=0.001, le=0.5)] = Field(
        default=0.05,
        description="between the tool axis there and the one driven, or between the orientations "
        "where the file gives whole ones [deg]",
    )


class MotionTable(Table):
    """Speeds and blending."""

    rapid_percent: Annotated[float, Field(gt=0.0, le=100.0)] = Field(
        default=50.0, description="axis speed of rapid moves [%]"
    )
    feed_mm_min: Positive | None = Field(
        default=None,
        description="feed where the CAM data gives none [mm/min]; default: there is none",
    )
    approximation_mm: NotNegative = Field(
        default=1.0, description="largest blending distance at points that need no exact stop [mm]"
    )
    corner_tolerance_mm: Positive = Field(
        default=0.2,
        description="how far the tool point may pass a corner at feed because of blending [mm]; "
        "where it could be more, the distance is lowered",
    )
    home_deg: SixAngles | None = Field(
        default=None, description="A1..A6 where programs start and end [deg]; default: no home move"
    )
    approach_mm: NotNegative = Field(
        default=50.0, description="height above a point without a depth where it is approached [mm]"
    )
    points: Annotated[PointService, CHOICE] = Field(
        default=PointService.AUTO,
        description="points of a list without a depth: touch: each is approached along the tool "
        "axis and left again; path: a line through all; auto: path where they have a feed",
    )
    chord_mm: Annotated[float, Field(ge=0.001)] = Field(
        default=0.01, description="how far the lines that stand in for an arc may leave it [mm]"
    )
    thin: ThinTable | None = Field(
        default=None,
        description="leave out points of cuts where the lines between the others pass them within "
        "this; default: every point is written",
    )
    arcs: Annotated[ArcMotion, CHOICE] = Field(
        default=ArcMotion.CIRC,
        description="circ: arcs as circular motions where possible; lin: as lines",
    )
    rapid_speed_m_s: Annotated[float, Field(gt=0.0, le=3.0)] = Field(
        default=2.0, description="path speed of straight rapid moves at rapid_percent = 100 [m/s]"
    )
    retract_in_cuts: bool = Field(
        default=False,
        description="leave a cut that no single arm configuration serves by approach_mm along the "
        "tool axis, and enter it there again in another one, with a warning; false: refuse it",
    )

    path_entry: Annotated[PathEntry, CHOICE] = Field(
        default=PathEntry.AXIS,
        description="into a cut that the CAM file does not lead into, and out of one at its end: "
        "axis: by approach_mm straight along the tool axis, with the feed; none: by joint moves",
    )

    @model_validator(mode="after")
    def _room_to_retract(self) -> MotionTable:
        if self.retract_in_cuts and not self.approach_mm:
            raise ValueError("retract_in_cuts: needs an approach_mm above 0")
        return self
