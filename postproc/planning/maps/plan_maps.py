"""What the page of a plan shows of its tags beside the plan itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.collision import Scene
from postproc.errors import Finding
from postproc.model import MotionKind, Plan
from postproc.planning.checks import Grade, grades, moves_of_tags, near_solids
from postproc.planning.job import problem_of
from postproc.planning.maps.failing_poses import FailingPose, failing_poses
from postproc.planning.maps.tags import at_places
from postproc.planning.states import PlanOptions, Problem, evaluate, postures, settle, spin_values
from postproc.process import claimed
from postproc.records import dataclass
from postproc.units import DEG

MOST_TAGS = 10_000
"""With more tags a page would be too large: the map is left out, and the page says so."""
_STEP = 10.0 * DEG
_CHUNK = 1000


@dataclass(frozen=True, slots=True)
class SpinIndex:
    """Index (n, s) [N/m] of tags over spins (s,) [rad], NaN where the arm cannot take the spin.

    ``hit`` (n, s): something collides there.
    """

    spins: FloatArray
    index: FloatArray
    hit: BoolArray


@dataclass(frozen=True, slots=True)
class PlanMaps:
    """Tags of a plan in figures.

    ``moves`` (n,) the move that works at each tag, -1 without any; ``clearance`` (n,) [m];
    ``grade`` (n,): ``Grade``; ``spins``: index over the spin, or ``no_spins`` why there is
    none; ``poses``: how the robot would stand at failing tags; ``tool``, ``base`` (n,): indices
    into those of the cell, -1 where no entry claims what the file asks for.
    """

    moves: IndexArray
    tool: IntArray
    base: IntArray
    clearance: FloatArray
    grade: IntArray
    spins: SpinIndex | None
    poses: Mapping[int, FailingPose]
    no_spins: str = ""

    @property
    def grades(self) -> dict[str, int]:
        """Tags by criteria class."""
        return {grade.name.lower(): int((self.grade == grade).sum()) for grade in Grade}


def _clearances(plan: Plan, cell: Cell) -> FloatArray:
    """Return the clearances of a plan, all NaN where nothing is near anywhere."""
    near = plan.clearance < near_solids(cell)
    return plan.clearance if near.any() else np.full(len(plan.clearance), np.nan)


def plan_maps(plan: Plan, cell: Cell, findings: Sequence[Finding]) -> PlanMaps:
    """Return the maps of a plan.

    Args:
        plan: the plan.
        cell: its cell, with the objective of the call.
        findings: all of the conversion; errors name the failing tags.
    """
    moves, claims = moves_of_tags(plan), claimed(plan.toolpath, cell)
    return PlanMaps(
        moves,
        claims.tool,
        claims.base,
        _clearances(plan, cell),
        grades(plan, cell),
        spin_index(plan, cell, moves),
        failing_poses(plan, cell, moves, findings),
        missing(plan),
    )


def missing(plan: Plan) -> str:
    """Return why a plan has no map; nothing where it has one."""
    if len(plan.toolpath) > MOST_TAGS:
        return f"not drawn for more than {MOST_TAGS} tags: convert --spin-map writes it to a file"
    if not len(plan):
        return "no pose was planned: convert --spin-map shows what every spin would mean"
    if not np.isfinite(plan.stiffness).any():
        return "the cell gives no joint stiffness"
    return ""


def spin_index(plan: Plan, cell: Cell, moves: IndexArray) -> SpinIndex | None:
    """Return the map of a plan, None where one is ``missing``.

    The posture is that of the plan: its branch, and the turns of the joints nearest to it.

    Args:
        plan: the plan.
        cell: its cell, with the objective of the call.
        moves: (n,) the move at which each tag's pose is taken, -1 for a tag without any.
    """
    if missing(plan):
        return None
    n = len(plan.toolpath)
    spins = spin_values(_STEP, *cell.optimize.range)
    index = np.full((n, len(spins)), np.nan)
    hit = np.zeros(index.shape, dtype=np.bool_)
    for place in at_places(plan, cell, moves):
        tags = place.tags[moves[place.tags] >= 0]
        if not len(tags):
            continue
        problem = problem_of(place.toolpath, *settle(place.cell, PlanOptions()))
        scene = Scene.shared(place.whole, problem.kinematics)
        for low in range(0, len(tags), _CHUNK):
            some = tags[low : low + _CHUNK]
            index[some], q = _values(plan, problem, some - place.first, moves[some], spins)
            hit[some] = _hits(plan, some, q, moves, scene)
    return SpinIndex(spins, index, hit)


def _values(
    plan: Plan, problem: Problem, tags: IndexArray, moves: IndexArray, spins: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return the index (t, s) of tags (t,) and the joints (t, s, 6), NaN where the arm cannot.

    Tags are those of the problem, moves (t,) those of the plan that serve them.
    """
    which, spin = np.repeat(tags, len(spins)), np.tile(spins, len(tags))
    T = problem.placement.tcp(which, spin)
    of_row = np.repeat(moves, len(spins))
    found = postures(problem, which, T, plan.q[of_row][:, None])
    own = np.arange(len(which)), plan.branch[of_row]
    q, good = found.q[own], found.good[own]
    rows = np.flatnonzero(good)
    index = np.full(len(which), np.nan)
    index[rows] = evaluate(problem, which[rows], spin[rows], T[rows], q[rows])[1]
    shape = (len(tags), len(spins))
    return index.reshape(shape), np.where(good[:, None], q, np.nan).reshape(*shape, 6)


def _hits(
    plan: Plan, tags: IndexArray, q: FloatArray, moves: IndexArray, scene: Scene
) -> BoolArray:
    """Return where (t, s) the pose q (t, s, 6) at a tag collides."""
    row, spin = np.nonzero(np.isfinite(q[..., 0]))
    hit = np.zeros(q.shape[:2], dtype=np.bool_)
    if len(row):
        poses = np.hstack([q[row, spin], plan.external[moves[tags[row]]]])
        contact = plan.toolpath.kind[tags[row]] != MotionKind.RAPID
        hit[row, spin] = scene.check(poses, contact).hit
    return hit
