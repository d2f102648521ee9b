"""What each preset would make of a toolpath: stiffness given up, cycle time, margin, side by side.

A preset weighs stiffness against short ways; which one is worth it depends on the part. Each is
planned whole, collisions and all, but only the chosen one is written.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from postproc.cell import Cell, Preset
from postproc.model import Plan
from postproc.planning import grade_counts
from postproc.records import dataclass
from postproc.units import MM, N_PER_MM


def lost_percent(plan: Plan) -> dict[str, float]:
    """Return what tags do without of the best stiffness within their reach, mean and largest [%].

    Empty where nothing is known of any tag.
    """
    lost = 100.0 * plan.stiffness_lost[np.isfinite(plan.stiffness_lost)]
    if not len(lost):
        return {}
    return {
        "lost_mean_percent": round(float(lost.mean()), 3),
        "lost_max_percent": round(float(lost.max()), 3),
    }


@dataclass(frozen=True, slots=True)
class Outcome:
    """One preset's plan in figures; None where there is nothing to count.

    ``failing``: tags that cannot be run. ``lost_mean``, ``lost_max`` [%] of the best stiffness that
    tags have within reach. ``grades``: tags by their margin. ``clearance`` [m].
    """

    preset: str
    is_chosen: bool
    failing: int
    lost_mean: float | None
    lost_max: float | None
    stiffness_min: float | None
    cycle_time: float
    grades: dict[str, int]
    clearance: float | None

    @property
    def good_percent(self) -> float:
        """Share of tags that keep a good margin [%]."""
        return 100.0 * self.grades["good"] / max(1, sum(self.grades.values()))

    def to_dict(self) -> dict[str, Any]:
        """Return it in the units of JSON documents."""
        k, gap = self.stiffness_min, self.clearance
        return {
            "preset": self.preset,
            "chosen": self.is_chosen,
            "failing": self.failing,
            "lost_mean_percent": self.lost_mean,
            "lost_max_percent": self.lost_max,
            "min_N_per_mm": None if k is None else round(k / N_PER_MM, 3),
            "cycle_time_s": round(self.cycle_time, 3),
            "grades": self.grades,
            "clearance_mm": None if gap is None else round(gap / MM, 3),
        }

    def row(self) -> tuple[str, ...]:
        """Return it as words under ``HEAD``."""
        lost = ("-" if v is None else f"{v:.1f}" for v in (self.lost_mean, self.lost_max))
        return (
            f"{self.preset} *" if self.is_chosen else self.preset,
            *lost,
            f"{self.cycle_time:.1f}",
            f"{self.good_percent:.0f}",
            "-" if self.clearance is None else f"{self.clearance / MM:.1f}",
            str(self.failing),
        )


HEAD = ("preset", "lost %", "most %", "time s", "good %", "clear mm", "failing")
"""Stiffness lost (mean, most), cycle time, tags of good margin, smallest clearance, failing tags;
the chosen preset has a ``*``."""


def outcomes(chosen: Plan, cell: Cell, planned: Callable[[Cell], Plan]) -> tuple[Outcome, ...]:
    """Return what each preset makes of a toolpath, stiffest first; ``chosen``: the cell's own."""
    own = cell.optimize.preset
    result = []
    for preset in (Preset.STIFFEST, Preset.BALANCED, Preset.FASTEST):
        here = replace(cell, optimize=replace(cell.optimize, preset=preset))
        plan = chosen if preset is own else planned(here)
        result.append(_outcome(plan, here, is_chosen=preset is own))
    return tuple(result)


def _outcome(plan: Plan, cell: Cell, *, is_chosen: bool) -> Outcome:
    stiffness = plan.stiffness[np.isfinite(plan.stiffness)]
    clearance = plan.clearance[np.isfinite(plan.clearance)]
    failing = {i.tag_index for i in plan.findings if i.is_error}
    lost = lost_percent(plan)
    return Outcome(
        cell.optimize.preset.value,
        is_chosen,
        len(failing),
        lost.get("lost_mean_percent"),
        lost.get("lost_max_percent"),
        float(stiffness.min()) if len(stiffness) else None,
        plan.cycle_time,
        grade_counts(plan, cell),
        float(clearance.min()) if len(clearance) else None,
    )
