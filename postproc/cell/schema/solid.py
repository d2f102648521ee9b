"""Keys of a solid: a mesh file, a box or a cylinder."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from postproc.cell.schema.table import Placement, Positive, Size, Table, Text


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
