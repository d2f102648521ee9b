"""Fit of the choice, tests of what is left, and what may still be named in the light of them."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.choice.evidence import ABSORBED_GAIN, is_absorbed
from postproc.gap.choice.residual import Dependence, dependences
from postproc.gap.choice.selection import Prepared
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.fit import (
    Fit,
    Free,
    Noise,
    Problem,
    Projection,
    Regression,
    fit,
)
from postproc.gap.robot_model import evaluate
from postproc.measurement import robust_sigma

STRUCTURE = 1.0
"""Structured rest, 3D root mean square, from which "explained" is no longer said, in sigma."""
INEXACT = 0.04
"""The same against the largest effect: its formula is not exact, and that is no other cause."""
_SURE = 1e-4
_F_RATIO = 1.35
"""Variance over that of the repeats from which the rest is more than noise, if significant."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """The choice that stands, its fit (with the alternatives as nuisance), the tests.

    residual: (n, 3) [m] of all rows against given model, adopted effects and registration;
    structure: 3D rms [m] of what is left and not noise. Tests and structure let the effects in
    that are too small to be named: they are no riddle.
    """

    choice: Choice
    fit: Fit
    residual: FloatArray
    tests: tuple[Dependence, ...]
    structure: float
    outlier: BoolArray


def assess(
    problem: Problem, prepared: Prepared, regression: Regression, choice: Choice
) -> Assessment:
    """Return what stands of a choice in the light of what it leaves."""
    level = prepared.noise
    outlier = _outliers(problem, regression, choice.model, prepared)
    rows = problem.searchable & ~outlier
    full = fitted(problem, regression, choice.model, level.sigma, rows)
    rest = problem.measured - full.point
    tests, structure = _tested(problem, regression, choice.model, rest, level, outlier)
    gone = [k for k in choice.adopted if not _outweighs(regression, choice, k, structure)]
    if structure <= tolerated(choice, level.sigma):
        gone = []
    if gone or choice.resembled:
        reasons = {regression.name(k): "what is left may be imitating it" for k in gone}
        choice = choice.moved(gone, Standing.REJECTED, reasons)
        full = fitted(problem, regression, choice.model, level.sigma, rows)
        rest = problem.measured - _point_without(problem, full, choice.resembled)
        known = (*choice.adopted, *choice.unnamed)
        tests, left = _tested(problem, regression, known, rest, level, outlier)
        structure = max(left, structure)
    if choice.unnamed:
        named = (*choice.adopted, *choice.resembled)
        full = fitted(problem, regression, named, level.sigma, rows)
    residual = problem.measured - _point_without(problem, full, choice.resembled)
    return Assessment(choice, full, residual, tests, structure, outlier)


def verdict(assessment: Assessment, sigma: float) -> str:
    """Return ``explained``, ``no_gap`` or ``unexplained``."""
    choice = assessment.choice
    if choice.resembled or assessment.structure > tolerated(choice, sigma):
        return "unexplained"
    return "explained" if choice.adopted else "no_gap"


def tolerated(choice: Choice, sigma: float) -> float:
    """Return the structured rest, 3D rms [m], up to which the adopted effects explain the gap."""
    largest = max((choice.evidence[k].unique for k in choice.adopted), default=0.0)
    return max(STRUCTURE * sigma, INEXACT * largest)


def fitted(
    problem: Problem, regression: Regression, keys: Iterable[str], sigma: float, rows: BoolArray
) -> Fit:
    """Fit blocks on some rows (n,); the fitted points are those of all rows."""
    index = np.flatnonzero(rows)
    blocks = {b.key: b for b in regression.blocks}
    free = {blocks[k].name: Free(blocks[k].setting) for k in keys}
    for name in problem.always:
        free[name] = Free(problem.settings[name], problem.widen(name))
    weight = np.full(len(index), 1.0 / sigma)
    part = problem.samples.rows(index)
    result = fit(part, problem.measured[index], weight, problem.given, free)
    return replace(result, point=evaluate(problem.samples, result.states)[0])


def _point_without(problem: Problem, full: Fit, alternatives: Collection[str]) -> FloatArray:
    """Return the points (n, 3) [m] of a fit with some effects as the given model has them."""
    states = {
        name: problem.given.get(name, state)
        for name, state in full.states.items()
        if name not in alternatives or name in problem.given
    }
    return evaluate(problem.samples, states)[0]


def _outliers(
    problem: Problem, regression: Regression, keys: tuple[str, ...], prepared: Prepared
) -> BoolArray:
    """Return (n,) rows that are measuring faults under the chosen model."""
    rest, level = prepared.saturated, max(prepared.saturated.sigma, prepared.noise.sigma)
    rows = problem.searchable.copy()
    rows[np.flatnonzero(rows)[rest.outlier]] = False
    result = fitted(problem, regression, keys, level, rows)
    left = np.linalg.norm(problem.measured - result.point, axis=1)
    usual = max(level, robust_sigma(left[rows]))
    bad: BoolArray = np.asarray(left > 6.0 * usual)
    return bad if bad.mean() <= 0.06 else np.asarray(bad & (left > np.quantile(left, 0.94)))


def _tested(
    problem: Problem,
    regression: Regression,
    keys: tuple[str, ...],
    residual: FloatArray,
    level: Noise,
    outlier: BoolArray,
) -> tuple[tuple[Dependence, ...], float]:
    index = np.flatnonzero(problem.searchable)
    weight = np.where(outlier[index], 0.0, 1.0 / level.sigma)
    base = [b for b in regression.blocks if b.key in (*keys, *regression.always)]
    context = Projection(base, regression.y, weight)
    tests = dependences(regression.samples, residual[index], weight, context)
    return tests, _structure(residual[index][weight > 0], tests, level)


def _outweighs(regression: Regression, choice: Choice, key: str, structure: float) -> bool:
    """Return whether an effect is far larger than the structure that nothing explains."""
    if is_absorbed(regression, choice.adopted, key):
        return choice.evidence[key].gain > ABSORBED_GAIN
    ratio = 0.5 if regression.block(key).effect.geometric else 2.0
    return choice.evidence[key].unique > ratio * structure


def _structure(residual: FloatArray, tests: tuple[Dependence, ...], level: Noise) -> float:
    """Return the 3D rms [m] of what follows some condition or exceeds the repeats."""
    limit = _SURE / max(len(tests), 1)
    found = max((t.rms for t in tests if t.p_value < limit), default=0.0)
    if level.freedom:
        square = float(np.mean(residual**2))
        ratio = square / level.sigma**2
        if ratio > _F_RATIO and fdtrc(residual.size, level.freedom, ratio) < 1e-3:
            found = max(found, float(np.sqrt(3.0 * (square - level.sigma**2))))
    return found
