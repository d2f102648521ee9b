"""Which way an arc goes whose record and end point leave both ways open.

What stands in a file is one writer's: another arc of it, no half turn, that can only go one way
shows how its records are meant. A tangent neighbour proves nothing of a half turn: cusps between
half turns, as of scallops and keyholes, are real.
"""

from __future__ import annotations

from math import nan

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.model import Arcs, WordClass
from postproc.readers.apt.arcs import ArcRecords, other_way, tangency
from postproc.readers.text import Faults
from postproc.readers.uses import WordUses
from postproc.records import dataclass
from postproc.units import TURN

_HALF = 1e-4
"""An arc this near to half turns or full ones [turns] can go either way."""
_HINT = "--arc-sense ccw or --arc-sense cw tells it, or [import] arc_sense in the cell"


@dataclass(frozen=True, slots=True)
class Around:
    """What lies at the two ends of m arcs.

    ``ends``: start and end points, (m, 3) each; ``cuts``: directions of the straight cuts before
    and after, (m, 3) each, NaN if none; ``joined`` (m,) whether it goes on from the arc before;
    ``own_end`` (m,) whether its record gives its own end, as ARC does.
    """

    ends: tuple[FloatArray, FloatArray]
    cuts: tuple[FloatArray, FloatArray]
    joined: BoolArray
    own_end: BoolArray

    def goes_on(self, arcs: Arcs, known: BoolArray | bool) -> IntArray:
        """Return as ``tangency`` (m, 2) how arcs go with cuts and ``known`` (m,) arcs beside."""
        known = np.broadcast_to(known, len(arcs))
        sides = []
        for at, cut, step in zip(self.ends[::-1], self.cuts, (1, -1), strict=True):
            beside = np.roll(np.cross(arcs.normal, at - arcs.centre), step, axis=0)
            is_arc = self.joined if step > 0 else np.roll(self.joined, -1)
            is_known = np.roll(known, step)[:, None]
            sides.append(np.where(is_arc[:, None], np.where(is_known, beside, nan), cut))
        return tangency(arcs, *self.ends, sides[0], sides[1])


def settled_senses(
    arcs: Arcs,
    closes: IntArray,
    records: ArcRecords,
    around: Around,
    told: tuple[int, int],
    faults: Faults,
    uses: WordUses,
) -> Arcs:
    """Return the arcs with those turned round that the file means the other way.

    What nothing proves goes counterclockwise about the written vector: with a warning where nothing
    lies beside it, and it is asked back where it would go back on what does.

    Args:
        arcs: m arcs, open ones counterclockwise about the written vector.
        closes: (m,) what the end of each shows.
        records: as read.
        around: what lies beside them.
        told: sense of the arcs with a sweep and of those without as user or writer tell it, else 0.
        faults: for the warnings.
        uses: for the records that are asked back.
    """
    swept = ~np.isnan(records.sweep)
    straight = around.goes_on(arcs, known=False).sum(axis=1)
    halves = 2.0 * arcs.sweep / TURN
    half = np.abs(halves - np.rint(halves)) < _HALF
    shown = np.where(swept, closes, np.where(half, 0, np.sign(straight)))
    by_ends = max(_proven(shown[records.free & swept]), 0)
    by_cuts = _proven(shown[records.free & ~swept])
    sense = np.where(swept, told[0] or by_ends, told[1] or by_cuts)
    is_open = records.free & (closes == 0)
    arcs = other_way(arcs, is_open & (sense < 0))
    is_told = np.where(swept, *told) != 0
    settled = is_told | ((sense != 0) & (half | swept))
    against = ~settled & (around.goes_on(arcs, known=True) < 0).any(axis=1)
    alone = (sense == 0) & (around.goes_on(arcs, ~is_open) == 0).all(axis=1)
    for row in np.flatnonzero(is_open).tolist():
        line = int(records.line[row])
        word = "MOVARC" if swept[row] else "ARC" if around.own_end[row] else "CIRCLE"
        if against[row] or (alone[row] and word == "ARC"):
            why = ", and so it goes back on what lies beside it" if against[row] else ""
            uses.refuse(
                word, WordClass.GEOMETRY, line,
                "its sense is not in the record: counterclockwise (read so) or clockwise about its "
                f"vector{why}", _HINT,
            )  # fmt: skip
        elif alone[row]:
            faults.warn(
                "APT133",
                "both senses of an arc meet its end and no tangent neighbour tells which; it goes "
                "counterclockwise about the written vector",
                line,
            )
        elif sense[row] < 0 and not is_told[row]:
            faults.warn(
                "APT134",
                "an arc without a sense in its record goes clockwise about its vector, as arcs of "
                "this file are tangent to what lies beside them; most systems mean "
                "counterclockwise",
                line,
            )
    return arcs


def _proven(shown: IntArray) -> int:
    """Return the one sense that arcs (k,) of a file show, 0 where none or several do."""
    said = np.unique(shown[shown != 0])
    return int(said[0]) if len(said) == 1 else 0
