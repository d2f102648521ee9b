"""Where a file says itself how the arm stands: joint targets, and strokes along the tool axis.

A joint target is met to the turn where its angles belong to the cell's arm: that is where they
reach the target's own pose.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.geometry import rotation_angle
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.planning.states.moves import Chosen
from postproc.planning.states.problem import HELD, Problem
from postproc.units import DEG, MM

NEAR = 0.05 * DEG
"""A state this near to given joints is that of the target."""
SAME_POSTURE = 45.0 * DEG
"""Poses of which no joint differs by more are of one posture: an approach and its hole."""
SAME_POSITION = 0.005 * MM
SAME_ANGLE = 0.003 * DEG
"""Given joints stand for the pose of a target within these."""
_ALONG = 0.999
_SHORT = 1e-6


def strokes_into(toolpath: ToolPath) -> BoolArray:
    """Return the tags (n,) to which the tool goes straight along its axis, in or out.

    By a cut, or by a rapid that leaves a cut or leads to one.
    """
    n = len(toolpath)
    found = np.zeros(n, dtype=np.bool_)
    if n < 2:
        return found
    way = np.diff(toolpath.points, axis=0)
    size = np.linalg.norm(way, axis=1)
    along = np.abs(np.einsum("ij,ij->i", way, toolpath.axes[1:])) > _ALONG * size
    kind = np.asarray(toolpath.kind)
    is_cut = np.isin(kind, CUTS)
    beside = is_cut[:-1] | np.append(is_cut[2:], False)
    runs = (kind[1:] == MotionKind.LINEAR) | ((kind[1:] == MotionKind.RAPID) & beside)
    found[1:] = along & (size > _SHORT) & runs
    return found


def _jointed(toolpath: ToolPath) -> BoolArray:
    joints = toolpath.joints
    if joints is None:
        return np.zeros(len(toolpath), dtype=np.bool_)
    is_joint = np.asarray(toolpath.kind) == MotionKind.JOINT
    return np.asarray(is_joint & np.isfinite(joints).all(axis=1))


def as_given(problem: Problem, tag: IndexArray, q: FloatArray) -> BoolArray:
    """Return which states (m,) may stand for their tags: where one meets given joints, it alone.

    So do those near the joints of a pose to hold: of its posture.
    """
    may = np.ones(len(tag), dtype=np.bool_)
    if HELD in problem.toolpath.extra and len(tag):
        held = np.asarray(problem.toolpath.extra[HELD])[:, 9:]
        near = np.abs(q - held[tag]).max(axis=1) < SAME_POSTURE
        has = np.zeros(len(held), dtype=np.bool_)
        has[tag[near]] = True
        may = near | ~has[tag]
    joints = problem.toolpath.joints
    if joints is None or not len(tag):
        return np.asarray(may)
    wanted = _jointed(problem.toolpath)
    near = wanted[tag] & (np.abs(q - joints[tag]).max(axis=1) < NEAR)
    met = np.zeros(len(wanted), dtype=np.bool_)
    met[tag[near]] = True
    return np.asarray(may & (near | ~met[tag]))


def take_joints(problem: Problem, chosen: Chosen) -> None:
    """Let tags stand at their given joints to the last digit, where these reach the own pose."""
    toolpath = problem.toolpath
    tags = np.flatnonzero(_jointed(toolpath) & chosen.good)
    if toolpath.joints is None or toolpath.rotations is None or not len(tags):
        return
    q = np.asarray(toolpath.joints)[tags]
    T = problem.kinematics.fk(q) @ np.asarray(problem.cell.tool.T_flange_tcp)
    upright = np.zeros((len(tags), 3))
    place = problem.placement
    asked = place.base(place.external[tags]) @ place.tcp(tags, upright)
    gap = np.linalg.norm(T[:, :3, 3] - asked[:, :3, 3], axis=1)
    turn = rotation_angle(T[:, :3, :3], asked[:, :3, :3])
    exact = (gap < SAME_POSITION) & (turn < SAME_ANGLE) & problem.within(q)
    rows = tags[exact]
    chosen.q[rows], chosen.attitude[rows] = q[exact], 0.0
    chosen.branch[rows] = problem.kinematics.slot(q[exact])
