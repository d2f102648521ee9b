"""What states cost: the objectives, each worked out no more often than it differs."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray, taken
from postproc.planning.states.costs import StateContext, state_costs
from postproc.planning.states.problem import Problem
from postproc.records import dataclass


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
