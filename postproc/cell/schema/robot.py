"""Keys of ``[robot]`` and ``[[external_axes]]``."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from postproc.cell.choices import RobotSolids
from postproc.cell.schema.table import (
    CHOICE,
    AngleRange,
    AxisName,
    Length,
    LinkSolid,
    Placement,
    Positive,
    SixPositive,
    Table,
    Text,
    entry,
)

SixRanges = Annotated[list[AngleRange], Field(min_length=6, max_length=6)]
LengthRange = Annotated[list[Length], Field(min_length=2, max_length=2)]


class DimensionsTable(Table):
    """Lengths of an arm of KUKA with spherical wrist, as `robots NAME --json` names them."""

    a1: Length = entry(..., "axis 1 to axis 2, forwards: $LENGTH_A [mm]")
    a2: Length = entry(..., "axis 3 to the wrist, downwards with the forearm level: -$TX3P3.Z [mm]")
    b: Length = entry(0.0, "sideways [mm]")
    c1: Length = entry(..., "foot to axis 2, upwards: $TIRORO.Z [mm]")
    c2: Positive = entry(..., "upper arm: $LENGTH_B [mm]")
    c3: Length = entry(..., "forearm: $TX3P3.X [mm]")
    c4: Length = entry(..., "wrist to flange: $TFLWP.Z [mm]")


class RobotTable(Table):
    """The arm: a built-in model, the lengths of an arm of KUKA, or a URDF file."""

    model: Text | None = entry(
        None, "built-in robot, by any spelling of its name or $TRAFONAME, see `postproc robots`"
    )
    dimensions_mm: DimensionsTable | None = entry(
        None,
        "lengths from the machine data: of an arm that is not built in, or instead of "
        "those of model",
    )
    name: Text | None = entry(None, "name of an arm that dimensions_mm alone describes")
    urdf: Text | None = entry(
        None, "URDF file instead of a built-in robot, relative to the cell file"
    )
    tip: Text | None = entry(
        None, "name of the flange link in the URDF; default: the end of the chain"
    )
    base: Placement = entry(Placement(), "robot root in the world")
    limits_deg: SixRanges | None = entry(
        None, "[smallest, largest] of A1..A6 [deg]; default: of the robot"
    )
    cable: dict[Literal["A1", "A2", "A3", "A4", "A5", "A6"], AngleRange] = entry(
        {},
        "what cables and hoses allow of single axes, within the limits [deg]: "
        "{ A4 = [-180, 180], A6 = [-270, 270] }",
    )
    speed_deg_s: SixPositive | None = entry(
        None, "largest speed of A1..A6 [deg/s]; default: of the robot"
    )
    accel_deg_s2: SixPositive | None = entry(
        None,
        "largest acceleration of A1..A6 [deg/s^2], which times of path motions keep as "
        "well; default: of the robot, or full speed in half a second in joint motions",
    )
    jerk_deg_s3: SixPositive | None = entry(
        None,
        "largest jerk of A1..A6 [deg/s^3], for times; default: full acceleration in "
        "a tenth of a second",
    )
    torque_nm: SixPositive | None = entry(
        None,
        "largest torques of A1..A6 [N*m], for times: of an arm whose urdf gives mass "
        "and inertia of every link; default: the efforts of that file, if all are above 0",
    )
    payload_kg: Positive | None = entry(None, "rated payload [kg]; default: of the robot")
    solids: Annotated[RobotSolids, CHOICE] = entry(
        RobotSolids.OUTLINE,
        "solids of a built-in arm: outline encloses the real one, simple is one convex "
        "hull of each link's outline, thicker and faster",
    )
    link_meshes: list[LinkSolid] = entry(
        [], "your own solids of the links instead of the built-in hulls"
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


class ExternalAxisTable(Placement):
    """A linear axis or a positioner; the placement is that of its axis in the world."""

    name: Literal["E1", "E2", "E3", "E4", "E5", "E6"] = entry(..., "controller axis")
    kind: Literal["rail", "positioner"] = entry(
        ..., "rail: carries the robot; positioner: turns the workpiece"
    )
    axis: AxisName = entry(..., "axis of the placement along or about which it moves")
    range_mm: LengthRange | None = entry(None, "[smallest, largest] of a rail [mm]")
    range_deg: Annotated[list[Length], Field(min_length=2, max_length=2)] | None = entry(
        None, "[smallest, largest] of a positioner [deg]"
    )
    speed_mm_s: Positive | None = entry(None, "largest speed of a rail [mm/s]")
    speed_deg_s: Positive | None = entry(None, "largest speed of a positioner [deg/s]")
    moves_in_cuts: bool = entry(
        True, "it may move while the tool cuts, where no one place serves a cut as well"
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
