"""The smallest change that makes a failing tag possible: more spin, a tilt, another place."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.checks.feasible import Checker, Reason
from postproc.planning.states import Postures, feed_directions, postures, spin_values
from postproc.units import DEG, MM

TILTS = (2.0 * DEG, 5.0 * DEG, 10.0 * DEG, 15.0 * DEG, 30.0 * DEG)
SHIFTS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
_STEP = 10.0 * DEG
_FEW = 20
"""A shift is tried with about so many tags first, evenly taken; if it serves those, with all."""


def remedy(checker: Checker, tag: int, reason: Reason) -> str:
    """Return what would help a tag, in words, empty if nothing tried does.

    Tried in turn: any spin at all, lead and side tilt where the tool mills, shifts of the
    workpiece; the smallest that gives a pose within reach and limits is named. A hole is never
    tilted: it would be another hole. Spins and tilts are checked for collision as well; shifts
    move the workpiece away from what it stands on, so only reach is checked.
    """
    spins = spin_values(_STEP, -np.pi, np.pi)
    T = _poses(checker, tag, spins)
    free = _free_spins(checker, tag, T)
    if free.any():
        best = spins[free][np.argmin(np.abs(spins[free]))]
        name = checker.problem.toolpath.tag_name(tag)
        how = "pin it there" if name in checker.problem.cell.optimize.pins else "widen range_deg"
        return f"a spin of {best / DEG:.0f} deg about the tool axis would do: {how}"
    if text := _lead_or_side(checker, tag):
        return text
    if reason is Reason.COLLISION:
        return "no spin is free of collision here: move the workpiece or the obstacle"
    return _shift(checker, tag, spins)


def _lead_or_side(checker: Checker, tag: int) -> str:
    """Return the smallest lead or side tilt that helps a milling tag, at its spins."""
    problem = checker.problem
    place, spins, allowed = problem.placement, problem.settings.spins, problem.cell.optimize.tilt
    feed = feed_directions(problem.toolpath, place.axis_base(np.arange(len(place))))
    if not np.isfinite(feed[tag]).all():
        return ""
    free_to_tilt = replace(place, feed=feed)
    words = (("lead angle", "lead_deg", allowed.lead), ("side tilt", "side_tilt_deg", allowed.side))
    for size in TILTS:
        for column, (word, key, (low, high)) in enumerate(words, start=1):
            for tilt in (size, -size):
                attitude = np.zeros((len(spins), 3))
                attitude[:, 0], attitude[:, column] = spins, tilt
                T = free_to_tilt.tcp(np.full(len(spins), tag), attitude)
                if _free_spins(checker, tag, T).any():
                    way = f"widen {key}" if not low <= tilt <= high else "lower tilt_step_deg"
                    return f"a {word} of {tilt / DEG:.0f} deg would do: {way} in [optimize]"
    return ""


def common_shift(checker: Checker) -> str:
    """Return the smallest shift of the workpiece that brings all tags within reach.

    Args:
        checker: of the job.

    Returns:
        The shift in words, nothing if none of those tried does.
    """
    spins = checker.problem.settings.spins
    given = np.flatnonzero(checker.problem.placement.given)
    few = given[:: max(1, len(given) // _FEW)]
    for shift in _shifts(checker):
        if all(_reached(checker, tags, spins, shift).all() for tags in (few, given)):
            return _words(checker, shift)
    return ""


def _shift(checker: Checker, tag: int, spins: FloatArray) -> str:
    """Return the smallest shift of the workpiece along an axis of robroot that brings reach."""
    for shift in _shifts(checker):
        if _reached(checker, np.array([tag]), spins, shift)[0]:
            return f"moving the workpiece {_words(checker, shift)} would bring it within reach"
    return ""


def _shifts(checker: Checker) -> Iterator[FloatArray]:
    """Yield shifts (3,) [m] of the workpiece in its own frame, along axes of robroot."""
    R_base_robroot = checker.problem.placement.T_robroot_base[:3, :3].T
    for length, axis, sign in product(SHIFTS, range(3), (1.0, -1.0)):
        yield R_base_robroot[:, axis] * sign * length


def _words(checker: Checker, shift: FloatArray) -> str:
    by = checker.problem.placement.T_robroot_base[:3, :3] @ shift
    axis = int(np.argmax(np.abs(by)))
    return f"{by[axis] / MM:+.0f} mm along {'xyz'[axis]} of the robot root"


def _reached(checker: Checker, tags: IndexArray, spins: FloatArray, shift: FloatArray) -> BoolArray:
    """Return (t,) whether a tag is within reach and limits at some spin, workpiece shifted."""
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    T = checker.problem.placement.tcp(which, spin)
    T[:, :3, 3] += shift
    good = _within(checker, which, T).good
    return np.asarray(good.reshape(len(tags), -1).any(axis=1))


def _poses(checker: Checker, tag: int, spins: FloatArray) -> FloatArray:
    return checker.problem.placement.tcp(np.full(len(spins), tag), spins)


def _within(checker: Checker, tags: IndexArray, T: FloatArray) -> Postures:
    problem = checker.problem
    middle = 0.5 * (np.asarray(problem.kinematics.q_min) + np.asarray(problem.kinematics.q_max))
    return postures(problem, tags, T, middle)


def _free_spins(checker: Checker, tag: int, T: FloatArray) -> BoolArray:
    """Return (s,) the poses that some branch reaches without a collision."""
    found = _within(checker, np.full(len(T), tag), T)
    free = found.good.copy()
    free[free] = checker.poses(np.full(int(free.sum()), tag), found.q[free]).good
    return np.asarray(free.any(axis=1))
