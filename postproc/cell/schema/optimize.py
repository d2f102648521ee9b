"""Keys of ``[limits]`` and ``[optimize]``."""

from __future__ import annotations

from typing import Annotated

from pydantic import BeforeValidator, Field, model_validator

from postproc.cell.choices import Index, Preset, Strategy
from postproc.cell.schema.table import CHOICE, Angle, AngleRange, NotNegative, Positive, Table, Text

TiltAngles = Annotated[
    list[Annotated[float, Field(ge=-45.0, le=45.0)]], Field(min_length=2, max_length=2)
]


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
    index: Annotated[Index, CHOICE, BeforeValidator(_index_name)] = Field(
        default=Index.COMPLIANCE,
        description="1/(n^T C n), or the ellipsoid index of Jiao et al. 2022",
    )
    step_deg: Annotated[float, Field(ge=0.1, le=360.0)] = Field(
        default=10.0, description="step of the spin about the tool axis [deg]"
    )
    range_deg: AngleRange = Field(
        default=[-180.0, 180.0], description="range of the spin about the tool axis [deg]"
    )
    strategy: Annotated[Strategy, CHOICE] = Field(
        default=Strategy.GLOBAL,
        description="global: best joint-continuous sequence over all tags; smooth: key tags "
        "optimised, the rest interpolated; each: every tag for itself",
    )
    preset: Annotated[Preset, CHOICE] = Field(
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
    spin_round_deg: Annotated[float, Field(ge=0.0, le=10.0)] = Field(
        default=1.0,
        description="holes and key tags take spins that are multiples of this; 0: any [deg]",
    )
    keep_loss_percent: Annotated[float, Field(ge=0.0, le=50.0)] = Field(
        default=2.0,
        description="--keep: a pose of the old program stays that loses no more stiffness than "
        "this against a free plan, of cells without stiffness the cycle no more time [%]",
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
