"""Signals in stretches: derivatives, shifted and filtered copies, reversals, what is white.

Everything is per stretch; nothing reaches over its end. Arrays are (n,) or (n, k) over all rows.
"""

from __future__ import annotations

import cmath
from functools import cached_property, lru_cache
from itertools import pairwise

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from postproc.arrays import FloatArray

DIFFERENCE = np.array([1.0, -3.0, 3.0, -1.0])
"""Third difference: blind to slow motion, and to the swing of the arm at 4 ms and less."""
ROOTS_APART = 1e-3
"""Share by which both roots of a filter differ at least: it moves the filter by its square."""
FINE = 2e-3
"""Step [s] at which filters run: jerk-limited ramps of 20 ms and more are told in it."""
NORMAL_MAD = 1.4826
"""Standard deviation of normal numbers over their median size."""


class Course:
    """A signal (n, k) over the time of one stretch, as a smooth function.

    Before its first row and after its last it goes on straight.
    """

    def __init__(self, time: FloatArray, values: FloatArray) -> None:
        self.time = time
        self.spline = CubicSpline(time, values)
        self._rate = self.spline.derivative()
        self.ends = tuple((self.spline(t), self._rate(t)) for t in (time[0], time[-1]))

    @cached_property
    def cycle(self) -> float:
        """Time between two rows [s]."""
        return float(np.median(np.diff(self.time)))

    def at(self, time: FloatArray) -> FloatArray:
        """Return the values (m, k) at times (m,) [s]."""
        values = np.asarray(self.spline(np.clip(time, self.time[0], self.time[-1])))
        for outside, edge, (value, rate) in zip(
            (time < self.time[0], time > self.time[-1]),
            (self.time[0], self.time[-1]),
            self.ends,
            strict=True,
        ):
            if outside.any():
                values[outside] = value + (time[outside] - edge)[:, None] * rate
        return values

    def rate(self, time: FloatArray) -> FloatArray:
        """Return the first derivative (m, k), constant beyond the ends."""
        return np.asarray(self._rate(np.clip(time, self.time[0], self.time[-1])))

    @cached_property
    def fine(self) -> FloatArray:
        """Times (m,) at equal steps in which no jerk is lost, from the first row on."""
        count = max(4, int(np.ceil((self.time[-1] - self.time[0]) / self.cycle)) + 1)
        parts = max(1, int(np.ceil(self.cycle / FINE)))
        return np.asarray(self.time[0] + self.cycle / parts * np.arange(count * parts))


def behind(step: float, values: FloatArray, first: float, second: float) -> FloatArray:
    """Return values (m, k) at equal steps [s] behind ``1 / (1 + first s + second s^2)``.

    Before the first row stood the first value.
    """
    top, below = _digital(step, first, second)
    start = values[:1]
    return np.asarray(start + lfilter(top, below, values - start, axis=0))


@lru_cache(maxsize=256)
def _digital(step: float, first: float, second: float) -> tuple[FloatArray, FloatArray]:
    """Return the exact filter of a signal straight between samples, by its answer to a ramp."""
    slow = first / step
    if not second > 0.0:
        pole = float(np.exp(-1.0 / slow))
        now = 1.0 - slow * (1.0 - pole)
        return np.array([now, 1.0 - pole - now]), np.array([1.0, -pole])
    middle = -0.5 * first / second
    half = cmath.sqrt(middle**2 - 1.0 / second)
    if abs(half) < ROOTS_APART * abs(middle):
        # a double root is two that lie close
        half = complex(ROOTS_APART * middle)
        slow = -2.0 * middle / (middle**2 - half.real**2) / step
    one, two = middle + half, middle - half
    a, b = cmath.exp(step * one), cmath.exp(step * two)
    # of 1 / (s^2 (second s^2 + first s + 1)) at both roots
    u, w = (one * two / (2.0 * half * r**2 * step) for r in (one, two))
    w = -w
    top = [
        (1.0 + slow) + slow * (a + b) - u * (b + 2.0) - w * (a + 2.0),
        -(1.0 + slow) * (a + b) - slow * a * b + u * (2.0 * b + 1.0) + w * (2.0 * a + 1.0),
        (1.0 + slow) * a * b - u * b - w * a,
    ]
    return np.real(top), np.real([1.0, -(a + b), a * b])


def swing(step: float, drive: FloatArray, frequency: float, damping: float) -> FloatArray:
    """Return how a mode moves (m, k) [m, rad] that its acceleration drives.

    ``y'' + 2 z w y' + w^2 y = -drive``, at rest in the beginning.

    Args:
        step: [s] between rows.
        drive: (m, k) acceleration.
        frequency: natural one [Hz].
        damping: share of the critical one.
    """
    w = 2.0 * np.pi * frequency
    return -behind(step, drive, 2.0 * damping / w, 1.0 / w**2) / w**2


def last_motion(position: FloatArray, dead: float, way: float = 0.0) -> FloatArray:
    """Return the sign (n,) of the last motion that went back by more than ``dead``; 0 before it.

    A turning point counts from where the motion went back by ``way``, at 0 from its own row on;
    the first motion from where the position leaves its first value.
    """
    sign = np.zeros(len(position))
    extreme, at, now, first = position[0], 0, 0.0, position[0]
    # only where the slope changes can a motion end: few rows of many
    slope = np.sign(np.diff(position))
    turns = np.flatnonzero(np.diff(slope) != 0) + 1
    for row in [*turns.tolist(), len(position) - 1]:
        value = position[row]
        if now == 0.0:
            if abs(value - first) > dead:
                now = float(np.sign(value - first))
                sign[np.flatnonzero(position != first)[0] :] = now
                extreme, at = value, row
        elif (value - extreme) * now >= 0.0:
            extreme, at = value, row
        elif abs(value - extreme) > dead:
            now = -now
            gone = np.abs(position[at : row + 1] - extreme) > way
            sign[at + int(np.argmax(gone)) * (way > 0.0) :] = now
            extreme, at = value, row
    return sign


def since_change(time: FloatArray, sign: FloatArray) -> FloatArray:
    """Return the time [s] since the sign (n,) last turned over, inf before it did."""
    change = np.flatnonzero((sign[1:] * sign[:-1]) < 0.0) + 1
    since = np.full(len(time), np.inf)
    for low, high in pairwise([*change.tolist(), len(time)]):
        since[low:high] = time[low:high] - time[low]
    return since


def white_sigma(values: FloatArray, stretches: list[slice]) -> float:
    """Return the standard deviation of what differs from row to row without memory.

    Rows that repeat the row before exactly, as at standstill, tell nothing unless all do.
    """
    parts = [np.convolve(values[rows], DIFFERENCE, "valid") for rows in stretches]
    steps = np.concatenate(parts) if parts else np.zeros(0)
    steps = steps[np.isfinite(steps) & (steps != 0.0)]
    if not len(steps):
        return 0.0
    return float(NORMAL_MAD * np.median(np.abs(steps)) / np.sqrt(np.sum(DIFFERENCE**2)))


LOWEST_OCTAVE = 0.1
"""Where the octaves of a spectrum begin [Hz]: what is slower counts with the first."""
OCTAVES = 16
"""Up to 6.5 kHz: what is faster than any recording."""
MEANS = (25, 100, 250)
"""Rows of the means that tell noise with a memory: 0.1 to 1 s at 4 ms."""


def means(values: FloatArray, stretches: list[slice], block: int) -> FloatArray:
    """Return the means over ``block`` rows of values (n,), none over the end of a stretch."""
    parts = [np.zeros(0)]
    for rows in stretches:
        part = values[rows][np.isfinite(values[rows])]
        count = len(part) // block
        parts.append(part[: count * block].reshape(count, block).mean(axis=1))
    return np.concatenate(parts)


def memory(values: FloatArray, stretches: list[slice]) -> float:
    """Return how many rows are worth one independent row: 1 for white noise."""
    total = float(np.nanmean(values**2))
    worth = 1.0
    for block in MEANS:
        found = means(values, stretches, block)
        if len(found) > 1 and total > 0.0:
            worth = max(worth, float(np.mean(found**2)) * block / total)
    return worth


def octaves(values: FloatArray, stretches: list[slice], cycle: float) -> FloatArray:
    """Return the mean squares (OCTAVES,) of the octaves of (n, k), less that of white noise.

    Args:
        values: in time.
        stretches: none is reached over.
        cycle: between two rows [s].
    """
    energy = np.zeros(OCTAVES)
    count = 0
    for rows in stretches:
        part = values[rows] - values[rows].mean(axis=0)
        power = np.sum(np.abs(np.fft.rfft(part, axis=0)) ** 2, axis=1)[1:] * 2.0 / len(part)
        frequency = np.fft.rfftfreq(len(part), cycle)[1:]
        place = np.clip(np.log2(frequency / LOWEST_OCTAVE), 0, OCTAVES - 1).astype(int)
        # the mean, not the median: noise that comes with speed counts as it is
        steps = np.apply_along_axis(np.convolve, 0, part, DIFFERENCE, "valid")
        white = np.sum(np.mean(steps**2, axis=0)) / np.sum(DIFFERENCE**2)
        energy += np.bincount(place, power - 2.0 * white, OCTAVES)
        count += len(part)
    return np.asarray(np.maximum(energy, 0.0) / max(1, count))
