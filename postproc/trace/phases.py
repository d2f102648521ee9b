"""Which phase of the motion each row is part of, from the set-point alone.

The gap itself has no say: phases cut from where the error is large would prove anything.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.trace.recording import Recording
from postproc.trace.signals import last_motion, since_change
from postproc.units import DEG, MM

NAMES = ("steady", "corner", "reversal", "start_stop", "cut")
STEADY, CORNER, REVERSAL, START_STOP, CUT = range(5)
REACH = 5.0 * MM
"""Half of the way over which a corner turns."""
SHARP = 20.0 * DEG
"""Least turn of the path over twice the reach that is a corner, not an arc: radius 30 mm."""
WIDE = 5.0
"""An arc keeps turning: a corner has half of its turn over so many times the way."""
RING = 0.15
"""How long [s] after a corner or a reversal the arm still shows it."""
BEFORE = 0.02
"""How long [s] before a reversal it is one."""
AT_SPEED = 0.9
"""Share of the speed ahead at which a start is over."""
STANDING = 0.01
"""Share of the usual speed below which the tool stands."""
RAMP = 0.5
"""Longest start or stop [s]."""
DEAD = 0.002 * DEG
"""Motion back of a joint that is a reversal: twenty counts of an encoder behind its gear."""


class Phases(NamedTuple):
    """Phase (n,) of each row, index of ``NAMES``; and (n,) whether the tool moves."""

    phase: IntArray
    moves: BoolArray


def phases_of(recording: Recording, points: FloatArray, stretches: list[slice]) -> Phases:
    """Return the phases of rows with commanded tool points (n, 3) [m].

    A row of several phases has the first of corner, start and stop, reversal, cut.
    """
    phase = np.full(len(recording), STEADY, dtype=np.int32)
    moves = np.zeros(len(recording), dtype=np.bool_)
    if recording.is_cut is not None and not recording.is_cut.all():
        phase[recording.is_cut] = CUT
    tops = [_speed(recording.time[rows], points[rows]) for rows in stretches]
    every = np.concatenate(tops)
    usual = float(np.quantile(every, 0.9)) if len(every) else 0.0
    for rows, speed in zip(stretches, tops, strict=True):
        time = recording.time[rows]
        part = phase[rows]
        part[_reversal(time, recording.command[rows])] = REVERSAL
        moves[rows] = speed > STANDING * usual
        part[_ramps(time, speed, STANDING * usual)] = START_STOP
        part[_corner(time, points[rows])] = CORNER
    return Phases(phase, moves)


def _speed(time: FloatArray, points: FloatArray) -> FloatArray:
    rate = np.gradient(points, time, axis=0)
    return np.asarray(np.linalg.norm(rate, axis=1))


def _reversal(time: FloatArray, command: FloatArray) -> BoolArray:
    """Return the rows (n,) about and after a joint turns round."""
    found = np.zeros(len(time), dtype=np.bool_)
    for joint in range(6):
        sign = last_motion(command[:, joint], DEAD)
        found |= since_change(time, sign) < RING
        found |= since_change(-time[::-1], sign[::-1])[::-1] < BEFORE
    return found


def _ramps(time: FloatArray, speed: FloatArray, still: float) -> BoolArray:
    """Return the rows (n,) of starts from and stops to standstill, and the ringing after a stop."""
    found = np.zeros(len(time), dtype=np.bool_)
    stands = speed <= still
    for start in np.flatnonzero(stands[:-1] & ~stands[1:]) + 1:
        found[start : start + _ramp(time[start:] - time[start], speed[start:])] = True
    for stop in np.flatnonzero(~stands[:-1] & stands[1:]) + 1:
        back = _ramp(time[stop - 1] - time[stop - 1 :: -1], speed[stop - 1 :: -1])
        found[max(0, stop - back) : stop] = True
        found[stop : stop + int(np.searchsorted(time[stop:] - time[stop], RING))] = True
    return found


def _ramp(since: FloatArray, speed: FloatArray) -> int:
    """Return the rows until the speed is nearly the largest within the longest ramp."""
    count = int(np.searchsorted(since, RAMP))
    ahead = speed[: max(1, count)]
    return int(np.argmax(ahead >= AT_SPEED * ahead.max())) + 1


def _corner(time: FloatArray, points: FloatArray) -> BoolArray:
    """Return the rows (n,) at and shortly after a corner of the path."""
    step = np.linalg.norm(np.diff(points, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(step)])
    found = np.zeros(len(time), dtype=np.bool_)
    if way[-1] < 2.0 * REACH:
        return found
    moved = np.flatnonzero(np.concatenate([[True], step > 1e-9]))
    even = np.arange(0.0, way[-1], REACH / 10.0)
    path = np.stack([np.interp(even, way[moved], points[moved, axis]) for axis in range(3)], axis=1)
    turn = _turn(path, 10)
    wide = _turn(path, 50)
    sharp = (turn > SHARP) & (turn > 0.5 * np.minimum(wide, np.pi))
    is_sharp = (
        sharp[np.clip(np.rint(way / even[1]).astype(int), 0, len(even) - 1)]
        if (len(even) > 1)
        else found
    )
    last = np.maximum.accumulate(np.where(is_sharp, time, -np.inf))
    return np.asarray(time - last < RING)


def _turn(path: FloatArray, half: int) -> FloatArray:
    """Return how much a path (m, 3) at equal steps turns within ``half`` steps to both sides."""
    tangent = np.diff(path, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    before = tangent[np.clip(np.arange(len(path)) - half, 0, len(tangent) - 1)]
    after = tangent[np.clip(np.arange(len(path)) + half - 1, 0, len(tangent) - 1)]
    return np.asarray(np.arccos(np.clip(np.sum(before * after, axis=1), -1.0, 1.0)))
