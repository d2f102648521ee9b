"""From a problem to a choice: noise, faults, gear waves, and the search over effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import fdtrc

from postproc.arrays import FloatArray
from postproc.gap.choice.choice import choose
from postproc.gap.choice.standing import Choice
from postproc.gap.data import Samples
from postproc.gap.effect import Kind, periodic_effect
from postproc.gap.fit import (
    Block,
    Noise,
    Problem,
    Regression,
    Saturated,
    Wave,
    block_of,
    find_waves,
    is_gear_error,
    repeats,
    saturated,
)
from postproc.gap.robot_model import evaluate

LOW_ORDERS = 6
"""Waves up to this order can be imitated by other effects: they are also sought beside them."""
_IMPURE = 1.3
"""Variance of the repeats over that of the saturated fit from which they are not pure."""


@dataclass(frozen=True, slots=True)
class Prepared:
    """Rows of the search with all candidates, the noise, and the fit of everything at once."""

    regression: Regression
    noise: Noise
    saturated: Saturated


def prepare(problem: Problem) -> Prepared:
    """Return the regression of a problem, with its noise and measuring faults."""
    index = np.flatnonzero(problem.searchable)
    samples = evaluate(problem.samples.rows(index), problem.given)[1]
    y = problem.gap[index]
    blocks = problem.blocks(problem.searchable)
    rest = saturated(blocks, y, float(np.median(np.abs(y))) + 1e-6)
    waves = find_waves(samples, y, _weights(rest, rest.sigma), blocks)
    variants = []
    if is_gear_error(waves):
        variants.append(wave_block(samples, waves, "all"))
        rest = saturated((*blocks, *variants), y, rest.sigma)
    level = _noise(problem, rest)
    weight = _weights(rest, max(rest.sigma, level.sigma))
    frames = [b for b in blocks if b.effect.kind == Kind.REGISTRATION]
    plain = find_waves(samples, y, weight, frames, at_most=4, highest=LOW_ORDERS)
    if is_gear_error(plain) and plain != waves:
        variants.append(wave_block(samples, plain, "frames"))
    regression = Regression(
        samples, y, weight, problem.split.fold[index], (*blocks, *variants), problem.always
    )
    return Prepared(regression, level, rest)


def select(regression: Regression) -> tuple[Regression, Choice]:
    """Choose; look for waves in what the choice leaves; choose again if there are new ones."""
    choice = choose(regression)
    for again in range(0 if periodic_effect().name in regression.excluded else 2):
        waves = find_waves(
            regression.samples, regression.y, regression.weight, without_waves(regression, choice)
        )
        known = {b.setting["waves"] for b in regression.blocks if b.effect.periodic}
        if not is_gear_error(waves) or waves in known:
            break
        more = wave_block(regression.samples, waves, f"rest{again}")
        regression = replace(regression, blocks=(*regression.blocks, more))
        choice = choose(regression)
    return regression, choice


def without_waves(regression: Regression, choice: Choice) -> list[Block]:
    """Return the chosen blocks but the waves."""
    inside = {*choice.model, *regression.always}
    return [b for b in regression.blocks if b.key in inside and not b.effect.periodic]


def wave_block(samples: Samples, waves: tuple[Wave, ...], key: str) -> Block:
    """Return the block of some waves."""
    effect = periodic_effect()
    return block_of(effect, samples, {"waves": waves}, f"{effect.name}:{key}")


def _weights(rest: Saturated, sigma: float) -> FloatArray:
    return np.where(rest.outlier, 0.0, 1.0 / sigma)


def _noise(problem: Problem, rest: Saturated) -> Noise:
    """Return the noise from repeats; from the saturated fit where they are impure or absent."""
    index = np.flatnonzero(problem.searchable)
    usable = np.ones(len(problem), dtype=bool)
    usable[index[rest.outlier]] = False
    repeated = repeats(problem.samples, problem.gap, usable)
    if not repeated.measured:
        repeated = repeats(problem.samples.rows(index), rest.raw, ~rest.outlier, rest.hat_root)
    estimated = Noise(rest.sigma, 0, repeated.repeats)
    if not repeated.measured:
        return estimated
    ratio = (repeated.sigma / rest.sigma) ** 2
    surely = float(fdtrc(repeated.freedom, max(rest.freedom, 1.0), ratio)) < 1e-3
    return estimated if ratio > _IMPURE and surely else repeated
