"""Keys of ``[process]``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from postproc.cell.choices import SpindleStart
from postproc.cell.schema.table import CHOICE, Positive, Table, Text

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
