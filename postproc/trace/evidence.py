"""Which effects a stage shows: every set of them is fitted, weighed, and proven on other rows.

The weight of a set is its likelihood with the size of the noise unknown, at the number of rows
that are worth an independent one, less the price of its parameters. The probability of an effect
is the weight of the sets that hold it. It is adopted if it is probable, if it is large enough to
matter, and if rows that were not fitted agree.
"""

from __future__ import annotations

from itertools import combinations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.records import dataclass
from postproc.trace.effect import PATH_EFFECTS
from postproc.trace.fit import Fit, fit, rest_of, unusual, values_of
from postproc.trace.recording import SHORTEST
from postproc.trace.scene import Stage
from postproc.trace.signals import memory, white_sigma

FIT_ROWS = 10_000
"""Rows that are fitted: enough for every figure, few enough for every set of effects."""
PIECE_ROWS = 2_000
"""Rows of the pieces in which a longer recording is thinned for the fit: 8 s at 4 ms."""
PRIOR_ODDS = 0.1
"""Of an effect, before anything is seen: most effects are absent from most recordings."""
PROBABLE = 0.9
"""Probability from which an effect is adopted."""
MATTERS = 0.25
"""Least size of an effect where it acts, against the noise of one row: less moves no figure."""
FOLDS = 3
WHOLE_RUNS = 3
"""Runs from which whole ones are withheld."""
APART = 8
"""Independent rows that are withheld together, where no run can be."""
STRETCHES = 30
"""Stretches of the rows that are drawn for intervals."""
HOPELESS = 5.0
"""Logarithm of the odds against an effect from which it is not tried beside others."""
WEIGHTLESS = 1e-12


@dataclass(frozen=True, slots=True, eq=False)
class Verdict:
    """What a stage shows.

    Args:
        stage: at the rows that were fitted.
        sigma: (m,) noise without memory; worth: (m,) rows worth one, see ``signals.memory``.
        adopted: names, the largest first; probability: of every effect that was tried.
        fitted: the adopted effects; with_each: the adopted and one more, for those that were not.
        twins: effects that the rows cannot tell from an adopted one.
    """

    stage: Stage
    sigma: FloatArray
    worth: FloatArray
    adopted: tuple[str, ...]
    probability: dict[str, float]
    fitted: Fit
    with_each: dict[str, Fit]
    twins: dict[str, tuple[str, ...]]


def thinned(stage: Stage) -> Stage:
    """Return the stage at rows that are fitted: whole pieces, evenly spread over the runs."""
    n = stage.gap.shape[1]
    if n <= FIT_ROWS:
        return stage
    pieces = max(1, FIT_ROWS // PIECE_ROWS)
    starts = np.linspace(0, n - PIECE_ROWS, pieces).astype(int)
    index = np.unique(np.concatenate([np.arange(s, s + PIECE_ROWS) for s in starts]))
    stretch = stage.scene.recording.stretch[index]
    ends = np.concatenate([[True], (np.diff(index) > 1) | (np.diff(stretch) != 0)])
    number = np.cumsum(ends) - 1
    long = np.bincount(number)[number] > SHORTEST
    return stage.rows(index[long])


def judged(stage: Stage) -> Verdict:
    """Return which effects a stage shows.

    Args:
        stage: all of its rows.
    """
    part = thinned(stage)
    sigma = _noise(part, part.gap)
    fits, fullest = _grown(part, sigma)
    best_full = min(fullest, key=lambda key: _unexplained(fits[key]))
    rest = _left_by(part, fits[best_full])
    sigma = _noise(part, rest)
    worth = _memory(part, rest)
    for full in fullest:
        for size in range(len(full)):
            for members in combinations(sorted(full), size):
                key = frozenset(members)
                start = {name: fits[full].thetas[name] for name in members}
                fits[key] = fits.get(key) or fit(part, start, sigma, steps=3)
    weights = _weights(fits, sigma, worth)
    tried = sorted(set().union(*fits))
    probability = {
        name: float(sum(weight for key, weight in weights.items() if name in key)) for name in tried
    }
    best = max(weights, key=lambda key: (weights[key], sorted(key)))
    for name in tried:
        likeliest = max((key for key in fits if name in key), key=lambda k: (weights[k], sorted(k)))
        # what is too small to move any figure is not there
        if not _matters(part, fits[likeliest], name, sigma):
            probability[name] = 0.0
    twins = _twins(best, weights)
    silent = {name for name in best if not PATH_EFFECTS.get(name).is_cause}
    chosen = [
        name
        for name in best - silent
        if probability[name] + sum(probability[t] for t in twins.get(name, ())) >= PROBABLE
    ]
    kept = frozenset(chosen) | silent
    fitted = fits.get(kept) or fit(part, {n: fits[best].thetas[n] for n in kept}, sigma)
    order = sorted(chosen, key=lambda n: -_size(part, fitted, n))
    with_each = {}
    for name in tried:
        key = kept | {name}
        if name not in kept and key in fits and PATH_EFFECTS.get(name).is_cause:
            with_each[name] = fits[key]
    alike = {name: twins[name] for name in chosen if name in twins}
    return Verdict(part, sigma, worth, tuple(order), probability, fitted, with_each, alike)


def _noise(stage: Stage, rest: FloatArray) -> FloatArray:
    """Return the noise without memory (m,) of each output."""
    stretches = stage.scene.stretches
    sigma = np.array([white_sigma(row, stretches) for row in rest])
    # an output without any noise is as exact as its numbers are written
    return np.asarray(np.maximum(sigma, _quantum(stage.gap)))


def _quantum(gap: FloatArray) -> FloatArray:
    size = np.nanmax(np.abs(gap), axis=1, initial=0.0)
    return np.asarray(np.maximum(1e-9, 1e-6 * size))


def _memory(stage: Stage, rest: FloatArray) -> FloatArray:
    return np.array([memory(np.nan_to_num(row), stage.scene.stretches) for row in rest])


def _grown(
    stage: Stage, sigma: FloatArray
) -> tuple[dict[frozenset[str], Fit], list[frozenset[str]]]:
    """Return the sets that were tried, and of these the fullest.

    One set for each family of rivals and one without: it grows by the effect that tells most, as
    long as one tells anything. What a large effect hides is tried again when that is in. What is no
    cause comes when the causes have told all they can: a curve with enough pieces fits anything.
    """
    able = [(n, e) for n, e in PATH_EFFECTS if stage.name in e.stages]
    rivals = [n for n, e in able if any(r in dict(able) for r in e.rivals)]
    alone = [n for n, _ in able if n not in rivals]
    is_cause = {n: e.is_cause for n, e in able}
    nothing: frozenset[str] = frozenset()
    fits = {nothing: fit(stage, {}, sigma)}
    mute: set[frozenset[str]] = set()
    fullest = []
    for first in [*rivals, None]:
        now, waiting = nothing, [*([first] if first else []), *alone]
        while waiting:
            gains, rest = [], _left_by(stage, fits[now])
            level = np.maximum(_noise(stage, rest), WEIGHTLESS)
            for name in waiting:
                key = now | {name}
                if key not in fits and key not in mute:
                    theta = PATH_EFFECTS.get(name).start(stage, rest, level)
                    if theta is None:
                        mute.add(key)
                    else:
                        fits[key] = fit(stage, {**fits[now].thetas, name: theta}, sigma)
                if key in fits:
                    worth = _memory(stage, _left_by(stage, fits[key]))
                    pair = [_evidence(fits[k], sigma, worth) for k in (key, now)]
                    gains.append((pair[0] - pair[1], name))
            telling = [(is_cause[name], gain, name) for gain, name in gains if gain > -HOPELESS]
            if not telling:
                break
            now |= {max(telling)[2]}
            waiting.remove(max(telling)[2])
        fullest.append(now)
    return fits, fullest


def _left_by(stage: Stage, found: Fit) -> FloatArray:
    """Return what a set leaves (m, n), about nothing."""
    return np.asarray(rest_of(stage, found.thetas) - found.constants[:, None])


def _unexplained(found: Fit) -> float:
    """Return the logarithm of what a set leaves, summed over outputs."""
    return float(np.sum(found.count * np.log(np.maximum(found.squares, WEIGHTLESS**2))))


def _weights(
    fits: dict[frozenset[str], Fit], sigma: FloatArray, worth: FloatArray
) -> dict[frozenset[str], float]:
    """Return the posterior probability of each set, by noise (m,) and rows worth one (m,)."""
    logs = {key: _evidence(found, sigma, worth) for key, found in fits.items()}
    top = max(logs.values())
    weights = {key: float(np.exp(value - top)) for key, value in logs.items()}
    total = sum(weights.values())
    return {key: weight / total for key, weight in weights.items()}


def _evidence(found: Fit, sigma: FloatArray, worth: FloatArray) -> float:
    """Return the logarithm of the posterior probability of a set, but for a constant."""
    # what is below the noise of the rows is no merit
    floor = (0.5 * sigma) ** 2 * found.count
    left = np.log(np.maximum(found.squares, np.maximum(floor, 1e-30)))
    cost = 0.5 * float(np.sum(found.count / worth * left)) + _price(found, worth)
    return len(found.thetas) * float(np.log(PRIOR_ODDS)) - cost


def _price(found: Fit, worth: FloatArray) -> float:
    """Return what the freedom of a set costs: how much narrower the rows made its usual sizes."""
    one = np.log(max(2.0, float(np.mean(found.count / worth))))
    price, told = 0.0, 0
    for name, theta in found.thetas.items():
        width, deviation = PATH_EFFECTS.get(name).widths(theta), found.deviations[name]
        sized = np.isfinite(width) & np.isfinite(deviation) & (theta != 0.0)
        told += int(sized.sum())
        price += float(np.sum(np.log(np.maximum(1.0, width[sized] / deviation[sized]))))
        price += unusual(name, theta)
    return float(price + 0.5 * one * max(0, found.free - told))


def _twins(
    best: frozenset[str], weights: dict[frozenset[str], float]
) -> dict[str, tuple[str, ...]]:
    """Return the rivals of each effect of the best set that would do as well in its place."""
    found = {}
    for name in best:
        others = []
        for rival in PATH_EFFECTS.get(name).rivals:
            swapped = (best - {name}) | {rival}
            if weights.get(swapped, 0.0) > PRIOR_ODDS * weights[best]:
                others.append(rival)
        if others:
            found[name] = tuple(others)
    return found


def _size(stage: Stage, found: Fit, name: str) -> float:
    """Return the root mean square [m] of an effect at the tool point."""
    value = values_of(stage, {name: found.thetas[name]})[name]
    return float(np.sqrt(np.mean(np.sum(stage.at_tool(value) ** 2, axis=1))))


def _matters(stage: Stage, found: Fit, name: str, sigma: FloatArray) -> bool:
    """Return whether an effect, where it acts most, is large against the noise of a row."""
    value = values_of(stage, {name: found.thetas[name]})[name]
    value = value - np.median(value, axis=1, keepdims=True)
    strongest = np.sqrt(np.mean(value**2, axis=1))
    busy = np.quantile(np.abs(value), 0.98, axis=1)
    return bool(np.any(np.maximum(strongest, 0.5 * busy) > MATTERS * sigma))


def folds_of(stage: Stage, worth: float) -> IntArray:
    """Return which fold (n,) each row is withheld in: whole runs, or stretches in turn.

    A stretch is as long as ``APART`` independent rows, as far as each fold has two of them: what
    is seen once can be proven only on a part of itself.
    """
    run = stage.scene.recording.run
    runs, number = np.unique(run, return_inverse=True)
    if len(runs) >= WHOLE_RUNS:
        return np.asarray(number % FOLDS, dtype=np.int32)
    length = min(APART * worth, len(run) / (2.0 * FOLDS))
    block = (np.arange(len(run)) / length).astype(np.int32)
    return np.asarray(block % FOLDS, dtype=np.int32)


def withheld(verdict: Verdict, extra: str | None = None) -> dict[str, FloatArray]:
    """Return the value (n, 3) [m] at the tool of each effect, on rows that were not fitted.

    Args:
        verdict: of a stage.
        extra: an effect beyond the adopted ones.
    """
    stage = verdict.stage
    start = verdict.fitted if extra is None else verdict.with_each[extra]
    fold = folds_of(stage, float(verdict.worth.max()))
    n = stage.gap.shape[1]
    found = {name: np.zeros((n, 3)) for name in start.thetas}
    for number in np.unique(fold):
        out: BoolArray = fold == number
        trained = fit(stage, start.thetas, verdict.sigma, ~out, steps=2)
        for name, value in values_of(stage, trained.thetas).items():
            found[name][out] = stage.at_tool(value)[out]
    return {name: value for name, value in found.items() if PATH_EFFECTS.get(name).is_cause}
