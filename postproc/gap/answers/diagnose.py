"""The diagnosis: which effects, how sure, what is left, and how far the gap shrinks."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.gap.answers.designs import is_worse, refusals
from postproc.gap.choice import (
    Assessment,
    Choice,
    Dependence,
    Prepared,
    RestPart,
    Standing,
    assess,
    beaten,
    displaced,
    elusive,
    fitted,
    named,
    prepare,
    select,
    unexplained,
    unusual,
    verdict,
    wandering,
    without_waves,
)
from postproc.gap.fit import (
    REST,
    Fit,
    Memory,
    Noise,
    Problem,
    Regression,
    Wave,
    block_of,
    deviations,
    find_waves,
)
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

    level: the noise and what it rests on; memory: correlated noise and smooth rest of the rows;
    baseline: (n, 3) points of the given model with the registration [m]; fit: of all rows, points
    and frames those of the adopted effects; residual: (n, 3) [m]; total: 3D rms [m] on rows not
    fitted before and after all adopted effects, and the 90 % interval of the shrinkage; held_out:
    how these rows were kept apart; extra: for each effect not adopted the 3D rms [m] on rows not
    fitted without and with it; deviation: standard deviations (p,) of each adopted effect's
    numbers; unexplained: what the rest is a function of; ripple: waves in what is left where the
    verdict is "unexplained"; transfer: by effect and design what it brings there [nats].
    """

    problem: Problem
    verdict: str
    level: Noise
    memory: Memory
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
    held_out: str
    extra: dict[str, tuple[float, float]]
    unexplained: tuple[RestPart, ...]
    ripple: tuple[Wave, ...]
    regression: Regression

    @property
    def noise(self) -> float:
        """Noise [m] per axis, as far as it is known; else what rows were weighed with."""
        return self.level.sigma

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
    regression, choice, reasons = _chosen(problem, prepared)
    say(2, 4, "what is left")
    assessed = assess(problem, prepared, regression, choice)
    choice = assessed.choice.moved((), Standing.REJECTED, reasons)
    sizes = {key: choice.evidence[key].unique for key in choice.adopted}
    gone = displaced(regression, sizes, (*choice.adopted, *choice.unnamed))
    why = {regression.name(key): reason for key, reason in gone.items()}
    choice = choice.moved(gone, Standing.REJECTED, why)
    ripple, rest = _left(regression, choice, prepared.noise)
    strange = unusual(regression, choice, rest, sigma)
    if strange:
        why = {regression.name(key): reason for key, reason in strange.items()}
        choice = choice.moved(strange, Standing.REJECTED, why)
        ripple, rest = _left(regression, choice, prepared.noise)
    assessed = replace(assessed, choice=choice)
    answer = verdict(assessed, prepared.noise, rest)
    say(3, 4, "sealed rows")
    apart = _Apart(problem, regression, assessed, prepared.scatter)
    steps, total = apart.steps()
    whole = _thinned(~assessed.outlier)
    final = named(problem, regression, choice, prepared.scatter, whole)
    base = fitted(problem, regression, (), prepared.scatter, whole)
    return Diagnosis(
        problem=problem,
        verdict=answer,
        level=prepared.noise,
        memory=prepared.memory,
        outlier=assessed.outlier,
        choice=choice,
        adopted=tuple(step.name for step in steps),
        fit=final,
        deviation=deviations(regression, final, choice.adopted, choice.unnamed),
        baseline=base.point,
        residual=problem.measured - final.point,
        tests=assessed.tests,
        structure=assessed.structure,
        steps=steps,
        total=total,
        held_out="sealed" if np.any(problem.split.sealed) else "folds",
        extra=_extra(problem, regression, assessed),
        unexplained=() if answer in ("explained", "no_gap") else rest,
        ripple=ripple if answer == "unexplained" else (),
        regression=regression,
    )


def _left(
    regression: Regression, choice: Choice, noise: Noise
) -> tuple[tuple[Wave, ...], tuple[RestPart, ...]]:
    """Return the waves in what a choice leaves, and what that is a function of."""
    ripple = _ripple(regression, choice)
    rest = unexplained(regression, (*choice.adopted, *choice.unnamed), ripple)
    return ripple, wandering(noise, rest)


def _chosen(problem: Problem, prepared: Prepared) -> tuple[Regression, Choice, dict[str, str]]:
    """Return the choice in which every name holds, and why others do not.

    A name goes where its effect does harm on rows that it was not fitted to, or where a class of
    which it is no cause explains more in its place; then all is chosen anew without it.
    """
    start = prepared.regression
    reasons: dict[str, str] = {}
    for _ in range(_ROUNDS):
        regression, choice = select(start)
        refused = _refused(problem, regression, choice)
        reasons |= refused
        if not refused:
            break
        start = start.without(refused)
    else:
        regression, choice = select(start)
        refused = _refused(problem, regression, choice)
        reasons |= refused
        keys = [k for k in choice.adopted if regression.name(k) in refused]
        choice = choice.moved(keys, Standing.REJECTED, refused)
    if choice.adopted and is_worse(regression, choice):
        worse = dict.fromkeys((regression.name(k) for k in choice.adopted), _WORSE)
        choice = choice.moved(choice.adopted, Standing.REJECTED, worse)
        reasons |= worse
    return regression, choice, reasons


def _refused(problem: Problem, regression: Regression, choice: Choice) -> dict[str, str]:
    """Return the names that do not hold, and why."""
    refused = dict.fromkeys(refusals(problem, regression, choice), _HARM)
    refused |= elusive(regression, choice)
    if refused:
        return refused
    rivals = beaten(regression, choice.adopted, choice.model)
    return {regression.name(key): why for key, why in rivals.items()}


_ROUNDS = 2
"""How often all is chosen anew without names that do not hold; then these just go."""
_HARM = "makes rows worse that it was not fitted to"
_WORSE = "the model as a whole makes rows worse that it was not fitted to"
LARGEST_FIT = 4000
"""Rows that the numbers of the model file are fitted to; more make them no surer."""


def _thinned(rows: BoolArray) -> BoolArray:
    index = np.flatnonzero(rows)
    kept = index[:: -(-len(index) // LARGEST_FIT)]
    out = np.zeros(len(rows), dtype=bool)
    out[kept] = True
    return out


@dataclass(slots=True)
class _Apart:
    """Rows that were not fitted, once, when everything else is decided.

    The sealed ones where there are any; else every row, left out in turn with its fold.
    """

    problem: Problem
    regression: Regression
    assessed: Assessment
    sigma: float

    def steps(self) -> tuple[tuple[Step, ...], tuple[float, float, float, float]]:
        """Add the adopted effects one by one, and compare.

        Each step adds the effect that removes most of what is left on fitted rows, and says how
        far the whole gap shrinks by that; the steps multiply to the whole shrinkage.
        """
        choice = self.assessed.choice
        test = ~self.assessed.outlier
        if np.any(self.problem.split.sealed):
            test = test & self.problem.split.sealed
        cluster = self.problem.split.cluster[test]
        nothing = choice.moved(choice.model, Standing.REJECTED, {})
        first = before = self._left(nothing)[test]
        order = _ordered(self.regression, choice)
        steps = []
        for count, key in enumerate(order, start=1):
            part = choice.moved(order[count:], Standing.REJECTED, {})
            after = self._left(part)[test]
            interval = shrink_interval(before, after, cluster)
            steps.append(Step(self.regression.name(key), rms(before), rms(after), interval))
            before = after
        last = before
        return tuple(steps), (rms(first), rms(last), *shrink_interval(first, last, cluster))

    def _left(self, choice: Choice) -> FloatArray:
        """Return how far each row (n,) is missed [m] by a choice fitted without it.

        Where there are sealed rows it is told of those alone, and NaN elsewhere.
        """
        problem, fold = self.problem, self.problem.split.fold
        rows = problem.searchable & ~self.assessed.outlier
        sealed = np.flatnonzero(problem.split.sealed)
        if len(sealed):
            point = named(problem, self.regression, choice, self.sigma, rows, sealed).point
            left = np.full(len(problem), np.nan)
            left[sealed] = np.linalg.norm(problem.measured[sealed] - point, axis=1)
            return left
        out = np.zeros(len(problem))
        for k in np.unique(fold):
            point = named(problem, self.regression, choice, self.sigma, rows & (fold != k)).point
            out[fold == k] = np.linalg.norm(problem.measured - point, axis=1)[fold == k]
        return out


def _ordered(regression: Regression, choice: Choice) -> list[str]:
    """Return the adopted blocks, most helpful next on the rows that are fitted."""
    equations = regression.equations_at(np.arange(len(regression.y)))
    order: list[str] = []
    waiting = sorted(choice.adopted)
    while len(waiting) > 1:
        coming = {regression.name(key) for key in waiting}
        free = [k for k in waiting if coming.isdisjoint(regression.block(k).effect.refines)]
        best = min(free, key=lambda k: (equations.left((*regression.always, *order, k)), k))
        order.append(best)
        waiting.remove(best)
    return [*order, *waiting]


def _extra(
    problem: Problem, regression: Regression, assessed: Assessment
) -> dict[str, tuple[float, float]]:
    """Return what each further effect would do on sealed rows, to first order."""
    test = ~assessed.outlier
    if np.any(problem.split.sealed):
        test = test & problem.split.sealed
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
    base += [b for b in regression.memory if b.key != REST]
    return find_waves(regression.samples, regression.y, regression.weight, base)


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
