"""From a problem to a choice: noise, faults, gear waves, and the search over effects."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, Rows
from postproc.gap.choice.choice import choose
from postproc.gap.choice.evidence import FOLDS_WON
from postproc.gap.choice.search import FEW, search
from postproc.gap.choice.standing import Choice
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, Kind, periodic_effect
from postproc.gap.fit import (
    LEAST,
    Block,
    Memory,
    Noise,
    NormalEquations,
    Problem,
    Regression,
    Saturated,
    Source,
    Wave,
    block_of,
    find_waves,
    gross_faults,
    is_gear_error,
    memory_of,
    noise_of,
    saturated,
)
from postproc.gap.robot_model import evaluate
from postproc.records import dataclass

LOW_ORDERS = 6
"""Waves up to this order can be imitated by other effects: they are also sought beside them."""
_CALLS_FOR = 100.0
"""Nats that an effect of many numbers must bring beside all others, to be tried."""
_ROWS_EACH = 4
"""Rows for each of its numbers."""
_FREE, _CHANCE = 60.0, 1e-3
"""Degrees of freedom from which the scatter of all rows bounds the noise, and the tail probability
of repeats that scatter more by chance."""
_MORE = 1.2
"""Ratio of what is left to the scatter from which it counts."""
_FAR_LESS = 0.8
"""Ratio of the scatter with and without candidates that were found late, from which they count."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """Rows of the search with all candidates, the noise, and the fit of everything at once."""

    regression: Regression
    noise: Noise
    saturated: Saturated
    memory: Memory

    @property
    def scatter(self) -> float:
        """How far rows scatter per axis [m] beside everything that is fitted to them."""
        return max(self.noise.sigma, self.memory.sigma)


def prepare(problem: Problem) -> Prepared:
    """Return the regression of a problem, with its noise, memory and measuring faults."""
    index = np.flatnonzero(problem.searchable)
    samples = evaluate(problem.samples.rows(index), problem.given)[1]
    y, relative = problem.gap[index], problem.relative[index]
    blocks = problem.blocks(problem.searchable)
    faults = index[gross_faults(y)]
    level = _noise(problem, faults, float(np.median(np.abs(y))))
    least = level.sigma if level.known else LEAST
    rest = saturated(blocks, y, max(float(np.median(np.abs(y))), least) + 1e-6, least=0.5 * least)
    waves = find_waves(samples, y, _weights(rest, max(rest.sigma, least), relative), blocks)
    variants = []
    if is_gear_error(waves):
        variants.append(wave_block(samples, waves, "all"))
        rest = saturated((*blocks, *variants), y, rest.sigma, least=0.5 * least)
    weight = _weights(rest, max(rest.sigma, least), relative)
    tables = _tables(samples, y, weight, (*blocks, *variants), problem.on_demand)
    if tables:
        variants += tables
        rest = saturated((*blocks, *variants), y, rest.sigma, least=0.5 * least)
    found = _weighed(problem, samples, (*blocks, *variants), rest)
    frames = [b for b in blocks if b.effect.kind == Kind.REGISTRATION]
    weight = found.regression.weight
    plain = find_waves(samples, y, weight, frames, at_most=4, highest=LOW_ORDERS)
    if is_gear_error(plain) and plain != waves:
        variants.append(wave_block(samples, plain, "frames"))
    return _of_few(
        replace(found, regression=replace(found.regression, blocks=(*blocks, *variants)))
    )


def _of_few(found: Prepared) -> Prepared:
    """Return a preparation whose rows, where they are few, are weighed by what a subset leaves.

    Few rows let few effects stand side by side. All candidates together may fit them to the noise,
    and the best of such subsets leave many times that, of what they have no room for: by the noise
    a flaw of a large effect would then count more than what is sought.
    """
    regression = found.regression
    if regression.rows >= FEW:
        return found
    equations = regression.normal_equations()
    scores = search(equations, regression.always).scores
    inside = (*regression.always, *max(scores, key=lambda s: (scores[s], s)))
    plain = regression.equations_at(np.arange(len(regression.y)))
    free = max(3.0 * plain.rows - plain.freedom(inside), 1.0)
    excess = float(np.sqrt(plain.left(inside) / free))
    if excess < _MORE:
        return found
    weight = regression.weight / excess
    sigma = found.memory.sigma * excess
    return replace(
        found,
        regression=replace(regression, weight=weight),
        memory=replace(found.memory, sigma=sigma),
    )


def prepared_with(problem: Problem, before: Prepared, blocks: tuple[Block, ...]) -> Prepared:
    """Return the preparation with more candidates, where rows scatter far less beside those.

    Waves are found in what a choice leaves. What they explain counted as scatter until then, and
    perhaps as a wander of the readings.

    Args:
        problem: all rows.
        before: the preparation without them.
        blocks: all candidates.
    """
    least = before.noise.white if before.noise.known else LEAST
    y = before.regression.y
    rest = saturated(blocks, y, before.saturated.sigma, least=0.5 * least)
    after = _of_few(_weighed(problem, before.regression.samples, blocks, rest))
    return after if after.scatter < _FAR_LESS * before.scatter else before


def _weighed(
    problem: Problem, samples: Samples, blocks: tuple[Block, ...], rest: Saturated
) -> Prepared:
    """Return the regression on candidates whose common fit is known, weighed by its scatter."""
    index = np.flatnonzero(problem.searchable)
    y, relative = problem.gap[index], problem.relative[index]
    level = _bounded(_noise(problem, index[rest.outlier], rest.sigma), rest)
    white = max(level.white, level.sigma if level.source is Source.ASSUMED else level.white)
    parts = [block.rows(index) for block in problem.processes]
    memory = memory_of(parts, y, _weights(rest, white, relative), blocks, level, rest.sigma)
    if memory.wander > level.wander:
        level = replace(
            level,
            sigma=float(np.hypot(level.white, memory.wander)),
            wander=memory.wander,
            correlation=memory.correlation,
        )
    regression = Regression(
        samples,
        y,
        _weights(rest, memory.sigma, relative),
        problem.split.fold[index],
        blocks,
        problem.always,
        memory.blocks,
        problem.split.stretch[index],
    )
    return Prepared(regression, level, rest, memory)


def _bounded(level: Noise, rest: Saturated) -> Noise:
    """Return the noise, no larger than all rows scatter by beside every candidate.

    Where readings of one pose surely scatter more than that, something moved them that a candidate
    follows and that the few of them do not tell from noise: a growth with the temperature.
    """
    from scipy.special import fdtrc

    if level.source is not Source.REPEATS or level.wander or rest.freedom < _FREE:
        return level
    ratio = (level.white / rest.sigma) ** 2
    if ratio < 1.0 or fdtrc(level.freedom, rest.freedom, ratio) > _CHANCE:
        return level
    return replace(level, sigma=rest.sigma, white=rest.sigma)


def select(regression: Regression) -> tuple[Regression, Choice]:
    """Choose; look for waves in what the choice leaves; choose again if there are new ones.

    They are also looked for in the place of what follows a joint's own angle, as waves do.
    """
    choice = choose(regression)
    for _ in range(0 if periodic_effect().name in regression.excluded else 2):
        others = without_waves(regression, choice)
        alone = [b for b in others if not b.effect.of_own_angle]
        more: list[Block] = []
        for place, beside in (("rest", others), ("place", alone)):
            if place == "rest" or len(alone) < len(others):
                known = [*regression.blocks, *more]
                more += _waves_beside(regression, beside, f"{place}{len(known)}", known)
        if not more:
            break
        regression = replace(regression, blocks=(*regression.blocks, *more))
        choice = choose(regression)
    return regression, choice


def elusive(regression: Regression, choice: Choice) -> dict[str, str]:
    """Return the named waves that are not found again where rows are left out, and why.

    Joints and orders were sought in all rows, so that a fold says little of them: they are sought
    anew in the others, and what is found then has to help on the fold.
    """
    alone = replace(regression, blocks=tuple(without_waves(regression, choice)))
    found = {}
    for block in regression.blocks:
        if block.key in choice.adopted and block.effect.periodic:
            most = len(block.setting["waves"])
            gains = [_gain_of_new(alone, rows, most) for rows in alone.fold_rows()] or [0.0]
            if np.mean(np.array(gains) > 0.0) < FOLDS_WON or sum(gains) <= 0.0:
                found[block.name] = "other waves are found where rows are left out"
    return found


def _gain_of_new(regression: Regression, apart: Rows, most: int) -> float:
    """Return what waves found in all other rows bring on some, half a squared misfit."""
    rows = np.setdiff1d(np.flatnonzero(regression.weight > 0), apart)
    known = [b.rows(rows) for b in (*regression.blocks, *regression.memory)]
    part, y, weight = regression.samples.rows(rows), regression.y[rows], regression.weight[rows]
    waves = find_waves(part, y, weight, known, at_most=most)
    if not waves:
        return 0.0
    new = wave_block(regression.samples, waves, "new")
    without = tuple(b.key for b in regression.blocks)
    regression = replace(regression, blocks=(*regression.blocks, new))
    told, asked = regression.equations_at(rows), regression.equations_at(apart)
    before, after = (
        asked.misfit(keys, told.numbers(keys)) for keys in (without, (*without, new.key))
    )
    return 0.5 * (before - after)


def _waves_beside(
    regression: Regression, beside: Sequence[Block], key: str, known: Sequence[Block]
) -> list[Block]:
    """Return the block of the waves in what some blocks leave, none if it is known."""
    blocks = [*beside, *regression.memory]
    waves = find_waves(regression.samples, regression.y, regression.weight, blocks)
    old = {b.setting["waves"] for b in known if b.effect.periodic}
    if not is_gear_error(waves) or waves in old:
        return []
    return [wave_block(regression.samples, waves, key)]


def _tables(
    samples: Samples,
    y: FloatArray,
    weight: FloatArray,
    blocks: Sequence[Block],
    effects: Sequence[Effect],
) -> list[Block]:
    """Return those of some effects of many numbers that rows call for beside other candidates."""
    found = []
    for effect in effects:
        setting = effect.prepare(samples)
        if len(effect.parameters(samples.arm, setting)) <= len(samples) // _ROWS_EACH:
            block = block_of(effect, samples, setting)
            equations = NormalEquations.of((*blocks, block), y, weight)
            keys = tuple(b.key for b in blocks)
            gain = equations.evidence((*keys, block.key)) - equations.evidence(keys)
            found += [block] if gain > _CALLS_FOR else []
    return found


def without_waves(regression: Regression, choice: Choice) -> list[Block]:
    """Return the chosen blocks but the waves."""
    inside = {*choice.model, *regression.always}
    return [b for b in regression.blocks if b.key in inside and not b.effect.periodic]


def wave_block(samples: Samples, waves: tuple[Wave, ...], key: str) -> Block:
    """Return the block of some waves."""
    effect = periodic_effect()
    return block_of(effect, samples, {"waves": waves}, f"{effect.name}:{key}")


def _weights(rest: Saturated, sigma: float, relative: FloatArray) -> FloatArray:
    return np.where(rest.outlier, 0.0, 1.0 / (sigma * relative))


def _noise(problem: Problem, faults: Rows, rest: float) -> Noise:
    usable = np.ones(len(problem), dtype=bool)
    usable[faults] = False
    return noise_of(
        problem.samples, problem.gap, usable, problem.set_ups.unit, problem.instrument, rest
    )
