"""Effects of one stage together: one least squares over all their parameters, relinearised."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.records import dataclass
from postproc.trace.effect import PATH_EFFECTS, Part
from postproc.trace.scene import Stage
from postproc.trace.signals import memory

STEPS = 6
"""Most steps of a fit; each is a whole least squares."""
CLOSE = 1e-4
"""A step that moves the sum of squares by less than this share is the last."""

Thetas = Mapping[str, FloatArray]


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """Parameters by effect at a stage.

    Args:
        thetas: parameters; deviations: of each, as long as the rest lasts and as large as it is.
        constants: (m,) mean of each output that no effect makes.
        squares: (m,) sum of squares of the rest over the rows fitted; count: (m,) of these rows.
        weight: (m,) of a row: the rest has so little size and memory where it was left.
    """

    thetas: dict[str, FloatArray]
    deviations: dict[str, FloatArray]
    constants: FloatArray
    squares: FloatArray
    count: FloatArray
    weight: FloatArray

    @property
    def free(self) -> int:
        """Number of free parameters of the effects."""
        return sum(PATH_EFFECTS.get(name).count(theta) for name, theta in self.thetas.items())


def values_of(stage: Stage, thetas: Thetas) -> dict[str, FloatArray]:
    """Return the value (m, n) of each effect."""
    return {name: _part(stage, name, theta, False).value for name, theta in thetas.items()}


def _part(stage: Stage, name: str, theta: FloatArray, tangent: bool = True) -> Part:
    """Return what parameters of an effect do beyond the known ones: two lags are none in a row."""
    effect, known = PATH_EFFECTS.get(name), stage.known.get(name)
    if known is None:
        return effect.part(stage, theta, tangent)
    both = effect.part(stage, effect.joined(known, theta), tangent)
    return Part(both.value - effect.part(stage, known, False).value, both.pieces)


def rest_of(stage: Stage, thetas: Thetas) -> FloatArray:
    """Return what effects leave (m, n)."""
    rest = stage.gap
    for value in values_of(stage, thetas).values():
        rest = rest - value
    return rest


def fit(
    stage: Stage,
    thetas: Thetas,
    sigma: FloatArray,
    rows: BoolArray | None = None,
    steps: int = STEPS,
) -> Fit:
    """Return the parameters of least squares, from ``thetas`` on.

    Args:
        stage: where.
        thetas: parameters to begin with.
        sigma: (m,) noise of the outputs.
        rows: (n,) rows to fit on; None: all whose past is known.
        steps: most steps.
    """
    use = stage.scene.known if rows is None else rows & stage.scene.known
    good = np.isfinite(stage.gap) & use
    now = {name: np.array(theta) for name, theta in thetas.items()}
    at, best, share = now, _solved(stage, now, sigma, good), 1.0
    for _ in range(1, steps):
        now = _moved(at, best.thetas, share)
        solved = _solved(stage, now, sigma, good)
        before = _cost(at, best.squares, best.weight)
        change = before - _cost(now, solved.squares, best.weight)
        # a step that makes it worse went too far
        if change < 0.0:
            share *= 0.5
        else:
            at, best, share = now, solved, 1.0
        if abs(change) <= CLOSE * before:
            break
    ends = [(end, *_left(stage, end, good)) for end in (at, _moved(at, best.thetas, share))]
    now, constants, squares = min(ends, key=lambda end: _cost(end[0], end[2], best.weight))
    return replace(best, thetas=dict(now), constants=constants, squares=squares)


def _moved(at: Thetas, to: Thetas, share: float) -> dict[str, FloatArray]:
    """Return parameters a share of the way to others, as far as each effect goes at once."""
    return {n: PATH_EFFECTS.get(n).moved(theta, share * (to[n] - theta)) for n, theta in at.items()}


def _left(stage: Stage, thetas: Thetas, good: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the means (m,) of what effects leave, and the sums of squares (m,) about them."""
    rest = rest_of(stage, thetas)
    constants = _means(rest, good)
    return constants, np.where(good, (rest - constants[:, None]) ** 2, 0.0).sum(axis=1)


def unusual(name: str, theta: FloatArray) -> float:
    """Return by how many nats parameters are rarer than 0, as Cauchy's distribution has it."""
    return float(np.sum(np.log1p((theta / PATH_EFFECTS.get(name).widths(theta)) ** 2)))


def _cost(thetas: Thetas, squares: FloatArray, weight: FloatArray) -> float:
    """Return twice the negative logarithm of the posterior, but for a constant."""
    rare = sum(unusual(name, theta) for name, theta in thetas.items())
    return float(np.sum(weight * squares)) + 2.0 * rare


def _means(rest: FloatArray, good: BoolArray) -> FloatArray:
    count = np.maximum(good.sum(axis=1), 1)
    return np.asarray(np.where(good, rest, 0.0).sum(axis=1) / count)


def _solved(stage: Stage, thetas: Thetas, sigma: FloatArray, good: BoolArray) -> Fit:
    """Return a Gauss-Newton step, rows weighed by the size of the rest and how long it lasts."""
    names = list(thetas)
    parts = {name: _part(stage, name, theta) for name, theta in thetas.items()}
    firsts = dict(zip(names, np.cumsum([0, *(len(thetas[n]) for n in names)]), strict=False))
    total = sum(len(thetas[n]) for n in names)
    m = len(stage.gap)
    N, g = np.zeros((total + m, total + m)), np.zeros(total + m)
    rest = stage.gap
    for part in parts.values():
        rest = rest - part.value
    by_output: dict[int, list[tuple[list[int], FloatArray]]] = {}
    for name in names:
        for piece in parts[name].pieces:
            place = [firsts[name] + k for k in piece.index]
            by_output.setdefault(piece.output, []).append((place, piece.columns))
    squares, weights = np.zeros(m), np.zeros(m)
    for output in range(m):
        rows = good[output]
        if not rows.any():
            continue
        pieces = by_output.get(output, [])
        index = [k for place, _ in pieces for k in place] + [total + output]
        X = np.concatenate([*(c[rows] for _, c in pieces), np.ones((int(rows.sum()), 1))], axis=1)
        y = rest[output, rows]
        squares[output] = float(np.sum((y - y.mean()) ** 2))
        lasting = memory(np.where(rows, rest[output] - y.mean(), np.nan), stage.scene.stretches)
        level = max(squares[output] / len(y), max(float(sigma[output]), 1e-12) ** 2)
        weight = weights[output] = 1.0 / (lasting * level)
        np.add.at(N, np.ix_(index, index), weight * (X.T @ X))
        np.add.at(g, index, weight * (X.T @ y))
    theta = np.concatenate([*(thetas[n] for n in names), np.zeros(m)])
    width = np.concatenate(
        [*(PATH_EFFECTS.get(n).widths(thetas[n]) for n in names), np.full(m, np.inf)]
    )
    touched = N.diagonal() > 0.0
    rare = 2.0 / (width**2 + theta**2)
    N[np.diag_indices_from(N)] += rare
    g -= theta * rare
    scale = 1.0 / np.sqrt(np.where(touched, N.diagonal(), 1.0))
    A = N * scale * scale[:, None]
    A[np.diag_indices_from(A)] = np.where(touched, A.diagonal() + 1e-10, 1.0)
    g = np.where(touched, g, 0.0)
    inverse = np.linalg.inv(A)
    step = scale * (inverse @ (scale * g))
    deviation = scale * np.sqrt(np.maximum(inverse.diagonal(), 0.0))
    deviation = np.where(touched, deviation, np.inf)
    new, spread = {}, {}
    for name in names:
        rows = slice(firsts[name], firsts[name] + len(thetas[name]))
        new[name] = theta[rows] + step[rows]
        spread[name] = deviation[rows]
    count = good.sum(axis=1).astype(np.float64)
    return Fit(new, spread, step[total:], squares, count, weights)
