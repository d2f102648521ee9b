"""Whether a compensated program keeps what the diagnosis before it has promised.

Rows of both campaigns with the same id aim at the same point: where the model without any effect
takes the joints of the first. The promise is made for these very points, from the campaign before
alone: what the model leaves at them is measured there, noise included, and will be measured again.
It was fitted to these readings among others, and so leaves them a little less than it will leave
others: the difference is what the fit took from each (Mallows 1973, Technometrics 15, 661).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.errors import DataError, SourceRef
from postproc.gap.answers.diagnose import Diagnosis
from postproc.gap.answers.shrinkage import rms
from postproc.gap.fit import Problem, variance
from postproc.geometry import apply
from postproc.measurement import (
    MeasurementSet,
    SetUps,
    fit_registration,
    in_robroot,
    points_of,
    set_ups,
)
from postproc.records import dataclass
from postproc.units import MM

FEWEST = 6
"""Rows that both campaigns must share."""


@dataclass(frozen=True, slots=True)
class Kept:
    """What was promised and what came of it.

    rows: how many both campaigns share; before, after: 3D rms [m] of how far the points aimed at
    are missed; promised: the same as expected with the model; spread: standard deviation of the
    logarithm of after over promised, if nothing has changed but the program.
    """

    rows: int
    before: float
    after: float
    promised: float
    spread: float

    @property
    def interval(self) -> tuple[float, float]:
        """The shrinkage to expect in nine of ten campaigns."""
        from scipy.special import ndtri

        reach = float(np.exp(ndtri(0.95) * self.spread))
        return self._shrinkage(self.promised * reach), self._shrinkage(self.promised / reach)

    @property
    def is_kept(self) -> bool:
        """Whether the gap has shrunk as far as was promised, within what readings scatter."""
        return self._shrinkage(self.after) >= self.interval[0]

    def _shrinkage(self, left: float) -> float:
        return 1.0 - left / max(self.before, 1e-12)

    def entry(self) -> dict[str, Any]:
        """Return the entry of the document, file units."""
        return {
            "rows": self.rows,
            "rms_before_mm": round(self.before / MM, 5),
            "rms_after_mm": round(self.after / MM, 5),
            "rms_promised_mm": round(self.promised / MM, 5),
            "shrinkage": round(self._shrinkage(self.after), 4),
            "promised": round(self._shrinkage(self.promised), 4),
            "promised_ci": [round(v, 4) for v in self.interval],
            "kept": self.is_kept,
        }

    def line(self) -> str:
        """Return the answer in words."""
        low, high = (f"{100 * v:.0f}" for v in self.interval)
        got, promised = (100 * self._shrinkage(v) for v in (self.after, self.promised))
        word = "as promised" if self.is_kept else "less than promised"
        return (
            f"Compensated: {self.before / MM:.3f} mm before, {self.after / MM:.3f} mm after on"
            f" {self.rows} points of both campaigns: the gap shrank by {got:.0f} %, {word}"
            f" for these points ({promised:.0f} %, 90 % interval {low} to {high})."
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
    aim, rows = before.baseline[first], set_ups(after).rows(second)
    expected = aim + before.residual[first]
    left = _missed(problem, first, aim, expected, rows)
    taken = 2.0 * np.mean(variance(problem.samples.rows(first), before.fit))
    promised = np.sqrt(np.mean(left**2) + taken)
    return Kept(
        len(pairs),
        rms(np.linalg.norm(problem.rest(aim, first), axis=1)),
        rms(_missed(problem, first, aim, np.asarray(after.position)[second], rows)),
        float(promised),
        _spread(before, first, left, float(promised)),
    )


def _missed(
    problem: Problem, first: IntArray, aim: FloatArray, measured: FloatArray, rows: SetUps
) -> FloatArray:
    """Return how far readings (k, 3) miss their aims [m], once registered where that was asked."""
    if problem.registration is not None:
        T_robroot_flange = problem.samples.arm.kinematics.fk(problem.samples.q[first])
        start = problem.registration.p_flange_point
        seen = fit_registration(T_robroot_flange, measured, start, None, rows)
        aim = apply(T_robroot_flange, points_of(seen, rows))
        measured = in_robroot(seen, measured, rows)
    return np.asarray(np.linalg.norm(measured - aim, axis=1))


def _spread(before: Diagnosis, first: IntArray, left: FloatArray, promised: float) -> float:
    """Return the sd of log(measured / promised): points scatter alone, all as a tracker wanders."""
    level, k = before.level, len(first)
    time = before.problem.samples.course[first]
    together = 0.0
    if level.wander > 0.0:
        C = level.wander**2 * np.exp(-np.abs(time[:, None] - time) / level.correlation)
        np.fill_diagonal(C, 0.0)
        steady = max(promised**2 - 3.0 * level.sigma**2, 0.0)
        together = 6.0 * float(np.mean(C**2)) + 4.0 * steady * float(np.mean(C))
    square = 2.0 * (float(np.var(left**2, ddof=1)) / k + together)
    return 0.5 * float(np.sqrt(square)) / max(promised**2, 1e-18)
