"""Columns of a point list to SI: units taken for want of others, and what refutes them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.process import SHALLOW, SMALL
from postproc.readers.base import LENGTH_UNITS, ReadOptions
from postproc.readers.csv.columns import POSITION, Column
from postproc.readers.csv.roles import BY_NAME
from postproc.readers.csv.table import Layout
from postproc.readers.text import Faults
from postproc.records import dataclass
from postproc.units import DEG, INCH_PER_MIN, MM, MM_PER_MIN, Dimension

_ASSUMED = {
    Dimension.LENGTH: "lengths in mm",
    Dimension.ANGLE: "angles in degrees",
    Dimension.SPEED: "feeds in mm/min",
    Dimension.TURNS: "spindle speeds in 1/min",
    Dimension.TIME: "times in s",
}
SLOWEST = 1.0 * MM_PER_MIN
"""No robot feeds slower [m/s]."""
LONGEST_DWELL = 60.0
"""No drill stands longer [s] at the bottom of a hole."""
_EIGHTH_TURN = math.pi / 4.0
_DIGITS = 1e-3
"""Angles that are all multiples of an eighth of a turn in radians, to so many digits, are those."""
_HINT = (
    "say the unit in the header or with --columns (x [m], depth_in, a_rad, feed_m_s), or that of "
    "lengths with --units m, inch, or mm where that is meant"
)


@dataclass(slots=True)
class Columns:
    """All rows: line (n,), numeric columns by role (n,) in SI, texts by role."""

    line: IntArray
    numbers: dict[str, FloatArray] = field(default_factory=dict)
    texts: dict[str, list[str]] = field(default_factory=dict)
    bare: frozenset[str] = frozenset()
    """Roles whose unit is the usual one, for none is said."""
    feeds_per_turn: bool = False

    def kept(self, rows: IndexArray) -> Columns:
        """Return some of the rows, by index (m,)."""
        numbers = {role: values[rows] for role, values in self.numbers.items()}
        texts = {role: [all_[i] for i in rows.tolist()] for role, all_ in self.texts.items()}
        return Columns(self.line[rows], numbers, texts, self.bare, self.feeds_per_turn)


def in_si(columns: list[Column], data: Columns, units: str) -> Columns:
    """Return the rows with all numbers in SI; of a feed per turn the advance of a turn [m]."""
    roles = [column for column in columns if column.role in data.numbers]
    factor = {c.role: c.unit.factor if c.unit else usual_factor(c.role, units) for c in roles}
    numbers = {role: data.numbers[role] * size for role, size in factor.items()}
    bare = frozenset(c.role for c in roles if c.unit is None and BY_NAME[c.role].dimensions)
    per_turn = any(c.unit is not None and c.unit.dimension is Dimension.ADVANCE for c in roles)
    return Columns(data.line, numbers, data.texts, bare, per_turn)


def usual_factor(name: str, units: str) -> float:
    """Return the factor to SI of numbers of a role in a file of these units of length."""
    role = BY_NAME[name]
    if Dimension.LENGTH in role.dimensions:
        return LENGTH_UNITS[units]
    if Dimension.SPEED in role.dimensions and units == "inch":
        return INCH_PER_MIN
    return role.bare


def check_sizes(
    points: FloatArray, line: IntArray, data: Columns, options: ReadOptions, faults: Faults
) -> None:
    """Ask for a unit (CSV017) where the numbers of points (n, 3) [m] refute the usual one."""
    for role, text in _refuted(points, data):
        is_length = Dimension.LENGTH in BY_NAME[role].dimensions
        if role in data.bare and not (is_length and options.units is not None):
            usual = _ASSUMED[BY_NAME[role].dimensions[0]]
            text = f"{text}: the file says no unit, and {usual} are hardly meant"
            raise faults.error("CSV017", text, int(line[0]), hint=_HINT)


def _refuted(points: FloatArray, data: Columns) -> Iterator[tuple[str, str]]:
    """Yield a role whose numbers do not fit the usual unit, and what they say in it."""
    extent = float(np.ptp(points, axis=0).max(initial=0.0)) if len(points) else 0.0
    if 0.0 < extent < SMALL:
        yield POSITION[0], f"all points lie within {extent / MM:.4g} mm"
    most = {
        role: float(np.nanmax(np.abs(values), initial=0.0)) for role, values in data.numbers.items()
    }
    if 0.0 < most.get("depth", 0.0) < SHALLOW:
        yield "depth", f"no hole is deeper than {most['depth'] / MM:.4g} mm"
    if 0.0 < most.get("feed", 0.0) < SLOWEST:
        yield "feed", f"no feed is above {most['feed'] / MM_PER_MIN:.4g} mm/min"
    if most.get("dwell", 0.0) > LONGEST_DWELL:
        yield "dwell", f"a dwell of {most['dwell']:.4g} s"
    for role in ("a", "b", "c"):
        turns = data.numbers.get(role, np.zeros(0)) / DEG / _EIGHTH_TURN
        if most.get(role, 0.0) > 0.0 and (np.abs(turns - np.rint(turns)) < _DIGITS).all():
            yield role, f"angles such as {most[role] / DEG:.5g}, parts of pi"


def assumptions(bare: frozenset[str], options: ReadOptions) -> tuple[str, ...]:
    """Return in words which units of columns (``bare``: roles) are taken for want of others."""
    found = {dimension for role in bare for dimension in BY_NAME[role].dimensions[:1]}
    if options.units is not None:
        found -= {Dimension.LENGTH, Dimension.SPEED}
    return tuple(text for dimension, text in _ASSUMED.items() if dimension in found)


def length_unit(columns: list[Column], options: ReadOptions, faults: Faults, layout: Layout) -> str:
    """Return the name of the unit of length for columns without one of their own."""
    units = [column.unit for column in columns if column.role in POSITION]
    factors = {unit.factor if unit is not None else None for unit in units}
    named = {name for name, factor in LENGTH_UNITS.items() if factor in factors}
    if options.units is not None and named and named != {options.units}:
        text = f"the header says {' and '.join(sorted(named))}, but --units says {options.units}"
        raise faults.error("CSV015", text, layout.header_line)
    return options.units or (min(named) if len(named) == 1 == len(factors) else "mm")
