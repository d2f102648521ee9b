"""The postures that poses of tags can be reached in, and whether these get to ends of strokes."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import BoolArray, FloatArray, IndexArray, renumbered, taken
from postproc.planning.states.problem import Problem, nearest_turn
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
    problem: Problem, tags: IndexArray, T_base_tcp: FloatArray, q_near: ArrayLike | None = None
) -> Postures:
    """Return the postures of poses (m, 4, 4) at tags (m,); a tag without a pose has none.

    Args:
        problem: what is asked.
        tags: (m,) indices.
        T_base_tcp: (m, 4, 4).
        q_near: (6,) or (m, 1, 6) [rad]; of the turns within limits the nearest to it are taken.
            None: the middle of the limits.
    """
    if q_near is None:
        q_near = 0.5 * (np.asarray(problem.kinematics.q_min) + problem.kinematics.q_max)
    slots, reached = problem.kinematics.ik(
        problem.placement.flange(T_base_tcp, problem.placement.external[tags])
    )
    reached = reached & problem.placement.given[tags][:, None]
    q = problem.kinematics.nearest(np.where(reached[:, :, None], slots, 0.0), q_near)
    inside = reached & problem.within(q)
    return Postures(q, reached, inside, inside & problem.regular(q))


@dataclass(frozen=True, slots=True)
class StrokeEnds:
    """How configurations (m,) get to the ends of strokes: within reach, off a straight wrist.

    Both wrists of an arm are solved together: they mostly come together.

    ``way``: (m, 6) [rad] by which the joints move there, for each end.
    """

    reached: BoolArray
    regular: BoolArray
    way: list[FloatArray]

    @classmethod
    def of(
        cls,
        problem: Problem,
        tags: IndexArray,
        T_robroot_flange: FloatArray,
        pose: IndexArray,
        slot: IndexArray,
        q: FloatArray,
    ) -> StrokeEnds:
        """Return the ends of configurations (m,), rising by ``pose``.

        Args:
            problem: what is asked.
            tags: (k,) of the poses.
            T_robroot_flange: (k, 4, 4) of the poses.
            pose: (m,) each configuration's.
            slot: (m,) branch of each.
            q: (m, 6) joints [rad].
        """
        found = cls(np.ones(len(q), dtype=np.bool_), np.ones(len(q), dtype=np.bool_), [])
        arms, which = renumbered(4 * pose + slot % 4, 4 * len(tags))
        own, arm = np.divmod(arms, 4)
        wrist = 2 * which + slot // 4
        for height in problem.strokes.levels(tags[own]):
            T = problem.placement.backed_off(taken(T_robroot_flange, own), height)
            both, valid = problem.kinematics.ik_wrists(T, arm)
            end = taken(both.reshape(-1, 6), wrist)
            found.reached[:] &= valid.ravel()[wrist]
            found.regular[:] &= problem.regular(end)
            found.way.append(nearest_turn(end, q) - q)
        return found

    def within(
        self, problem: Problem, kept: IndexArray, q: FloatArray, source: IndexArray
    ) -> BoolArray:
        """Return which turn copies (s, 6) of the configurations kept stay within limits."""
        fits = np.ones(len(q), dtype=np.bool_)
        for way in self.way:
            fits &= problem.within(q + taken(way, kept[source]))
        return fits
