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
from postproc.planning.job import checker_of
from postproc.planning.maps.plan_maps import axes_of
from postproc.planning.maps.spin_map import CLASS_OF, SpinClass, ruled_out
from postproc.planning.planner import plan as plan_tags
from postproc.planning.states import (
    HELD,
    UPRIGHT,
    Postures,
    evaluate,
    postures,
    rounded_spin,
    settle,
    spin_values,
)
from postproc.process import assign
from postproc.records import dataclass
from postproc.units import DEG

_STEP = 45.0 * DEG
"""Step of the spins that are tried where the one of the plan does not do any more."""
_FREE = 6
"""So many tags on either side may turn, ..."""
_KEPT = 2
"""... and so many beyond them stay as they are."""


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


@dataclass(frozen=True, slots=True)
class _Stretch:
    """Tags that one tool serves in one base, the external axes where the plan has them."""

    low: int
    high: int
    checker: Checker


class TagPoses:
    """The tags of a plan in its cell, each asked at any spin."""

    def __init__(self, plan: Plan, cell: Cell) -> None:
        """Take a plan and its cell, with the objective of the call."""
        self._plan = plan
        self._cell, self._settings = settle(cell)
        self._moves = moves_of_tags(plan)

    @cached_property
    def _stretches(self) -> list[_Stretch]:
        plan, found = self._plan, []
        axes = axes_of(plan, self._cell, self._moves) if self._cell.external_axes else None
        for part in assign(plan.toolpath, self._cell).stretches():
            if part.is_assigned:
                rows = np.arange(part.low, part.high)
                cell = self._cell.with_tool(part.tool, part.base)
                external = None if axes is None else axes[rows]
                checker = checker_of(plan.toolpath.rows(rows), cell, self._settings, external)
                found.append(_Stretch(part.low, part.high, checker))
        return found

    def at(self, tag: int, spin: float) -> TagPose | None:
        """Return the pose of a tag at a spin [rad], best of all postures and tilts it may have.

        The posture of the plan is kept where it will do. None for a tag that nothing claims.
        """
        part = next((part for part in self._stretches if part.low <= tag < part.high), None)
        if part is None:
            return None
        checker, own = part.checker, tag - part.low
        problem, move = checker.problem, int(self._moves[tag])
        tilts = problem.tilts if problem.placement.may_tilt[own] else UPRIGHT
        attitude = np.column_stack([np.full(len(tilts), rounded_spin(spin)), tilts])
        tags = np.full(len(tilts), own)
        T = problem.placement.tcp(tags, attitude)
        found = postures(problem, tags, T, self._near(np.array([tag]))[0])
        row, branch = np.nonzero(found.good)
        tool, base = problem.cell.tool_index, problem.cell.base_index
        if not len(row):
            return replace(_ruled_out(checker, found), tool=tool, base=base)
        q = found.q[row, branch]
        index = evaluate(problem, tags[row], attitude[row, 0], T[row], q)[1]
        kept = branch == self._plan.branch[move] if move >= 0 else np.zeros(len(row), np.bool_)
        order = np.lexsort((-np.nan_to_num(index), ~kept))
        best, kind, pair = self._first_free(checker, order, tags[row], q, attitude[row], branch)
        poses = np.hstack([q[[best]], problem.placement.external[[own]]])
        margin, wrist = _margins(checker, q[best])
        return TagPose(
            kind=kind,
            q=q[best],
            pair=pair,
            point=_meeting(checker, poses, pair),
            clearance=_clearance(checker, own, poses),
            stiffness=float(index[best]),
            turned=bool(move >= 0 and not kept[best]),
            margin=margin,
            wrist=wrist,
            tool=tool,
            base=base,
        )

    @staticmethod
    def _first_free(
        checker: Checker,
        order: IndexArray,
        tags: IndexArray,
        q: FloatArray,
        attitude: FloatArray,
        branch: IndexArray,
    ) -> tuple[int, SpinClass, tuple[str, ...]]:
        """Return the first free of rows (m,) in an order, else the first: why not, what hits."""
        shown: tuple[int, SpinClass, tuple[str, ...]] | None = None
        for row in order.tolist():
            verdict = checker.states(tags[[row]], q[[row]], attitude[[row]], branch[[row]])
            pair = int(verdict.pair[0])
            kind = CLASS_OF[Reason(int(verdict.reason[0]))]
            now = row, kind, checker.pairs[pair] if pair >= 0 else ()
            if kind is SpinClass.FREE:
                return now
            shown = shown or now
        return shown or (0, SpinClass.UNREACHABLE, ())

    def _near(self, tags: IndexArray) -> FloatArray:
        """Return the joints (t, 6) whose turns are kept: those of the plan, else their middle."""
        robot, moves = self._cell.robot, self._moves[tags]
        middle = 0.5 * (robot.q_min + robot.q_max)
        near = np.tile(middle, (len(tags), 1))
        near[moves >= 0] = self._plan.q[moves[moves >= 0]]
        return near

    def reach(self) -> tuple[IntArray, FloatArray]:
        """Return class (n,) and stiffness (n,) [N/m] of all tags, at the spin nearest to the plan.

        The pose of the plan first, then turned about the tool axis; strokes are not asked.
        """
        n = len(self._plan.toolpath)
        kind, stiffness = np.full(n, SpinClass.UNREACHABLE, dtype=np.int32), np.full(n, np.nan)
        grid = spin_values(_STEP, *self._cell.optimize.range)
        for part in self._stretches:
            left = np.arange(part.low, part.high)
            for turn in (0.0, *grid[np.argsort(np.abs(grid), kind="stable")]):
                found, index = self._standing(part, left, turn)
                stiffness[left] = np.where(found == SpinClass.FREE, index, stiffness[left])
                kind[left] = np.minimum(kind[left], found)
                left = left[found != SpinClass.FREE]
                if not len(left):
                    break
        return kind, stiffness

    def _turned(
        self, part: _Stretch, tags: IndexArray, turn: float
    ) -> tuple[FloatArray, FloatArray]:
        """Return spin (t,) [rad] and pose (t, 4, 4) turned from the plan, its tilt kept."""
        place, moves = part.checker.problem.placement, self._moves[tags]
        own, has = tags - part.low, moves >= 0
        spins = np.zeros(len(tags))
        spins[has] = np.nan_to_num(self._plan.spin[moves[has]])
        T = place.tcp(own, rounded_spin(spins + turn))
        upright = place.tcp(own[has], rounded_spin(spins[has]))[:, :3, :3]
        tilt = self._plan.T_base_tcp[moves[has], :3, :3] @ np.swapaxes(upright, 1, 2)
        T[has, :3, :3] = tilt @ T[has, :3, :3]
        return spins + turn, T

    def _standing(
        self, part: _Stretch, tags: IndexArray, turn: float
    ) -> tuple[IntArray, FloatArray]:
        """Return class (t,) and stiffness (t,) of tags turned by ``turn``, in any posture."""
        checker, own = part.checker, tags - part.low
        spins, T = self._turned(part, tags, turn)
        found = postures(checker.problem, own, T, self._near(tags)[:, None])
        kind = ruled_out(found, SpinClass.COLLISION).min(axis=1)
        moves = self._moves[tags]
        branch = np.full(len(tags), -1)
        branch[moves >= 0] = self._plan.branch[moves[moves >= 0]]
        order = np.argsort(np.arange(found.good.shape[1]) != branch[:, None], axis=1, kind="stable")
        index = np.full(len(tags), np.nan)
        for slot in order.T:
            rows = np.flatnonzero(found.good[np.arange(len(own)), slot] & (kind != SpinClass.FREE))
            if not len(rows):
                continue
            q = found.q[rows, slot[rows]]
            free = checker.poses(own[rows], q).good
            kind[rows] = np.where(free, SpinClass.FREE, SpinClass.COLLISION)
            some = rows[free]
            index[some] = evaluate(checker.problem, own[some], spins[some], T[some], q[free])[1]
        return kind, index


def _meeting(checker: Checker, poses: FloatArray, pair: tuple[str, ...]) -> FloatArray | None:
    """Return where (3,) the solids of a pair meet in a pose (1, 6 + k)."""
    if not pair or checker.scene is None:
        return None
    number = checker.scene.pairs.index((pair[0], pair[1]))
    return checker.scene.meeting_point(poses[0], number)


def _clearance(checker: Checker, own: int, poses: FloatArray) -> float:
    """Return how near solids are in a pose (1, 6 + k) at a tag, infinite where none is near."""
    if checker.scene is None:
        return np.nan
    most = near_solids(checker.problem.cell)
    near = float(checker.scene.nearest(poses, checker.problem.is_contact[[own]], most)[0][0])
    return near if near < most else np.inf


def _margins(checker: Checker, q: FloatArray) -> tuple[float, float]:
    """Return the way [rad] to the nearest joint limit, and to the straight wrist."""
    kinematics = checker.problem.kinematics
    limit = np.minimum(q - kinematics.q_min, kinematics.q_max - q).min()
    return float(limit), float(wrist_distance(kinematics, q[None])[0])


def _ruled_out(checker: Checker, found: Postures) -> TagPose:
    """Return the posture to show of poses that reach, limits or singularity rule out."""
    for kind, slots in ((SpinClass.SINGULAR, found.inside), (SpinClass.JOINT_LIMIT, found.reached)):
        if slots.any():
            q = found.q[slots][0]
            margin, wrist = _margins(checker, q)
            return TagPose(kind, q, margin=margin, wrist=wrist)
    return TagPose(SpinClass.UNREACHABLE)


def replanned(plan: Plan, cell: Cell, tag: int) -> tuple[Plan, IndexArray]:
    """Return the plan of the tags around one, and which tags (t,) they are.

    The planner itself plans them; those at both ends hold the poses that they have. The whole
    plan with the same pins may still differ: it weighs all tags together.

    Args:
        plan: of all tags.
        cell: its cell, with the pins and the places that are to count.
        tag: the one that was edited.
    """
    parts = assign(plan.toolpath, cell).stretches()
    part = next(part for part in parts if part.low <= tag < part.high)
    tags = np.arange(max(part.low, tag - _FREE - _KEPT), min(part.high, tag + _FREE + _KEPT + 1))
    moves = moves_of_tags(plan)[tags]
    column = np.full((len(tags), 15), np.nan)
    held = np.flatnonzero((moves >= 0) & (np.abs(tags - tag) > _FREE))
    column[held, :9] = plan.T_base_tcp[moves[held], :3, :3].reshape(-1, 9)
    column[held, 9:] = plan.q[moves[held]]
    path = plan.toolpath.named().rows(tags)
    return plan_tags(replace(path, extra={**path.extra, HELD: column}), cell), tags
