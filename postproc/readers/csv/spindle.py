"""The spindle of a point list: speed and sense of each row, as the events that set it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.model import Event, EventKind
from postproc.readers.csv.columns import Column
from postproc.readers.csv.roles import roles_spelled
from postproc.readers.text import Faults

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
    """Return a column with the question whether its numbers without a unit are speeds.

    Args:
        column: of spindle speeds.
        values: (n,) as the file has them.

    Returns:
        The column as it is, or with its question. A name of one letter needs a speed in every row,
        the others may stop the spindle by 0.
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

    Args:
        speeds: (n,) [turns/s], NaN in front of the first one.
        senses: which way, in words; the sign of the speed says it where there are none.
        line: (n,) of the rows.
        faults: for the errors.

    Raises:
        ReadError: CSV035 for a word that is no sense, CSV036 for a sense beside a negative speed.
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
