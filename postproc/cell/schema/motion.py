"""Keys of ``[motion]``."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field, model_validator

from postproc.cell.choices import ArcMotion, PathEntry, PointService
from postproc.cell.schema.table import CHOICE, NotNegative, Positive, Table

SixAngles = Annotated[
    list[Annotated[float, Field(ge=-720.0, le=720.0)]], Field(min_length=6, max_length=6)
]


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
