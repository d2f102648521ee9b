"""CIRCLE records to arcs of the model: start from the point before, end at the point after.

NX's ``TIMES,n`` counts the turns that are begun: the arc to the end point and n - 1 full turns. So
read, the helical leads of real files slope by exactly the round ramp angles that were asked for
(2.000 and 0.400 degrees); with n full turns they would slope by 1.118 and 0.219.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import FloatArray, IntArray, Table
from postproc.geometry import angle_about
from postproc.model import Arcs
from postproc.readers.text import Faults
from postproc.units import MM

FULL_CIRCLE_GAP = 1e-4 * MM
"""Start and end closer than this are a full circle [m]."""
RADIUS_GAP = 0.02 * MM
"""How far [m] the radii at start, at end and as written may differ, plus 1e-4 of the radius."""
_RELATIVE_GAP = 1e-4
TURN = 2.0 * np.pi
_TANGENT_COSINE = 0.999
"""Cosine of 2.6 degrees: closer than this two directions count as tangent."""


@dataclass(frozen=True, slots=True)
class ArcRecords(Table):
    """m arcs as read, in the part frame [m].

    ``tag`` (m,) index of the tag an arc ends at; ``line`` (m,); ``centre`` (m, 3); ``normal``
    (m, 3) ccw, any length; ``tangent`` (m, 3) start direction that stands in for the normal, NaN
    else; ``radius`` (m,) NaN where not written; ``turns`` (m,) turns begun: TIMES,n
    of NX, 0 or 1 for a plain arc.
    """

    tag: IntArray
    line: IntArray
    centre: FloatArray
    normal: FloatArray
    tangent: FloatArray
    radius: FloatArray
    turns: IntArray

    @classmethod
    def joined(cls, parts: list[ArcRecords]) -> ArcRecords:
        """Return all parts as one."""
        empty = cls(
            np.zeros(0, dtype=np.int32),
            np.zeros(0, dtype=np.int32),
            np.zeros((0, 3)),
            np.zeros((0, 3)),
            np.zeros((0, 3)),
            np.zeros(0),
            np.zeros(0, dtype=np.int32),
        )
        return cls.concat([empty, *parts])


def arcs_between(records: ArcRecords, starts: FloatArray, ends: FloatArray, faults: Faults) -> Arcs:
    """Return the arcs of the model, normals turned so that every motion is counterclockwise.

    Args:
        records: m arcs as read.
        starts: (m, 3) where the tool stands before each arc [m], NaN where nothing came before.
        ends: (m, 3) where each arc ends [m].
        faults: for the errors.

    Raises:
        ReadError: APT036 without a start point, APT037 for a zero vector or radius, APT038 if
            start and end do not lie on one circle.
    """
    missing = np.flatnonzero(np.isnan(starts).any(axis=1))
    if len(missing):
        raise faults.error(
            "APT036", "an arc with no point before it to start from", int(records.line[missing[0]])
        )
    normal = _unit_normals(records, starts, faults)
    to_start = _in_plane(starts - records.centre, normal)
    to_end = _in_plane(ends - records.centre, normal)
    radius = _checked_radius(records, to_start, to_end, faults)
    sweep = angle_about(normal, to_start, to_end)
    closed = np.linalg.norm(to_end - to_start, axis=1) <= FULL_CIRCLE_GAP
    sweep = np.where(closed, TURN, sweep) + TURN * np.maximum(records.turns - 1, 0)
    return Arcs(records.centre, normal, radius, sweep)


def _unit_normals(records: ArcRecords, starts: FloatArray, faults: Faults) -> FloatArray:
    by_tangent = np.cross(starts - records.centre, records.tangent)
    normal = np.where(np.isnan(records.tangent), records.normal, by_tangent)
    length = np.linalg.norm(normal, axis=1)
    bad = np.flatnonzero(~(length > 0.0))
    if len(bad):
        raise faults.error(
            "APT037", "an arc without a plane: its vector is zero", int(records.line[bad[0]])
        )
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
    allowed = RADIUS_GAP + _RELATIVE_GAP * radius
    written = np.where(np.isnan(records.radius), radius, np.abs(records.radius))
    gap = np.maximum(np.abs(radius - r_start), np.abs(radius - written))
    bad = np.flatnonzero((gap > allowed) | (radius <= 0.0))
    if len(bad):
        i = int(bad[0])
        radii = f"{r_start[i] / MM:.4f}, {radius[i] / MM:.4f} and {written[i] / MM:.4f} mm"
        raise faults.error(
            "APT038",
            f"start, end and radius of an arc do not fit one circle: {radii}",
            int(records.line[i]),
        )
    return radius


def tangency(
    arcs: Arcs, starts: FloatArray, ends: FloatArray, before: FloatArray, after: FloatArray
) -> IntArray:
    """Return how each arc goes with the straight cuts at its start and end.

    CAM systems lead in and out of arcs tangentially, so a straight cut next to an arc shows which
    way the arc turns.

    Args:
        arcs: m arcs, counterclockwise about their normals.
        starts: (m, 3) start points.
        ends: (m, 3) end points.
        before: (m, 3) direction of the straight cut that ends where the arc starts, NaN if none.
        after: (m, 3) direction of the straight cut that begins where the arc ends, NaN if none.

    Returns:
        (m, 2) at start and end: 1 the arc goes on in the cut's direction, -1 it goes back, 0 no
        straight cut there or not tangent to it.
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
