"""What the tables of ``cell.toml`` are made of: kinds of values with their ranges."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator
from pydantic.fields import FieldInfo

CHOICE = Field(strict=False)
"""A word of a list: the file holds text, the strict table would ask for the member itself."""
Length = Annotated[float, Field(ge=-1e5, le=1e5)]
Angle = Annotated[float, Field(ge=-360.0, le=360.0)]
Positive = Annotated[float, Field(gt=0.0)]
NotNegative = Annotated[float, Field(ge=0.0)]
Size = Annotated[float, Field(gt=0.0, le=1e5)]
Vector = Annotated[list[Length], Field(min_length=3, max_length=3)]
Angles = Annotated[list[Angle], Field(min_length=3, max_length=3)]
SixPositive = Annotated[list[Positive], Field(min_length=6, max_length=6)]
AngleRange = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=2, max_length=2)
]
AxisName = Literal["+x", "-x", "+y", "-y", "+z", "-z"]
Text = Annotated[str, Field(min_length=1, max_length=255)]
EMPTY: Any = {}
"""A table of which no key is given, as a default. A table in its place would be built while the
schema loads, apart from that of the whole file."""
CamNames = list[Text | Annotated[int, Field(ge=0)]]


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


def default_of(field: FieldInfo) -> Any:  # noqa: ANN401 - a value of any key
    """Return the default of a key, that of a table as a table."""
    kind, value = field.annotation, field.default
    if isinstance(value, dict) and isinstance(kind, type) and issubclass(kind, Table):
        return kind.model_validate(value)
    return value


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
