"""The fit of a choice: frames, names and what they resemble, and the same without some rows."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray, Rows
from postproc.gap.choice.standing import Choice
from postproc.gap.effect import State
from postproc.gap.fit import (
    REST,
    Block,
    Fit,
    Free,
    NormalEquations,
    Problem,
    Regression,
    block_of,
    fit,
    moved_points,
    predicted,
    without_blocks,
)
from postproc.gap.robot_model import effect_of, evaluate
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Named:
    """The fit of a choice to some rows (n,), of which the named effects alone are kept.

    Alternatives are fitted beside them, and do not stay: then the frames are fitted once more to
    what does. full: of everything; fit: points (n, 3) and frames of the named effects alone.
    """

    problem: Problem
    regression: Regression
    sigma: float
    rows: BoolArray
    keys: tuple[str, ...]
    full: Fit
    fit: Fit

    @classmethod
    def of(
        cls,
        problem: Problem,
        regression: Regression,
        choice: Choice,
        sigma: float,
        rows: BoolArray,
    ) -> Named:
        """Fit a choice to some rows (n,)."""
        keys = (*choice.adopted, *choice.resembled)
        full = fitted(problem, regression, keys, sigma, rows)
        if not choice.resembled:
            return cls(problem, regression, sigma, rows, keys, full, full)
        gone = {*problem.always, *(regression.name(k) for k in choice.resembled)}
        states = dict(problem.given) | {n: s for n, s in full.states.items() if n not in gone}
        if problem.always:
            index = np.flatnonzero(rows)
            weight = 1.0 / (sigma * problem.relative[index])
            part = problem.samples.rows(index)
            frames = fit(part, problem.measured[index], weight, states, _frames(problem))
            states |= {n: frames.states[n] for n in problem.always}
        kept = replace(full, states=states, point=evaluate(problem.samples, states)[0])
        return cls(problem, regression, sigma, rows, keys, full, kept)

    def missed(self, label: IntArray) -> FloatArray:
        """Return how far each row (n,) is missed [m] by the fit without the rows of its label.

        Args:
            label: (n,) 0..k-1.
        """
        problem, samples, states = self.problem, self.problem.samples, self.full.states
        weight = np.where(self.rows, 1.0 / (self.sigma * problem.relative), 0.0)
        free, rest = _free(problem, self.regression, self.keys), self._left(weight)
        by = without_blocks(samples, states, free, rest, weight, label)
        ends = np.cumsum([len(states[name].theta) for name in free])
        parts = dict(zip(free, np.split(by, ends[:-1], axis=1), strict=True)) if free else {}
        again = _frames(problem) if self.full is not self.fit else {}
        stays = {n: part for n, part in parts.items() if n in self.fit.states and n not in again}
        moved = moved_points(samples, states, stays, np.hstack([by[:, :0], *stays.values()]))
        if again:
            rest = problem.measured - self.fit.point
            by = without_blocks(samples, self.fit.states, again, rest, weight, label, moved)
            moved = moved + moved_points(samples, self.fit.states, again, by)
        left = problem.measured - self.fit.point - moved[label, np.arange(len(label))]
        return np.asarray(np.linalg.norm(left, axis=1))

    def _left(self, weight: FloatArray) -> FloatArray:
        """Return what the whole fit leaves (n, 3) [m], without the wander of the readings."""
        rest = self.problem.measured - self.full.point
        memory = _wander(self.problem, self.regression, np.arange(len(rest)))
        if not memory:
            return rest
        equations = NormalEquations.of(memory, rest, weight, tuple(b.key for b in memory))
        return rest - predicted(memory, equations.noise_of(()))


def _frames(problem: Problem) -> dict[str, Free]:
    return {n: Free(problem.settings[n], problem.widen(n)) for n in problem.always}


def _free(problem: Problem, regression: Regression, keys: Iterable[str]) -> dict[str, Free]:
    blocks = {b.key: b for b in regression.blocks}
    return {blocks[k].name: Free(blocks[k].setting) for k in keys} | _frames(problem)


def fitted(
    problem: Problem,
    regression: Regression,
    keys: Iterable[str],
    sigma: float,
    rows: BoolArray,
    at: Rows | None = None,
) -> Fit:
    """Fit blocks on some rows (n,); the fitted points are those ``at`` some rows, else of all."""
    index = np.flatnonzero(rows)
    free = _free(problem, regression, keys)
    weight = 1.0 / (sigma * problem.relative[index])
    part = problem.samples.rows(index)
    wander = _wandered(problem, regression, free, weight, index)
    result = fit(part, problem.measured[index] - wander, weight, problem.given, free)
    return replace(result, point=_points(problem, result.states, at))


def _points(problem: Problem, states: Mapping[str, State], at: Rows | None) -> FloatArray:
    """Return the points (k, 3) [m] of some rows, None for all."""
    samples = problem.samples if at is None else problem.samples.rows(at)
    return evaluate(samples, states)[0]


def _wander(problem: Problem, regression: Regression, index: Rows) -> tuple[Block, ...]:
    """Return the blocks of the wander of the readings at some rows."""
    blocks = [block for block in regression.memory if block.key != REST]
    return problem.memory_at(blocks, index)


def _wandered(
    problem: Problem,
    regression: Regression,
    free: Mapping[str, Free],
    weight: FloatArray,
    index: Rows,
) -> FloatArray:
    """Return (k, 3) [m] the wander at some rows, beside effects fitted to them."""
    memory = _wander(problem, regression, index)
    if not memory:
        return np.zeros((len(index), 3))
    actual = evaluate(problem.samples.rows(index), problem.given)[1]
    blocks = [
        block_of(effect_of(name), actual, options.setting, widen=options.widen)
        for name, options in free.items()
    ]
    names = tuple(b.key for b in memory)
    equations = NormalEquations.of((*blocks, *memory), problem.gap[index], weight, names)
    theta = equations.noise_of([b.key for b in blocks])
    return predicted(memory, theta)


def point_without(
    problem: Problem, full: Fit, alternatives: Collection[str], at: Rows
) -> FloatArray:
    """Return the points (k, 3) [m] of a fit with some effects as the given model has them."""
    states = {
        name: problem.given.get(name, state)
        for name, state in full.states.items()
        if name not in alternatives or name in problem.given
    }
    return _points(problem, states, at)
