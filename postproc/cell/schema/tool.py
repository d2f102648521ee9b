"""Keys of ``[tool]`` and ``[[tools]]``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from postproc.cell.schema.solid import ToolSolid
from postproc.cell.schema.table import (
    AxisName,
    CamNames,
    NotNegative,
    Placement,
    Positive,
    Table,
    Text,
    Vector,
)


class CutterTable(Table):
    """The solid of a cutter: a cylinder from the TCP back against the tool axis."""

    diameter_mm: Positive = Field(description="diameter [mm]")
    length_mm: Positive = Field(description="length from the TCP to the holder [mm]")


class ToolTable(Table):
    """A tool on the flange."""

    number: Annotated[int, Field(ge=1, le=128)] = Field(default=1, description="KUKA TOOL number")
    name: Text = Field(default="tool", description="name of the tool")
    cam: CamNames = Field(
        default=[],
        description="numbers and names by which CAM files call this tool; each suffices",
    )
    frame: Placement = Field(
        default=Placement(), description="TCP in the flange, as in KUKA's TOOL_DATA"
    )
    axis: AxisName | None = Field(
        default=None,
        description="axis of the TCP frame that points out of the tool into the part; without it "
        "no job can use the tool",
    )
    mass_kg: NotNegative | None = Field(default=None, description="mass of the tool [kg]")
    cog_mm: Vector | None = Field(default=None, description="centre of gravity in the flange [mm]")
    inertia_kg_m2: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] | None = Field(
        default=None, description="principal inertia of the tool for LOAD_DATA [kg*m^2]"
    )
    meshes: list[ToolSolid] = Field(default=[], description="solids of the tool, in the flange")
    cutter: CutterTable | None = Field(
        default=None,
        description="solid of the cutter, which may touch the workpiece during a cut: a cylinder "
        "from the TCP back against the tool axis",
    )
    spindle: Literal["cw", "ccw"] = Field(
        default="cw",
        description="which way the tool cuts, seen from the spindle towards the tool; a CAM file "
        "that turns it the other way is refused",
    )


class ToolEntry(ToolTable):
    """One of several tools."""

    stand: Placement | None = Field(
        default=None,
        description="where the flange of the tool is in the world while it is not mounted; its "
        "solids are obstacles there; without it they are not looked at",
    )
