"""Distance from the commanded path: what the part sees, apart from what only costs time."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.scene import Scene

LONGEST = 0.5
"""No tool point is this long [s] off its place."""
_APART = 0.02
"""The nearest point is looked for from points of the command so far [s] apart, ..."""
_STEPS = 3
"""... with so many steps of Newton from the nearest of them, and from the row's own time."""


def contour_error(scene: Scene, actual: FloatArray) -> FloatArray:
    """Return the distance (n,) [m] of tool points (n, 3) from the path of the command.

    It is that to the nearest point of at most ``LONGEST`` before and behind: what lies farther off
    in time is another pass of the path. So a delay, of the arm or of a clock, is no contour error.
    """
    distance = np.empty(len(actual))
    for course, rows in zip(scene.commanded, scene.stretches, strict=True):
        time, points = scene.time[rows], actual[rows]
        usual = float(np.max(np.sum(course.rate(time) ** 2, axis=1), initial=0.0))
        best = np.full(len(time), np.inf)
        for start in (time, _nearest(time, scene.points[rows], points)):
            at = start
            for _ in range(_STEPS):
                off, rate = points - course.at(at), course.rate(at)
                best = np.minimum(best, np.linalg.norm(off, axis=1))
                squared, ahead = np.sum(rate * rate, axis=1), np.sum(off * rate, axis=1)
                step = np.where(squared > 1e-6 * usual, ahead / np.maximum(squared, 1e-12), 0.0)
                at = np.clip(at + step, time - LONGEST, time + LONGEST)
                at = np.clip(at, time[0], time[-1])
            best = np.minimum(best, np.linalg.norm(points - course.at(at), axis=1))
        distance[rows] = best
    return distance


def _nearest(time: FloatArray, path: FloatArray, points: FloatArray) -> FloatArray:
    """Return the times (n,) [s] of the rows of a path (n, 3) that lie nearest to points (n, 3)."""
    cycle = float(np.median(np.diff(time))) if len(time) > 1 else 1.0
    stride = max(1, round(_APART / cycle))
    own, last = np.arange(len(time)), len(time) - 1
    best, at = np.sum((points - path) ** 2, axis=1), own.copy()
    for shift in range(stride, int(LONGEST / cycle) + 1, stride):
        for other in (np.maximum(own - shift, 0), np.minimum(own + shift, last)):
            squared = np.sum((points - path[other]) ** 2, axis=1)
            nearer = squared < best
            best, at = np.where(nearer, squared, best), np.where(nearer, other, at)
    return np.asarray(time[at])
