"""What rows of a point list name: operations, tools, bases, the spindle; names that repeat."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import groupby

import numpy as np

from postproc.arrays import NONE, FloatArray, IndexArray, IntArray
from postproc.model import CamSetup, CamTool, Event, EventKind, Operation
from postproc.readers.base import distinct, tool_changes
from postproc.readers.csv.columns import Column
from postproc.readers.csv.roles import roles_spelled
from postproc.readers.text import Faults, parse_number
from postproc.units import MM


def operation_runs(
    names: list[str] | None, line: IntArray
) -> tuple[IntArray, tuple[Operation, ...]]:
    """Return the operation (n,) of each row; an empty name goes on with the one before."""
    n = len(line)
    if names is None:
        return np.full(n, NONE, dtype=np.int32), ()
    runs: list[Operation] = []
    index: list[int] = []
    for name, same in groupby(names):
        if name and not (runs and runs[-1].name == name):
            runs.append(Operation(name, int(line[len(index)])))
        index += [len(runs) - 1] * sum(1 for _ in same)
    return np.array(index, dtype=np.int32), tuple(runs)


def tool_calls(
    names: list[str] | None, line: IntArray, faults: Faults
) -> tuple[IntArray, tuple[CamTool, ...], tuple[Event, ...]]:
    """Return the tool (n,) of each row, the distinct tools, and an event for every change."""
    n = len(line)
    if names is None:
        return np.full(n, NONE, dtype=np.int32), (), ()
    _, first = distinct(names)
    keys = {name: _tool_key(name, int(line[row]), faults) for name, row in first.items()}
    column, rows = distinct(map(keys.get, names))
    tools = tuple(CamTool(no, name, line=int(line[at])) for (no, name), at in rows.items())
    return column, tools, tuple(tool_changes(column, tools, line, with_first=True))


def _tool_key(text: str, line: int, faults: Faults) -> tuple[int, str]:
    """Return number and name of a tool: a text that is no number is a name."""
    number = parse_number(text)
    if number is None:
        return 0, text
    if number < 0.0 or number != round(number):
        raise faults.error("CSV033", "a tool number must be whole", line)
    return int(number), "" if number > 0.0 else text


def setup_calls(
    names: list[str] | None, line: IntArray
) -> tuple[IntArray | None, tuple[CamSetup, ...]]:
    """Return the setup (n,) of each row, None without such a column, and the distinct setups."""
    if names is None:
        return None, ()
    column, first = distinct(names)
    return column, tuple(CamSetup(name, int(line[row])) for name, row in first.items())


LEAST_RPM = 50.0
"""No drill or cutter of a robot turns slower [1/min]: a smaller number is one of another kind."""
_SENSES = {
    word: sense
    for sense, words in {
        1.0: "cw clw clockwise m3 m03 1 +1 + right rechts rechtslauf droite horaire",
        -1.0: "ccw cclw counterclockwise anticlockwise m4 m04 -1 - left links linkslauf gauche "
        "antihoraire",
        0.0: "off stop m5 m05 aus arret",
    }.items()
    for word in words.split()
}


def doubted(column: Column, values: FloatArray) -> Column:
    """Return a column, with the question whether its numbers (n,) without a unit are speeds.

    A name of one letter needs a speed in every row, the others may stop the spindle by 0.
    """
    size = np.abs(values)
    if not any(needs_unit for _, needs_unit in roles_spelled(column.name.strip('" ').lower())):
        size = size[size != 0.0]
    slow = size[size < LEAST_RPM]
    if column.unit is not None or not len(slow):
        return column
    return replace(column, question=f"no unit, and {slow[0]:g} is not a spindle speed in 1/min")


def turns_of(
    speeds: FloatArray | None, senses: list[str] | None, line: IntArray, faults: Faults
) -> FloatArray | None:
    """Return the turns per second (n,) of rows, negative counterclockwise; None without speeds.

    ``speeds`` are NaN in front of the first one; their sign says the sense where no words do.
    """
    if speeds is None or np.isnan(speeds).all():
        return None
    if senses is None:
        return speeds
    unknown = [row for row, word in enumerate(senses) if word and word.lower() not in _SENSES]
    if unknown:
        row = unknown[0]
        text = "unknown sense of rotation, expected CW or CCW, M3 or M4"
        raise faults.error("CSV035", text, int(line[row]), senses[row])
    below = [row for row in np.flatnonzero(speeds < 0.0).tolist() if senses[row]]
    if below:
        text = "a negative speed and a sense of rotation: the direction is not clear"
        raise faults.error("CSV036", text, int(line[below[0]]))
    return np.asarray(speeds * [_SENSES[word.lower()] if word else 1.0 for word in senses])


def spindle_events(turns: FloatArray | None, line: IntArray) -> list[Event]:
    """Return an event wherever the spindle turns (n,) otherwise than before."""
    if turns is None:
        return []
    known = np.flatnonzero(np.isfinite(turns))
    changed = known[np.diff(turns[known], prepend=np.nan) != 0.0]
    return [
        Event(row, EventKind.SPINDLE_ON, speed, "", int(line[row]))
        if speed
        else Event(row, EventKind.SPINDLE_OFF, 0.0, "", int(line[row]))
        for row, speed in zip(changed.tolist(), turns[changed].tolist(), strict=True)
    ]


SPREAD = 1.0 * MM
"""Rows of one name that lie within this [m] of each other are repeated measurements."""


def merged_repeats(
    names: list[str], others: Sequence[Sequence[object]], points: FloatArray, line: IntArray,
    faults: Faults,
) -> tuple[FloatArray, IndexArray] | None:  # fmt: skip
    """Return the mean point of each name and the first row of each, None if no name repeats.

    Rows without a name stay as they are, and one hole may stand in several operations, with several
    tools, depths or speeds, and in several bases: ``others``, columns that tell rows of one name
    apart. Rows of one name that are far apart are the error CSV040.
    """
    keys = list(zip(names, *others, strict=True))
    if len(set(keys)) == len(names) and "" not in names:
        return None
    index: dict[object, int] = {}
    group = np.array(
        [
            index.setdefault(key if name else (key, row), len(index))
            for row, (key, name) in enumerate(zip(keys, names, strict=True))
        ]
    )
    if len(index) == len(names):
        return None
    first = np.full(len(index), len(names), dtype=np.int64)
    np.minimum.at(first, group, np.arange(len(names)))
    mean = np.zeros((len(index), 3))
    np.add.at(mean, group, points)
    mean /= np.bincount(group)[:, None]
    gap = np.linalg.norm(points - points[first[group]], axis=1)
    far = np.flatnonzero(gap > SPREAD)
    if len(far):
        row = int(far[0])
        text = (
            f"{names[row]!r} stands for two points {gap[row] / MM:.3f} mm apart, "
            f"the other in line {line[first[group[row]]]}"
        )
        hint = "give each point its own name; rows within 1 mm count as repeated measurements"
        raise faults.error("CSV040", text, int(line[row]), hint=hint)
    text = (
        f"{len(names) - len(index)} rows repeat a name: repeated measurements, their mean is taken"
    )
    faults.warn("CSV140", text, int(line[np.setdiff1d(np.arange(len(names)), first)[0]]))
    return mean, first
