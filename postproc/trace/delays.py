"""A signal that comes later: pure delays and first-order lags, as parts of an effect."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.scene import Stage
from postproc.trace.signals import Course

SHORT = 0.3e-3
"""A time constant [s] below this is none: no recording resolves it."""
_STEP = 0.5e-3


def delayed(stage: Stage, delay: float) -> tuple[FloatArray, FloatArray]:
    """Return how far (n, 6) the joints are from the set-point so much later, and the slope.

    Args:
        stage: whose reference is delayed.
        delay: [s], negative: ahead.
    """
    scene = stage.scene
    value, rate = np.empty_like(scene.reference), np.empty_like(scene.reference)
    for course, rows in zip(scene.courses, scene.stretches, strict=True):
        time = scene.time[rows]
        value[rows] = course.at(time - delay) - scene.reference[rows]
        rate[rows] = -course.rate(time - delay)
    return value, rate


def lagged(stage: Stage, joint: int, total: float, constant: float) -> FloatArray:
    """Return how far (n,) a joint is from the set-point behind a lag.

    Args:
        stage: whose reference is followed.
        joint: 0..5.
        total: delay of slow motions [s].
        constant: the part of it that a first-order lag makes [s]; the rest is dead time.
    """
    scene = stage.scene
    value = np.empty(len(scene.time))
    for whole, rows in zip(scene.courses, scene.stretches, strict=True):
        time = scene.time[rows]
        q = scene.reference[rows, joint]
        if constant < SHORT:
            late = whole.at(time - total)[:, joint]
        else:
            course = Course(time, q[:, None]).filtered(constant)
            late = course.at(time - (total - constant))[:, 0]
        value[rows] = late - q
    return value


def with_slopes(
    stage: Stage, joint: int, total: float, constant: float
) -> tuple[FloatArray, FloatArray]:
    """Return ``lagged`` (n,), and its change (n, 2) with the delay and the time constant."""
    at = lagged(stage, joint, total, constant)
    slopes = [
        (lagged(stage, joint, total + _STEP, constant) - at) / _STEP,
        (lagged(stage, joint, total, constant + _STEP) - at) / _STEP,
    ]
    return at, np.stack(slopes, axis=1)
