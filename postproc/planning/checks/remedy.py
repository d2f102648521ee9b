"""The smallest change that makes a failing tag possible: more spin, or a tilt."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.checks.feasible import Checker, Reason
from postproc.planning.states import Postures, feed_directions, postures, spin_values
from postproc.units import DEG

TILTS = (2.0 * DEG, 5.0 * DEG, 10.0 * DEG, 15.0 * DEG, 30.0 * DEG)
LEAD_OUT = "let the CAM file lead the tool out, or lower [motion] approach_mm"
"""What helps where the tool cannot back off along its axis from the end of a cut."""
_STEP = 10.0 * DEG


def remedy(checker: Checker, tag: int, reason: Reason) -> str:
    """Return what would help a tag, in words, empty if nothing tried does.

    Tried in turn: any spin at all, lead and side tilt where the tool mills; the smallest that gives
    a pose within reach and limits, free of collision, is named, stroke and way out of material and
    all. A hole is never tilted: it would be another hole. What frees all tags is asked of the whole
    job, not here.
    """
    spins = spin_values(_STEP, -np.pi, np.pi)
    standing, free = _free_spins(checker, tag, _upright(spins))
    if free.any():
        how = "widen range_deg" if np.isnan(checker.problem.pins[tag]) else "pin it there"
        return f"a spin of {_least(spins[free])} deg about the tool axis would do: {how}"
    if standing.any() and checker.problem.ways_out[tag]:
        return (
            f"the tool stands free at a spin of {_least(spins[standing])} deg but cannot come away "
            f"from the cut: {LEAD_OUT}"
        )
    if text := _lead_or_side(checker, tag):
        return text
    if reason is not Reason.COLLISION:
        return ""
    if not standing.any():
        return "no spin is free of collision here"
    where = f"the tool stands free at a spin of {_least(spins[standing])} deg"
    return f"{where} but not all along its stroke"


def _least(spins: FloatArray) -> str:
    """Return the smallest of spins (s,) [rad] in degrees."""
    return f"{spins[np.argmin(np.abs(spins))] / DEG:.0f}"


def _lead_or_side(checker: Checker, tag: int) -> str:
    """Return the smallest lead or side tilt that helps a milling tag, at its spins."""
    problem = checker.problem
    place, spins, allowed = problem.placement, problem.settings.spins, problem.cell.optimize.tilt
    feed = feed_directions(problem.toolpath, place.axis_base(np.arange(len(place))))
    if not np.isfinite(feed[tag]).all():
        return ""
    tilted = replace(checker, problem=replace(problem, placement=replace(place, feed=feed)))
    words = (("lead angle", "lead_deg", allowed.lead), ("side tilt", "side_tilt_deg", allowed.side))
    for size in TILTS:
        for column, (word, key, (low, high)) in enumerate(words, start=1):
            for tilt in (size, -size):
                attitude = _upright(spins)
                attitude[:, column] = tilt
                if _free_spins(tilted, tag, attitude)[1].any():
                    way = f"widen {key}" if not low <= tilt <= high else "lower tilt_step_deg"
                    return f"a {word} of {tilt / DEG:.0f} deg would do: {way} in [optimize]"
    return ""


def _upright(spins: FloatArray) -> FloatArray:
    """Return attitudes (s, 3) [rad] at spins (s,) without a tilt."""
    return np.stack([spins, np.zeros_like(spins), np.zeros_like(spins)], axis=1)


def _within(checker: Checker, tags: IndexArray, T: FloatArray) -> Postures:
    problem = checker.problem
    middle = 0.5 * (np.asarray(problem.kinematics.q_min) + np.asarray(problem.kinematics.q_max))
    return postures(problem, tags, T, middle)


def _free_spins(checker: Checker, tag: int, attitude: FloatArray) -> tuple[BoolArray, BoolArray]:
    """Return at which of attitudes (s, 3) [rad] a tool stands free, and where it also comes away.

    Free of collision in some branch; coming away is the stroke, or the way out of material.
    """
    tags = np.full(len(attitude), tag)
    found = _within(checker, tags, checker.problem.placement.tcp(tags, attitude))
    row, branch = np.nonzero(found.good)
    q = found.q[row, branch]
    standing, free = np.zeros((2, len(attitude)), dtype=np.bool_)
    away = checker.states(tags[row], q, attitude[row], branch).good
    if checker.problem.ways_out[tag]:
        away &= checker.problem.way_out(tags[row], attitude[row], branch, q)[2]
    standing[row[checker.poses(tags[row], q).good]] = True
    free[row[away]] = True
    return standing, free
