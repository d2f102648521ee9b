"""A signal that comes later: pure delays and loops of second order, as parts of an effect."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.scene import Stage
from postproc.trace.signals import behind

SHORT = 0.3e-3
"""A time constant [s] below this is none: no recording resolves it."""
_STEP = 0.5e-3
_SHARE = 0.2

Times = tuple[float, float, float]


def delayed(stage: Stage, delay: float) -> tuple[FloatArray, FloatArray]:
    """Return how far (m, n) outputs are from those so much later, and the slope.

    Args:
        stage: whose reference is delayed.
        delay: [s], negative: ahead.
    """
    scene = stage.scene
    value, rate = np.empty_like(stage.gap), np.empty_like(stage.gap)
    for course, rows in zip(
        scene.courses if stage.in_joints else scene.ways, scene.stretches, strict=True
    ):
        time, outputs = scene.time[rows], slice(len(stage.gap))
        value[:, rows] = (course.at(time - delay) - course.at(time))[:, outputs].T
        rate[:, rows] = -course.rate(time - delay)[:, outputs].T
    return value, rate


def lagged(stage: Stage, joint: int, times: Times) -> FloatArray:
    """Return how far (n,) a joint is from the set-point behind a lag of ``times``."""
    return with_slopes(stage, joint, times, False)[0]


def with_slopes(
    stage: Stage, joint: int, times: Times, sloped: bool = True
) -> tuple[FloatArray, FloatArray]:
    """Return ``lagged`` (n,), and its change (n, k) with each of the times.

    Args:
        stage: whose reference is followed.
        joint: 0..5.
        times: delay of slow motions [s], the part of it that the loop makes [s]; the rest is dead
            time; and the loop's second order [s^2]. A loop below ``SHORT`` is none: then k = 1.
        sloped: the change is asked for, else k = 0.
    """
    total, first, second = times
    scene = stage.scene
    filters = first >= SHORT
    dead = total - first if filters else total
    value = np.empty(len(scene.time))
    slopes = np.empty((len(scene.time), (1 + 2 * filters) * sloped))
    for course, rows in zip(scene.single[joint], scene.stretches, strict=True):
        time = scene.time[rows]
        if not filters:
            value[rows] = course.at(time - dead)[:, 0] - scene.reference[rows, joint]
            if sloped:
                slopes[rows] = -course.rate(time - dead)
            continue
        fine = course.fine
        step = float(fine[1] - fine[0])
        late, rate = course.at(fine - dead), course.rate(fine - dead)
        # before the first row it went on at one speed, which comes out as late as ``first`` says
        straight = late[0] + (fine - fine[0])[:, None] * rate[0]
        bent = np.concatenate([late - straight, rate], axis=1)
        found = behind(step, bent, first, second)
        gone = (straight - first * rate[0])[:, 0] + found[:, 0]
        value[rows] = np.interp(time, fine, gone) - scene.reference[rows, joint]
        if not sloped:
            continue
        longer = behind(step, bent @ [[1.0], [_STEP]], first + _STEP, second)
        slower = behind(step, bent[:, :1], first, second + (_SHARE * first) ** 2)
        changes = (
            -found[:, 1],
            (longer[:, 0] - found[:, 0]) / _STEP - rate[0, 0],
            (slower[:, 0] - found[:, 0]) / (_SHARE * first) ** 2,
        )
        slopes[rows] = np.stack([np.interp(time, fine, c) for c in changes], axis=1)
    return value, slopes
