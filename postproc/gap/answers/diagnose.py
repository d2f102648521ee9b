"""The diagnosis: which effects, how sure, what is left, and how far the gap shrinks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import stdtrit

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.choice import (
    Assessment,
    Choice,
    Dependence,
    Standing,
    assess,
    fitted,
    prepare,
    select,
    verdict,
    without_waves,
)
from postproc.gap.fit import Fit, Problem, Regression, Wave, block_of, deviations, find_waves
from postproc.gap.robot_model import evaluate
from postproc.progress import Progress


@dataclass(frozen=True, slots=True)
class Step:
    """What one adopted effect does on sealed rows: 3D rms [m] before and once it is added.

    Both of the whole measured difference; the effects listed before it are in the model.
    """

    name: str
    before: float
    after: float
    interval: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of a diagnosis, SI. Rows refer to those of ``problem``.

    noise: [m] per axis, from ``noise_freedom`` degrees of freedom of repeats (0: estimated);
    baseline: (n, 3) points of the given model with the registration [m]; residual: (n, 3) [m];
    total: 3D rms [m] on sealed rows before and after all adopted effects, and the 90 % interval
    of the shrinkage; extra: for each effect not adopted the 3D rms [m] on sealed rows without and
    with it; deviation: standard deviations (p,) of each adopted effect's numbers; ripple: waves
    in what is left where the verdict is "unexplained".
    """

    problem: Problem
    verdict: str
    noise: float
    noise_freedom: int
    outlier: BoolArray
    choice: Choice
    adopted: tuple[str, ...]
    fit: Fit
    deviation: dict[str, FloatArray]
    baseline: FloatArray
    residual: FloatArray
    tests: tuple[Dependence, ...]
    structure: float
    steps: tuple[Step, ...]
    total: tuple[float, float, float, float]
    extra: dict[str, tuple[float, float]]
    ripple: tuple[Wave, ...]
    regression: Regression

    @property
    def resembled(self) -> tuple[str, ...]:
        """Alternatives that the gap behaves like."""
        return tuple(self.regression.name(key) for key in self.choice.resembled)

    @property
    def kept(self) -> BoolArray:
        """(n,) rows that are no measuring faults."""
        return ~self.outlier


def diagnose(problem: Problem, progress: Progress | None = None) -> Diagnosis:
    """Return the diagnosis of a campaign."""
    say = progress or (lambda done, total, what: None)
    say(0, 4, "noise and measuring faults")
    prepared = prepare(problem)
    say(1, 4, "which effects")
    sigma = prepared.noise.sigma
    start = prepared.regression
    while True:
        regression, choice = select(start)
        say(2, 4, "what is left")
        assessed = assess(problem, prepared, regression, choice)
        say(3, 4, "sealed rows")
        rows = problem.searchable & ~assessed.outlier
        base = fitted(problem, regression, (), sigma, rows)
        worse = _worse(problem, regression, assessed, sigma, base)
        if not worse:
            break
        start = start.without(worse)
    steps, total = _steps(problem, regression, assessed, sigma, base)
    answer = verdict(assessed, sigma)
    reasons = dict.fromkeys(start.excluded, "makes rows worse that were not fitted")
    choice = assessed.choice.moved((), Standing.REJECTED, reasons)
    return Diagnosis(
        problem=problem,
        verdict=answer,
        noise=sigma,
        noise_freedom=prepared.noise.freedom,
        outlier=assessed.outlier,
        choice=choice,
        adopted=tuple(step.name for step in steps),
        fit=assessed.fit,
        deviation=deviations(regression, assessed.fit, choice.adopted, choice.unnamed),
        baseline=base.point,
        residual=assessed.residual,
        tests=assessed.tests,
        structure=assessed.structure,
        steps=steps,
        total=total,
        extra=_extra(problem, regression, assessed),
        ripple=_ripple(regression, choice) if answer == "unexplained" else (),
        regression=regression,
    )


def _steps(
    problem: Problem, regression: Regression, assessed: Assessment, sigma: float, base: Fit
) -> tuple[tuple[Step, ...], tuple[float, float, float, float]]:
    """Add the adopted effects one by one, refit on unsealed rows, compare on sealed ones.

    Each step adds the effect that removes most of what is left on unsealed rows, and says how far
    the whole gap shrinks by that; the steps multiply to the whole shrinkage.
    """
    test = problem.split.sealed & ~assessed.outlier
    cluster = problem.split.cluster[test]
    last = _left(assessed.residual, test)
    first = before = _left(problem.measured - base.point, test)
    steps = []
    for key, part in _ordered(problem, regression, assessed, sigma):
        after = last if part is None else _left(problem.measured - part.point, test)
        interval = shrink_interval(before, after, cluster)
        steps.append(Step(regression.name(key), rms(before), rms(after), interval))
        before = after
    return tuple(steps), (rms(first), rms(last), *shrink_interval(first, last, cluster))


def _ordered(
    problem: Problem, regression: Regression, assessed: Assessment, sigma: float
) -> list[tuple[str, Fit | None]]:
    """Return the adopted effects, most helpful next, each with the fit of it and those before.

    The fit of them all is that of the diagnosis: None stands for it.
    """
    rows = problem.searchable & ~assessed.outlier
    order: list[tuple[str, Fit | None]] = []
    waiting = sorted(assessed.choice.adopted)
    while len(waiting) > 1:
        taken = tuple(key for key, _ in order)
        coming = {regression.name(key) for key in waiting}
        free = [k for k in waiting if coming.isdisjoint(regression.block(k).effect.refines)]
        fits = {key: fitted(problem, regression, (*taken, key), sigma, rows) for key in free}
        best = min(free, key=lambda k: (rms(_left(problem.measured - fits[k].point, rows)), k))
        order.append((best, fits[best]))
        waiting.remove(best)
    return [*order, *((key, None) for key in waiting)]


def _worse(
    problem: Problem, regression: Regression, assessed: Assessment, sigma: float, base: Fit
) -> set[str]:
    """Return the adopted effects without which sealed rows come out better."""
    rows = problem.searchable & ~assessed.outlier
    test = problem.split.sealed & ~assessed.outlier
    after = rms(_left(assessed.residual, test))
    keys = assessed.choice.adopted
    found = set()
    for key in keys:
        rest = tuple(k for k in keys if k != key)
        part = fitted(problem, regression, rest, sigma, rows) if rest else base
        if after > rms(_left(problem.measured - part.point, test)):
            found.add(regression.name(key))
    return found


def _extra(
    problem: Problem, regression: Regression, assessed: Assessment
) -> dict[str, tuple[float, float]]:
    """Return what each further effect would do on sealed rows, to first order."""
    test = problem.split.sealed & ~assessed.outlier
    index = np.flatnonzero(test)
    if len(index) == 0:
        return {}
    actual = evaluate(problem.samples.rows(index), problem.given)[1]
    chosen_keys = (*regression.always, *assessed.choice.adopted)
    equations = regression.normal_equations()
    far = {
        b.key: block_of(b.effect, actual, b.setting, b.key, problem.widen(b.name)).X
        for b in regression.blocks
        if not b.is_alternative
    }
    y = problem.gap[index]

    def left(keys: tuple[str, ...]) -> float:
        theta = equations.solve(keys)[0]
        X = np.concatenate([far[k] for k in keys] or [np.zeros((len(y), 3, 0))], axis=2)
        return rms(np.linalg.norm(y - X @ theta, axis=1))

    before = left(chosen_keys)
    named = {b.name for b in regression.blocks if b.key in chosen_keys}
    return {
        b.name: (before, left((*chosen_keys, b.key)))
        for b in regression.blocks
        if b.name not in named and not b.is_alternative
    }


def _ripple(regression: Regression, choice: Choice) -> tuple[Wave, ...]:
    """Return the waves of joint angles in what is left."""
    base = without_waves(regression, choice) + [
        b for b in regression.blocks if b.effect.periodic and b.key in choice.adopted
    ]
    return find_waves(regression.samples, regression.y, regression.weight, base)


def _left(residual: FloatArray, test: BoolArray) -> FloatArray:
    return np.asarray(np.linalg.norm(residual, axis=1)[test])


def shrink_interval(
    before: FloatArray, after: FloatArray, cluster: IntArray, draws: int = 400
) -> tuple[float, float]:
    """Return the 90 % interval of the shrinkage on as many new poses of the same kind.

    Pose clusters are drawn anew for the scatter of the logarithm of what remains; new poses
    scatter as much as those that were measured, hence the root of two.

    Args:
        before: (n,) distances without the effects [m].
        after: (n,) with them [m].
        cluster: (n,) cluster of each row.
        draws: how often the clusters are drawn.
    """
    names, index = np.unique(cluster, return_inverse=True)
    k = len(names)
    if k < 2:
        return 0.0, 0.0
    rng = np.random.default_rng(3)
    sums = np.stack([np.bincount(index, v**2, minlength=k) for v in (before, after)])
    total = rng.multinomial(k, np.full(k, 1.0 / k), draws) @ sums.T
    left = 0.5 * np.log(np.maximum(total[:, 1], 1e-30) / np.maximum(total[:, 0], 1e-30))
    whole = np.maximum(np.sum(sums, axis=1), 1e-30)
    here = 0.5 * float(np.log(whole[1] / whole[0]))
    half = float(np.sqrt(2.0) * stdtrit(k - 1, 0.95) * np.std(left))
    return 1.0 - float(np.exp(here + half)), 1.0 - float(np.exp(here - half))


def rms(values: FloatArray) -> float:
    """Return the root mean square, NaN of nothing."""
    return float(np.sqrt(np.mean(values**2))) if len(values) else float("nan")
