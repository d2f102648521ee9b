"""What speaks for each block of a subset, and what disqualifies it."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.fit.bench import Bench, picked
from postproc.gap.fit.linear import Gram, block_of
from postproc.gap.fit.select import CLEAR, Search, Subset
from postproc.gap.fit.waves import Context

SMALLEST = 0.5
"""Unique part of a named effect, 3D root mean square, in sigma of one axis."""
SMALLEST_POSE = 1.0
"""The same of an effect that follows the pose alone: anything that follows the pose looks a little
like it, and nothing was varied to tell them apart."""
SMALLEST_SHARE = 0.05
"""The same against the largest effect: below it, a flaw of the largest one's formula."""
SMALLEST_SUSPECT = 1.4
"""The same of a cause outside of the library: a smaller one changes no verdict."""
ABSORBED_GAIN = 30.0
"""Nats that an effect must bring which another one of the subset absorbs: how little only it
explains says nothing of its size. A free geometry imitates the sag of the arm where it was measured
and is wrong elsewhere."""
_PLACEBOS = 60
_PLACEBO_LIMIT = 0.02


@dataclass(slots=True)
class Evidence:
    """What speaks for one effect in the chosen model.

    gain: nats lost without it; unique: [m] 3D rms that only it explains; wins: share of folds
    that it makes better; placebo: share of placebos as good.
    """

    gain: float
    unique: float
    wins: float = 1.0
    placebo: float = 0.0
    twins: tuple[str, ...] = ()


def evidence_of(
    bench: Bench, found: Search, folds: Sequence[Gram], best: Subset, key: str
) -> Evidence:
    """Return what speaks for one block of a subset."""
    rest = tuple(k for k in best if k != key)
    with_it, without = (*found.always, *best), (*found.always, *rest)
    gain = found.score(best) - found.score(rest)
    better = []
    for part in folds:
        others = found.gram.minus(part)
        a = part.misfit(with_it, others.solve(with_it)[0])
        b = part.misfit(without, others.solve(without)[0])
        better.append(b - a)
    wins = float(np.mean(np.array(better) > 0.0)) if better else 1.0
    if better and float(np.sum(better)) <= 0.0:
        wins = 0.0
    return Evidence(gain, unique_part(bench, found, best, (key,)), wins)


def unique_part(bench: Bench, found: Search, best: Subset, keys: Collection[str]) -> float:
    """Return what only some blocks of a subset explain together, 3D rms [m]."""
    rest = tuple(k for k in best if k not in keys)
    with_it, without = (*found.always, *best), (*found.always, *rest)
    more = found.gram.freedom(with_it) - found.gram.freedom(without)
    drop = found.gram.left(without) - found.gram.left(with_it) - more
    return bench.sigma * float(np.sqrt(max(drop, 0.0) / bench.rows))


def small(bench: Bench, best: Subset, evidence: Mapping[str, Evidence]) -> Subset:
    """Return the blocks whose unique part is too small to be named."""
    return tuple(
        key
        for key in best
        if evidence[key].unique < smallest_part(bench, best, evidence, key)
        and not (evidence[key].gain > ABSORBED_GAIN and is_absorbed(bench, best, key))
    )


def smallest_part(bench: Bench, best: Subset, evidence: Mapping[str, Evidence], key: str) -> float:
    """Return the unique part from which a block of a subset is named, 3D rms [m]."""
    largest = max(evidence[k].unique for k in best)
    block = bench.block(key)
    smallest = SMALLEST if block.effect.needs else SMALLEST_POSE
    smallest = SMALLEST_SUSPECT if block.suspect else smallest
    return max(smallest * bench.sigma, SMALLEST_SHARE * largest)


def weakest(bench: Bench, best: Subset, evidence: Mapping[str, Evidence]) -> tuple[str, str] | None:
    """Return the block that least deserves its place and why, None if all do."""
    failing = []
    for key in best:
        item = evidence[key]
        if item.gain > ABSORBED_GAIN and is_absorbed(bench, best, key):
            continue
        if item.gain < CLEAR:
            failing.append((item.gain / CLEAR, key, "not clear enough"))
        elif item.wins < (0.85 if bench.block(key).suspect else 0.7):
            failing.append((1.0 + item.wins, key, "does not help on rows that were not fitted"))
    return min(failing)[1:] if failing else None


def is_absorbed(bench: Bench, best: Subset, key: str) -> bool:
    """Return whether an effect is nearly absorbed by another one that is in the subset."""
    absorbing = bench.block(key).effect.absorbed_by
    return any(bench.name(k) in absorbing for k in best)


def unphysical(bench: Bench, found: Search, best: Subset) -> tuple[str, str] | None:
    """Return a block of a subset whose fitted numbers are not physical, and why."""
    keys = (*found.always, *best)
    theta, covariance = found.gram.solve(keys)
    deviation = np.sqrt(np.diag(covariance))
    start = 0
    for key in keys:
        block = bench.block(key)
        part = slice(start, start + block.X.shape[2])
        start = part.stop
        if key in best:
            arm = bench.samples.arm
            size = block.typical
            total = theta[part] * size
            if block.start is not None:
                total = total + np.nan_to_num(block.start)
            reason = block.effect.objection(total, deviation[part] * size, arm)
            if reason:
                return key, f"not physical: {reason}"
    return None


def imitated(
    bench: Bench, best: Subset, spared: Subset, evidence: Mapping[str, Evidence]
) -> tuple[str, str] | None:
    """Return a block that a placebo of its own can imitate, and why it goes."""
    for key in best:
        if key not in spared and not bench.block(key).suspect:
            evidence[key].placebo = _placebo(bench, best, key)
            if evidence[key].placebo > _PLACEBO_LIMIT:
                return key, "a placebo does as well"
    return None


def _placebo(bench: Bench, best: Subset, key: str) -> float:
    """Return the share of shuffled copies of an effect that explain as much as it does."""
    block = bench.block(key)
    if not block.effect.needs:
        return 0.0
    rest = {*bench.always, *(k for k in best if k != key)}
    use = np.flatnonzero(bench.weight > 0)
    weight = bench.weight[use]
    context = Context([picked(b, use) for b in bench.blocks if b.key in rest], bench.y[use], weight)
    left = context.clean(context.y[:, None])[:, 0]
    samples = bench.samples.rows(use)
    rng = np.random.default_rng(11)
    real = _brought(context, left, block.X[use], weight)
    beaten = 0
    for _ in range(_PLACEBOS):
        fake = block.effect.placebo(samples, rng)
        mixed = block_of(block.effect, fake, block.setting).X
        beaten += _brought(context, left, mixed, weight) >= real
        if beaten > 1:
            break
    return beaten / _PLACEBOS


def _brought(context: Context, left: FloatArray, X: FloatArray, weight: FloatArray) -> float:
    """Return the evidence [nats] that columns (n, 3, p) add to a context."""
    Z = (X * weight[:, None, None]).reshape(-1, X.shape[2])
    A = Z.T @ context.clean(Z) + np.eye(Z.shape[1])
    b = Z.T @ left
    return float(0.5 * b @ np.linalg.solve(A, b) - 0.5 * np.linalg.slogdet(A)[1])
