"""Which way an arc goes whose record and end point leave both ways open."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.model import Arcs, WordClass
from postproc.readers.apt.arcs import TURN, ArcRecords, other_way, tangency
from postproc.readers.apt.uses import WordUses
from postproc.readers.text import Faults

_WHOLE = 1e-9
"""Turns."""


def settled_senses(
    arcs: Arcs,
    either: BoolArray,
    tags: IntArray,
    ends: tuple[FloatArray, FloatArray],
    cuts: tuple[FloatArray, FloatArray],
) -> tuple[Arcs, IntArray]:
    """Return the arcs with those turned round that would go back on themselves.

    A neighbour that is tangent decides, a straight cut or an arc of known sense.

    Args:
        arcs: m arcs, those that are open as most systems mean them.
        either: (m,) which of them are open.
        tags: (m,) index of the tag each ends at, rising.
        ends: start and end points, (m, 3) each.
        cuts: directions of the straight cuts before and after, (m, 3) each, NaN if none.

    Returns:
        the arcs, and (m,) what the neighbours of each say: 1 as it was, -1 the other way, 0 for an
        open one nothing; 1 for those that were not open.
    """
    m = len(arcs)
    row = np.arange(m)
    joins = np.diff(tags) == 1
    left = np.where(np.append(False, joins), row - 1, m)
    right = np.where(np.append(joins, False), row + 1, m)
    leaving, arriving = (np.cross(arcs.normal, at - arcs.centre) for at in ends)
    before = np.where((left < m)[:, None], np.roll(arriving, 1, axis=0), cuts[0])
    after = np.where((right < m)[:, None], np.roll(leaving, -1, axis=0), cuts[1])
    goes_on = tangency(arcs, *ends, before, after)
    sense = np.append(np.where(either, 0, 1), 1)
    rows = np.flatnonzero(either)
    while len(rows):
        score = goes_on[rows, 0] * sense[left[rows]] + goes_on[rows, 1] * sense[right[rows]]
        decided = rows[score != 0]
        sense[decided] = np.sign(score[score != 0])
        rows = np.unique(np.concatenate([left[decided], right[decided]]))
        rows = rows[sense[rows] == 0]
    return other_way(arcs, sense[:m] < 0), sense[:m]


def report_senses(
    arcs: Arcs,
    sense: IntArray,
    records: ArcRecords,
    own_end: BoolArray,
    faults: Faults,
    uses: WordUses,
) -> None:
    """Say which arcs were turned round, and ask back what nothing decides.

    ARC, whose sense is that of its points, is asked back. Any other goes as most systems mean it,
    which is a warning.

    Args:
        arcs: m arcs as they are driven.
        sense: (m,) what ``settled_senses`` found.
        records: as read.
        own_end: (m,) which records give their own end: ARC.
        faults: for the warnings.
        uses: for the records that are asked back.
    """
    unswept = np.isnan(records.sweep)
    whole = np.abs(arcs.sweep / TURN - np.rint(arcs.sweep / TURN)) < _WHOLE
    for row in np.flatnonzero(sense == 0).tolist():
        line = int(records.line[row])
        if own_end[row] and unswept[row] and not whole[row]:
            uses.refuse(
                "ARC", WordClass.GEOMETRY, line,
                "its sense is not in the record: counterclockwise (read so) or clockwise about its "
                "vector", "--dialect NAME of the system that wrote the file",
            )  # fmt: skip
        else:
            faults.warn(
                "APT133",
                "both senses of an arc meet its end and no tangent neighbour tells which; it goes "
                "counterclockwise about the written vector",
                line,
            )
    for row in np.flatnonzero((sense < 0) & unswept).tolist():
        faults.warn(
            "APT134",
            "an arc without a sense in its record goes clockwise about its vector, as what lies "
            "beside it is tangent; most systems mean counterclockwise",
            int(records.line[row]),
        )
