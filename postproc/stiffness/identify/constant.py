"""One compliance per joint from load responses: weighted robust least squares with intervals.

Compliances, not stiffnesses, are fitted: the response is linear in them, they may be bounded at
zero, and a joint that hardly moves gives a small number instead of a huge one. Columns are scaled
by the expected compliance, so that all unknowns are of size one. This replaces Eq. (7) of Jiao et
al. 2022, (AᵀA)⁻¹Aᵀ D as printed with a misprint, by its weighted form through a factorisation.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.errors import StiffnessError
from postproc.measurement import robust_sigma
from postproc.records import dataclass
from postproc.stiffness.identify.cases import LoadCases
from postproc.stiffness.identify.observability import (
    FINEST,
    WEAK,
    Observability,
    Visibility,
    observe,
)
from postproc.units import UM

TYPICAL_C = 1.0 / np.array([1.5e7, 6e6, 5e6, 4e5, 2.5e5, 3e5])
"""Expected pattern of joint compliances [rad/(N*m)] where nothing is known; its size is fitted."""
BOUNDS = (0.02, 50.0)
"""Multiples of the expected compliance beyond which an estimate is no spring's."""
NEAR = 5.0
"""A weakly seen joint of a finer model starts within this factor of the expected compliance."""
HUBER = 3.4
"""Case residuals beyond this many sigma (3D norm; 1 % of clean cases) lose weight."""
OUTLIER = 7.0
"""Beyond this many sigma a case is called a measuring fault."""


@dataclass(frozen=True, slots=True)
class ConstantFit:
    """A fitted set of compliances.

    c_joint (6,) [rad/(N*m)], NaN where unseen; sd (6,) one sigma, NaN where unseen; low, high
    (6,): interval of c at ``confidence`` (low may be <= 0: no upper bound on stiffness);
    sigma: sd of a component of a case [m]; dof; weight (n,) of the cases; at_bound: joints left
    out because their free estimate lay outside the bounds; observability: what the loads show;
    c_ref (6,): what visibility was judged against; c_expected (6,): the expected pattern at the
    size of the data.
    """

    c_joint: FloatArray
    sd: FloatArray
    low: FloatArray
    high: FloatArray
    sigma: float
    dof: int
    weight: FloatArray
    at_bound: tuple[int, ...]
    observability: Observability
    c_ref: FloatArray
    c_expected: FloatArray
    confidence: float

    @property
    def centre(self) -> FloatArray:
        """(6,) [rad/(N*m)] around which a finer model looks.

        Where stiffness varies, one constant for all absorbs the variation in the joints that it
        hardly sees; those are kept near what is expected.
        """
        known = np.where(np.isfinite(self.c_joint), self.c_joint, self.c_expected)
        near = np.clip(known, self.c_expected / NEAR, self.c_expected * NEAR)
        good = [grade is Visibility.GOOD for grade in self.observability.visibility]
        return np.where(good, self.c_joint, near)

    def seen_with(self, cases: LoadCases, sigma: float) -> BoolArray:
        """Return the joints (6,) that a finer model sees, whose scatter is ``sigma`` [m] only.

        The scatter of the constant fit holds the variation of stiffness and may hide a joint.
        """
        A = cases.A * np.sqrt(self.weight)[:, None, None]
        return self.observability.seen | observe(A, self.centre, sigma).seen

    def stiffness_interval(self, joint: int) -> tuple[float, float]:
        """Return the interval of a joint's stiffness [N*m/rad]; the upper end may be infinite."""
        upper = 1.0 / self.low[joint] if self.low[joint] > 0.0 else float("inf")
        return 1.0 / self.high[joint], upper


def fit_constant(
    cases: LoadCases, k_ref: FloatArray | None = None, confidence: float = 0.9, robust: bool = True
) -> ConstantFit:
    """Fit one compliance per joint.

    Args:
        cases: load responses.
        k_ref: (6,) expected joint stiffness [N*m/rad]; only its pattern counts.
        confidence: of the intervals, 0..1.
        robust: weigh down outliers (Huber).

    Raises:
        StiffnessError: STF012 if the loads show no joint at all.
    """
    shape = TYPICAL_C if k_ref is None else 1.0 / np.asarray(k_ref, dtype=np.float64)
    c_ref = c_expected = shape * _common_size(cases, shape)
    weight = np.ones(len(cases))
    c, sigma, dof = _solve(cases, c_ref, np.ones(6, dtype=bool), weight)
    for _ in range(20 if robust else 0):
        previous = weight
        weight = huber_weight(_lengths(cases, c))
        c, sigma, dof = _solve(cases, c_ref, np.ones(6, dtype=bool), weight)
        if np.max(np.abs(weight - previous)) < 1e-3:
            break
    A = cases.A * np.sqrt(weight)[:, None, None]
    seen = observe(A, c_ref, sigma)
    # where the data are clear they, not the expected pattern, say how large a compliance is
    clear = seen.seen & (seen.relative_sd < WEAK) & (c > BOUNDS[0] * c_ref)
    c_ref = np.where(clear, c, c_ref)
    seen = observe(A, c_ref, sigma)
    if not np.any(seen.seen):
        raise StiffnessError(
            "STF012",
            "the loads move the tool too little to show any joint's stiffness",
            hint=f"they move it by {float(seen.motion.max()) / UM:.1f} um, the noise is "
            f"{sigma / UM:.1f} um",
        )
    c, sigma, dof = _solve(cases, c_ref, seen.seen, weight)
    at_bound: list[int] = []
    while np.any(out := _beyond(c, c_ref, seen)):
        # an estimate beyond what is physical is none: the least seen joint is left out first
        worst = int(np.argmax(np.where(out, seen.relative_sd, -np.inf)))
        at_bound.append(worst)
        seen = seen.without(np.arange(6) == worst)
        c, sigma, dof = _solve(cases, c_ref, seen.seen, weight)
    sd = _deviations(A, c_ref, seen.seen, sigma)
    reach = _quantile(confidence, dof) * sd
    return ConstantFit(
        c_joint=np.where(seen.seen, c, np.nan),
        sd=sd,
        low=c - reach,
        high=c + reach,
        sigma=sigma,
        dof=dof,
        weight=weight,
        at_bound=tuple(sorted(at_bound)),
        observability=seen,
        c_ref=c_ref,
        c_expected=c_expected,
        confidence=confidence,
    )


def outliers(cases: LoadCases, c_joint: FloatArray) -> BoolArray:
    """Return (n,) which cases are measuring faults: far beyond the scatter of the others."""
    error = _lengths(cases, c_joint)
    return np.asarray(error > OUTLIER * max(robust_sigma(error), FINEST))


def huber_weight(error: FloatArray) -> FloatArray:
    """Return the weights (n,) of cases by the lengths of their errors."""
    limit = HUBER * max(robust_sigma(error), FINEST)
    return np.asarray(np.minimum(1.0, limit / np.maximum(error, 1e-300)))


def _lengths(cases: LoadCases, c_joint: FloatArray) -> FloatArray:
    """Return the lengths (n,) of the errors [m], of equal noise."""
    return np.asarray(np.linalg.norm(cases.error(c_joint) / cases.scale[:, None], axis=1))


def _common_size(cases: LoadCases, shape: FloatArray) -> float:
    """Return the one factor on the pattern that explains the responses best, within reason."""
    predicted = np.einsum("nij,j->ni", cases.A, shape)
    square = float(np.sum(predicted**2))
    if square <= 0.0:
        raise StiffnessError("STF012", "the loads put no torque on any joint")
    factor = float(np.sum(predicted * cases.d)) / square
    return float(np.clip(factor, 1e-4, 1e5)) if factor > 0.0 else 1.0


def _solve(
    cases: LoadCases, c_ref: FloatArray, use: BoolArray, weight: FloatArray
) -> tuple[FloatArray, float, int]:
    """Return free compliances (0 where not used), sigma and degrees of freedom."""
    root = np.repeat(np.sqrt(weight), 3)
    X = (cases.A.reshape(-1, 6) * c_ref)[:, use] * root[:, None]
    y = cases.d.reshape(-1) * root
    x, _, rank, _ = np.linalg.lstsq(X, y, rcond=1e-9)
    c = np.zeros(6)
    c[use] = x * c_ref[use]
    left = y - X @ x
    dof = max(3 * len(cases) - int(rank), 1)
    return c, float(np.sqrt(left @ left / dof)), dof


def _deviations(A: FloatArray, c_ref: FloatArray, use: BoolArray, sigma: float) -> FloatArray:
    X = (A.reshape(-1, 6) * c_ref)[:, use]
    sd = np.full(6, np.nan)
    sd[use] = sigma * np.sqrt(np.diag(np.linalg.pinv(X.T @ X))) * c_ref[use]
    return sd


def _beyond(c: FloatArray, c_ref: FloatArray, seen: Observability) -> BoolArray:
    """Return the joints (6,) that are seen and whose free estimate is no spring's."""
    size = c / c_ref
    return np.asarray(seen.seen & ((size < BOUNDS[0]) | (size > BOUNDS[1])))


def _quantile(confidence: float, dof: int) -> float:
    from scipy.special import stdtrit

    return float(stdtrit(dof, 0.5 + 0.5 * confidence))
