"""The keys of ``cell.toml``: types, units, ranges, defaults and meaning, in file units.

This is the only place where a key of the cell is described and has its default; the reference page
is generated from it. ``postproc.cell.options`` and ``postproc.cell.file`` turn it into SI units.
"""

from __future__ import annotations

import re
from typing import Annotated, Literal

from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, model_validator

from postproc.cell.choices import (
    ArcMotion,
    HomeStyle,
    Index,
    Kss,
    MotionStyle,
    PointPlace,
    PointService,
    Preset,
    RobotSolids,
    Split,
    Strategy,
)

_Choice = Field(strict=False)
"""A word of a list: the file holds text, the strict table would ask for the member itself."""

Length = Annotated[float, Field(ge=-1e5, le=1e5)]
Angle = Annotated[float, Field(ge=-360.0, le=360.0)]
Positive = Annotated[float, Field(gt=0.0)]
Size = Annotated[float, Field(gt=0.0, le=1e5)]
NotNegative = Annotated[float, Field(ge=0.0)]
Vector = Annotated[list[Length], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
Loads = Annotated[list[float], Field(min_length=3, max_length=3)]
SixAngles = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=6, max_length=6)
]
SixPositive = Annotated[list[Positive], Field(min_length=6, max_length=6)]
AngleRange = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=2, max_length=2)
]
TiltAngles = Annotated[
    list[Annotated[float, Field(ge=-45.0, le=45.0)]], Field(min_length=2, max_length=2)
]
LengthRange = Annotated[list[Length], Field(min_length=2, max_length=2)]
SixRanges = Annotated[list[AngleRange], Field(min_length=6, max_length=6)]
AxisName = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Text = Annotated[str, Field(min_length=1, max_length=255)]
CamNames = list[Text | Annotated[int, Field(ge=0)]]
Signal = Annotated[int, Field(ge=1, le=8192)]
HoleStep = Annotated[str, Field(pattern=r"^[A-Za-z][A-Za-z0-9_]{0,20}$")]
KRL_NAME = r"^[A-Za-z_][A-Za-z0-9_]{0,23}$"
KrlName = Annotated[str, Field(pattern=KRL_NAME)]


class Table(BaseModel):
    """A TOML table: no unknown keys, no text for numbers, no nan or inf."""

    model_config = ConfigDict(
        extra="forbid",
        strict=True,
        allow_inf_nan=False,
        frozen=True,
        validate_default=True,
        defer_build=True,  # tables are only read as part of the whole file
    )


class Placement(Table):
    """Where something stands: shift and turn."""

    xyz_mm: Vector = Field(default=[0.0, 0.0, 0.0], description="origin [mm]")
    abc_deg: Angles = Field(
        default=[0.0, 0.0, 0.0], description="KUKA A, B, C [deg]: R = Rz(A) Ry(B) Rx(C)"
    )


class BoxShape(Table):
    """A box, centred in its frame."""

    size_mm: Annotated[list[Size], Field(min_length=3, max_length=3)] = Field(
        description="edge lengths along x, y, z [mm]"
    )


class CylinderShape(Table):
    """A cylinder along z, centred in its frame."""

    radius_mm: Size = Field(description="radius [mm]")
    length_mm: Size = Field(description="length along z [mm]")


class Solid(Placement):
    """A solid: exactly one of file, box and cylinder."""

    name: Text | None = Field(
        default=None, description="name in messages; default: made from the table"
    )
    file: Text | None = Field(
        default=None, description="mesh file (STL, OBJ, PLY), relative to the cell file"
    )
    box: BoxShape | None = Field(default=None, description="a box instead of a file, centred")
    cylinder: CylinderShape | None = Field(
        default=None, description="a cylinder along z instead of a file, centred"
    )
    scale: Positive = Field(default=1.0, description="millimetres per unit of the mesh file")

    @model_validator(mode="after")
    def _one_shape(self) -> Solid:
        given = [key for key in ("file", "box", "cylinder") if getattr(self, key) is not None]
        if len(given) != 1:
            found = " and ".join(given) if given else "none of them"
            raise ValueError(f"exactly one of file, box and cylinder is needed, found {found}")
        return self


class ToolSolid(Solid):
    """A solid of the tool, in the flange."""

    cutting: bool = Field(
        default=False, description="true: this part may touch the workpiece during a cut"
    )


class LinkSolid(Solid):
    """A solid of a robot link, in the frame of that link."""

    link: Annotated[int, Field(ge=0, le=6)] = Field(
        description="0 = base of the robot, 1..6 = link moved by that axis"
    )


class DimensionsTable(Table):
    """Lengths of an arm of KUKA with spherical wrist, as `robots NAME --json` names them."""

    a1: Length = Field(description="axis 1 to axis 2, forwards: $LENGTH_A [mm]")
    a2: Length = Field(
        description="axis 3 to the wrist, downwards with the forearm level: -$TX3P3.Z [mm]"
    )
    b: Length = Field(default=0.0, description="sideways [mm]")
    c1: Length = Field(description="foot to axis 2, upwards: $TIRORO.Z [mm]")
    c2: Positive = Field(description="upper arm: $LENGTH_B [mm]")
    c3: Length = Field(description="forearm: $TX3P3.X [mm]")
    c4: Length = Field(description="wrist to flange: $TFLWP.Z [mm]")


class RobotTable(Table):
    """The arm: a built-in model, the lengths of an arm of KUKA, or a URDF file."""

    model: Text | None = Field(
        default=None,
        description="built-in robot, by any spelling of its name or $TRAFONAME, see "
        "`postproc robots`",
    )
    dimensions_mm: DimensionsTable | None = Field(
        default=None,
        description="lengths from the machine data: of an arm that is not built in, or instead of "
        "those of model",
    )
    name: Text | None = Field(
        default=None, description="name of an arm that dimensions_mm alone describes"
    )
    urdf: Text | None = Field(
        default=None, description="URDF file instead of a built-in robot, relative to the cell file"
    )
    tip: Text | None = Field(
        default=None,
        description="name of the flange link in the URDF; default: the end of the chain",
    )
    base: Placement = Field(default=Placement(), description="robot root in the world")
    limits_deg: SixRanges | None = Field(
        default=None, description="[smallest, largest] of A1..A6 [deg]; default: of the robot"
    )
    cable: dict[Literal["A1", "A2", "A3", "A4", "A5", "A6"], AngleRange] = Field(
        default={},
        description="what cables and hoses allow of single axes, within the limits [deg]: "
        "{ A4 = [-180, 180], A6 = [-270, 270] }",
    )
    speed_deg_s: SixPositive | None = Field(
        default=None, description="largest speed of A1..A6 [deg/s]; default: of the robot"
    )
    accel_deg_s2: SixPositive | None = Field(
        default=None,
        description="largest acceleration of A1..A6 [deg/s^2], which times of path motions keep as "
        "well; default: of the robot, or full speed in half a second in joint motions",
    )
    jerk_deg_s3: SixPositive | None = Field(
        default=None,
        description="largest jerk of A1..A6 [deg/s^3], for times; default: full acceleration in "
        "a tenth of a second",
    )
    torque_nm: SixPositive | None = Field(
        default=None,
        description="largest torques of A1..A6 [N*m], for times: of an arm whose urdf gives mass "
        "and inertia of every link; default: the efforts of that file, if all are above 0",
    )
    payload_kg: Positive | None = Field(
        default=None, description="rated payload [kg]; default: of the robot"
    )
    solids: Annotated[RobotSolids, _Choice] = Field(
        default=RobotSolids.OUTLINE,
        description="solids of a built-in arm: outline encloses the real one, simple hulls are "
        "thinner by up to 0.7 m in places",
    )
    link_meshes: list[LinkSolid] = Field(
        default=[], description="your own solids of the links instead of the built-in hulls"
    )

    @model_validator(mode="after")
    def _one_robot(self) -> RobotTable:
        if (self.model or self.dimensions_mm) and self.urdf:
            raise ValueError("exactly one of model and urdf is needed, found both")
        if not (self.model or self.dimensions_mm or self.urdf):
            raise ValueError("exactly one of model and urdf is needed, found none of them")
        if self.name is not None and (self.model or self.urdf):
            raise ValueError("name goes with dimensions_mm alone")
        for key in ("tip", "torque_nm"):
            if getattr(self, key) is not None and self.urdf is None:
                raise ValueError(f"{key} goes with urdf only")
        for axis, (low, high) in enumerate(self.limits_deg or [], start=1):
            if low >= high:
                raise ValueError(f"limits_deg of A{axis}: {low:g} is not below {high:g}")
        for name, (low, high) in self.cable.items():
            if low >= high:
                raise ValueError(f"cable of {name}: {low:g} is not below {high:g}")
        return self


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


class WorkpieceTable(Table):
    """A workpiece."""

    number: Annotated[int, Field(ge=1, le=128)] = Field(default=1, description="KUKA BASE number")
    name: Text | None = Field(default=None, description="name of the base, as on the controller")
    cam: CamNames = Field(
        default=[], description="names by which CAM files call this setup; each suffices"
    )
    frame: Placement = Field(default=Placement(), description="CAM coordinates in the robot root")
    meshes: list[Solid] = Field(
        default=[], description="solids of the workpiece, in CAM coordinates"
    )


class LimitsTable(Table):
    """Margins that every pose of a program must keep."""

    joint_margin_deg: Annotated[float, Field(ge=0.0, le=90.0)] = Field(
        default=2.0, description="distance from the joint limits [deg]"
    )
    singularity_deg: Annotated[float, Field(ge=0.0, le=90.0)] = Field(
        default=5.0, description="smallest |A5| [deg]"
    )
    clearance_mm: NotNegative = Field(
        default=2.0,
        description="smallest distance between solids, but of a cutting solid from the workpiece; "
        "by default about what a large arm is off that was not calibrated [mm]",
    )
    contact_depth_mm: NotNegative | None = Field(
        default=None,
        description="how deep cutting solids may go into the workpiece during a cut [mm]; "
        "default: any depth",
    )


def _index_name(value: object) -> object:
    """Return the name of an index for the one that older cells have."""
    return Index.ELLIPSOID if value == "seed" else value


class OptimizeTable(Table):
    """What the freedom about the tool axis is used for."""

    objective: Text | dict[str, float] = Field(
        default="axial",
        description="axial (along the tool axis), normal, radial, process (along the force), "
        "or a table of weights; see `postproc plugins`",
    )
    index: Annotated[Index, _Choice, BeforeValidator(_index_name)] = Field(
        default=Index.COMPLIANCE,
        description="1/(n^T C n), or the ellipsoid index of Jiao et al. 2022",
    )
    step_deg: Annotated[float, Field(ge=0.1, le=360.0)] = Field(
        default=10.0, description="step of the spin about the tool axis [deg]"
    )
    range_deg: AngleRange = Field(
        default=[-180.0, 180.0], description="range of the spin about the tool axis [deg]"
    )
    strategy: Annotated[Strategy, _Choice] = Field(
        default=Strategy.GLOBAL,
        description="global: best joint-continuous sequence over all tags; smooth: key tags "
        "optimised, the rest interpolated; each: every tag for itself",
    )
    preset: Annotated[Preset, _Choice] = Field(
        default=Preset.BALANCED,
        description="of an objective by name: stiffest, balanced (a tag loses more than 5 % of "
        "its stiffness only for a way or a margin that is worth more) or fastest",
    )
    turns: bool = Field(
        default=True, description="also use angles a whole turn away where the limits allow them"
    )
    refine: bool = Field(
        default=True, description="leave the grid of turns for better ones in between"
    )
    key_every_mm: Positive = Field(
        default=100.0, description="smooth: a key tag at least every so many mm of path"
    )
    key_corner_deg: Annotated[float, Field(gt=0.0, le=180.0)] = Field(
        default=20.0, description="smooth: a bend of path or tool axis that makes a key tag [deg]"
    )
    key_tags: list[Text | int] = Field(
        default=[], description="smooth: ids of the key tags, instead of corners and distances"
    )
    loss_bound_percent: Annotated[float, Field(ge=0.0, le=100.0)] | None = Field(
        default=None,
        description="no tag loses more stiffness than this wherever that can be run [%]; default: "
        "5 of smooth, else none",
    )
    free_order: bool = Field(
        default=False, description="the order of holes is not binding: take the quickest one found"
    )
    pins: dict[str, Angle] = Field(
        default={}, description="tag id to the spin about the tool axis it must have [deg]"
    )

    lead_deg: TiltAngles = Field(
        default=[0.0, 0.0],
        description="milling: allowed lead angle, the tilt of the tool axis in the feed direction, "
        "positive leans the holder forward [deg]; holes are never tilted",
    )
    side_tilt_deg: TiltAngles = Field(
        default=[0.0, 0.0],
        description="milling: allowed side tilt (lean) of the tool axis across the feed direction, "
        "positive leans the holder to the right [deg]",
    )
    tilt_step_deg: Annotated[float, Field(ge=0.5, le=45.0)] = Field(
        default=5.0, description="step of lead and side tilt in the search [deg]"
    )

    @model_validator(mode="after")
    def _ordered(self) -> OptimizeTable:
        low, high = self.range_deg
        if low > high:
            raise ValueError(f"range_deg: {low:g} is above {high:g}")
        for key in ("lead_deg", "side_tilt_deg"):
            low, high = getattr(self, key)
            if low > high:
                raise ValueError(f"{key}: {low:g} is above {high:g}")
            if not low <= 0.0 <= high:
                raise ValueError(
                    f"{key}: 0 must lie in the range, found [{low:g}, {high:g}]: points without a "
                    "feed direction and holes are not tilted"
                )
        if isinstance(self.objective, dict) and not any(w > 0 for w in self.objective.values()):
            raise ValueError("objective: a table of weights needs at least one above 0")
        return self


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
    hole: list[HoleStep] | None = Field(
        default=None,
        description="routines called at each hole, in order, with its number, depth [mm], feed "
        "[mm/min] and speed [1/min]; with feed_by = robot those up to drill (else all but the "
        "last) come before the stroke; default: none, clamp, drill, unclamp with feed_by = unit",
    )


class StiffnessTable(Table):
    """Joint stiffness."""

    joint_Nmm_per_rad: SixPositive = Field(description="stiffness of A1..A6 [N*mm/rad]")  # noqa: N815


class MeasuringTable(Table):
    """The measuring device of campaigns."""

    sigma_mm: Annotated[float, Field(gt=0.0, le=100.0)] | None = Field(
        default=None,
        description="standard deviation of a reading per axis [mm], where none was repeated",
    )


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
    points: Annotated[PointService, _Choice] = Field(
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
    arcs: Annotated[ArcMotion, _Choice] = Field(
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

    @model_validator(mode="after")
    def _room_to_retract(self) -> MotionTable:
        if self.retract_in_cuts and not self.approach_mm:
            raise ValueError("retract_in_cuts: needs an approach_mm above 0")
        return self


class ImportTable(Table):
    """How CAM files are read where the call does not say; the same keys as its options."""

    format: Text = Field(
        default="auto", description="auto, apt, csv, delmia or another one of plugins"
    )
    dialect: Text | None = Field(
        default=None, description="APT dialect; default: as the file shows"
    )
    units: Literal["mm", "inch", "m"] | None = Field(
        default=None, description="unit of length where the CAM file names none"
    )
    columns: Text | None = Field(
        default=None, description="columns of a CSV, e.g. id,x,y,z,i,j,k,-,depth; - is none"
    )
    cycle_words: Text | None = Field(
        default=None,
        description="meaning of the numbers of a positional drill cycle, e.g. depth,clearance,feed",
    )
    feed_units: Literal["mm", "inch"] | None = Field(
        default=None, description="per minute, where FEDRAT and UNITS of a CAM file contradict"
    )
    task: Text | None = Field(
        default=None, description="DELMIA task to read instead of all that no other one calls"
    )
    accept_words: list[Text] = Field(
        default=[], description="words of CAM files that are known to be harmless; others stop"
    )


class HooksTable(Table):
    """Routines that the integrator defines and programs call; names of process.hole too."""

    model_config = ConfigDict(extra="allow")

    @model_validator(mode="after")
    def _names(self) -> HooksTable:
        for name, routine in (self.model_extra or {}).items():
            if not isinstance(routine, str) or not re.fullmatch(KRL_NAME, routine):
                raise ValueError(f"{name}: expected the name of a routine, found {routine!r}")
        return self

    spindle_on: KrlName = Field(
        default="PP_SPINDLE_ON", description="gets the speed [1/min], negative counterclockwise"
    )
    spindle_off: KrlName = Field(default="PP_SPINDLE_OFF", description="without parameter")
    coolant_on: KrlName = Field(
        default="PP_COOLANT_ON",
        description="gets 1 flood, 2 mist, 3 through the tool, 4 air, 5 tap, 6 to 8 custom",
    )
    coolant_off: KrlName = Field(default="PP_COOLANT_OFF", description="without parameter")
    stop: KrlName = Field(default="PP_STOP", description="stop of the CAM program")
    optional_stop: KrlName = Field(default="PP_OPTIONAL_STOP", description="optional stop")
    tool_change: KrlName = Field(default="PP_TOOL_CHANGE", description="gets the tool number")
    signal: KrlName = Field(
        default="PP_SIGNAL", description="sets a signal; gets its name, port (0: none) and value"
    )
    wait_signal: KrlName = Field(
        default="PP_WAIT_SIGNAL",
        description="waits for a signal; gets its name, port (0: none) and value",
    )
    spindle_orient: KrlName | None = Field(
        default=None,
        description="stops the spindle at an angle at the bottom of a bore and returns when it "
        "stands there; gets the angle [deg]; default: none, such a bore is refused",
    )
    tap_reverse: KrlName | None = Field(
        default=None,
        description="reverses the spindle at the bottom of a tapped hole and returns when it turns "
        "the other way; gets the speed [1/min], negative counterclockwise. Naming it says that the "
        "tap sits in a holder that gives along its axis; default: none, tapping is refused",
    )


class KrlTable(Table):
    """How programs are written."""

    emitter: Text = Field(
        default="kuka_krl", description="what writes them; see `postproc plugins`"
    )
    template: Text = Field(
        default="default", description="built-in template, or a folder relative to the cell file"
    )
    max_points_per_file: Annotated[int, Field(ge=2)] = Field(
        default=1000, description="a longer program is split into sub-programs"
    )
    split: Annotated[Split, _Choice] = Field(
        default=Split.POINTS, description="operations: each operation begins a sub-program"
    )
    motion: Annotated[MotionStyle, _Choice] = Field(
        default=MotionStyle.DENSE,
        description="dense: PTP, LIN, CIRC; spline: SPTP, SLIN, SCIRC; spline_block: the same in "
        "SPLINE blocks; forms: as dense, entries and approaches as inline forms",
    )
    home: Annotated[HomeStyle, _Choice] = Field(
        default=HomeStyle.AXES,
        description="how home_deg is written: axes: its values; xhome: PTP XHOME; form: the pad's "
        "inline form, which selects tool 1. For both XHOME of the controller is home_deg",
    )
    points: Annotated[PointPlace, _Choice] = Field(
        default=PointPlace.INLINE,
        description="dat: the points stand in the .dat file, to be touched up",
    )
    kss: Annotated[Kss, _Choice] = Field(
        default=Kss.V8_6,
        description="system software of the controller: 5 (KRC2, no splines), 8.3 and 8.5 (forms "
        "with parameters in their line), 8.6 and 8.7 (in a fold of their own)",
    )
    advance: Annotated[int, Field(ge=0, le=5)] = Field(
        default=3, description="$ADVANCE: motions planned ahead; 0 stops at every point"
    )
    orientation_speed_deg_s: Annotated[float, Field(gt=0.0, le=400.0)] = Field(
        default=200.0, description="$VEL.ORI1 and ORI2 [deg/s]"
    )
    path_speed_max_m_s: Annotated[float, Field(gt=0.0, le=3.0)] = Field(
        default=2.0, description="largest path speed [m/s]: rapids are slowed, a feed is refused"
    )
    block_ms: Positive = Field(
        default=12.0,
        description="time that the controller needs to plan a motion ahead: points that follow "
        "each other faster are worth a warning [ms]",
    )
    memory_mb: Positive = Field(
        default=4.0, description="memory for programs: larger ones are worth a warning [MB]"
    )
    cam_lines: bool = Field(default=True, description="name the CAM line behind each motion")
    setup: bool = Field(
        default=False, description="write NAME_SETUP, which enters tool, base and load data"
    )
    hooks_example: bool = Field(
        default=False, description="write PP_HOOKS, an example of the routines of krl.hooks"
    )
    inertia_kg_m2: Annotated[list[NotNegative], Field(min_length=3, max_length=3)] | None = Field(
        default=None,
        description="principal inertia for LOAD_DATA of a cell with one tool [kg*m^2]",
    )
    outputs: dict[str, Signal] = Field(
        default={}, description="signal of an OLP task to the number of its output: $OUT[n]"
    )
    inputs: dict[str, Signal] = Field(
        default={}, description="signal of an OLP task to the number of its input: $IN[n]"
    )
    hooks: HooksTable = Field(default=HooksTable(), description="routines that programs call")

    @model_validator(mode="after")
    def _motions_of_kss(self) -> KrlTable:
        is_spline = self.motion in (MotionStyle.SPLINE, MotionStyle.SPLINE_BLOCK)
        if is_spline and not self.kss.has_splines:
            raise ValueError(f"motion: {self.motion.value} needs KSS 8, found kss = {self.kss}")
        if is_spline and self.home is HomeStyle.FORM and not self.kss.has_parameter_folds:
            raise ValueError(f"home: form of an SPTP needs KSS 8.6, found kss = {self.kss}")
        return self


class VerifyTable(Table):
    """What ``verify`` takes on trust."""

    accept: list[Text] = Field(
        default=[],
        description="system variables, routines, statements and conditions that verify cannot "
        "judge and that are known to be harmless here, as it names them",
    )


class ExternalAxisTable(Placement):
    """A linear axis or a positioner; the placement is that of its axis in the world."""

    name: Literal["E1", "E2", "E3", "E4", "E5", "E6"] = Field(description="controller axis")
    kind: Literal["rail", "positioner"] = Field(
        description="rail: carries the robot; positioner: turns the workpiece"
    )
    axis: AxisName = Field(description="axis of the placement along or about which it moves")
    range_mm: LengthRange | None = Field(
        default=None, description="[smallest, largest] of a rail [mm]"
    )
    range_deg: Annotated[list[Length], Field(min_length=2, max_length=2)] | None = Field(
        default=None, description="[smallest, largest] of a positioner [deg]"
    )
    speed_mm_s: Positive | None = Field(default=None, description="largest speed of a rail [mm/s]")
    speed_deg_s: Positive | None = Field(
        default=None, description="largest speed of a positioner [deg/s]"
    )
    moves_in_cuts: bool = Field(
        default=True,
        description="it may move while the tool cuts, where no one place serves a cut as well",
    )

    @model_validator(mode="after")
    def _units_of_kind(self) -> ExternalAxisTable:
        own, other = ("mm", "deg") if self.kind == "rail" else ("deg", "mm")
        for key in ("range", "speed"):
            end = "" if key == "range" else "_s"
            if getattr(self, f"{key}_{other}{end}") is not None:
                raise ValueError(f"a {self.kind} takes {key}_{own}{end}, not {key}_{other}{end}")
            if getattr(self, f"{key}_{own}{end}") is None:
                raise ValueError(f"a {self.kind} needs {key}_{own}{end}")
        low, high = self.range_mm or self.range_deg or [0.0, 0.0]
        if low >= high:
            raise ValueError(f"range: {low:g} is not below {high:g}")
        return self


class CellFile(Table):
    """A whole cell file."""

    schema_name: Literal["postproc.cell/1"] = Field(
        alias="schema", description="version of this format"
    )
    name: Text | None = Field(
        default=None, description="name of the cell; default: name of the file"
    )
    robot: RobotTable = Field(description="the arm")
    tool: ToolTable = Field(
        default=ToolTable(axis="+z"), description="the tool of a cell with one tool"
    )
    tools: list[ToolEntry] = Field(
        default=[], description="the tools of a cell with several, instead of tool"
    )
    workpiece: WorkpieceTable = Field(
        default=WorkpieceTable(), description="the workpiece of a cell with one setup"
    )
    bases: list[WorkpieceTable] = Field(
        default=[], description="the setups of a cell with several, instead of workpiece"
    )
    obstacles: list[Solid] = Field(default=[], description="solids in the world")
    limits: LimitsTable = Field(default=LimitsTable(), description="margins")
    optimize: OptimizeTable = Field(default=OptimizeTable(), description="use of the redundancy")
    process: ProcessTable = Field(default=ProcessTable(), description="load while working")
    stiffness: StiffnessTable | None = Field(default=None, description="joint stiffness")
    measuring: MeasuringTable = Field(
        default=MeasuringTable(), description="measuring device of campaigns"
    )
    motion: MotionTable = Field(default=MotionTable(), description="speeds")
    reading: ImportTable = Field(
        default=ImportTable(), alias="import", description="how CAM files are read"
    )
    krl: KrlTable = Field(default=KrlTable(), description="program text")
    verify: VerifyTable = Field(default=VerifyTable(), description="judging of programs")
    external_axes: Annotated[list[ExternalAxisTable], Field(max_length=6)] = Field(
        default=[], description="rails and positioners; a positioner carries those behind it"
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
        if self.motion.home_deg is None:
            raise ValueError(f"krl.home: {home.value} needs home_deg in [motion], found none")
        if self.external_axes:
            raise ValueError(f"krl.home: {home.value} says nothing of external axes: take axes")
        numbers = [tool.number for tool in (*self.tools, *([] if self.tools else [self.tool]))]
        if home is HomeStyle.FORM and numbers != [1]:
            raise ValueError("krl.home: form selects tool 1 and its load, expected no other tool")
        return self
