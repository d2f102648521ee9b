"""What the page of a plan shows of its tags beside the plan itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from postproc.arrays import FloatArray, IndexArray, IntArray
from postproc.cell import Cell
from postproc.errors import Finding
from postproc.model import Plan
from postproc.planning.checks import Grade, grades, moves_of_tags, near_solids
from postproc.planning.maps.failing_poses import FailingPose, failing_poses
from postproc.planning.maps.spin_index import SpinIndex, missing, spin_index
from postproc.process import claimed
from postproc.records import dataclass


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
