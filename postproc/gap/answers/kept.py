"""Whether a compensated program keeps what the diagnosis before it has promised.

Rows of both campaigns with the same id aim at the same point: where the model without any effect
takes the joints of the first. How far the arm misses it, before and after, is compared with the
shrinkage that was promised on rows not fitted.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from postproc.errors import DataError, SourceRef
from postproc.gap.answers.diagnose import Diagnosis, rms, shrink_interval
from postproc.geometry import apply
from postproc.measurement import (
    MeasurementSet,
    fit_registration,
    in_robroot,
    points_of,
    set_ups,
)
from postproc.units import MM

FEWEST = 6
"""Rows that both campaigns must share."""
_ROUNDING = 0.005


@dataclass(frozen=True, slots=True)
class Kept:
    """What was promised and what came of it.

    rows: how many both campaigns share; before, after: 3D rms [m] of how far the points aimed at
    are missed; interval, promised_interval: 90 %.
    """

    rows: int
    before: float
    after: float
    interval: tuple[float, float]
    promised: float
    promised_interval: tuple[float, float]

    @property
    def shrinkage(self) -> float:
        """The part of the gap that is gone."""
        return 1.0 - self.after / max(self.before, 1e-12)

    @property
    def is_kept(self) -> bool:
        """Whether the gap has shrunk as far as was promised, or may have."""
        return self.interval[1] >= self.promised_interval[0] - _ROUNDING

    def entry(self) -> dict[str, Any]:
        """Return the entry of the document, file units."""
        return {
            "rows": self.rows,
            "rms_before_mm": round(self.before / MM, 5),
            "rms_after_mm": round(self.after / MM, 5),
            "shrinkage": round(self.shrinkage, 4),
            "shrinkage_ci": [round(v, 4) for v in self.interval],
            "promised": round(self.promised, 4),
            "promised_ci": [round(v, 4) for v in self.promised_interval],
            "kept": self.is_kept,
        }

    def line(self) -> str:
        """Return the answer in words."""
        low, high = (f"{100 * v:.0f}" for v in self.promised_interval)
        word = "as promised" if self.is_kept else "less than promised"
        return (
            f"Compensated: {self.before / MM:.3f} mm before, {self.after / MM:.3f} mm after on"
            f" {self.rows} points of both campaigns: the gap shrank by"
            f" {100 * self.shrinkage:.0f} %, {word} ({100 * self.promised:.0f} %,"
            f" 90 % interval {low} to {high})."
        )


def kept(before: Diagnosis, after: MeasurementSet) -> Kept:
    """Return what came of a diagnosis in a campaign that was measured with its compensation.

    Args:
        before: the diagnosis whose model was used.
        after: readings of the compensated program; where the first campaign was registered, the
            measuring device may stand elsewhere now.

    Raises:
        DataError: GAP008 if the campaigns share fewer than ``FEWEST`` rows.
    """
    problem = before.problem
    good = {name: k for k, name in enumerate(problem.measurements.ids) if before.kept[k]}
    pairs = [(good[name], k) for k, name in enumerate(after.ids) if name in good]
    if len(pairs) < FEWEST:
        raise DataError(
            "GAP008",
            f"{len(pairs)} rows have an id of the campaign before, expected at least {FEWEST}",
            SourceRef(after.path, int(after.line[0])),
        )
    first, second = np.array(pairs).T
    aim, measured = before.baseline[first], np.asarray(after.position)[second]
    was = np.linalg.norm(problem.measured[first] - aim, axis=1)
    if problem.registration is not None:
        T_robroot_flange = problem.samples.arm.kinematics.fk(problem.samples.q[first])
        rows, start = set_ups(after).rows(second), problem.registration.p_flange_point
        seen = fit_registration(T_robroot_flange, measured, start, None, rows)
        aim = apply(T_robroot_flange, points_of(seen, rows))
        measured = in_robroot(seen, measured, rows)
    left = np.linalg.norm(measured - aim, axis=1)
    promised_before, promised_after, low, high = before.total
    return Kept(
        len(pairs),
        rms(was),
        rms(left),
        shrink_interval(was, left, problem.split.cluster[first]),
        1.0 - promised_after / max(promised_before, 1e-12),
        (low, high),
    )
