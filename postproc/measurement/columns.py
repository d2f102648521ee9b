"""The columns of a measurement file, each said once: name, unit, what an empty cell means."""

from __future__ import annotations

import math
from enum import Enum, auto

from postproc.records import dataclass
from postproc.units import DEG, MM

JOINTS = tuple(f"q{i}_deg" for i in range(1, 7))
POSITION = ("x_mm", "y_mm", "z_mm")
ORIENTATION = ("a_deg", "b_deg", "c_deg")
DIRECTION = tuple(f"dir{i}" for i in range(1, 7))
SPEED = tuple(f"qd{i}_deg_s" for i in range(1, 7))
WRENCH = ("fx_N", "fy_N", "fz_N", "mx_Nm", "my_Nm", "mz_Nm")
EXPECTED = ("expected_x_mm", "expected_y_mm", "expected_z_mm")
PLANNED = (*EXPECTED, "why")
"""Columns of a table to fill in that say what was planned: not measured, no conditions."""


LABELS = ("group", "station", "reflector", "from_id", "plane")
"""Columns of names: what rows have in common."""
CONDITIONS = {
    "tool_no": "tool by which the row was taken",
    "fixture": "fixture by which the row was taken",
    **{f"e{i}_{unit}": f"external axis E{i}" for i in range(1, 7) for unit in ("mm", "deg")},
}
"""Logged conditions with a name of their own: the first two are names, never numbers."""
NAMED_CONDITIONS = ("tool_no", "fixture")


class Empty(Enum):
    """What an empty cell means."""

    ERROR = auto()
    """Every row needs the number."""
    COLUMN = auto()
    """All rows have the number, or none."""
    BETWEEN = auto()
    """It lies between those of the rows around; where most are empty it was not logged."""
    PART = auto()
    """Not measured in this row."""
    ZERO = auto()
    """Nothing: no load, direction unknown, standing."""


@dataclass(frozen=True, slots=True)
class Quantity:
    """Numbers of a row that belong together.

    ``field`` of a ``MeasurementSet``: (n, k) with the k columns ``names``, (n,) with one; ``unit``:
    of the file in SI; ``meaning``: for the reference; ``largest``: in the unit of the file, no
    reading is beyond; a value that is has another unit or a lost decimal point.
    """

    field: str
    names: tuple[str, ...]
    meaning: str
    unit: float = 1.0
    empty: Empty = Empty.ZERO
    largest: float = math.inf


QUANTITIES = (
    Quantity("q", JOINTS, "commanded joint positions A1..A6", DEG, Empty.ERROR, 7200.0),
    Quantity(
        "position",
        POSITION,
        "measured tool point, in the robot root; anywhere with --register",
        MM,
        Empty.PART,
        1e6,
    ),
    Quantity("along", ("u_mm",), "reading along a direction, as of a dial gauge", MM, Empty.PART),
    Quantity("way", ("ux", "uy", "uz"), "that direction in the measured frame", 1.0, Empty.PART),
    Quantity(
        "length", ("length_mm",), "distance from a point, as of a ball bar", MM, Empty.PART, 1e6
    ),
    Quantity(
        "origin",
        ("from_x_mm", "from_y_mm", "from_z_mm"),
        "that point; where it is not known, `from_id` names it",
        MM,
        Empty.PART,
        1e6,
    ),
    Quantity("abc", ORIENTATION, "measured tool orientation, KUKA A, B, C", DEG, Empty.COLUMN),
    Quantity("time", ("time_s",), "time since the start", 1.0, Empty.BETWEEN),
    Quantity("temperature", ("temp_C",), "temperature of the arm", 1.0, Empty.BETWEEN),
    Quantity(
        "direction",
        DIRECTION,
        "side from which each joint came: 1 its angle grew, -1 it fell, 0 unknown",
    ),
    Quantity("qd", SPEED, "commanded joint speeds at the reading", DEG),
    Quantity(
        "wrench", WRENCH, "force and moment on the tool, at the tool point, axes of the robot root"
    ),
    Quantity(
        "sigma",
        ("sigma_mm",),
        "standard deviation of the reading per axis, of the instrument",
        MM,
        Empty.BETWEEN,
    ),
    Quantity("sigmas", ("sx_mm", "sy_mm", "sz_mm"), "the same of each coordinate", MM, Empty.PART),
)
READINGS = ("position", "along", "length", "plane")
"""What a row may have read, one of them at least."""
KNOWN = ("id", *LABELS, *(name for part in QUANTITIES for name in part.names), *PLANNED)
