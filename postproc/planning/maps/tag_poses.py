"""What one pose of a tag would mean, at once: for editing a plan while it is looked at.

Asked are the planner's own checks; a plan made with the spin as a pin may still differ, for it
also needs a way to the pose.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.kinematics import wrist_distance
from postproc.model import Plan
from postproc.planning.checks import Checker, Reason, moves_of_tags, near_solids
from postproc.planning.maps.spin_map import CLASS_OF, SpinClass
from postproc.planning.maps.tags import Place, at_places
from postproc.planning.planner import checker_of
from postproc.planning.states import (
    PlanOptions,
    Postures,
    evaluate,
    postures,
    rounded_spin,
    settle,
    spin_values,
)
from postproc.records import dataclass
from postproc.units import DEG

_STEP = 45.0 * DEG
"""Step of the spins that are tried where the one of the plan does not do any more."""


@dataclass(frozen=True, slots=True)
class TagPose:
    """A tag at a spin.

    ``kind``: the best that any posture offers; ``q`` (6,) [rad] the posture shown, None out of
    reach; ``pair``: the solids that hit, ``point`` (3,) where [m, robroot]; ``margin``, ``wrist``
    [rad] to the nearest joint limit and to the straight wrist; ``clearance`` [m], infinite where
    nothing is near; ``stiffness`` [N/m], NaN where the cell has none; ``turned``: the posture is
    another one than that of the plan.
    """

    kind: SpinClass
    q: FloatArray | None = None
    pair: tuple[str, ...] = ()
    point: FloatArray | None = None
    margin: float = np.nan
    wrist: float = np.nan
    clearance: float = np.nan
    stiffness: float = np.nan
    turned: bool = False
    tool: int = 0
    base: int = 0


class TagPoses:
    """The tags of a plan in its cell, each asked at any spin."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Take a plan and its cell, with the objective of the call."""
        self._plan = plan
        self._cell, self._settings = settle(cell, PlanOptions())
        self._moves = moves_of_tags(plan)
        self._checkers: dict[int, Checker] = {}

    @cached_property
    def _places(self) -> list[Place]:
        return list(at_places(self._plan, self._cell, self._moves))

    def _checker(self, number: int) -> Checker:
        if number not in self._checkers:
            place = self._places[number]
            self._checkers[number] = checker_of(place.toolpath, place.cell, self._settings)
        return self._checkers[number]

    def at(self, tag: int, spin: float) -> TagPose | None:
        """Return the pose of a tag at a spin [rad]; None for a tag that nothing claims."""
        number = next((k for k, p in enumerate(self._places) if tag in p.tags), None)
        if number is None:
            return None
        place, checker = self._places[number], self._checker(number)
        own, spins = np.array([tag - place.first]), rounded_spin([spin])
        problem, move = checker.problem, int(self._moves[tag])
        T = problem.placement.tcp(own, spins)
        found = postures(problem, own, T, self._near(tag))
        tool, base = place.cell.tool_index, place.cell.base_index
        rows = np.flatnonzero(found.good[0])
        if not len(rows):
            return replace(_ruled_out(checker, found), tool=tool, base=base)
        q = found.q[0, rows]
        of_row = np.zeros(len(rows), dtype=np.int64)
        verdict = checker.states(own[of_row], q, spins[of_row], rows)
        index = evaluate(problem, own[of_row], spins[of_row], T[of_row], q)[1]
        kept = rows == self._plan.branch[move] if move >= 0 else np.zeros(len(rows), np.bool_)
        order = np.lexsort((-np.nan_to_num(index), ~kept, ~verdict.good))
        best = int(order[0])
        pair = checker.pairs[verdict.pair[best]] if verdict.pair[best] >= 0 else ()
        margin, wrist = _margins(checker, q[best])
        return TagPose(
            kind=CLASS_OF[Reason(int(verdict.reason[best]))],
            q=q[best],
            pair=pair,
            point=self._meeting(checker, q[best], pair),
            clearance=self._clearance(checker, own, q[best]),
            stiffness=float(index[best]),
            turned=bool(move >= 0 and not kept[best]),
            margin=margin,
            wrist=wrist,
            tool=tool,
            base=base,
        )

    def _near(self, tag: int) -> FloatArray:
        """Return the joints (6,) whose turns are kept: those of the plan."""
        move = int(self._moves[tag])
        if move >= 0:
            return np.asarray(self._plan.q[move])
        robot = self._cell.robot
        return np.asarray(0.5 * (robot.q_min + robot.q_max))

    def _meeting(self, checker: Checker, q: FloatArray, pair: tuple[str, ...]) -> FloatArray | None:
        if not pair or checker.scene is None:
            return None
        return checker.scene.meeting_point(q, checker.scene.pairs.index((pair[0], pair[1])))

    def _clearance(self, checker: Checker, own: IndexArray, q: FloatArray) -> float:
        if checker.scene is None:
            return np.nan
        most = near_solids(checker.problem.cell)
        contact = checker.problem.is_contact[own]
        near = float(checker.scene.nearest(q[None], contact, most)[0][0])
        return near if near < most else np.inf

    def reach(self) -> tuple[IntArray, FloatArray]:
        """Return class (n,) and stiffness (n,) [N/m] of all tags, at the spin nearest to the plan.

        The spin of the plan first, then others; strokes are not asked.
        """
        n = len(self._plan.toolpath)
        kind, stiffness = np.full(n, SpinClass.UNREACHABLE, dtype=np.int32), np.full(n, np.nan)
        grid = spin_values(_STEP, *self._cell.optimize.range)
        for number, place in enumerate(self._places):
            checker = self._checker(number)
            left = place.tags
            for turn in (0.0, *grid[np.argsort(np.abs(grid), kind="stable")]):
                spins = rounded_spin(self._spins(left) + turn)
                found, index = self._standing(checker, left - place.first, spins, left)
                stiffness[left] = np.where(found == SpinClass.FREE, index, stiffness[left])
                kind[left] = np.minimum(kind[left], found)
                left = left[found != SpinClass.FREE]
                if not len(left):
                    break
        return kind, stiffness

    def _spins(self, tags: IndexArray) -> FloatArray:
        """Return the spin (t,) of the plan [rad], 0 for a tag without a move."""
        moves = self._moves[tags]
        spins = np.zeros(len(tags))
        spins[moves >= 0] = self._plan.spin[moves[moves >= 0]]
        return np.nan_to_num(spins)

    def _standing(
        self, checker: Checker, own: IndexArray, spins: FloatArray, tags: IndexArray
    ) -> tuple[IntArray, FloatArray]:
        """Return class (t,) and stiffness (t,) at spins (t,), the posture of the plan first."""
        problem = checker.problem
        T = problem.placement.tcp(own, spins)
        near = np.stack([self._near(int(tag)) for tag in tags])[:, None]
        found = postures(problem, own, T, near)
        kind = _without_collision(found)
        moves = self._moves[tags]
        branch = np.where(moves >= 0, self._plan.branch[np.maximum(moves, 0)], -1)
        order = np.argsort(np.arange(found.good.shape[1]) != branch[:, None], axis=1, kind="stable")
        index = np.full(len(tags), np.nan)
        for rank in range(found.good.shape[1]):
            slot = order[:, rank]
            rows = np.flatnonzero(found.good[np.arange(len(own)), slot] & (kind != SpinClass.FREE))
            if not len(rows):
                continue
            q = found.q[rows, slot[rows]]
            free = checker.poses(own[rows], q).good
            kind[rows] = np.where(free, SpinClass.FREE, SpinClass.COLLISION)
            some = rows[free]
            index[some] = evaluate(problem, own[some], spins[some], T[some], q[free])[1]
        return kind, index


def _margins(checker: Checker, q: FloatArray) -> tuple[float, float]:
    """Return the way [rad] to the nearest joint limit, and to the straight wrist."""
    kinematics = checker.problem.kinematics
    limit = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min()
    return float(limit), float(wrist_distance(kinematics, q[None])[0])


def _ruled_out(checker: Checker, found: Postures) -> TagPose:
    """Return the posture to show of a pose that reach, limits or singularity rule out."""
    for kind, rows in (
        (SpinClass.SINGULAR, found.inside[0]),
        (SpinClass.JOINT_LIMIT, found.reached[0]),
    ):
        if rows.any():
            q = found.q[0, int(np.argmax(rows))]
            margin, wrist = _margins(checker, q)
            return TagPose(kind, q, margin=margin, wrist=wrist)
    return TagPose(SpinClass.UNREACHABLE)


def _without_collision(found: Postures) -> IntArray:
    """Return the class (m,) by the postures that reach, limits and singularity rule out."""
    rows = (found.good.any(axis=1), found.inside.any(axis=1), found.reached.any(axis=1))
    kinds = [SpinClass.COLLISION, SpinClass.SINGULAR, SpinClass.JOINT_LIMIT]
    return np.select(rows, kinds, SpinClass.UNREACHABLE).astype(np.int32)
