"""What states cost, each no more often than it differs; and where a file says how the arm stands.

A joint target is met to the turn where its angles belong to the cell's arm: that is where they
reach the target's own pose.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import TINY, BoolArray, FloatArray, IndexArray, taken
from postproc.geometry import rotation_angle
from postproc.model import CUTS, MotionKind, ToolPath
from postproc.planning.states.costs import StateContext, state_costs
from postproc.planning.states.moves import Chosen
from postproc.planning.states.problem import (
    HELD,
    Problem,
)
from postproc.records import dataclass
from postproc.units import DEG, MM

NEAR = 0.05 * DEG
"""A state this near to given joints is that of the target."""
SAME_POSTURE = 45.0 * DEG
"""Poses of which no joint differs by more are of one posture: an approach and its hole."""
SAME_POSITION = 0.005 * MM
SAME_ANGLE = 0.003 * DEG
"""Given joints stand for the pose of a target within these."""
_ALONG = 0.999


@dataclass(frozen=True, slots=True)
class Orientation:
    """How the tool stands in poses (m,): R_robroot_tcp (m, 3, 3), tilt (m,) [rad] or None."""

    R_robroot_tcp: FloatArray
    tilt: FloatArray | None

    @classmethod
    def of(cls, problem: Problem, tag: IndexArray, T_base_tcp: FloatArray) -> Orientation:
        """Return the orientation of the tool in poses (m, 4, 4) at tags (m,)."""
        place = problem.placement
        R_robroot_base = place.base(place.external[tag])[..., :3, :3]
        return cls(R_robroot_base @ T_base_tcp[:, :3, :3], problem.tilt_of(tag, T_base_tcp))

    def rows(self, index: IndexArray) -> Orientation:
        """Return some of them."""
        return Orientation(
            taken(self.R_robroot_tcp, index), None if self.tilt is None else self.tilt[index]
        )


def costs_of(
    problem: Problem,
    tag: IndexArray,
    spin: FloatArray,
    orientation: Orientation,
    pose: IndexArray,
    q: FloatArray,
    source: IndexArray,
) -> tuple[FloatArray, FloatArray]:
    """Return cost and index of every state; turn copies share what does not depend on the turn.

    Args:
        problem: what is asked.
        tag: (k,) of poses.
        spin: (k,) [rad].
        orientation: (k,).
        pose: (m,) of configurations.
        q: (s, 6) [rad] of states.
        source: (s,) their configurations, rising.
    """
    weights = problem.settings.weights
    if not weights.states or not len(q):
        return np.zeros(len(q)), np.full(len(q), np.nan)

    def context(states: IndexArray | slice) -> StateContext:
        rows = pose[source[states]]
        at = q if isinstance(states, slice) else taken(q, states)
        return _context(problem, tag[rows], spin[rows], orientation.rows(rows), at)

    of_pose, of_turn = weights.split()
    cost, index = np.zeros(len(q)), np.full(len(q), np.nan)
    if of_pose.states:
        first = np.flatnonzero(np.diff(source, prepend=-1))
        shared = state_costs(of_pose, context(first))
        count = np.diff(np.append(first, len(source)))
        cost, index = np.repeat(shared[0], count), np.repeat(shared[1], count)
    if of_turn.states:
        cost = cost + state_costs(of_turn, context(slice(None)))[0]
    return cost, index


def evaluate(
    problem: Problem, tag: IndexArray, spin: FloatArray, T_base_tcp: FloatArray, q: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return cost (m,) and stiffness index (m,) of poses with known joints."""
    context = context_of(problem, tag, spin, T_base_tcp, q)
    return state_costs(problem.settings.weights, context)


def context_of(
    problem: Problem, tag: IndexArray, spin: FloatArray, T_base_tcp: FloatArray, q: FloatArray
) -> StateContext:
    """Return what objectives and indices look at, for poses (m,) with known joints."""
    return _context(problem, tag, spin, Orientation.of(problem, tag, T_base_tcp), q)


def _context(
    problem: Problem, tag: IndexArray, spin: FloatArray, orientation: Orientation, q: FloatArray
) -> StateContext:
    return StateContext(
        kinematics=problem.kinematics,
        cell=problem.cell,
        q=q,
        tag=tag,
        spin=spin,
        R_robroot_tcp=orientation.R_robroot_tcp,
        normal=taken(problem.normal, tag),
        c_joint=None if problem.c_joint is None else problem.c_joint(q),
        tilt=orientation.tilt,
    )


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
    found[1:] = along & (size > TINY) & runs
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
