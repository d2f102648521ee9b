"""The diagnosis: which effects, how sure, what is left, and how far the gap shrinks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.answers.designs import is_worse, refusals
from postproc.gap.answers.shrinkage import Apart, Step, rms
from postproc.gap.choice import (
    Choice,
    Dependence,
    Prepared,
    RestPart,
    Standing,
    assess,
    beaten,
    displaced,
    doubted,
    elusive,
    prepare,
    prepared_with,
    select,
    uneven,
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
    design_matrix,
    deviations,
    find_waves,
)
from postproc.progress import Progress
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Diagnosis:
    """Result of a diagnosis, SI. Rows refer to those of ``problem``.

    level: the noise and what it rests on; memory: correlated noise and smooth rest of the rows;
    baseline: (n, 3) points of the given model with the registration [m]; fit: of all rows, points
    and frames those of the adopted effects; residual: (n, 3) [m]; total: 3D rms [m] on rows left
    out, before and after all adopted effects, and the 90 % interval of the shrinkage; held: (k, 2)
    the same of each row kept [m]; sealed: the
    same two of the sealed rows, NaN without such; extra: for each effect not adopted the 3D rms [m]
    on rows left out, without and with it; deviation: standard deviations (p,) of each adopted
    effect's numbers; unexplained: what the rest is a function of; ripple: waves in what is left
    where the verdict is "unexplained"; transfer: by effect and design what it brings there [nats].
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
    held: FloatArray
    sealed: tuple[float, float]
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
    prepared, regression, choice, reasons = _chosen(problem, prepared)
    sigma = prepared.noise.sigma
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
    choice = doubted(regression, choice)
    assessed = replace(assessed, choice=choice)
    answer = verdict(assessed, prepared.noise, rest)
    say(3, 4, "rows left out")
    apart = Apart.of(problem, regression, choice, prepared.scatter, ~assessed.outlier)
    final = apart.fit
    return Diagnosis(
        problem=problem,
        verdict=answer,
        level=prepared.noise,
        memory=prepared.memory,
        outlier=assessed.outlier,
        choice=choice,
        adopted=tuple(step.name for step in apart.steps),
        fit=final,
        deviation=deviations(regression, final, choice.adopted, choice.unnamed),
        baseline=apart.baseline,
        residual=problem.measured - final.point,
        tests=assessed.tests,
        structure=assessed.structure,
        steps=apart.steps,
        total=apart.total,
        held=apart.held,
        sealed=apart.sealed,
        extra=_extra(regression, choice),
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
    return ripple, wandering(noise, (*rest, *uneven(regression, choice)))


def _chosen(
    problem: Problem, prepared: Prepared
) -> tuple[Prepared, Regression, Choice, dict[str, str]]:
    """Return the choice in which every name holds, and why others do not.

    A name goes where its effect does harm on rows that it was not fitted to, or where a class of
    which it is no cause explains more in its place; then all is chosen anew without it. So it is
    where a candidate that was found late leaves far less scatter than the rows were weighed with.
    """
    reasons: dict[str, str] = {}
    regression, choice = select(prepared.regression)
    known = {block.key for block in prepared.regression.blocks}
    if any(key not in known for key in choice.adopted):
        again = prepared_with(problem, prepared, regression.blocks)
        if again is not prepared:
            prepared = again
            regression, choice = select(prepared.regression)
    start = prepared.regression
    for _ in range(_ROUNDS):
        refused = _refused(problem, regression, choice)
        reasons |= refused
        if not refused:
            break
        start = start.without(refused)
        regression, choice = select(start)
    else:
        refused = _refused(problem, regression, choice)
        reasons |= refused
        keys = [k for k in choice.adopted if regression.name(k) in refused]
        choice = choice.moved(keys, Standing.REJECTED, refused)
    if choice.adopted and is_worse(regression, choice):
        worse = dict.fromkeys((regression.name(k) for k in choice.adopted), _WORSE)
        choice = choice.moved(choice.adopted, Standing.REJECTED, worse)
        reasons |= worse
    return prepared, regression, choice, reasons


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
_WORSE = "the model as a whole is not clearly better on rows that it was not fitted to"


def _extra(regression: Regression, choice: Choice) -> dict[str, tuple[float, float]]:
    """Return what each further effect would do on places not fitted, to first order."""
    chosen = (*regression.always, *choice.adopted)
    whole = regression.equations_at(np.arange(len(regression.y)))
    parts = [(rows, whole.minus(regression.equations_at(rows))) for rows in regression.fold_rows()]

    def left(keys: tuple[str, ...]) -> float:
        X = design_matrix([regression.block(k) for k in keys], len(regression.y))
        miss = [regression.y[rows] - X[rows] @ others.numbers(keys) for rows, others in parts]
        return rms(np.concatenate([np.zeros(0), *(np.linalg.norm(m, axis=1) for m in miss)]))

    before = left(chosen)
    named = {regression.name(key) for key in chosen}
    return {
        b.name: (before, left((*chosen, b.key)))
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
