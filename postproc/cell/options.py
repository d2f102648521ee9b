"""Tables of options of a cell file in file units, with their defaults, to options in SI units.

A key is called as its option, and ends in its unit. What is no more than that stands nowhere else.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from postproc.cell.cell import KrlOptions, Limits, Motion, Optimize, Reading, Thin, TiltRange
from postproc.cell.forms import routines
from postproc.cell.schema import (
    ImportTable,
    KrlTable,
    LimitsTable,
    MotionTable,
    OptimizeTable,
    Table,
)
from postproc.units import DEG, MEGABYTE, MM, MM_PER_MIN, MS, PERCENT

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
