"""Distance from the commanded path: what the part sees, apart from what only costs time."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.scene import Scene

STEPS = 3
LONGEST = 0.5
"""No tool point is this long [s] off its place."""


def contour_error(scene: Scene, actual: FloatArray) -> FloatArray:
    """Return the distance (n,) [m] of tool points (n, 3) from the path of the command.

    The nearest point is searched from the row's own time on, so that a path that comes by twice is
    not mistaken.
    """
    distance = np.empty(len(actual))
    for course, rows in zip(scene.commanded, scene.stretches, strict=True):
        time, points = scene.time[rows], actual[rows]
        at = time.copy()
        usual = float(np.max(np.sum(course.rate(time) ** 2, axis=1), initial=0.0))
        best = np.linalg.norm(points - scene.points[rows], axis=1)
        for _ in range(STEPS):
            rate = course.rate(at)
            squared = np.sum(rate * rate, axis=1)
            ahead = np.sum((points - course.at(at)) * rate, axis=1)
            step = np.where(squared > 1e-6 * usual, ahead / np.maximum(squared, 1e-12), 0.0)
            at = np.clip(at + step, time - LONGEST, time + LONGEST)
            at = np.clip(at, time[0], time[-1])
            best = np.minimum(best, np.linalg.norm(points - course.at(at), axis=1))
        distance[rows] = best
    return distance
