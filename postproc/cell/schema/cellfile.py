"""The tables of a cell file, and what they ask of each other."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from postproc.cell.choices import HomeStyle
from postproc.cell.schema.krl import KrlOptions
from postproc.cell.schema.measuring import Instrument
from postproc.cell.schema.motion import Motion, Process
from postproc.cell.schema.optimize import Limits, Optimize
from postproc.cell.schema.robot import ExternalAxisTable, RobotTable
from postproc.cell.schema.table import (
    EMPTY,
    AxisName,
    CamNames,
    NotNegative,
    Options,
    Placement,
    Positive,
    Read,
    SixPositive,
    Solid,
    Table,
    Text,
    ToolSolid,
    Vector,
    entry,
    key,
)
from postproc.records import dataclass

ALONG_Z: Any = {"axis": "+z"}
"""A tool of which no key is given, for the reason of ``EMPTY``."""


class CutterTable(Table):
    """The solid of a cutter: a cylinder from the TCP back against the tool axis."""

    diameter_mm: Positive = entry(..., "diameter [mm]")
    length_mm: Positive = entry(..., "length from the TCP to the holder [mm]")


class ToolTable(Table):
    """A tool on the flange."""

    number: Annotated[int, Field(ge=1, le=128)] = entry(1, "KUKA TOOL number")
    name: Text = entry("tool", "name of the tool")
    cam: CamNames = entry([], "numbers and names by which CAM files call this tool; each suffices")
    frame: Placement = entry(Placement(), "TCP in the flange, as in KUKA's TOOL_DATA")
    axis: AxisName | None = entry(
        None,
        "axis of the TCP frame that points out of the tool into the part; without it "
        "no job can use the tool",
    )
    mass_kg: NotNegative | None = entry(None, "mass of the tool [kg]")
    cog_mm: Vector | None = entry(None, "centre of gravity in the flange [mm]")
    inertia_kg_m2: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] | None = entry(
        None, "principal inertia of the tool for LOAD_DATA [kg*m^2]"
    )
    meshes: list[ToolSolid] = entry([], "solids of the tool, in the flange")
    cutter: CutterTable | None = entry(
        None,
        "solid of the cutter, which may touch the workpiece during a cut: a cylinder "
        "from the TCP back against the tool axis",
    )
    spindle: Literal["cw", "ccw"] = entry(
        "cw",
        "which way the tool cuts, seen from the spindle towards the tool; a CAM file "
        "that turns it the other way is refused",
    )


class ToolEntry(ToolTable):
    """One of several tools."""

    stand: Placement | None = entry(
        None,
        "where the flange of the tool is in the world while it is not mounted; its "
        "solids are obstacles there; without it they are not looked at",
    )


@dataclass(frozen=True, slots=True)
class Reading(Options):
    """How CAM files are read where the call does not say; the same keys as its options."""

    format: str = key("auto", "auto, apt, csv, delmia, gcode or one of postproc plugins", form=Text)
    dialect: str | None = key(
        None, "dialect of APT or G-code; default: as the file shows", form=Text
    )
    units: str | None = key(
        None, "unit of length where the CAM file names none", form=Literal["mm", "inch", "m"]
    )
    columns: str | None = key(
        None, "columns of a CSV, e.g. id,x,y,z,i,j,k,-,depth; - is none", form=Text
    )
    cycle_words: str | None = key(
        None,
        "meaning of the numbers of a positional drill cycle, e.g. depth,clearance,feed",
        form=Text,
    )
    feed_units: str | None = key(
        None,
        "per minute, where FEDRAT and UNITS of a CAM file contradict",
        form=Literal["mm", "inch"],
    )
    arc_sense: str | None = key(
        None,
        "way of arcs about their vector where their records leave it open, as half "
        "turns do; default: as the rest of the file shows",
        form=Literal["ccw", "cw"],
    )
    head: str | None = key(
        None,
        "rotary axes of the head of the machine that G-code was posted for, from the "
        "machine to the tool, each with the sense and CAM axis about which a growing angle turns "
        "the tool: C+z B+y; tip behind them: X, Y, Z are of the tool tip without G43.4 too",
        form=Text,
    )
    task: str | None = key(
        None, "DELMIA task to read instead of all that no other one calls", form=Text
    )
    accept_words: tuple[str, ...] = key(
        (), "words of CAM files that are known to be harmless; others stop", form=list[Text]
    )


CALL_KEYS: Mapping[str, tuple[str, type[Options]]] = {
    **dict.fromkeys(Reading.__annotations__, ("import", Reading)),
    "emitter": ("krl", KrlOptions),
    **dict.fromkeys(("strategy", "objective", "preset"), ("optimize", Optimize)),
}
"""Keys of the cell that a call may give in their place: the table of each, and its options."""


def call_keys(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of ``CALL_KEYS`` that a call gives; words have commas between in a text."""
    keys = {name: given[name] for name in CALL_KEYS if given.get(name) not in (None, "", ())}
    if isinstance(words := keys.get("accept_words"), str):
        keys["accept_words"] = tuple(word for word in words.split(",") if word)
    return keys


class WorkpieceTable(Table):
    """A workpiece."""

    number: Annotated[int, Field(ge=1, le=128)] = entry(1, "KUKA BASE number")
    name: Text | None = entry(None, "name of the base, as on the controller")
    cam: CamNames = entry([], "names by which CAM files call this setup; each suffices")
    frame: Placement = entry(Placement(), "CAM coordinates in the robot root")
    meshes: list[Solid] = entry([], "solids of the workpiece, in CAM coordinates")


class StiffnessTable(Table):
    """Joint stiffness."""

    joint_Nmm_per_rad: SixPositive = entry(..., "stiffness of A1..A6 [N*mm/rad]")  # noqa: N815


class VerifyTable(Table):
    """What ``verify`` takes on trust."""

    accept: list[Text] = entry(
        [],
        "system variables, routines, statements and conditions that verify cannot "
        "judge and that are known to be harmless here, as it names them",
    )


class CellFile(Table):
    """A whole cell file."""

    schema_name: Literal["postproc.cell/1"] = Field(
        alias="schema", description="version of this format"
    )
    name: Text | None = entry(None, "name of the cell; default: name of the file")
    robot: RobotTable = entry(..., "the arm")
    tool: ToolTable = entry(ALONG_Z, "the tool of a cell with one tool")
    tools: list[ToolEntry] = entry([], "the tools of a cell with several, instead of tool")
    workpiece: WorkpieceTable = entry(EMPTY, "the workpiece of a cell with one setup")
    bases: list[WorkpieceTable] = entry(
        [], "the setups of a cell with several, instead of workpiece"
    )
    obstacles: list[Solid] = entry([], "solids in the world")
    limits: Read[Limits] = entry(EMPTY, "margins")
    optimize: Read[Optimize] = entry(EMPTY, "use of the redundancy")
    process: Read[Process] = entry(EMPTY, "load while working")
    stiffness: StiffnessTable | None = entry(None, "joint stiffness")
    measuring: Read[Instrument] = entry(EMPTY, "measuring device of campaigns")
    motion: Read[Motion] = entry(EMPTY, "speeds")
    reading: Read[Reading] = Field(
        default=EMPTY, alias="import", description="how CAM files are read"
    )
    krl: Read[KrlOptions] = entry(EMPTY, "program text")
    verify: VerifyTable = entry(EMPTY, "judging of programs")
    external_axes: Annotated[list[ExternalAxisTable], Field(max_length=6)] = entry(
        [], "rails and positioners; a positioner carries those behind it"
    )

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
        if self.motion.home is None:
            raise ValueError(f"krl.home: {home.value} needs home_deg in [motion], found none")
        if self.external_axes:
            raise ValueError(f"krl.home: {home.value} says nothing of external axes: take axes")
        numbers = [tool.number for tool in (*self.tools, *([] if self.tools else [self.tool]))]
        if home is HomeStyle.FORM and numbers != [1]:
            raise ValueError("krl.home: form selects tool 1 and its load, expected no other tool")
        return self
