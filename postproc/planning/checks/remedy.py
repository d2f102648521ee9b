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
LEAD_OUT = "let the CAM file lead the tool out, or lower [motion] approach_mm"
"""What helps where the tool cannot back off along its axis from the end of a cut."""
_STEP = 10.0 * DEG
_FEW = 20
"""A shift is tried with about so many tags first, evenly taken; if it serves those, with all."""


def remedy(checker: Checker, tag: int, reason: Reason, common: str) -> str:
    """Return what would help a tag, in words, empty if nothing tried does.

    ``common``: the shift of the workpiece that brings it and others within reach, empty for none.

    Tried in turn: any spin at all, lead and side tilt where the tool mills, shifts of the
    workpiece; the smallest that gives a pose within reach and limits is named, stroke and way out
    of material and all. A hole is never tilted: it would be another hole. Spins and tilts are
    checked for collision as well; shifts move the workpiece away from what it stands on, so the
    arm is only kept from hitting itself.
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
        return _shift(checker, tag, common, spins)
    away = "move the workpiece or the obstacle"
    if not standing.any():
        return f"no spin is free of collision here: {away}"
    where = f"the tool stands free at a spin of {_least(spins[standing])} deg"
    return f"{where} but not all along its stroke: {away}"


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


def common_shift(checker: Checker) -> str:
    """Return the smallest shift of the workpiece that brings all tags within reach.

    Args:
        checker: of the job.

    Returns:
        The shift in words, nothing if none of those tried does.
    """
    given = np.flatnonzero(checker.problem.placement.given)
    few = given[:: max(1, len(given) // _FEW)]
    for shift in _shifts(checker):
        if not _reached(checker, few, shift).all():
            continue
        if _stands(checker, few, shift) and _reached(checker, given, shift).all():
            return _words(checker, shift)
    return ""


def _shift(checker: Checker, tag: int, common: str, every: FloatArray) -> str:
    """Return what shift of the workpiece along an axis of robroot brings reach, in words.

    The one that serves others too, else the smallest; at ``every`` spin (s,) [rad] where none does
    at those that the cell lets the tag have.
    """
    tags, text = np.array([tag]), "moving the workpiece {} would bring it within reach"
    if common:
        return text.format(common)
    for spins, so in ((None, ""), (every, " at another spin")):
        for shift in _shifts(checker):
            if _reached(checker, tags, shift, spins)[0] and _stands(checker, tags, shift, spins):
                return text.format(_words(checker, shift)) + so
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


def _spins_at(
    checker: Checker, tags: IndexArray, spins: FloatArray | None
) -> tuple[IndexArray, FloatArray]:
    """Return tags (k,), each repeated for every spin (k,) [rad]; None: those the cell lets it have.

    Pins count then.
    """
    problem = checker.problem
    if spins is not None:
        return np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    pins = problem.pins[tags, None]
    spins = np.where(np.isnan(pins), problem.settings.spins, pins)
    return np.repeat(tags, spins.shape[1]), spins.ravel()


def _reached(
    checker: Checker, tags: IndexArray, shift: FloatArray, spins: FloatArray | None = None
) -> BoolArray:
    """Return (t,) whether a tag is within reach and limits at some spin, workpiece shifted."""
    which, spin = _spins_at(checker, tags, spins)
    problem, strokes = checker.problem, checker.strokes
    good = np.ones((len(which), 1), dtype=np.bool_)
    for height in (0.0, np.where(strokes.is_stroke, strokes.top, problem.ways_out)[which]):
        good = good & _shifted(checker, which, spin, shift, height).good
    return np.asarray(good.reshape(len(tags), -1).any(axis=1))


def _stands(
    checker: Checker, tags: IndexArray, shift: FloatArray, spins: FloatArray | None = None
) -> bool:
    """Return whether the arm reaches each tag without hitting itself, workpiece shifted."""
    which, spin = _spins_at(checker, tags, spins)
    found = _shifted(checker, which, spin, shift)
    row, branch = np.nonzero(found.good)
    free = row[~checker.hits_itself(found.q[row, branch])]
    return bool(np.isin(tags, which[free]).all())


def _shifted(
    checker: Checker,
    tags: IndexArray,
    spin: FloatArray,
    shift: FloatArray,
    height: FloatArray | float = 0.0,
) -> Postures:
    """Return the postures at tags (m,), spins (m,) and heights above them, workpiece shifted."""
    T = checker.problem.placement.tcp(tags, spin, height)
    T[:, :3, 3] += shift
    return _within(checker, tags, T)


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
