"""All postures of the arm that bring the tool to a pose, and what rules each of them out."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.planning.states.problem import Problem
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Postures:
    """Joints q (m, 8, 6) [rad] of TCP poses by branch, at the turns nearest to a reference.

    ``reached`` (m, 8): the branch reaches the pose; ``inside``: and keeps the cell's margin of all
    joint limits; ``good``: and keeps its distance from the straight wrist.
    """

    q: FloatArray
    reached: BoolArray
    inside: BoolArray
    good: BoolArray


def postures(
    problem: Problem, tags: IndexArray, T_base_tcp: FloatArray, q_near: ArrayLike
) -> Postures:
    """Return the postures of poses (m, 4, 4) at tags (m,); a tag without a pose has none.

    Args:
        problem: what is asked.
        tags: (m,) indices.
        T_base_tcp: (m, 4, 4).
        q_near: (6,) or (m, 1, 6) [rad]; of the turns within limits the nearest to it are taken.
    """
    slots, reached = problem.kinematics.ik(
        problem.placement.flange(T_base_tcp, problem.placement.external[tags])
    )
    reached = reached & problem.placement.given[tags][:, None]
    q = problem.kinematics.nearest(np.where(reached[:, :, None], slots, 0.0), q_near)
    inside = reached & problem.within(q)
    return Postures(q, reached, inside, inside & problem.regular(q))
