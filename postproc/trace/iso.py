"""Figures by the names of ISO 9283: path accuracy and repeatability, corners cut and overshot."""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray
from postproc.trace.program import Match, corners_of
from postproc.trace.scene import Scene
from postproc.trace.signals import Course
from postproc.units import MM

RUNS = 10
"""Runs that the standard asks for; with fewer the figures are told with their number."""
STILL = 1e-3
"""Speed [m/s] below which the tool stands: a row of no path."""


def figures(scene: Scene, actual: FloatArray, match: Match | None) -> dict[str, Any]:
    """Return AT and RT of the position and CR and CO of each corner [mm].

    Args:
        scene: of the command.
        actual: (n, 3) attained tool points [m].
        match: on the program; without one no corners.
    """
    told: dict[str, Any] = {"runs": len(scene.stretches), "runs_of_the_standard": RUNS}
    told |= _path(scene, actual)
    if match is not None:
        told["corners"] = _corners(scene, actual, match)
    return told


def _path(scene: Scene, actual: FloatArray) -> dict[str, Any]:
    """AT_p: largest distance of the mean of the runs from the path; RT_p: of the runs from it."""
    runs = scene.recording.run[[part.start for part in scene.stretches]]
    first = scene.stretches[0]
    time = scene.time[first] - scene.time[first][0]
    ways = []
    for part in scene.stretches:
        own = scene.time[part] - scene.time[part][0]
        if len(own) < len(time) // 2:
            # a run of which part is lost is no run of the standard
            continue
        at = np.clip(time, 0.0, own[-1])
        ways.append([Course(own, values[part]).at(at) for values in (scene.points, actual)])
    commands, attained = (np.stack(side) for side in zip(*ways, strict=True))
    if np.abs(commands - commands[0]).max() > 1.0 * MM:
        # stretches of different paths have no mean
        return {"AT_p_mm": None, "RT_p_mm": None}
    mean = attained.mean(axis=0)
    course = Course(time, commands[0])
    rate = course.rate(time)
    moves = np.linalg.norm(rate, axis=1) > STILL
    unit = rate / np.maximum(np.linalg.norm(rate, axis=1), 1e-12)[:, None]
    off = mean - commands[0]
    across = off - np.sum(off * unit, axis=1)[:, None] * unit
    accuracy = float(np.linalg.norm(across[moves], axis=1).max(initial=0.0))
    spread = None
    if len(np.unique(runs)) > 1 and len(attained) > 1:
        lag = attained - mean
        radius = np.linalg.norm(lag - np.sum(lag * unit, axis=2)[..., None] * unit, axis=2)
        limit = radius.mean(axis=0) + 3.0 * radius.std(axis=0, ddof=1)
        spread = float(np.round(limit[moves].max(initial=0.0) / MM, 6))
    return {"AT_p_mm": float(np.round(accuracy / MM, 6)), "RT_p_mm": spread}


def _corners(scene: Scene, actual: FloatArray, match: Match) -> list[dict[str, Any]]:
    """CR: least distance of a corner from the attained path; CO: largest way off beyond it."""
    rows = []
    for corner in corners_of(match.program):
        place = match.program.points[match.program.ends[corner.motion]]
        near = np.abs(match.way - corner.way) < corner.reach
        if near.sum() < 4:
            continue
        beyond = near & (match.way > corner.way)
        # what the first leg would have gone on to: outside of the second
        side = corner.before - (corner.before @ corner.after) * corner.after
        side = side / max(float(np.linalg.norm(side)), 1e-12)
        over = (actual[beyond] - place) @ side
        rows.append(
            {
                "line": int(match.program.line[corner.motion]),
                "CR_mm": _mm(float(np.linalg.norm(actual[near] - place, axis=1).min())),
                "CO_mm": _mm(max(0.0, float(over.max(initial=0.0)))),
            }
        )
    return rows


def _mm(value: float) -> float:
    return float(np.round(value / MM, 6))
