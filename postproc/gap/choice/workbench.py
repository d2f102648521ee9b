"""From a problem to a choice: noise, faults, gear waves, and the search over effects."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.choice.choice import Choice, choose
from postproc.gap.data import Samples
from postproc.gap.effect import Kind, periodic_effect
from postproc.gap.fit import (
    Bench,
    Block,
    Noise,
    Problem,
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

    bench: Bench
    noise: Noise
    saturated: Saturated


def prepare(problem: Problem) -> Prepared:
    """Return the bench of a problem."""
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
    bench = Bench(
        samples, y, weight, problem.split.fold[index], (*blocks, *variants), problem.always
    )
    return Prepared(bench, level, rest)


def chosen(bench: Bench) -> tuple[Bench, Choice]:
    """Choose; look for waves in what the choice leaves; choose again if there are new ones."""
    choice = choose(bench)
    for turn in range(0 if periodic_effect().name in bench.barred else 2):
        waves = find_waves(bench.samples, bench.y, bench.weight, without_waves(bench, choice))
        known = {b.setting["waves"] for b in bench.blocks if b.effect.periodic}
        if not is_gear_error(waves) or waves in known:
            break
        more = wave_block(bench.samples, waves, f"rest{turn}")
        bench = replace(bench, blocks=(*bench.blocks, more))
        choice = choose(bench)
    return bench, choice


def without_waves(bench: Bench, choice: Choice) -> list[Block]:
    """Return the chosen blocks but the waves."""
    inside = {*choice.keys, *choice.suspects, *choice.silent, *bench.always}
    return [b for b in bench.blocks if b.key in inside and not b.effect.periodic]


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
    from scipy.special import fdtrc

    ratio = (repeated.sigma / rest.sigma) ** 2
    surely = float(fdtrc(repeated.freedom, max(rest.freedom, 1.0), ratio)) < 1e-3
    return estimated if ratio > _IMPURE and surely else repeated
