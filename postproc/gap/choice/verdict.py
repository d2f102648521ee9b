"""Fit of the choice, tests of what is left, and what may still be named in the light of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.choice.classes import Part
from postproc.gap.choice.evidence import ABSORBED_GAIN, is_absorbed, numbers, only_by
from postproc.gap.choice.fitting import fitted, point_without
from postproc.gap.choice.residual import Dependence, dependences
from postproc.gap.choice.rivals import INEXACT
from postproc.gap.choice.selection import LOW_ORDERS, Prepared
from postproc.gap.choice.standing import Choice, Standing
from postproc.gap.effect import Effect
from postproc.gap.fit import (
    REST,
    Noise,
    NormalEquations,
    Problem,
    Projection,
    Regression,
    gross_faults,
    predicted,
)
from postproc.measurement import robust_sigma
from postproc.records import dataclass

STRUCTURE = 1.0
"""Structured rest, 3D root mean square, from which "explained" is no longer said, in sigma."""
_SURE = 1e-4
_F_RATIO = 1.35
"""Variance over that of the repeats from which the rest is more than noise, if significant."""
_DEVICE, _DEVICE_RATIO = 40, 2.0
"""The same of an instrument whose figure is believed as if it had that freedom."""
_BEYOND = 1.7
"""Structured rest, 3D root mean square, over the bound of an unknown noise per axis."""


@dataclass(frozen=True, slots=True)
class Assessment:
    """The choice that stands, and the tests of what it leaves.

    structure: 3D rms [m] of what is left and not noise; outlier: (n,) measuring faults. Tests and
    structure let the effects in that are too small to be named: they are no riddle.
    """

    choice: Choice
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
    index = np.flatnonzero(problem.searchable)
    full = fitted(problem, regression, choice.model, prepared.scatter, rows, index)
    rest = problem.measured[index] - full.point
    tests, structure = _tested(problem, regression, choice.model, rest, level, outlier)
    before = choice
    if structure > tolerated(choice, level.sigma):
        choice = _outweighing(regression, choice, structure)
    if choice is not before or choice.resembled:
        full = fitted(problem, regression, choice.model, prepared.scatter, rows, index)
        rest = problem.measured[index] - point_without(problem, full, choice.resembled, index)
        known = (*choice.adopted, *choice.unnamed)
        tests, left = _tested(problem, regression, known, rest, level, outlier)
        structure = max(left, structure)
    return Assessment(choice, tests, structure, outlier)


def verdict(assessment: Assessment, noise: Noise, rest: Sequence[Part] = ()) -> str:
    """Return ``explained``, ``no_gap``, ``unexplained`` or ``undetermined``.

    Where the noise is not known neither of the first two can be said; the third can, where more
    than any noise that the rows allow is left. Nor can they where readings of one pose scatter far
    more than the instrument is said to: something moves them that nobody logged.

    Args:
        assessment: what stands.
        noise: of the campaign.
        rest: what is left by its class.
    """
    choice = assessment.choice
    parts = float(np.sqrt(sum(part.rms**2 for part in rest)))
    left = max(assessment.structure, parts)
    if not noise.known:
        most = max(tolerated(choice, noise.sigma), _BEYOND * noise.upper)
        return "unexplained" if left > most else "undetermined"
    if choice.resembled or left > tolerated(choice, noise.sigma):
        return "unexplained"
    if noise.is_doubted:
        return "undetermined"
    return "explained" if choice.adopted else "no_gap"


def tolerated(choice: Choice, sigma: float) -> float:
    """Return the structured rest, 3D rms [m], up to which the adopted effects explain the gap."""
    largest = max((choice.evidence[k].unique for k in choice.adopted), default=0.0)
    return max(STRUCTURE * sigma, INEXACT * largest)


def unusual(
    regression: Regression, choice: Choice, rest: Sequence[Part], sigma: float
) -> dict[str, str]:
    """Return the named blocks with numbers that are seldom theirs, beside what overshadows them.

    Args:
        regression: rows and blocks.
        choice: what stands.
        rest: what is left by its class.
        sigma: noise [m] per axis.

    Returns:
        Why, by key.
    """
    keys = [
        key
        for key in choice.adopted
        if is_overshadowed(choice, key, regression.block(key).effect, rest, sigma)
    ]
    if not keys:
        return {}
    equations = regression.normal_equations()
    inside = (*regression.always, *choice.adopted, *choice.unnamed)
    return {
        key: "its numbers are seldom so, and more is left unexplained than it explains"
        for key, theta, deviation in numbers(regression, equations, inside)
        if key in keys and regression.block(key).effect.is_unusual(theta, deviation)
    }


def is_overshadowed(
    choice: Choice, key: str, effect: Effect, rest: Sequence[Part], sigma: float
) -> bool:
    """Return whether a name is no likelier than what is left unexplained beside it.

    So it is where more is left than only the name explains, and where a part of its own class is
    left that an inexact formula does not excuse: then the formula is not what that class follows.

    Args:
        choice: what stands.
        key: block of the name.
        effect: the name.
        rest: what is left by its class.
        sigma: noise [m] per axis.
    """
    unique = choice.evidence[key].unique
    own = sum(part.rms**2 for part in rest if part.kind in effect.classes)
    whole = sum(part.rms**2 for part in rest)
    return whole > unique**2 or own > max(STRUCTURE * sigma, INEXACT * unique) ** 2


def is_undecided(regression: Regression, choice: Choice, key: str) -> bool:
    """Return whether a name is one of a set that the rows do not decide in.

    So it is where another cause would do as well or a class better, where a table of angles is
    named beside waves, of which it may hold more, and where waves of low order are named beside a
    larger effect that follows a joint's own angle, as they do: its formula may be bent a little.

    Args:
        regression: blocks.
        choice: what stands.
        key: block of the name.
    """
    item, block = choice.evidence[key], regression.block(key)
    effects = [regression.block(k).effect for k in choice.adopted]
    beside_waves = block.effect.on_demand and any(effect.periodic for effect in effects)
    if item.confounded or item.rival or beside_waves:
        return True
    if not block.effect.periodic or all(n > LOW_ORDERS for _, n in block.setting["waves"]):
        return False
    return any(
        regression.block(k).effect.of_own_angle and choice.evidence[k].unique > item.unique
        for k in choice.adopted
    )


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
    gross = gross_faults(problem.gap)
    bad: BoolArray = np.asarray(left > 6.0 * usual)
    if bad[~gross].mean() > 0.06:
        bad &= left > np.quantile(left[~gross], 0.94)
    return np.asarray(bad | gross)


def _tested(
    problem: Problem,
    regression: Regression,
    keys: tuple[str, ...],
    residual: FloatArray,
    level: Noise,
    outlier: BoolArray,
) -> tuple[tuple[Dependence, ...], float]:
    index = np.flatnonzero(problem.searchable)
    weight = np.where(outlier[index], 0.0, 1.0 / (level.sigma * problem.relative[index]))
    base = [b for b in regression.blocks if b.key in (*keys, *regression.always)]
    wander = tuple(b for b in regression.memory if b.key != REST)
    context = Projection((*base, *wander), regression.y, weight)
    rest = residual
    if wander:
        equations = NormalEquations.of(wander, rest, weight, tuple(b.key for b in wander))
        rest = rest - predicted(wander, equations.noise_of(()))
    tests = dependences(regression.samples, rest, weight, context)
    # a wander that repeats have shown is noise, one that only the rows ask for is not
    if level.freedom:
        return tests, _structure(residual[weight > 0], tests, level.sigma, level)
    return tests, _structure(rest[weight > 0], tests, level.white, level)


def _outweighing(regression: Regression, choice: Choice, structure: float) -> Choice:
    """Return a choice without the names that are not far larger than what nothing explains.

    One after the other, the least first and what refines another before that: two that share what
    they explain are each small beside the other, and what is left by one is the other's.
    """
    equations = regression.equations_at(np.arange(len(regression.y)))
    while True:
        weak = [k for k in choice.adopted if not _outweighs(regression, choice, k, structure)]
        refined = {name for k in weak for name in regression.block(k).effect.refines}
        first = [k for k in weak if regression.name(k) not in refined]
        if not first:
            return choice
        least = min(first, key=lambda k: (choice.evidence[k].unique, k))
        why = {regression.name(least): "what is left may be imitating it"}
        choice = choice.moved([least], Standing.REJECTED, why)
        inside = (*regression.always, *choice.model)
        evidence = {
            k: replace(item, unique=only_by(regression, equations, inside, (k,)))
            for k, item in choice.evidence.items()
            if k in inside
        }
        choice = replace(choice, evidence={**choice.evidence, **evidence})


def _outweighs(regression: Regression, choice: Choice, key: str, structure: float) -> bool:
    """Return whether an effect is far larger than the structure that nothing explains."""
    if is_absorbed(regression, choice.adopted, key):
        return choice.evidence[key].gain > ABSORBED_GAIN
    ratio = 0.5 if regression.block(key).effect.geometric else 2.0
    return choice.evidence[key].unique > ratio * structure


def _structure(
    residual: FloatArray, tests: tuple[Dependence, ...], sigma: float, level: Noise
) -> float:
    """Return the 3D rms [m] of what follows some condition or exceeds a noise [m] per axis."""
    from scipy.special import fdtrc

    limit = _SURE / max(len(tests), 1)
    found = max((t.rms for t in tests if t.p_value < limit), default=0.0)
    if level.known:
        square = float(np.mean(residual**2))
        ratio = square / sigma**2
        freedom, most = (level.freedom, _F_RATIO) if level.freedom else (_DEVICE, _DEVICE_RATIO)
        if ratio > most and fdtrc(residual.size, freedom, ratio) < 1e-3:
            found = max(found, float(np.sqrt(3.0 * (square - sigma**2))))
    return found
