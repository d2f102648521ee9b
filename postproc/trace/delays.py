"""A signal that comes later: pure delays and first-order lags, as parts of an effect."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.scene import Stage

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
    return with_slopes(stage, joint, total, constant, False)[0]


def with_slopes(
    stage: Stage, joint: int, total: float, constant: float, sloped: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return ``lagged`` (n,), and its change (n, k) with the delay and, if any, the time constant.

    Args:
        stage: whose reference is followed.
        joint: 0..5.
        total: delay of slow motions [s].
        constant: as for ``lagged``; below ``SHORT`` none, then k = 1.
        sloped: the change is asked for, else k = 0.
    """
    scene = stage.scene
    filters = constant >= SHORT
    value = np.empty(len(scene.time))
    slopes = np.empty((len(scene.time), (1 + filters) * sloped))
    for whole, rows in zip(scene.single[joint], scene.stretches, strict=True):
        time = scene.time[rows]
        q = scene.reference[rows, joint]
        course = whole.filtered(constant) if filters else whole
        dead = total - constant if filters else total
        late = course.at(time - dead)[:, 0]
        value[rows] = late - q
        if sloped:
            slopes[rows, 0] = -course.rate(time - dead)[:, 0]
        if sloped and filters:
            longer = whole.filtered(constant + _STEP)
            slopes[rows, 1] = (longer.at(time - (dead - _STEP))[:, 0] - late) / _STEP
    return value, slopes
