"""The fastest way along a path whose axes are bounded, by reachability analysis (TOPP-RA).

Along a path q(s) everything that bounds an axis is linear in the acceleration u along the path and
the square x of the speed: the acceleration of an axis is q'(s) u + q''(s) x, and so is its torque.
From the end backward, the largest x from which the end can be reached; from the start forward, the
largest u that stays below it.

Source:
    Pham and Pham 2018, "A new approach to time-optimal path parameterization based on reachability
    analysis", IEEE Transactions on Robotics 34 (3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from postproc.arrays import ROUNDING, FloatArray, IndexArray
from postproc.records import dataclass
from postproc.timing.torques import Torques

_TINY = 1e-12
_WITHIN = 0.95
"""Share of the blending distance by which a knot stands for the corner within it."""


@dataclass(frozen=True, slots=True)
class JointPath:
    """Sampled joints of path motions, and what their axes can do.

    Args:
        row: (s,) number of the motion; share: (s,) place on it (0, 1], its end among them.
        q: (s, d) [rad] there; q_start: (m, d) where each motion starts.
        blend: (m,) distance [m] at the end of each from which on the next one is approached;
            infinite for half the way.
        acceleration: (d,) limits [rad/s^2], infinite where nobody has said them.
        ramp: time in which the axes build their acceleration up [s].
        torques: what the joints need and have, None where nobody has said it.
    """

    row: IndexArray
    share: FloatArray
    q: FloatArray
    q_start: FloatArray
    blend: FloatArray
    acceleration: FloatArray
    ramp: float
    torques: Torques | None = None

    def bounds(
        self, row: IndexArray, q: FloatArray, first: FloatArray, second: FloatArray
    ) -> Bounds:
        """Return what bounds the axes at knots (k,) of motions: joints, q' and q'' (k, d)."""
        most = np.broadcast_to(self.acceleration, q.shape)
        parts = [(first, second, -most, most)]
        if self.torques is not None:
            parts.append(self.torques.rows(row, q, first, second))
        return Bounds(*(np.hstack(columns) for columns in zip(*parts, strict=True)))


class Bounds(NamedTuple):
    """At knots (k,): ``low <= slope u + curve x <= high``, columns (k, r) of r bounds each.

    u is the acceleration along the path [m/s^2], x the square of the speed; low < 0 < high.
    """

    slope: FloatArray
    curve: FloatArray
    low: FloatArray
    high: FloatArray


def bounded_times(
    length: FloatArray,
    speed: FloatArray,
    push: FloatArray,
    joints: JointPath,
    chain: tuple[int, int],
) -> FloatArray:
    """Return the times (high - low,) [s] of the motions ``low`` to ``high`` from stop to stop.

    At a corner the slope of the joints goes from that of the one motion to that of the next within
    the blending distances. Jerk is not limited.

    Args:
        length: (m,) of all motions [m].
        speed: (m,) largest [m/s].
        push: (m,) largest acceleration along the path [m/s^2].
        joints: of all motions.
        chain: low, high.
    """
    low, high = chain
    rows = low + np.flatnonzero(length[low:high] > ROUNDING)
    if not len(rows):
        return np.zeros(high - low)
    row, way, *path = _knots(length, joints, rows)
    segment, step = row[1:], np.diff(way)
    found = bounded_speed(step, speed[segment], push[segment], joints.bounds(row, *path))
    times = segment_times(step, *found)
    return np.asarray(np.bincount(segment - low, times, minlength=high - low), np.float64)


def _knots(
    length: FloatArray, joints: JointPath, rows: IndexArray
) -> tuple[IndexArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return knots of motions ``rows`` (n,): motion (k,), way (k,) [m], q, q' and q'' (k, d)."""
    mine = np.flatnonzero(np.isin(joints.row, rows))
    row = np.concatenate([rows, joints.row[mine]])
    at = np.concatenate([np.zeros(len(rows)), joints.share[mine]]) * length[row]
    q = np.vstack([joints.q_start[rows], joints.q[mine]])
    order = np.lexsort((at, row))
    row, at, q = row[order], at[order], q[order]
    first, second = slopes(row, at, q)
    begins, ends = np.searchsorted(row, rows), np.searchsorted(row, rows, "right") - 1
    size = length[rows]
    blend = blending_distances(joints.blend[rows], size)
    turn = (first[begins[1:]] - first[ends[:-1]]) / (2.0 * np.maximum(blend, ROUNDING))[:, None]
    before, behind = np.insert(blend, 0, 0.0), np.append(blend, 0.0)
    number = np.searchsorted(rows, row)
    inner = (at > before[number] + ROUNDING) & (at < (size - behind)[number] - ROUNDING)
    middle = 0.5 * (first[ends[:-1]] + first[begins[1:]])
    corner = q[ends[:-1]]
    parts = (
        (row[inner], at[inner], q[inner], first[inner], second[inner]),
        (rows, before, q[begins], first[begins], second[begins]),
        (rows, size - behind, q[ends], first[ends], second[ends]),
        (rows[:-1], size[:-1] - _WITHIN * blend, corner, first[ends[:-1]], turn),
        (rows[:-1], size[:-1], corner, middle, turn),
        (rows[1:], _WITHIN * blend, corner, first[begins[1:]], turn),
    )
    row, at, q, first, second = (np.concatenate(column) for column in zip(*parts, strict=True))
    way = (np.cumsum(size) - size)[np.searchsorted(rows, row)] + at
    order = np.lexsort((np.arange(len(way)), way))
    order = order[np.append(True, np.diff(way[order]) > ROUNDING)]
    return row[order], way[order], q[order], first[order], second[order]


def blending_distances(blend: FloatArray, length: FloatArray) -> FloatArray:
    """Return how far (m - 1,) [m] from each corner of motions (m,) a blend begins.

    Args:
        blend: (m,) distance [m] at the end of each.
        length: (m,) of the motions [m]; a blend takes half of one at most.
    """
    return np.minimum(blend[:-1], 0.5 * np.minimum(length[:-1], length[1:]))


def slopes(row: IndexArray, at: FloatArray, q: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return q' and q'' (k, d) at places on motions, one-sided where a motion begins and ends.

    Args:
        row: (k,) motion, rising.
        at: (k,) place on it [m], rising.
        q: (k, d) joints there.
    """
    step = np.maximum(np.diff(at), ROUNDING)[:, None]
    chord = np.diff(q, axis=0) / step
    first, second = np.zeros_like(q), np.zeros_like(q)
    same = np.diff(row) == 0
    first[:-1][same], first[1:][same] = chord[same], chord[same]
    inner = np.flatnonzero(same[1:] & same[:-1]) + 1
    before, behind = step[inner - 1], step[inner]
    first[inner] = (before * chord[inner] + behind * chord[inner - 1]) / (before + behind)
    second[inner] = 2.0 * (chord[inner] - chord[inner - 1]) / (before + behind)
    starts = inner[~np.isin(inner - 1, inner)]
    ends = inner[~np.isin(inner + 1, inner)]
    for at_end, beside, half in ((starts - 1, starts, -0.5), (ends + 1, ends, 0.5)):
        second[at_end] = second[beside]
        first[at_end] += half * step[np.minimum(at_end, beside)] * second[beside]
    return first, second


def bounded_speed(
    step: FloatArray, cap: FloatArray, push: FloatArray, bounds: Bounds
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the fastest way along a chain from rest to rest.

    Args:
        step: (k-1,) lengths of the segments [m], above 0.
        cap: (k-1,) largest speed on each [m/s].
        push: (k-1,) largest acceleration along each [m/s^2].
        bounds: of the axes at the knots (k,).

    Returns:
        The speed (k,) at the knots [m/s], and on each segment the largest speed (k-1,) and the
        acceleration (k-1,) that is left at it [m/s^2].
    """
    # what bounds the axes at both ends of a segment bounds u and the x it begins with
    slope = bounds.slope[1:] + 2.0 * step[:, None] * bounds.curve[1:]
    slope = np.hstack([bounds.slope[:-1], slope])
    curve, low, high = (np.hstack([rows[:-1], rows[1:]]) for rows in bounds[1:])
    size = np.abs(slope)
    moves = size > _TINY
    with np.errstate(divide="ignore", invalid="ignore"):
        up = np.where(moves, np.where(slope > 0.0, high, -low) / size, np.inf)
        down = np.where(moves, np.where(slope > 0.0, -low, high) / size, np.inf)
        bend = np.where(moves, curve / slope, 0.0)
        still = np.where(curve > 0.0, high, -low) / np.abs(curve)
        still = np.where(moves, np.inf, still).min(axis=1)
    up, down = np.column_stack([up, push]), np.column_stack([down, push])
    bend = np.column_stack([bend, np.zeros(len(step))])
    limit = np.minimum(_largest(up, down, bend), still)
    square = np.minimum(limit[1:], np.minimum(cap[1:], cap[:-1]) ** 2)
    square = _passes(step, np.concatenate([[0.0], square, [0.0]]), up, down, bend)
    highest = np.maximum(square[1:], square[:-1])
    left = (np.minimum(up, down) - np.abs(bend) * highest[:, None]).min(axis=1)
    needed = np.abs(np.diff(square)) / (2.0 * step)
    top = np.maximum(np.minimum(cap**2, limit), highest)
    return np.sqrt(square), np.sqrt(top), np.maximum(np.maximum(left, needed), ROUNDING)


def _largest(up: FloatArray, down: FloatArray, bend: FloatArray) -> FloatArray:
    """Return the largest x (k,) for which a u keeps ``-down <= u + bend x <= up`` of all (k, n)."""
    best = np.full(len(up), np.inf)
    for j in range(up.shape[1]):
        apart = bend - bend[:, j : j + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            bound = np.where(apart > _TINY, (up + down[:, j : j + 1]) / apart, np.inf)
        best = np.minimum(best, bound.min(axis=1))
    return best


def _passes(
    step: FloatArray, square: FloatArray, up: FloatArray, down: FloatArray, bend: FloatArray
) -> FloatArray:
    """Return the squares (k,) of the speeds, none above ``square``, after both passes."""
    found, size = square.copy(), 2.0 * step[:, None]
    slope = 1.0 - size * bend
    steep = 1.0 / np.maximum(np.abs(slope), _TINY)
    # where the axis bends so much that it has to speed up, the next x is 0 at least
    room = np.where(slope > 0.0, down, up) * size * steep
    share = np.where(slope > 0.0, steep, 0.0)
    for i in range(len(step) - 1, -1, -1):
        found[i] = min(found[i], (room[i] + share[i] * found[i + 1]).min())
    for i in range(len(step)):
        push = (up[i] - bend[i] * found[i]).min()
        reached = max(found[i] + 2.0 * step[i] * push, ROUNDING**2)
        found[i + 1] = min(found[i + 1], reached)
    return found


def segment_times(
    step: FloatArray, speed: FloatArray, top: FloatArray, push: FloatArray
) -> FloatArray:
    """Return the time (k-1,) [s] of each segment: speed up, keep, slow down between the knots.

    Args:
        step: (k-1,) lengths [m].
        speed: (k,) at the knots [m/s].
        top: (k-1,) largest speed [m/s].
        push: (k-1,) largest acceleration [m/s^2].
    """
    start, end = speed[:-1], speed[1:]
    peak = np.sqrt(np.minimum(top**2, push * step + 0.5 * (start**2 + end**2)))
    peak = np.maximum(peak, np.maximum(start, end))
    ramps = (2.0 * peak - start - end) / push
    covered = (2.0 * peak**2 - start**2 - end**2) / (2.0 * push)
    with np.errstate(divide="ignore", invalid="ignore"):
        cruise = np.where(step > _TINY, (step - covered) / peak, 0.0)
    return np.where(step > _TINY, ramps + np.maximum(cruise, 0.0), 0.0)
