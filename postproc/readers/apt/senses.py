"""Which way an arc goes whose record and end point leave both ways open."""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.model import Arcs, WordClass
from postproc.readers.apt.arcs import ArcRecords, other_way, tangency
from postproc.readers.apt.uses import WordUses
from postproc.readers.text import Faults


def settled_senses(
    arcs: Arcs,
    either: BoolArray,
    records: ArcRecords,
    ends: tuple[FloatArray, FloatArray],
    cuts: tuple[FloatArray, FloatArray],
    faults: Faults,
    uses: WordUses,
) -> Arcs:
    """Return the arcs with those turned round that would go back on themselves.

    A neighbour that is tangent decides, a straight cut or an arc of known sense. Without one, an
    arc of known sweep goes counterclockwise about its vector, which is reported; where not even the
    sweep is written, the record is refused.

    Args:
        arcs: m arcs, those that are open counterclockwise about the written vector.
        either: (m,) which of them are open.
        records: as read.
        ends: start and end points, (m, 3) each.
        cuts: directions of the straight cuts before and after, (m, 3) each, NaN if none.
        faults: for warnings.
        uses: for refused records.
    """
    either = either.copy()
    while either.any():
        before, after = _with_arcs(arcs, either, records, ends, cuts)
        score = tangency(arcs, *ends, before, after).sum(axis=1)
        arcs = other_way(arcs, either & (score < 0))
        decided = either & (score != 0)
        if not decided.any():
            break
        either &= ~decided
    for row in np.flatnonzero(either).tolist():
        line = int(records.line[row])
        if np.isnan(records.sweep[row]):
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
    return arcs


def _with_arcs(
    arcs: Arcs,
    either: BoolArray,
    records: ArcRecords,
    ends: tuple[FloatArray, FloatArray],
    cuts: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Return the directions before and after each arc, those of neighbouring arcs among them."""
    before, after = cuts[0].copy(), cuts[1].copy()
    leaving, arriving = (np.cross(arcs.normal, at - arcs.centre) for at in ends)
    joined = np.flatnonzero(np.diff(records.tag) == 1)
    rows = joined[~either[joined]]
    before[rows + 1] = arriving[rows]
    rows = joined[~either[joined + 1]]
    after[rows] = leaving[rows + 1]
    return before, after
