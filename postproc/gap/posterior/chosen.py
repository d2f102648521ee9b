"""The posterior of a campaign: rows, noise, candidates, sets; searched twice.

The second search stands where the first has brought the arm, knows which rows are sound under it,
and has the waves of joint angles that the first could not show.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.gap.effect import Setting, periodic_effect
from postproc.gap.fit import (
    HIGHEST,
    LEAST,
    LOWEST,
    STANDING,
    WIDE,
    Free,
    Noise,
    Problem,
    Source,
    Wave,
    find_waves,
    fit,
    gross_faults,
    noise_of,
)
from postproc.gap.posterior.classes import groups_of, moments_of
from postproc.gap.posterior.evidence import NoisePrior, Optimum
from postproc.gap.posterior.likelihood import (
    Linearised,
    candidates_of,
    pilot,
    row_roots,
    student,
)
from postproc.gap.posterior.prior import LOW_ORDER, Candidate, Equations, Sort, of_group, wander
from postproc.gap.posterior.search import Search, Subset, search
from postproc.gap.robot_model import effect_of, evaluate
from postproc.measurement import robust_sigma
from postproc.records import dataclass

USUAL_NOISE = 3e-5
"""Usual noise [m] of a reading where nothing tells it: trackers and their targets on arms."""
_DEVICE = 40.0
"""Freedom that an instrument's figure counts with."""
_UNUSUAL = -6.0
"""Logarithm of how seldom a cause has numbers that it may have, and does not usually."""
_CLEARLY = 4.0
"""Standard deviations from which a number is beyond a bound."""


@dataclass(frozen=True, slots=True)
class Posterior:
    """What the searched rows say.

    problem; level: noise; prior: the same as the search takes it; at: rows at their pose; weight:
    (n,) roots of Student weights of these; search: sets visited; moments: [s] at which steps were
    tried.
    """

    problem: Problem
    level: Noise
    prior: NoisePrior
    at: Linearised
    weight: FloatArray
    search: Search
    moments: FloatArray

    @property
    def best(self) -> Optimum:
        """The most probable set at its optimum."""
        return self.search.found[self.search.best]

    def candidate(self, key: str) -> Candidate:
        """Return a candidate by its key."""
        return self.search.equations.by_key[key]

    def of_sort(self, *sorts: Sort) -> Subset:
        """Return the keys of some sorts in the most probable set."""
        return tuple(k for k in self.search.best if self.candidate(k).sort in sorts)

    def moved(self, at: Optimum, keys: Iterable[str]) -> FloatArray:
        """Return what some candidates of a set move the searched rows by (n, 3) [m]."""
        total = np.zeros_like(self.at.z)
        for key in keys:
            part = at.part(self.search.equations, key)
            total += self.candidate(key).X @ at.theta[part]
        return total


def posterior(problem: Problem) -> Posterior:
    """Return the posterior of a campaign."""
    index = np.flatnonzero(problem.searchable)
    faults = index[gross_faults(problem.gap[index])]
    level = _level(problem, faults, float(np.median(np.abs(problem.gap[index]))))
    states, weight = pilot(problem, index, _prior(level))
    problem, states = problem.around(states)
    at = Linearised.at(problem, index, states)
    rest = problem.rest(evaluate(problem.samples.rows(index), states)[0], index)
    size = problem.size(rest, index)[weight > 0.0]
    level = _level(problem, faults, robust_sigma(size))
    return _again(_searched(problem, level, at, weight, (), ()))


def _again(first: Posterior) -> Posterior:
    """Search once more where the first search has brought the arm."""
    problem, index = first.problem, first.at.index
    best = first.best
    beside = first.moved(best, first.of_sort(Sort.CLASS, Sort.WANDER))
    free = free_of(first, first.of_sort(Sort.CAUSE, Sort.RESEMBLANCE))
    weight = problem.by(first.weight / best.sigma, index)
    samples = problem.samples.rows(index)
    found = fit(samples, problem.measured[index] - beside, weight, problem.given, free)
    rest = problem.measured[index] - beside - found.point
    size = problem.size(rest, index)
    sound = first.weight > 0.0
    sigma = max(robust_sigma(size[sound]), first.prior.sigma if first.level.known else LEAST)
    weight = np.where(sound, student(size / sigma), 0.0)
    at = Linearised.at(problem, index, found.states)
    waves = _waves(first, at, weight / sigma)
    return _searched(problem, first.level, at, weight, waves, (first.search.best,))


def _searched(
    problem: Problem,
    level: Noise,
    at: Linearised,
    weight: FloatArray,
    waves: Sequence[Wave],
    starts: Sequence[Subset],
) -> Posterior:
    prior, moments = _prior(level), moments_of(at.samples)
    settings = _settings(problem, at, waves)
    candidates = [*candidates_of(problem, at, settings), *_classes(at, moments)]
    candidates += _wanders(problem, level, at)
    equations = Equations.of(candidates, at.z, row_roots(problem, at.index, weight))
    known = set(equations.by_key)
    usual = [e for e in problem.effects if e.is_common]
    rigid = [e.name for e in usual if not e.equilibrium]
    tried = (*starts, [e.name for e in usual], rigid)
    starts = [tuple(k for k in s if k in known) for s in tried]

    def believed(found: Optimum) -> float:
        return sum(belief(problem, equations.by_key[k], found, equations) for k in found.keys)

    found = search(equations, prior, problem.always, starts, believed, len(at.index))
    return Posterior(problem, level, prior, at, weight, found, moments)


def belief(problem: Problem, candidate: Candidate, at: Optimum, equations: Equations) -> float:
    """Return the log prior of the signs and shapes of a candidate's numbers in a set [nats]."""
    if candidate.effect is None or candidate.lower is None or candidate.sort is not Sort.CAUSE:
        return 0.0
    theta, deviation = numbers(problem, candidate, at, equations)
    beyond = bool(np.any(theta + _CLEARLY * deviation < candidate.lower))
    if beyond or candidate.effect.objection(theta, deviation, problem.samples.arm):
        return -np.inf
    return _UNUSUAL if candidate.effect.is_unusual(theta, deviation) else 0.0


def numbers(
    problem: Problem, candidate: Candidate, at: Optimum, equations: Equations
) -> tuple[FloatArray, FloatArray]:
    """Return the numbers (p,) of an effect in a set and their standard deviations, SI."""
    root, part = candidate.root, at.part(equations, candidate.key)
    if root is None:
        raise ValueError("a class has no numbers")
    theta, variance = (
        root @ at.theta[part],
        np.sum((root @ at.covariance[part, part]) * root, axis=1),
    )
    known = problem.given.get(candidate.name)
    if known is not None and len(known.theta) == len(theta):
        theta = theta + np.nan_to_num(known.theta)
    return theta, np.sqrt(variance)


def free_of(of: Posterior, keys: Iterable[str], at: Optimum | None = None) -> dict[str, Free]:
    """Return the effects of some keys, and the frames, as a nonlinear fit takes them.

    It starts at their numbers in a set, the best one where none is given.
    """
    problem, at = of.problem, of.best if at is None else at
    equations = of.search.equations

    def start(*parts: Candidate) -> FloatArray:
        return np.concatenate([numbers(problem, c, at, equations)[0] for c in parts])

    free = {n: Free(problem.settings[n], WIDE, start(of.candidate(n))) for n in problem.always}
    by_name: dict[str, list[Candidate]] = {}
    for key in keys:
        by_name.setdefault(of.candidate(key).name, []).append(of.candidate(key))
    for name, parts in by_name.items():
        widen = np.concatenate([np.exp(at.log_scale[c.key])[c.family] for c in parts])
        settings = [c.setting or {} for c in parts]
        setting = settings[0] if len(settings) == 1 else effect_of(name).joined(settings)
        free[name] = Free(setting, widen, start(*parts))
    return free


def _prior(level: Noise) -> NoisePrior:
    if level.source is Source.ASSUMED:
        return NoisePrior(USUAL_NOISE, 0.0)
    freedom = float(level.freedom) if level.source is Source.REPEATS else _DEVICE
    return NoisePrior(max(level.white, LEAST), freedom)


def _level(problem: Problem, faults: IndexArray, rest: float) -> Noise:
    usable = problem.whole
    usable[faults] = False
    return noise_of(
        problem.samples, problem.gap, usable, problem.set_ups.unit, problem.instrument, rest
    )


def _settings(
    problem: Problem, at: Linearised, waves: Sequence[Wave]
) -> dict[str, list[tuple[str, Setting]]]:
    """Return the waves that are tried: low orders of each joint that turns, and some others."""
    effect = periodic_effect()
    if effect not in problem.effects or effect.name in problem.given:
        return {}
    turning = np.flatnonzero(np.ptp(at.samples.q, axis=0) > STANDING)
    every = [(int(j) + 1, float(n)) for j in turning for n in range(2, LOW_ORDER + 1)]
    # what was found beside others may be a whole order, or the overtone of one
    near = [(j, float(k)) for j, n in waves for k in (n, round(n), round(n / 2.0)) if k >= LOWEST]
    every += [wave for wave in dict.fromkeys(near) if wave not in every]
    return {
        effect.name: [
            (f"{effect.name}:{j}:{n:g}", {"waves": _with_overtone(j, n)}) for j, n in every
        ]
    }


def _with_overtone(joint: int, n: float) -> tuple[Wave, ...]:
    """Return a wave of a joint and the one of twice its periods: no gear errs in a pure sine."""
    return ((joint, n), (joint, 2.0 * n)) if 2.0 * n <= HIGHEST else ((joint, n),)


def _waves(first: Posterior, at: Linearised, weight: FloatArray) -> tuple[Wave, ...]:
    """Return the waves in what the most probable set without tables and waves leaves."""
    beside = [
        k
        for k in first.best.keys
        if (c := first.candidate(k)).effect is None or not (c.effect.on_demand or c.effect.periodic)
    ]
    scales = first.best
    X = [
        first.candidate(k).X * scales.deviation[scales.part(first.search.equations, k)]
        for k in beside
    ]
    columns = np.concatenate([np.zeros((len(at.z), 3, 0)), *X], axis=2)
    return find_waves(at.samples, at.z, weight, columns)


def _classes(at: Linearised, moments: FloatArray) -> list[Candidate]:
    return [of_group(g) for g in groups_of(at.samples, moments) if g.is_rival and g.X.shape[2]]


def _wanders(problem: Problem, level: Noise, at: Linearised) -> list[Candidate]:
    """Return the wanders that repeats let be noise."""
    parts = problem.wanders
    if level.source is Source.REPEATS:
        parts = tuple(w for w in parts if level.lets(level.white, w.scale))
    return wander((w.key, w.X[at.index]) for w in parts)
