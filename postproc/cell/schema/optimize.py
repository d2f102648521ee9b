"""Keys of ``[limits]`` and ``[optimize]``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, Self

from pydantic import AfterValidator, BeforeValidator, Field

from postproc.cell.choices import Index, Preset, Strategy
from postproc.cell.schema.table import CHOICE, Angle, AngleRange, Options, Text, key
from postproc.records import dataclass
from postproc.units import DEG

Range = tuple[float, float]
TiltAngles = Annotated[
    list[Annotated[float, Field(ge=-45.0, le=45.0)]], Field(min_length=2, max_length=2)
]


@dataclass(frozen=True, slots=True)
class Limits(Options):
    """Margins that every pose of a program must keep."""

    joint_margin: float = key(2.0, "distance from the joint limits [deg]", "deg", ge=0.0, le=90.0)
    singularity: float = key(5.0, "smallest |A5| [deg]", "deg", ge=0.0, le=90.0)
    clearance: float = key(
        2.0,
        "smallest distance between solids, but of a cutting solid from the workpiece; "
        "by default about what a large arm is off that was not calibrated [mm]",
        "mm",
        ge=0.0,
    )
    contact_depth: float = key(
        None,
        "how deep cutting solids may go into the workpiece during a cut [mm]; default: any depth",
        "mm",
        ge=0.0,
        missing=math.inf,
    )


def _index_name(value: object) -> object:
    """Return the name of an index for the one that older cells have."""
    return Index.ELLIPSOID if value == "seed" else value


def _texts(tags: list[str | int]) -> list[str]:
    return list(map(str, tags))


def _in_rad(pins: dict[str, float]) -> dict[str, float]:
    return {tag: spin * DEG for tag, spin in pins.items()}


@dataclass(frozen=True, slots=True)
class TiltRange:
    """Smallest and largest lead and side tilt, and the step of the search, all [rad]."""

    lead: Range
    side: Range
    step: float

    def __bool__(self) -> bool:
        """Return whether any tilt is allowed."""
        return any((*self.lead, *self.side))


@dataclass(frozen=True, slots=True)
class Optimize(Options):
    """What the freedom about the tool axis is used for."""

    objective: str | Mapping[str, float] = key(
        "axial",
        "axial (along the tool axis), normal, radial, process (along the force), "
        "or a table of weights; see `postproc plugins`",
        form=Text | dict[str, float],
    )
    index: Index = key(
        Index.COMPLIANCE,
        "1/(n^T C n), or the ellipsoid index of Jiao et al. 2022",
        form=Annotated[Index, CHOICE, BeforeValidator(_index_name)],
    )
    step: float = key(10.0, "step of the spin about the tool axis [deg]", "deg", ge=0.1, le=360.0)
    range: Range = key(
        (-180.0, 180.0), "range of the spin about the tool axis [deg]", "deg", form=AngleRange
    )
    strategy: Strategy = key(
        Strategy.GLOBAL,
        "global: best joint-continuous sequence over all tags; smooth: key tags "
        "optimised, the rest interpolated; each: every tag for itself",
    )
    preset: Preset = key(
        Preset.BALANCED,
        "of an objective by name: stiffest, balanced (a tag loses more than 5 % of "
        "its stiffness only for a way or a margin that is worth more) or fastest",
    )
    turns: bool = key(True, "also use angles a whole turn away where the limits allow them")
    refine: bool = key(True, "leave the grid of turns for better ones in between")
    spin_round: float = key(
        1.0,
        "holes and key tags take spins that are multiples of this; 0: any [deg]",
        "deg",
        ge=0.0,
        le=10.0,
    )
    keep_loss: float = key(
        2.0,
        "--keep: a pose of the old program stays that loses no more stiffness than "
        "this against a free plan, of cells without stiffness the cycle no more time [%]",
        "percent",
        ge=0.0,
        le=50.0,
    )
    key_every: float = key(
        100.0, "smooth: a key tag at least every so many mm of path", "mm", gt=0.0
    )
    key_corner: float = key(
        20.0,
        "smooth: a bend of path or tool axis that makes a key tag [deg]",
        "deg",
        gt=0.0,
        le=180.0,
    )
    key_tags: tuple[str, ...] = key(
        (),
        "smooth: ids of the key tags, instead of corners and distances",
        form=Annotated[list[Text | int], AfterValidator(_texts)],
    )
    loss_bound: float | None = key(
        None,
        "no tag loses more stiffness than this wherever that can be run [%]; default: "
        "5 of smooth, else none",
        "percent",
        ge=0.0,
        le=100.0,
    )
    free_order: bool = key(False, "the order of holes is not binding: take the quickest one found")
    pins: Mapping[str, float] = key(
        {},
        "tag id to the spin about the tool axis it must have [deg]",
        form=Annotated[dict[str, Angle], AfterValidator(_in_rad)],
    )
    lead: Range = key(
        (0.0, 0.0),
        "milling: allowed lead angle, the tilt of the tool axis in the feed direction, "
        "positive leans the holder forward [deg]; holes are never tilted",
        "deg",
        form=TiltAngles,
    )
    side_tilt: Range = key(
        (0.0, 0.0),
        "milling: allowed side tilt (lean) of the tool axis across the feed direction, "
        "positive leans the holder to the right [deg]",
        "deg",
        form=TiltAngles,
    )
    tilt_step: float = key(
        5.0, "step of lead and side tilt in the search [deg]", "deg", ge=0.5, le=45.0
    )

    @property
    def tilt(self) -> TiltRange:
        """The tilts that milling may take."""
        return TiltRange(self.lead, self.side_tilt, self.tilt_step)

    def checked(self) -> Self:
        """Return the options; ValueError for ranges that are none and weights of nothing."""
        for key_, ends in (
            ("range", self.range),
            ("lead", self.lead),
            ("side_tilt", self.side_tilt),
        ):
            low, high = (end / DEG for end in ends)
            if low > high:
                raise ValueError(f"{key_}_deg: {low:g} is above {high:g}")
            if key_ != "range" and not low <= 0.0 <= high:
                raise ValueError(
                    f"{key_}_deg: 0 must lie in the range, found [{low:g}, {high:g}]: points "
                    "without a feed direction and holes are not tilted"
                )
        if isinstance(self.objective, dict) and not any(w > 0 for w in self.objective.values()):
            raise ValueError("objective: a table of weights needs at least one above 0")
        return self
