"""What rows say of numbers: readings at the pose that the arm really takes, weights, noise.

The forward model is the exact one. Columns are taken where a first joint fit of everything that
turns or bends the arm has brought it, never at the nominal pose: half a degree at a shoulder moves
the point by a tenth of a millimetre more than its column says.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, Kind, Setting, State
from postproc.gap.fit import WIDE, Free, Problem, fit, gross_faults
from postproc.gap.posterior.evidence import NoisePrior, optimum
from postproc.gap.posterior.prior import Candidate, Equations, of_effect
from postproc.gap.robot_model import States, columns, effect_of, evaluate
from postproc.measurement import robust_sigma
from postproc.records import dataclass

_LOOSE = float(np.exp(2.0))
"""Widening of the priors of the geometry in the first fit: it may be of any size."""
_FREEDOM = 4.0
"""Of the Student distribution that rows are weighed by."""
_ROUNDS = 3
_FINEST = 5e-6


@dataclass(frozen=True, slots=True)
class Linearised:
    """Rows (n,) of a problem at the pose that some states bring the arm to.

    index: rows of the problem; samples: at that pose; z: (n, 3) what all numbers together move the
    points by [m], to first order: zero numbers are the given model; states: of that fit.
    """

    index: IndexArray
    samples: Samples
    z: FloatArray
    states: States

    @classmethod
    def at(cls, problem: Problem, index: IndexArray, states: States) -> Linearised:
        """Return rows at the pose that states bring the arm to."""
        part = problem.samples.rows(index)
        point, actual = evaluate(part, states)
        z = problem.rest(point, index)
        for name, state in states.items():
            moved = _change(problem, name, state)
            if np.any(moved):
                X = columns(actual, effect_of(name).basis(actual, state.setting))
                z = z + problem.onto(X @ moved, index)
        return cls(index, actual, z, states)


def _change(problem: Problem, name: str, state: State) -> FloatArray:
    """Return the numbers of an effect beyond those that the given model has."""
    known = problem.given.get(name)
    theta = np.nan_to_num(state.theta)
    if known is None or len(known.theta) != len(theta):
        return theta
    return theta - np.nan_to_num(known.theta)


def pilot(problem: Problem, index: IndexArray, noise: NoisePrior) -> tuple[States, FloatArray]:
    """Return the states of a first fit of all that moves the arm much, and weights (n,) of rows.

    First frames and geometry, of any size; then all, at the scales that the rows ask for.

    Args:
        problem: the campaign.
        index: rows to fit.
        noise: what is known of it.
    """
    samples, measured = problem.samples.rows(index), problem.measured[index]
    effects = [e for e in problem.effects if _moves_much(e)]
    widen: dict[str, FloatArray | float] = {
        e.name: WIDE if e.name in problem.always else _LOOSE if e.geometric else 1.0
        for e in effects
    }
    weight = np.where(gross_faults(problem.gap[index]), 0.0, 1.0)
    states, sigma = problem.given, 1e-3
    for turn in range(_ROUNDS):
        some = [e for e in effects if turn or e.geometric]
        free = {e.name: _free(problem, e, widen[e.name], states) for e in some}
        by = problem.by(weight / max(sigma, noise.sigma), index)
        found = fit(samples, measured, by, problem.given, free)
        states = found.states
        size = problem.size(measured - found.point, index)
        sigma = max(robust_sigma(size[weight > 0.0]), _FINEST)
        weight = np.where(weight > 0.0, student(size / sigma), 0.0)
        if turn + 1 == _ROUNDS:
            break
        at = Linearised.at(problem, index, states)
        own = [c for c in candidates_of(problem, at, {}) if c.name in widen and c.key == c.name]
        equations = Equations.of(own, at.z, row_roots(problem, index, weight))
        best = optimum(equations, [c.key for c in own], noise)
        for c in own:
            if not c.fixed:
                widen[c.name] = np.exp(best.log_scale[c.key])[c.family]
    return states, weight


def student(size: FloatArray) -> FloatArray:
    """Return the roots (n,) of the Student weights of rests (n,) in sigma."""
    return np.asarray(np.sqrt((_FREEDOM + 3.0) / (_FREEDOM + size**2)))


def _moves_much(effect: Effect) -> bool:
    is_plain = not (effect.periodic or effect.on_demand or effect.is_rare)
    return is_plain and effect.kind in (Kind.MACHINE, Kind.REGISTRATION)


def _free(problem: Problem, effect: Effect, widen: float | FloatArray, start: States) -> Free:
    name = effect.name
    state = start.get(name)
    setting = problem.settings[name] if state is None else state.setting
    return Free(setting, widen, None if state is None else np.nan_to_num(state.theta))


def candidates_of(
    problem: Problem, at: Linearised, settings: Mapping[str, Sequence[tuple[str, Setting]]]
) -> list[Candidate]:
    """Return the candidates of all effects that can be tested, at a pose.

    Args:
        problem: the campaign.
        at: rows at their pose.
        settings: of effects whose variants are sought in the rows: key and setting of each.
    """
    found = []
    for effect in problem.effects:
        always = effect.name in problem.always
        variants: Mapping[str, Setting]
        if effect.name in settings:
            variants = dict(settings[effect.name])
        elif effect.periodic:
            continue
        elif effect.name in problem.given:
            variants = {effect.name: problem.given[effect.name].setting}
        else:
            variants = effect.variants(problem.settings[effect.name])
        found += [of_effect(effect, at.samples, s, key, always) for key, s in variants.items()]
    return found


def row_roots(problem: Problem, index: IndexArray, weight: FloatArray) -> FloatArray:
    """Return the root (n, 3, 3) of the relative weight of rows: sd of readings, and how sound."""
    root = problem.by(np.where(weight > 0.0, weight, 0.0), index)
    return root if root.ndim == 3 else root[:, None, None] * np.eye(3)
