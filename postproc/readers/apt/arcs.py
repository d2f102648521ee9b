"""Arc records to arcs of the model: start from the point before, end at the point after.

Of an arc whose record and end point leave both ways open, what stands in the file is one writer's:
another arc of it, no half turn, that can only go one way shows how its records are meant. A tangent
neighbour proves nothing of a half turn: cusps between half turns, as of scallops and keyholes, are
real.

NX's ``TIMES,n`` counts the turns that are begun: the arc to the end point and n - 1 full turns. So
read, the helical leads of real files slope by exactly the round ramp angles that were asked for
(2.000 and 0.400 degrees); with n full turns they would slope by 1.118 and 0.219.
"""

from __future__ import annotations

from math import nan

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, Table
from postproc.geometry import angle_about
from postproc.model import Arcs, WordClass
from postproc.readers.base import FULL_CIRCLE_GAP, RADIUS_GAP, radius_gap
from postproc.readers.text import Faults
from postproc.readers.uses import WordUses
from postproc.records import dataclass
from postproc.units import MM, TURN

_SHORT = 0.25 * TURN
"""A shorter sweep [rad] goes where it meets its end better, however near the other way comes."""
_TANGENT_COSINE = 0.999
"""Cosine of 2.6 degrees: closer than this two directions count as tangent."""


@dataclass(frozen=True, slots=True)
class ArcRecords(Table):
    """m arcs as read, in the part frame [m]; those of a block as it writes them.

    ``tag`` (m,) index of the tag an arc ends at; ``line`` (m,); ``centre`` (m, 3); ``normal``
    (m, 3) ccw, any length; ``tangent`` (m, 3) start direction that decides which way round the
    normal stands, NaN else; ``radius`` (m,) NaN where not written; ``turns`` (m,) turns begun:
    TIMES,n of NX, 0 or 1 for a plain arc; ``sweep`` (m,) [rad] and ``rise`` (m,) [m] as written,
    NaN else; ``free`` (m,) whether the record leaves the sense open.
    """

    tag: IntArray
    line: IntArray
    centre: FloatArray
    normal: FloatArray
    tangent: FloatArray
    radius: FloatArray
    turns: IntArray
    sweep: FloatArray
    rise: FloatArray
    free: BoolArray


def arcs_between(
    records: ArcRecords, starts: FloatArray, ends: FloatArray, faults: Faults
) -> tuple[Arcs, IntArray]:
    """Return the arcs of the model, counterclockwise, and how their ends prove this.

    Where the record leaves the sense open, the start is turned by the written sweep both ways: one
    of them meets the end. If both do, as half turns and full circles do, the arc goes
    counterclockwise about the written vector, or as the sign of a negative sweep says. ``starts``
    (m, 3) [m] are NaN where nothing came before. The proof (m,): 1 as the sweep says, -1 against
    it, 0 none.
    """
    missing = np.flatnonzero(np.isnan(starts).any(axis=1))
    if len(missing):
        text = "an arc with no point before it to start from"
        raise faults.error("APT036", text, int(records.line[missing[0]]))
    normal = _unit_normals(records, starts, faults)
    to_start = _in_plane(starts - records.centre, normal)
    to_end = _in_plane(ends - records.centre, normal)
    radius = _checked_radius(records, to_start, to_end, faults)
    _check_rise(records, np.einsum("ni,ni->n", ends - starts, normal), faults)
    closes = _closing(records, to_start, to_end, normal, faults)
    normal[records.free & ((closes < 0) ^ (records.sweep < 0.0))] *= -1.0
    angle = angle_about(normal, to_start, to_end)
    closed = np.linalg.norm(to_end - to_start, axis=1) <= FULL_CIRCLE_GAP
    sweep = np.where(closed, TURN, angle) + TURN * np.maximum(records.turns - 1, 0)
    written = ~np.isnan(records.sweep)
    said = np.abs(records.sweep[written])
    whole = angle[written] + TURN * np.rint((said - angle[written]) / TURN)
    sweep[written] = np.where(whole > 0.0, whole, said)
    return Arcs(records.centre, normal + 0.0, radius, sweep), closes


def _closing(
    records: ArcRecords,
    to_start: FloatArray,
    to_end: FloatArray,
    normal: FloatArray,
    faults: Faults,
) -> IntArray:
    """Return whether the end of each arc (m,) is met by its sweep: 1, against it: -1, both: 0."""
    across = np.cross(normal, to_start)
    sweep = np.where(records.free, records.sweep, np.abs(records.sweep))[:, None]
    cosine, sine = np.cos(sweep), np.sin(sweep)
    forth = np.linalg.norm(cosine * to_start + sine * across - to_end, axis=1)
    back = np.linalg.norm(cosine * to_start - sine * across - to_end, axis=1)
    back[~records.free] = np.inf
    allowed = radius_gap(np.linalg.norm(to_end, axis=1))
    bad = np.flatnonzero(np.minimum(forth, back) > allowed)
    if len(bad):
        i = int(bad[0])
        angle = np.degrees(angle_about(normal, to_start, to_end)[i])
        text = (
            f"an arc of {np.degrees(records.sweep[i]):.4f} deg does not lead from its start to its "
            f"end, which lie {angle:.4f} deg apart: it misses by "
            f"{min(forth[i], back[i]) / MM:.4f} mm"
        )
        raise faults.error("APT085", text, int(records.line[i]))
    open_ends = ~(np.maximum(forth, back) > allowed) & ~(records.sweep < _SHORT)
    return np.where(open_ends, 0, np.where(back < forth, -1, 1)).astype(np.int32)


def _check_rise(records: ArcRecords, rise: FloatArray, faults: Faults) -> None:
    """Compare the rise of a helix with the written one; its sign goes with the sense."""
    bad = np.flatnonzero(np.abs(np.abs(rise) - np.abs(records.rise)) > RADIUS_GAP)
    if len(bad):
        i = int(bad[0])
        text = (
            f"ARCSLP says a rise of {records.rise[i] / MM:.4f} mm, start and end of the arc say "
            f"{rise[i] / MM:.4f} mm"
        )
        raise faults.error("APT086", text, int(records.line[i]))


def other_way(arcs: Arcs, rows: BoolArray) -> Arcs:
    """Return the arcs with some (m,) turned round: same start, same end, the other side."""
    normal, sweep = np.array(arcs.normal), np.array(arcs.sweep)
    normal[rows] *= -1.0
    before = np.ceil(sweep[rows] / TURN - 1e-9) - 1.0
    part = sweep[rows] - TURN * before
    is_whole = part > TURN - 1e-9
    sweep[rows] = np.where(is_whole, TURN, TURN - part) + TURN * before
    return Arcs(arcs.centre, normal + 0.0, arcs.radius, sweep)


def _unit_normals(records: ArcRecords, starts: FloatArray, faults: Faults) -> FloatArray:
    by_tangent = np.cross(starts - records.centre, records.tangent)
    along = np.einsum("ni,ni->n", by_tangent, records.normal)
    normal = np.where(np.isnan(along), 1.0, np.sign(along))[:, None] * records.normal
    length = np.linalg.norm(normal, axis=1)
    bad = np.flatnonzero(~(length > 0.0))
    if len(bad):
        text = "an arc without a plane: its vector is zero"
        raise faults.error("APT037", text, int(records.line[bad[0]]))
    unit: FloatArray = normal / length[:, None] + 0.0
    return unit


def _in_plane(vectors: FloatArray, normal: FloatArray) -> FloatArray:
    part: FloatArray = vectors - np.einsum("ni,ni->n", vectors, normal)[:, None] * normal
    return part


def _checked_radius(
    records: ArcRecords, to_start: FloatArray, to_end: FloatArray, faults: Faults
) -> FloatArray:
    """Return the radius at the end point; the start's and the written one must agree with it."""
    r_start = np.linalg.norm(to_start, axis=1)
    radius: FloatArray = np.linalg.norm(to_end, axis=1)
    allowed = radius_gap(radius)
    written = np.where(np.isnan(records.radius), radius, np.abs(records.radius))
    gap = np.maximum(np.abs(radius - r_start), np.abs(radius - written))
    bad = np.flatnonzero((gap > allowed) | (radius <= 0.0))
    if len(bad):
        i = int(bad[0])
        radii = f"{r_start[i] / MM:.4f}, {radius[i] / MM:.4f} and {written[i] / MM:.4f} mm"
        text = f"start, end and radius of an arc do not fit one circle: {radii}"
        raise faults.error("APT038", text, int(records.line[i]))
    return radius


def tangency(
    arcs: Arcs, starts: FloatArray, ends: FloatArray, before: FloatArray, after: FloatArray
) -> IntArray:
    """Return how each arc (m, 2) goes with the straight cuts at its start and end.

    CAM systems lead in and out of arcs tangentially, so a straight cut next to an arc shows which
    way the arc turns: 1 the arc goes on in the cut's direction, -1 it goes back, 0 no straight cut
    there or not tangent to it. ``before``, ``after`` (m, 3): directions of the cuts, NaN if none.
    """
    result = np.zeros((len(arcs), 2), dtype=np.int32)
    for column, (at, cut) in enumerate(((starts, before), (ends, after))):
        tangent = np.cross(arcs.normal, at - arcs.centre)
        with np.errstate(invalid="ignore", divide="ignore"):
            cosine = np.einsum("ni,ni->n", tangent, cut) / (
                np.linalg.norm(tangent, axis=1) * np.linalg.norm(cut, axis=1)
            )
        result[:, column] = np.where(np.abs(cosine) > _TANGENT_COSINE, np.sign(cosine), 0.0)
    return result


_HALF = 1e-4
"""An arc this near to half turns or full ones [turns] can go either way."""
_HINT = "--arc-sense ccw or --arc-sense cw says it, or [import] arc_sense in the cell"


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
    lies beside it, and it is asked back where it would go back on what does. ``closes`` (m,): what
    their ends show; ``told``: sense of the arcs with a sweep and of those without as user or writer
    tell it, else 0.
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
            why = ", so it turns back on its neighbours" if against[row] else ""
            uses.refuse(
                word, WordClass.GEOMETRY, line,
                "its sense is not in the record: counterclockwise (read so) or clockwise about its "
                f"vector{why}", _HINT,
            )  # fmt: skip
        elif alone[row]:
            text = (
                "both senses of an arc meet its end and no tangent neighbour decides it; it goes "
                "counterclockwise about the written vector"
            )
            faults.warn("APT133", text, line)
        elif sense[row] < 0 and not is_told[row]:
            message = (
                "an arc without a sense in its record goes clockwise about its vector, since arcs "
                "of this file are then tangent to their neighbours; most systems mean "
                "counterclockwise"
            )
            faults.warn("APT134", message, line)
    return arcs


def _proven(shown: IntArray) -> int:
    """Return the one sense that arcs (k,) of a file show, 0 where none or several do."""
    said = np.unique(shown[shown != 0])
    return int(said[0]) if len(said) == 1 else 0
