"""The tables of a cell file, and what they ask of each other."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from postproc.cell.choices import HomeStyle
from postproc.cell.schema.krl import KrlTable
from postproc.cell.schema.motion import MotionTable
from postproc.cell.schema.optimize import LimitsTable, OptimizeTable
from postproc.cell.schema.process import ProcessTable
from postproc.cell.schema.reading import ImportTable
from postproc.cell.schema.robot import ExternalAxisTable, RobotTable
from postproc.cell.schema.solid import Solid
from postproc.cell.schema.table import EMPTY, SixPositive, Table, Text, Vector
from postproc.cell.schema.tool import ToolEntry, ToolTable
from postproc.cell.schema.workpiece import WorkpieceTable

ALONG_Z: Any = {"axis": "+z"}
"""A tool of which no key is given, for the reason of ``EMPTY``."""


class StiffnessTable(Table):
    """Joint stiffness."""

    joint_Nmm_per_rad: SixPositive = Field(description="stiffness of A1..A6 [N*mm/rad]")  # noqa: N815


class MeasuringTable(Table):
    """The measuring device of campaigns."""

    sigma_mm: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        default=None,
        description="standard deviation of a reading per axis [mm], where none was repeated",
    )
    range_sigma_mm: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        default=None, description="of a tracker: standard deviation along the beam [mm]"
    )
    range_sigma_mm_per_m: Annotated[float, Field(ge=0.0, le=100.0)] = Field(
        default=0.0, description="of a tracker: what the distance adds to that [mm/m]"
    )
    angle_sigma_mm_per_m: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        default=None, description="of a tracker: standard deviation across the beam [mm/m]"
    )
    stands_mm: Vector = Field(
        default=[0.0, 0.0, 0.0], description="where the tracker stands in the measured frame [mm]"
    )
    instrument: Text | None = Field(default=None, description="name of the device, for reports")
    serial: Text | None = Field(default=None, description="its serial number, for reports")
    calibrated: Text | None = Field(default=None, description="its calibration, for reports")
    operator: Text | None = Field(default=None, description="who measured, for reports")
    date: Text | None = Field(default=None, description="when it was measured, for reports")


class VerifyTable(Table):
    """What ``verify`` takes on trust."""

    accept: list[Text] = Field(
        default=[],
        description="system variables, routines, statements and conditions that verify cannot "
        "judge and that are known to be harmless here, as it names them",
    )


class CellFile(Table):
    """A whole cell file."""

    schema_name: Literal["postproc.cell/1"] = Field(
        alias="schema", description="version of this format"
    )
    name: Text | None = Field(
        default=None, description="name of the cell; default: name of the file"
    )
    robot: RobotTable = Field(description="the arm")
    tool: ToolTable = Field(default=ALONG_Z, description="the tool of a cell with one tool")
    tools: list[ToolEntry] = Field(
        default=[], description="the tools of a cell with several, instead of tool"
    )
    workpiece: WorkpieceTable = Field(
        default=EMPTY, description="the workpiece of a cell with one setup"
    )
    bases: list[WorkpieceTable] = Field(
        default=[], description="the setups of a cell with several, instead of workpiece"
    )
    obstacles: list[Solid] = Field(default=[], description="solids in the world")
    limits: LimitsTable = Field(default=EMPTY, description="margins")
    optimize: OptimizeTable = Field(default=EMPTY, description="use of the redundancy")
    process: ProcessTable = Field(default=EMPTY, description="load while working")
    stiffness: StiffnessTable | None = Field(default=None, description="joint stiffness")
    measuring: MeasuringTable = Field(default=EMPTY, description="measuring device of campaigns")
    motion: MotionTable = Field(default=EMPTY, description="speeds")
    reading: ImportTable = Field(
        default=EMPTY, alias="import", description="how CAM files are read"
    )
    krl: KrlTable = Field(default=EMPTY, description="program text")
    verify: VerifyTable = Field(default=EMPTY, description="judging of programs")
    external_axes: Annotated[list[ExternalAxisTable], Field(max_length=6)] = Field(
        default=[], description="rails and positioners; a positioner carries those behind it"
    )

    @model_validator(mode="after")
    def _whole_tracker(self) -> CellFile:
        if (self.measuring.range_sigma_mm is None) != (self.measuring.angle_sigma_mm_per_m is None):
            raise ValueError(
                "measuring: range_sigma_mm and angle_sigma_mm_per_m belong together, found one"
            )
        return self

    @model_validator(mode="after")
    def _distinct_axes(self) -> CellFile:
        names = [axis.name for axis in self.external_axes]
        if len(set(names)) != len(names):
            raise ValueError("external_axes: two axes have the same name")
        return self

    @model_validator(mode="after")
    def _home_of_controller(self) -> CellFile:
        home = self.krl.home
        if home is HomeStyle.AXES:
            return self
        if self.motion.home_deg is None:
            raise ValueError(f"krl.home: {home.value} needs home_deg in [motion], found none")
        if self.external_axes:
            raise ValueError(f"krl.home: {home.value} says nothing of external axes: take axes")
        numbers = [tool.number for tool in (*self.tools, *([] if self.tools else [self.tool]))]
        if home is HomeStyle.FORM and numbers != [1]:
            raise ValueError("krl.home: form selects tool 1 and its load, expected no other tool")
        return self
