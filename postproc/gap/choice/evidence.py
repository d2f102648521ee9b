"""What speaks for each block of a subset, and what disqualifies it."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.choice.search import DECISIVE, Search
from postproc.gap.effect import Effect
from postproc.gap.fit import NormalEquations, Projection, Regression, Subset, block_of
from postproc.records import dataclass

SMALLEST = 0.5
"""Unique part of a named effect, 3D root mean square, in sigma of one axis."""
SMALLEST_POSE = 1.0
"""The same of an effect that follows the pose alone: anything that follows the pose looks a little
like it, and nothing was varied to tell them apart."""
SMALLEST_SHARE = 0.05
"""The same against the largest effect: below it, a flaw of the largest one's formula."""
SMALLEST_ALTERNATIVE = 1.4
"""The same of a cause outside of the library: a smaller one changes no verdict."""
ABSORBED_GAIN = 30.0
"""Nats that an effect must bring which another one of the subset absorbs: how little only it
explains says nothing of its size. A free geometry imitates the sag of the arm where it was measured
and is wrong elsewhere."""
FOLDS_WON, _FOLDS_WON_BY_OTHERS = 0.7, 0.85
"""Share of the folds that an effect, or a cause outside of the library, must make better."""
UNHELPFUL = "does not help on rows that were not fitted"
_PLACEBOS = 60
_PLACEBO_LIMIT = 0.02


Folds = Sequence[Sequence[tuple[NormalEquations, NormalEquations]]]
"""Parts of the rows that are left out in turn, by place and by time, each with all the others."""


@dataclass(frozen=True, slots=True)
class Evidence:
    """What speaks for one effect in the chosen model.

    gain: nats lost without it; unique: [m] 3D rms that only it explains; wins: share of folds
    that it makes better; confounded: effects that would do as well in its place; rival: a class
    that explains more there, in words.
    """

    gain: float
    unique: float
    wins: float = 1.0
    confounded: tuple[str, ...] = ()
    rival: str = ""


def evidence_of(
    regression: Regression, found: Search, folds: Folds, best: Subset, key: str
) -> Evidence:
    """Return what speaks for one block of a subset."""
    rest = tuple(k for k in best if k != key)
    with_it, without = (*found.always, *best), (*found.always, *rest)
    gain = found.score(best) - found.score(rest)
    wins = [_wins(parts, with_it, without) for parts in folds]
    return Evidence(gain, unique_part(regression, found, best, (key,)), min(wins, default=1.0))


def _wins(
    parts: Sequence[tuple[NormalEquations, NormalEquations]], with_it: Subset, without: Subset
) -> float:
    """Return the share of parts that come out better, 0 if all together do not."""
    better = []
    for part, others in parts:
        a = part.misfit(with_it, others.numbers(with_it))
        b = part.misfit(without, others.numbers(without))
        better.append(b - a)
    if not better:
        return 1.0
    return float(np.mean(np.array(better) > 0.0)) if float(np.sum(better)) > 0.0 else 0.0


def unique_part(
    regression: Regression, found: Search, best: Subset, keys: Collection[str]
) -> float:
    """Return what only some blocks of a subset explain together, 3D rms [m]."""
    equations = found.plain or found.equations
    return only_by(regression, equations, (*found.always, *best), keys)


def only_by(
    regression: Regression, equations: NormalEquations, inside: Subset, keys: Collection[str]
) -> float:
    """Return what only some blocks explain together, 3D rms [m].

    Args:
        regression: rows.
        equations: of all rows, without a smooth rest.
        inside: the blocks that are fitted, these among them.
        keys: of these blocks.
    """
    without = tuple(k for k in inside if k not in keys)
    more = equations.freedom(inside) - equations.freedom(without)
    drop = equations.left(without) - equations.left(inside) - more
    return regression.sigma * float(np.sqrt(max(drop, 0.0) / regression.rows))


def negligible(regression: Regression, best: Subset, evidence: Mapping[str, Evidence]) -> Subset:
    """Return the blocks whose unique part is too small to be named."""
    return tuple(
        key
        for key in best
        if evidence[key].unique < smallest_part(regression, best, evidence, key)
        and not (evidence[key].gain > ABSORBED_GAIN and is_absorbed(regression, best, key))
    )


def smallest_part(
    regression: Regression, best: Subset, evidence: Mapping[str, Evidence], key: str
) -> float:
    """Return the unique part from which a block of a subset is named, 3D rms [m]."""
    largest = max(evidence[k].unique for k in best)
    smallest = smallest_of(regression.block(key).effect)
    return max(smallest * regression.sigma, SMALLEST_SHARE * largest)


def smallest_of(effect: Effect) -> float:
    """Return the unique part of an effect alone from which it is named, 3D rms in sigma."""
    if effect.is_alternative:
        return SMALLEST_ALTERNATIVE
    return SMALLEST if effect.needs else SMALLEST_POSE


def weakest(
    regression: Regression, best: Subset, evidence: Mapping[str, Evidence]
) -> tuple[str, str] | None:
    """Return the block that least deserves its place and why, None if all do.

    Where an alternative that describes it more closely takes its place, that one goes.
    """
    failing = []
    for key in best:
        item = evidence[key]
        if item.gain > ABSORBED_GAIN and is_absorbed(regression, best, key):
            continue
        if item.gain < DECISIVE:
            failing.append((item.gain / DECISIVE, key, "not clear enough"))
        elif item.wins < (
            _FOLDS_WON_BY_OTHERS if regression.block(key).is_alternative else FOLDS_WON
        ):
            failing.append((1.0 + item.wins, key, UNHELPFUL))
    if not failing:
        return None
    _, key, reason = min(failing)
    for other in best:
        effect = regression.block(other).effect
        if effect.is_alternative and regression.name(key) in effect.refines:
            return other, "others explain the same"
    return key, reason


def is_absorbed(regression: Regression, best: Subset, key: str) -> bool:
    """Return whether an effect is nearly absorbed by another one that is in the subset."""
    return bool(absorbing(regression, best, key))


def absorbing(regression: Regression, best: Subset, key: str) -> tuple[str, ...]:
    """Return the effects of a subset that take one of its blocks in almost wholly."""
    by = regression.block(key).effect.absorbed_by
    return tuple(name for name in map(regression.name, best) if name in by)


def unphysical(regression: Regression, found: Search, best: Subset) -> tuple[str, str] | None:
    """Return a block of a subset whose fitted numbers are not physical, and why.

    Where the subset leaves more than noise its numbers are as unsure as that.
    """
    arm, inside, equations = regression.samples.arm, (*found.always, *best), found.equations
    free = max(3.0 * equations.rows - equations.freedom(inside), 1.0)
    excess = max(1.0, float(np.sqrt(equations.left(inside) / free)))
    for key, theta, deviation in numbers(regression, equations, inside):
        reason = regression.block(key).effect.objection(theta, excess * deviation, arm)
        if key in best and reason:
            return key, f"not physical: {reason}"
    return None


def numbers(
    regression: Regression, equations: NormalEquations, keys: Subset
) -> Iterator[tuple[str, FloatArray, FloatArray]]:
    """Yield each block of a subset, its fitted numbers (p,) in SI and their standard deviations."""
    theta, covariance = equations.solve(keys)
    deviation = np.sqrt(np.diag(covariance))
    start = 0
    for key in keys:
        block = regression.block(key)
        part = slice(start, start + block.X.shape[2])
        start = part.stop
        given = 0.0 if block.start is None else np.nan_to_num(block.start)
        yield key, theta[part] * block.typical + given, deviation[part] * block.typical


def matched_by_placebo(
    regression: Regression, best: Subset, spared: Subset
) -> tuple[str, str] | None:
    """Return a block that a placebo of its own matches, and why it goes."""
    for key in best:
        if key in spared or regression.block(key).is_alternative:
            continue
        if _placebo(regression, best, key) > _PLACEBO_LIMIT:
            return key, "a placebo does as well"
    return None


def _placebo(regression: Regression, best: Subset, key: str) -> float:
    """Return the share of shuffled copies of an effect that explain as much as it does."""
    block = regression.block(key)
    if not block.effect.needs:
        return 0.0
    rest = {*regression.always, *(k for k in best if k != key)}
    use = np.flatnonzero(regression.weight > 0)
    weight = regression.weight[use]
    blocks = (*(b for b in regression.blocks if b.key in rest), *regression.memory)
    others = [b.rows(use) for b in blocks]
    context = Projection(others, regression.y[use], weight)
    samples = regression.samples.rows(use)
    rng = np.random.default_rng(11)
    left = context.rest

    def brought(X: FloatArray) -> float:
        return context.gain((X * weight[:, None, None]).reshape(-1, X.shape[2]), left)

    real = brought(block.X[use])
    beaten = 0
    for _ in range(_PLACEBOS):
        fake = block.effect.placebo(samples, rng)
        beaten += brought(block_of(block.effect, fake, block.setting).X) >= real
        if beaten > 1:
            break
    return beaten / _PLACEBOS
