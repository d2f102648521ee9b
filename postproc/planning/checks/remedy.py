"""The smallest change that would make a failing tag possible: more spin, a tilt, another place."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.geometry import rotation_about
from postproc.planning.checks.feasible import Checker, Reason
from postproc.planning.states import Postures, cross_axes, feed_directions, postures, spin_values
from postproc.units import DEG, MM

TILTS = (2.0 * DEG, 5.0 * DEG, 10.0 * DEG, 15.0 * DEG, 30.0 * DEG)
SHIFTS = (0.05, 0.1, 0.2, 0.4, 0.8, 1.6)
_STEP = 10.0 * DEG


def remedy(checker: Checker, tag: int, reason: Reason) -> str:
    """Return what would help a tag, in words, empty if nothing tried does.

    Tried in turn: any spin at all, lead and side tilt where the tool mills, any tilt of the tool
    axis, shifts of the workpiece; the smallest that gives a pose within reach and limits is named.
    Spins and tilts are checked for collision as well; shifts move the workpiece away from what it
    stands on, so only reach is checked.
    """
    spins = spin_values(_STEP, -np.pi, np.pi)
    T = _poses(checker, tag, spins, np.eye(3))
    free = _free_spins(checker, tag, T)
    if free.any():
        best = spins[free][np.argmin(np.abs(spins[free]))]
        name = checker.problem.toolpath.tag_name(tag)
        how = "pin it there" if name in checker.problem.cell.optimize.pins else "widen range_deg"
        return f"a spin of {best / DEG:.0f} deg about the tool axis would do: {how}"
    if text := _lead_or_side(checker, tag):
        return text
    first, second = cross_axes(checker.problem.placement.tool_axis)
    names = {0: "x", 1: "y", 2: "z"}
    for tilt in TILTS:
        for axis in (first, second):
            for sign in (1.0, -1.0):
                T = _poses(checker, tag, spins, rotation_about(axis, sign * tilt))
                if _free_spins(checker, tag, T).any():
                    name = names[int(np.argmax(axis))]
                    return f"a tilt of {sign * tilt / DEG:.0f} deg about the tool's {name} would do"
    if reason is Reason.COLLISION:
        return "no tilt up to 30 deg is free of collision here: move the workpiece or the obstacle"
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


def _shift(checker: Checker, tag: int, spins: FloatArray) -> str:
    """Return the smallest shift of the workpiece along an axis of robroot that brings reach."""
    T = _poses(checker, tag, spins, np.eye(3))
    R_base_robroot = checker.problem.placement.T_robroot_base[:3, :3].T
    for shift in SHIFTS:
        for axis in range(3):
            for sign in (1.0, -1.0):
                moved = T.copy()
                moved[:, :3, 3] += R_base_robroot[:, axis] * sign * shift
                if _within(checker, tag, moved).good.any():
                    way = f"{sign * shift / MM:+.0f} mm along {'xyz'[axis]} of the robot root"
                    return f"moving the workpiece {way} would bring it within reach"
    return ""


def _poses(checker: Checker, tag: int, spins: FloatArray, R_tilt: FloatArray) -> FloatArray:
    T = checker.problem.placement.tcp(np.full(len(spins), tag), spins)
    T[:, :3, :3] = T[:, :3, :3] @ R_tilt
    return T


def _within(checker: Checker, tag: int, T: FloatArray) -> Postures:
    problem = checker.problem
    middle = 0.5 * (np.asarray(problem.kinematics.q_min) + np.asarray(problem.kinematics.q_max))
    return postures(problem, np.full(len(T), tag), T, middle)


def _free_spins(checker: Checker, tag: int, T: FloatArray) -> BoolArray:
    """Return (s,) the poses that some branch reaches without a collision."""
    found = _within(checker, tag, T)
    free = found.good.copy()
    free[free] = checker.poses(np.full(int(free.sum()), tag), found.q[free]).good
    return np.asarray(free.any(axis=1))
