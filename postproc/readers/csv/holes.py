"""Rows of a point list to motions: which are holes, and their drill cycles."""

from __future__ import annotations

import numpy as np

from postproc.arrays import NONE, FloatArray, IndexArray, IntArray
from postproc.model import Cycle, CycleKind, MotionKind
from postproc.readers.base import DEFAULT_CLEARANCE
from postproc.readers.csv.quantities import Columns
from postproc.readers.text import Faults
from postproc.units import MM

DEFAULT_RETRACT = 10.0 * MM
"""Height [m] above a hole where the tool ends, without a column for it."""
_SHOWN = 20
"""Rows of one fault that are named."""
_IN_MM = (1.0 / MM, "mm")
_SHOWN_IN = {
    "depth": _IN_MM, "clearance": _IN_MM, "retract": _IN_MM, "peck": _IN_MM, "diameter": _IN_MM,
    "dwell": (1.0, "s"),
}  # fmt: skip
"""Factor and unit by which a message names what a hole has."""
_MOTIONS = {
    "rapid": MotionKind.RAPID, "g0": MotionKind.RAPID, "g00": MotionKind.RAPID,
    "linear": MotionKind.LINEAR, "lin": MotionKind.LINEAR, "g1": MotionKind.LINEAR,
    "g01": MotionKind.LINEAR, "feed": MotionKind.LINEAR, "cut": MotionKind.LINEAR,
    "hole": MotionKind.HOLE, "drill": MotionKind.HOLE,
}  # fmt: skip


def motion_kinds(columns: Columns, faults: Faults) -> tuple[IntArray, IntArray, tuple[Cycle, ...]]:
    """Return kind (n,) and cycle (n,) of every row, and the table of cycles."""
    line = columns.line
    n = len(line)
    kind = np.full(n, MotionKind.LINEAR, dtype=np.int32)
    if "depth" in columns.numbers:
        kind[~np.isnan(columns.numbers["depth"])] = MotionKind.HOLE
    if "motion" in columns.texts:
        named = _named_kinds(columns.texts["motion"], line, faults)
        kind[named >= 0] = named[named >= 0]
    holes = np.flatnonzero(kind == MotionKind.HOLE)
    cycle = np.full(n, NONE, dtype=np.int32)
    if len(holes) == 0:
        return kind, cycle, ()
    depth = _depths(columns, holes, faults)
    table, index = distinct_rows(_parameters(columns, holes, depth, faults))
    cycle[holes] = index
    return kind, cycle, tuple(_cycle(row) for row in table.tolist())


def distinct_rows(table: FloatArray) -> tuple[FloatArray, IndexArray]:
    """Return the distinct rows of a table (n, c), and which of them each row is (n,)."""
    code = np.zeros(len(table), dtype=np.int64)
    for column in table.T:
        values, index = np.unique(column, return_inverse=True)
        code = code * len(values) + index
        _, code = np.unique(code, return_inverse=True)
    first = np.full(int(code.max(initial=-1)) + 1, len(table), dtype=np.int64)
    np.minimum.at(first, code, np.arange(len(table)))
    return table[first], code


def _named_kinds(motion: list[str], line: IntArray, faults: Faults) -> IntArray:
    kinds = {text: _MOTIONS.get(text.lower(), NONE) for text in set(motion)}
    unknown = [text for text in kinds if text and kinds[text] == NONE]
    if unknown:
        row = next(i for i, text in enumerate(motion) if text in unknown)
        text = "unknown motion, expected rapid, linear or hole"
        raise faults.error("CSV031", text, int(line[row]), motion[row])
    return np.array([kinds[text] for text in motion], dtype=np.int32)


def _depths(columns: Columns, holes: IndexArray, faults: Faults) -> FloatArray:
    depth = columns.numbers.get("depth", np.full(len(columns.line), np.nan))[holes]
    missing = holes[np.isnan(depth)]
    if len(missing):
        raise faults.error("CSV032", "a hole without a depth", int(columns.line[missing[0]]))
    return depth


def _sizes(values: FloatArray, role: str, line: IntArray, faults: Faults) -> FloatArray:
    """Return the sizes of what a hole has; one below zero says something else than it seems to."""
    for row in np.flatnonzero(values < 0.0)[:_SHOWN].tolist():
        text = f"a {role} of {values[row] * _SHOWN_IN[role][0]:g} {_SHOWN_IN[role][1]}"
        expected = {"depth": "how far below the point, above zero"}.get(role, "one above zero")
        faults.fix("CSV030", f"{text}, expected {expected}", "its size is taken", int(line[row]))
    return np.asarray(np.abs(values))


def _parameters(
    columns: Columns, holes: IndexArray, depth: FloatArray, faults: Faults
) -> FloatArray:
    line = columns.line[holes]

    def of(role: str, default: float) -> FloatArray:
        if role not in columns.numbers:
            return np.full(len(holes), default)
        given = columns.numbers[role][holes]
        return np.where(np.isnan(given), default, _sizes(given, role, line, faults))

    clearance = of("clearance", DEFAULT_CLEARANCE)
    retract = of("retract", DEFAULT_RETRACT)
    if "retract" not in columns.numbers:
        retract = np.maximum(retract, clearance)
    sizes = _sizes(depth, "depth", line, faults)
    more = of("peck", 0.0), of("dwell", 0.0), of("diameter", -1.0)
    return np.column_stack([sizes, clearance, retract, *more])


def _cycle(row: list[float]) -> Cycle:
    depth, clearance, retract, peck, dwell, diameter = row
    return Cycle(
        kind=CycleKind.DEEP if peck > 0.0 else CycleKind.DRILL,
        depth=depth,
        clearance=clearance,
        retract=retract,
        peck_first=peck,
        peck=peck,
        dwell=dwell,
        diameter=diameter if diameter >= 0.0 else float("nan"),
    )
