"""One spin within every straight stroke of a task along the tool axis: the tool does not roll."""

from __future__ import annotations

import itertools

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, runs
from postproc.errors import Finding
from postproc.model import MotionKind
from postproc.planning.checks import Checker, Lines, Reason, failure
from postproc.planning.states import Chosen, cross_axes, strokes_into

_BRANCHES = 8
_SAME = 1e-7
"""Spins nearer than this [rad] are one."""


def without_roll(checker: Checker, chosen: Chosen) -> list[Finding]:
    """Give the tags of every stroke the spin of its start, else another one that serves them all.

    Returns:
        Findings at strokes that no single spin serves.
    """
    stroke = strokes_into(checker.problem.toolpath) & chosen.good & ~chosen.entry
    findings = []
    for low, high in runs(stroke.astype(np.int64)):
        if not stroke[low] or not low or not chosen.good[low - 1]:
            continue
        tags = np.arange(low - 1, high)
        offset = _offsets(checker, tags)
        spins = chosen.attitude[tags, 0] - offset
        if np.abs(spins - spins[0]).max() < _SAME:
            continue
        branches = [int(chosen.branch[tags[0]])]
        tried = [float(spins[0])]
        if _may_turn(checker, chosen, int(tags[0])):
            others = checker.problem.settings.spins
            tried += others[np.argsort(np.abs(others - spins[0]), kind="stable")].tolist()
            branches += [branch for branch in range(_BRANCHES) if branch not in branches]
        ways = itertools.product(branches, tried)
        if not any(_turned(checker, chosen, tags, offset + s, branch) for branch, s in ways):
            text = "no single turn about the tool axis serves this straight stroke"
            findings.append(failure(checker.problem, low, Reason.COLLISION, text))
    return findings


def _may_turn(checker: Checker, chosen: Chosen, tag: int) -> bool:
    """Return whether the start of a stroke may turn: nothing but a joint motion leads there."""
    toolpath = checker.problem.toolpath
    given = toolpath.joints is not None and bool(np.isfinite(toolpath.joints[tag]).all())
    joint = toolpath.kind[tag] in (MotionKind.JOINT, MotionKind.RAPID)
    return (joint or bool(chosen.entry[tag])) and not given


def _offsets(checker: Checker, tags: IndexArray) -> FloatArray:
    """Return the spin (m,) [rad] that each tag needs to stand as the first one at spin 0."""
    place = checker.problem.placement
    R = place.R_base_tcp[tags]
    turned = np.swapaxes(R, 1, 2) @ R[0]
    first, second = cross_axes(place.tool_axis)
    sense = float(np.dot(np.cross(first, second), place.tool_axis))
    along, across = turned @ first @ first, turned @ first @ second
    return np.asarray(np.arctan2(sense * across, along))


def _turned(
    checker: Checker, chosen: Chosen, tags: IndexArray, spins: FloatArray, slot: int
) -> bool:
    """Turn a stroke to spins (m,); return whether that can be run, else nothing is changed."""
    problem = checker.problem
    attitude = chosen.attitude[tags].copy()
    own = abs(attitude[0, 0] - spins[0]) < _SAME and slot == chosen.branch[tags[0]]
    if not own:
        attitude[:, 0] = spins
    attitude[1:, 0] = spins[1:]
    T = problem.placement.tcp(tags, attitude)
    branch = np.full(len(tags), slot)
    q: FloatArray = np.tile(chosen.q[tags[0]], (len(tags), 1))
    reached: BoolArray = np.ones(len(tags), dtype=np.bool_)
    external = problem.placement.external[tags]
    for k in range(1 if own else 0, len(tags)):
        row, near = slice(k, k + 1), q[max(k - 1, 0)][None]
        solved, valid = problem.solve(T[row], external[row], branch[row], near)
        q[k], reached[k] = solved[0], valid[0]
    if not (reached & problem.within(q) & problem.regular(q)).all():
        return False
    contact = np.ones(len(tags) - 1, dtype=np.bool_)
    lines = Lines(T[:-1], T[1:], q[:-1], q[1:], branch[1:], contact, (external[:-1], external[1:]))
    if not checker.lines(lines)[0].good.all():
        return False
    chosen.attitude[tags], chosen.q[tags], chosen.branch[tags] = attitude, q, branch
    return True
