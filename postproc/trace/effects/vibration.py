"""The arm swings: a mode that accelerations drive, or a line that lasts."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.trace.effect import JOINTS, TOOL, WHOLE, Part, PathEffect, register
from postproc.trace.phases import CUT
from postproc.trace.scene import Piece, Stage
from postproc.trace.signals import Course, swing
from postproc.units import MM

LOWEST = 2.0
"""No mode of an arm is slower [Hz]; what is slower is the rhythm of the path."""
HIGHEST = 0.4
"""Share of the sampling rate up to which a swing can be told."""
CANDIDATES = 4
"""Lines of the spectrum that are tried."""
MODES = 3
"""Modes that are tried on all rows."""
DAMPING = 0.03
"""Share of the critical damping that modes are searched with: arms have one to four percent."""
WIDE = 1.3
"""Distance of the modes that are tried, against their damping: a mode is twice as wide."""
DAMPED = 0.1
"""Largest damping of a mode: what is damped more is a loop that follows, not an arm that swings."""
WINDOW = 2.0
"""Length [s] of the pieces whose spectra are summed: half a hertz of resolution."""
APART = 1.0
"""Distance [Hz] of two candidates."""
_STEP_HZ = 0.01
_STEP_DAMPING = 1e-3
_DRIVEN, _LINE, _LINE_MOVING, _LINE_CUT = range(4)
_HEAD = 3


@register
class Vibration(PathEffect):
    """theta = kind, frequency [Hz], damping, then gains or amplitudes per output.

    Driven: one gain for each output and each coordinate of the tool point's acceleration. A line:
    cosine and sine for each output and each run. No model file is read: a program cannot know the
    phase of a swing.
    """

    name = "vibration"
    title = "the arm swings at one frequency"
    action = "lower the acceleration, or keep tooth frequency and speed away from the mode"
    stages = (JOINTS, TOOL, WHOLE)
    keys = ("frequency_Hz", "amplitude_mm", "damping", "course")
    is_kept = False

    def start(self, stage: Stage, rest: FloatArray, sigma: FloatArray) -> FloatArray | None:
        """Find candidates in the spectrum; keep what fits best as a driven mode or as a line."""
        scene = stage.scene
        best, found = np.inf, None
        good = scene.known & np.isfinite(rest).all(axis=0)
        if not good.any() or not scene.phases.moves.any():
            return None
        clean = np.where(np.isfinite(rest), rest, 0.0) / np.maximum(sigma, 1e-12)[:, None]
        kinds = [_LINE]
        if not scene.phases.moves.all():
            kinds.append(_LINE_MOVING)
        if (scene.phases.phase == CUT).any():
            kinds.append(_LINE_CUT)
        tried = [(kind, f, 0.0) for f in _peaks(stage, clean) for kind in kinds]
        tried += [(_DRIVEN, f, DAMPING) for f in _modes(stage, clean)]
        for kind, frequency, damping in tried:
            theta = np.array([float(kind), frequency, damping])
            columns = _columns(stage, theta)[good]
            left = _left(columns, clean[:, good].T)
            # one more parameter costs the logarithm of the rows
            cost = np.log(max(left, 1e-30)) * clean[:, good].size
            cost += columns.shape[1] * len(rest) * np.log(good.sum())
            if cost < best:
                best = cost
                found = np.concatenate([theta, np.zeros(columns.shape[1] * len(rest))])
        return found

    def part(self, stage: Stage, theta: FloatArray, tangent: bool = True) -> Part:
        """Let the mode swing, or the line last."""
        columns = _columns(stage, theta)
        count = columns.shape[1]
        gains = theta[_HEAD:].reshape(len(stage.gap), count)
        value = gains @ columns.T
        pieces = []
        if tangent:
            slopes = [(1, _STEP_HZ)] + ([(2, _STEP_DAMPING)] if theta[0] == _DRIVEN else [])
            varied = []
            for place, step in slopes:
                other = theta.copy()
                other[place] += step
                varied.append((_columns(stage, other) - columns) / step)
            for output, gain in enumerate(gains):
                index = tuple(range(_HEAD + output * count, _HEAD + (output + 1) * count))
                extra = [(v @ gain)[:, None] for v in varied]
                whole = np.concatenate([columns, *extra], axis=1)
                pieces.append(Piece(output, (*index, *(p for p, _ in slopes)), whole))
        return Part(np.asarray(value), pieces)

    def moved(self, theta: FloatArray, step: FloatArray) -> FloatArray:
        """Return new parameters; the frequency goes no further at once than its line is wide."""
        new = theta + step
        new[0] = theta[0]
        new[1] = max(LOWEST, theta[1] + float(np.clip(step[1], -0.2, 0.2)))
        new[2] = float(np.clip(theta[2] + np.clip(step[2], -0.01, 0.01), 0.0, DAMPED))
        return np.asarray(new)

    def count(self, theta: FloatArray) -> int:
        """Return the gains, the frequency and the damping."""
        return len(theta) - 1

    def table(self, stage: Stage, theta: FloatArray, deviation: FloatArray) -> dict[str, Any]:
        """Return frequency, largest amplitude at the tool and damping."""
        del deviation
        size = np.linalg.norm(stage.at_tool(self.part(stage, theta, False).value), axis=1)
        names = ("driven by acceleration", "lasting", "lasting while moving", "lasting in the cut")
        table = {
            "frequency_Hz": float(np.round(theta[1], 4)),
            "amplitude_mm": float(np.round(np.quantile(size, 0.999) / MM, 6)),
            "course": names[int(theta[0])],
        }
        return table | ({"damping": float(np.round(theta[2], 5))} if theta[0] == _DRIVEN else {})


def _columns(stage: Stage, theta: FloatArray) -> FloatArray:
    """Return what the gains of each output multiply (n, c)."""
    kind, frequency, damping = int(theta[0]), float(theta[1]), float(theta[2])
    scene = stage.scene
    if kind == _DRIVEN:
        parts = []
        for (even, drive), rows in zip(_drives(stage), scene.stretches, strict=True):
            swings = swing(float(even[1] - even[0]), drive, frequency, damping)
            time = scene.time[rows]
            parts.append(np.stack([np.interp(time, even, s) for s in swings.T], axis=1))
        return np.concatenate(parts)
    angle = 2.0 * np.pi * frequency * (scene.time - scene.time[0])
    runs, number = np.unique(scene.recording.run, return_inverse=True)
    where: BoolArray = np.ones(len(angle), dtype=np.bool_)
    if kind == _LINE_MOVING:
        where = scene.phases.moves
    elif kind == _LINE_CUT:
        where = scene.phases.phase == CUT
    columns = np.zeros((len(angle), 2 * len(runs)))
    for run in range(len(runs)):
        mine = (number == run) & where
        columns[mine, 2 * run], columns[mine, 2 * run + 1] = (
            np.cos(angle[mine]),
            np.sin(angle[mine]),
        )
    return columns


def _drives(stage: Stage) -> Iterator[tuple[FloatArray, FloatArray]]:
    """Yield times at equal steps and the acceleration (m, 3) of the tool point, per stretch."""
    scene = stage.scene
    for number, course in enumerate(scene.commanded):
        yield course.fine, scene.kept(("drive", number), partial(_acceleration, course))


def _acceleration(course: Course) -> FloatArray:
    times = np.minimum(course.fine, course.time[-1])
    return np.asarray(course.spline.derivative(2)(times))


def _modes(stage: Stage, clean: FloatArray) -> list[float]:
    """Return frequencies [Hz] of modes, driven by the path, that leave least of values (m, n)."""
    scene = stage.scene
    drives = list(_drives(stage))
    number = int(np.argmax([part.stop - part.start for part in scene.stretches]))
    even, drive = drives[number]
    rows = scene.stretches[number]
    step, time = float(even[1] - even[0]), scene.time[rows]
    values = clean[:, rows].T - clean[:, rows].mean(axis=1)
    top = HIGHEST / max(scene.recording.cycle, 1e-6)
    tried = np.exp(np.arange(np.log(LOWEST), np.log(top), WIDE * DAMPING))
    left = []
    for frequency in tried.tolist():
        swings = swing(step, drive, frequency, DAMPING)
        columns = np.stack([np.interp(time, even, s) for s in swings.T], axis=1)
        left.append(_left(columns - columns.mean(axis=0), values))
    return [float(f) for f in tried[np.argsort(left, kind="stable")[:MODES]]]


def _left(columns: FloatArray, values: FloatArray) -> float:
    """Return the mean square of values (n, m) that columns (n, c) leave."""
    gram = columns.T @ columns
    gram[np.diag_indices_from(gram)] += 1e-12 * max(1e-30, float(np.trace(gram)))
    fit = np.linalg.solve(gram, columns.T @ values)
    return float(np.mean((values - columns @ fit) ** 2))


def _peaks(stage: Stage, clean: FloatArray) -> list[float]:
    """Return the frequencies [Hz] of the largest lines of values (m, n), summed over outputs."""
    scene = stage.scene
    cycle = max(scene.recording.cycle, 1e-6)
    length = int(WINDOW / cycle)
    power, count = np.zeros(2 * length + 1), 0
    taper = np.hanning(length)
    for rows in scene.stretches:
        even = scene.even(rows)
        for output in clean:
            values = np.interp(even, scene.time[rows], output[rows])
            for low in range(0, max(1, len(values) - length // 2), length // 2):
                part = values[low : low + length]
                if len(part) < length // 4:
                    continue
                tapered = (part - part.mean()) * (
                    taper if len(part) == length else np.hanning(len(part))
                )
                power += np.abs(np.fft.rfft(tapered, 4 * length)) ** 2
                count += 1
    frequency = np.fft.rfftfreq(4 * length, cycle)
    inside = (frequency > LOWEST) & (frequency < HIGHEST / cycle)
    if not count or not inside.any():
        return []
    power, frequency = power[inside], frequency[inside]
    found: list[float] = []
    while len(found) < CANDIDATES and power.max() > 0.0:
        top = int(np.argmax(power))
        found.append(float(frequency[top]))
        power = np.where(np.abs(frequency - found[-1]) < APART, 0.0, power)
    return found
