"""Keys of ``[workpiece]`` and ``[[bases]]``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from postproc.cell.schema.solid import Solid
from postproc.cell.schema.table import CamNames, Placement, Table, Text


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
