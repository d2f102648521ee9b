"""The options of a cell in SI units, and their tables of the file, with defaults, to them.

A key is called as its option, and ends in its unit. What is no more than that stands nowhere else.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import field
from typing import Any

import numpy as np

from postproc.arrays import FloatArray, frozen_floats
from postproc.cell.choices import (
    ArcMotion,
    HomeStyle,
    Index,
    Kss,
    MotionStyle,
    PathEntry,
    PointPlace,
    PointService,
    Preset,
    SpindleStart,
    Split,
    Strategy,
)
from postproc.cell.forms import hole_steps, routines
from postproc.cell.schema import (
    ImportTable,
    KrlTable,
    LimitsTable,
    MotionTable,
    OptimizeTable,
    ProcessTable,
    Table,
)
from postproc.records import dataclass
from postproc.units import DEG, MEGABYTE, MM, MM_PER_MIN, MS, PERCENT, RPM

_UNITS = {
    "_mm_min": MM_PER_MIN,
    "_m_s": 1.0,
    "_deg_s": DEG,
    "_percent": PERCENT,
    "_deg": DEG,
    "_mm": MM,
    "_ms": MS,
    "_mb": MEGABYTE,
}
"""End of a key to what one of its unit is in SI; the first that fits."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Margins that a plan must keep: joint margin [rad], smallest |A5| [rad], clearance [m]."""

    joint_margin: float
    singularity: float
    clearance: float
    contact_depth: float
    """How deep [m] solids marked as cutting may go into the workpiece during a cut (inf = any)."""


@dataclass(frozen=True, slots=True)
class TiltRange:
    """Smallest and largest lead and side tilt, and the step of the search, all [rad]."""

    lead: tuple[float, float]
    side: tuple[float, float]
    step: float

    def __bool__(self) -> bool:
        """Return whether any tilt is allowed."""
        return any((*self.lead, *self.side))


@dataclass(frozen=True, slots=True)
class Optimize:
    """What the redundancy about the tool axis is used for.

    ``step`` and ``range`` [rad] of the spin; ``turns``: also angles a whole turn away; ``refine``:
    leave the grid of spins for multiples of ``spin_round`` [rad], 0 for any; a pose of
    an old program is kept that loses no more than the share ``keep_loss``. ``smooth`` makes a key
    tag every ``key_every`` [m], at corners above ``key_corner`` [rad], or at ``key_tags``, and more
    where more than the share ``loss_bound`` of the stiffness is lost. ``free_order``: holes in any
    order. ``pins``: tag id to spin [rad].
    """

    objective: str | Mapping[str, float]
    index: Index
    step: float
    range: tuple[float, float]
    strategy: Strategy
    preset: Preset
    turns: bool
    refine: bool
    spin_round: float
    keep_loss: float
    key_every: float
    key_corner: float
    key_tags: tuple[str, ...]
    loss_bound: float | None
    free_order: bool
    pins: Mapping[str, float]
    tilt: TiltRange


@dataclass(frozen=True, slots=True)
class Process:
    """Load on the tool while it works: wrench (6,) [N, N*m] ON the tool at and in axes of TCP.

    ``operations``: the wrench (6,) of single operations of the CAM file, by name. ``hole``: names
    of the routines called at each hole, in order; ``unit_feeds``: the end effector drills while the
    robot stands; ``least_feed``: lowest share of a feed that the process takes, 0 for any;
    ``spindle``: who starts it, None: nothing says it; ``spindle_turns``: speed [turns/s] that the
    program starts it with where a file gives none, 0 without.
    """

    wrench_tcp: FloatArray
    operations: Mapping[str, FloatArray] = field(default_factory=dict)
    hole: tuple[str, ...] = ()
    unit_feeds: bool = False
    least_feed: float = 0.0
    spindle: SpindleStart | None = None
    spindle_turns: float = 0.0

    def wrench_of(self, operation: str) -> FloatArray:
        """Return the wrench (6,) of an operation of the CAM file."""
        return np.asarray(self.operations.get(operation, self.wrench_tcp), dtype=np.float64)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "wrench_tcp", (6,))


@dataclass(frozen=True, slots=True)
class Thin:
    """How far the tool may pass a point left out: ``chord`` [m], its axis by ``axis`` [rad]."""

    chord: float
    axis: float


@dataclass(frozen=True, slots=True)
class Motion:
    """Speeds and blending of motions.

    Rapids run at the share ``rapid`` of the axis speeds, straight ones at ``rapid_speed`` [m/s].
    ``feed`` [m/s] or NaN where the CAM data gives none; ``approximation`` [m], and how far the tool
    may pass a corner at feed for it, ``corner_tolerance`` [m]; ``home`` (6,) [rad];
    ``approach`` [m] above a point without a depth; ``chord`` [m] between an arc and its lines;
    ``thin``: by how much points of cuts may be passed, None: every point is written;
    ``retract_in_cuts``: whether a cut that no arm configuration serves is left and entered again;
    ``path_entry``: how the tool comes into a cut that the file does not lead into, and out.
    """

    rapid: float
    rapid_speed: float
    feed: float
    approximation: float
    corner_tolerance: float
    home: FloatArray | None
    approach: float
    points: PointService
    chord: float
    arcs: ArcMotion
    thin: Thin | None = None
    retract_in_cuts: bool = False
    path_entry: PathEntry = PathEntry.AXIS

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "home", (6,))


@dataclass(frozen=True, slots=True)
class Reading:
    """How the CAM files of this cell are read where a call does not say; None: as the file says.

    ``format``: ``auto`` or the name of a reader; ``accept_words``: words that are harmless here.
    """

    format: str = "auto"
    dialect: str | None = None
    units: str | None = None
    columns: str | None = None
    cycle_words: str | None = None
    feed_units: str | None = None
    arc_sense: str | None = None
    head: str | None = None
    task: str | None = None
    accept_words: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class KrlOptions:
    """How programs are written.

    ``emitter``: name of the registered emitter; the rest is for that of KUKA. ``advance``: motions
    planned ahead; ``orientation_speed`` [rad/s]; ``path_speed_max`` [m/s]; ``block`` [s] to
    plan a motion; ``memory`` [bytes] for programs; ``hooks``: event to the routine that the
    integrator defines.
    """

    emitter: str
    template: str
    max_points_per_file: int
    split: Split
    motion: MotionStyle
    points: PointPlace
    kss: Kss
    home: HomeStyle
    advance: int
    orientation_speed: float
    path_speed_max: float
    block: float
    memory: float
    cam_lines: bool
    setup: bool
    hooks_example: bool
    hooks: Mapping[str, str]
    outputs: Mapping[str, int] = field(default_factory=dict)
    """Signals of OLP tasks by the number of their output."""
    inputs: Mapping[str, int] = field(default_factory=dict)
    stops_advance: tuple[str, ...] | None = None
    """Keys of the hooks whose routines stop the advance run first; None: the cell does not say."""

    @property
    def is_spline(self) -> bool:
        """Whether all motions are the newer ones, which do not blend with the classic ones."""
        return self.motion in (MotionStyle.SPLINE, MotionStyle.SPLINE_BLOCK)


def limits_of(table: LimitsTable) -> Limits:
    """Return the margins of ``[limits]``."""
    return Limits(**_in_si(table, contact_depth=float("inf")))


def optimize_of(table: OptimizeTable) -> Optimize:
    """Return the options of ``[optimize]``."""
    found = _in_si(table)
    tilt = TiltRange(*(found.pop(name) for name in ("lead", "side_tilt", "tilt_step")))
    found["key_tags"] = tuple(map(str, table.key_tags))
    found["pins"] = {tag: spin * DEG for tag, spin in table.pins.items()}
    return Optimize(**found, tilt=tilt)


def motion_of(table: MotionTable) -> Motion:
    """Return the options of ``[motion]``."""
    found = _in_si(table, feed=float("nan"))
    found["rapid_speed"] *= found["rapid"]
    found["thin"] = None if table.thin is None else Thin(**_in_si(table.thin))
    return Motion(**found)


def process_of(table: ProcessTable) -> Process:
    """Return the options of ``[process]``."""
    return Process(
        np.array([*table.force_N, *table.moment_Nm]),
        {load.name: np.array([*load.force_N, *load.moment_Nm]) for load in table.operations},
        hole_steps(table),
        table.feed_by == "unit",
        0.0 if table.least_feed_percent is None else table.least_feed_percent * PERCENT,
        table.started_by,
        0.0 if table.spindle_rpm is None else table.spindle_rpm * RPM,
    )


def reading_of(table: ImportTable) -> Reading:
    """Return the options of ``[import]``."""
    return Reading(**_in_si(table))


def krl_of(table: KrlTable, hole: Sequence[str] = ()) -> KrlOptions:
    """Return the options of ``[krl]``; the template as the file names it.

    Args:
        table: as in the file.
        hole: routines of ``[process] hole``: called ``PP_`` and their name unless the table says.
    """
    found = _in_si(table)
    del found["inertia_kg_m2"]  # of the tool
    found["hooks"], stops = routines(table.hooks, hole), table.hooks.stops_advance
    found["stops_advance"] = None if stops is None else tuple(stops)
    return KrlOptions(**found)


def _in_si(table: Table, **missing: float) -> dict[str, Any]:
    """Return the values of a table by the names of their options; ``missing``: those of None."""
    found: dict[str, Any] = {}
    for key, value in table:
        unit = next((end for end in _UNITS if key.endswith(end)), "")
        name, factor = key.removesuffix(unit), _UNITS.get(unit)
        if isinstance(value, list):
            value = tuple(value if factor is None else (number * factor for number in value))
        elif value is not None and factor is not None:
            value = value * factor
        found[name] = missing.get(name) if value is None else value
    return found
