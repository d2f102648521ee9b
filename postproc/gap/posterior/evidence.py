"""How probable rows are under a set of candidates: Laplace at the most probable scales.

With columns A (m, k) of unit noise, D the prior standard deviations and sigma the noise, the
covariance of the readings is sigma^2 + A D^2 A'. Everything is written in B = 1 + D A'A D /
sigma^2, which stays regular however small a scale or a determined number is. The scales and sigma
are themselves found: the same noise for every set would make of a flaw in one formula a thousand
nats for any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.posterior.prior import Candidate, Equations, log_half_cauchy
from postproc.records import dataclass

_STEPS = 25
_NEARLY = 3e-6
"""What a step may bring, over the evidence, that is taken without a look at what it brought."""
_LONGEST = 2.0
"""Step of a log scale in which the curvature may change its sign."""
_FLAT = 1e-9
_LOG_SCALE_BOUNDS = (-6.0, 6.0)
_LOG_NOISE_BOUNDS = (-16.0, -2.0)
_LEAST_FREE = 0.2
"""Share of the readings that a fit leaves free at least, however many numbers it has."""


@dataclass(frozen=True, slots=True)
class NoisePrior:
    """What is known of the noise before the fit: sd [m] of a reading, and how sure.

    freedom: of the repeats or the instrument, as of a chi-squared; what rows scatter by beside a
    model is no less than that, and may be more. Without (0): a log-normal of ``spread``.
    """

    sigma: float
    freedom: float
    spread: float = 1.1

    def value(self, log_sigma: float) -> tuple[float, float]:
        """Return the log density at a log sd, and its slope."""
        apart = log_sigma - float(np.log(self.sigma))
        if self.freedom <= 0.0:
            return -0.5 * (apart / self.spread) ** 2, -apart / self.spread**2
        if apart >= 0.0:
            return 0.0, 0.0
        ratio = float(np.exp(-2.0 * apart))
        return -0.5 * self.freedom * (ratio - 1.0 + 2.0 * apart), self.freedom * (ratio - 1.0)

    def curvature(self, log_sigma: float) -> float:
        """Return the second derivative of the log density."""
        if self.freedom <= 0.0:
            return -1.0 / self.spread**2
        apart = log_sigma - float(np.log(self.sigma))
        return 0.0 if apart >= 0.0 else -2.0 * self.freedom * float(np.exp(-2.0 * apart))


@dataclass(frozen=True, slots=True)
class Optimum:
    """A set of candidates at its most probable scales.

    value: log evidence [nats]; log_scale: by key, (families,); sigma: [m]; u: (p,) numbers of unit
    prior times their scale's standard deviation; spread: (p, p) covariance of these; left: [m^2]
    square of the rest; free: degrees of freedom of it; quadratic: square of the gap in the whole
    covariance.
    """

    keys: tuple[str, ...]
    value: float
    log_scale: Mapping[str, FloatArray]
    sigma: float
    theta: FloatArray
    covariance: FloatArray
    deviation: FloatArray
    left: float
    free: float
    quadratic: float

    def part(self, equations: Equations, key: str) -> slice:
        """Return where the numbers of one candidate stand."""
        start = 0
        for k in self.keys:
            size = equations.by_key[k].X.shape[2]
            if k == key:
                return slice(start, start + size)
            start += size
        raise KeyError(key)


def optimum(
    equations: Equations,
    keys: Sequence[str],
    noise: NoisePrior,
    start: Optimum | None = None,
    first: Mapping[str, FloatArray] | None = None,
    held: bool = False,
) -> Optimum:
    """Return a set of candidates at its most probable scales and noise.

    Args:
        equations: products.
        keys: the set.
        noise: what is known of it.
        start: another set whose scales are the start.
        first: start of scales by key, before that.
        held: the scales stay as they start; only the noise is sought.
    """
    keys = tuple(keys)
    parts = [equations.by_key[k] for k in keys]
    _, H, b = equations.among(keys)
    scale, base = [np.full(0, -1)], 0
    x0: list[float] = []
    for part in parts:
        if part.fixed:
            scale.append(np.full(len(part.family), -1))
            continue
        scale.append(part.family + base)
        base += part.families
        known = (first or {}).get(part.key)
        if known is None and start is not None:
            known = start.log_scale.get(part.key)
        x0 += list(np.zeros(part.families) if known is None else known)
    group = np.concatenate(scale).astype(np.int32)
    sigma = noise.sigma if start is None else start.sigma
    problem = _Problem(H, b, equations.square, equations.readings, group, base, noise)
    scales = [(v, v) for v in x0] if held else [_LOG_SCALE_BOUNDS] * base
    bounds = np.array([*scales, _LOG_NOISE_BOUNDS])
    return problem.result(problem.climbed(np.array([*x0, np.log(sigma)]), bounds), keys, parts)


@dataclass(frozen=True, slots=True)
class _Solved:
    """Log evidence, its slope, u (p,), inverse of B (p, p), square of the rest, D (p,).

    quadratic: square of the gap in the whole covariance.
    """

    value: float
    slope: FloatArray
    u: FloatArray
    inverse: FloatArray
    left: float
    D: FloatArray
    quadratic: float


@dataclass(frozen=True, slots=True)
class _Problem:
    """Log evidence as a function of log scales and log noise."""

    H: FloatArray
    b: FloatArray
    square: float
    readings: int
    group: IntArray
    groups: int
    noise: NoisePrior

    def climbed(self, x: FloatArray, bounds: FloatArray) -> FloatArray:
        """Return where the log evidence is highest within bounds (k, 2), by Newton steps."""
        x = np.clip(x, bounds[:, 0], bounds[:, 1])
        here, damping = self.solved(x), 0.0
        for _ in range(_STEPS):
            pushed = np.where(here.slope > 0.0, bounds[:, 1], bounds[:, 0])
            free = np.flatnonzero(x != pushed)
            curved, turns = np.linalg.eigh(-self.curvature(x, here)[np.ix_(free, free)])
            slope = turns.T @ here.slope[free]
            while True:
                # a saddle is left as a summit of the same curvature is reached
                step = turns @ (slope / (np.maximum(np.abs(curved), _FLAT) + damping))
                long = np.max(np.abs(step), initial=0.0)
                step *= min(1.0, _LONGEST / max(long, _FLAT))
                there = x.copy()
                there[free] += step
                there = np.clip(there, bounds[:, 0], bounds[:, 1])
                close = _NEARLY * max(abs(here.value), 1.0)
                if float(here.slope @ (there - x)) < close:
                    return there
                tried = self.solved(there)
                if tried.value >= here.value:
                    break
                damping = max(4.0 * damping, 1.0)
            x, here, damping = there, tried, 0.25 * damping if damping > 1.0 else 0.0
        return x

    def curvature(self, x: FloatArray, at: _Solved) -> FloatArray:
        """Return the second derivatives (k, k) of the log evidence by log scales and log noise."""
        M, u, Mu = at.inverse, at.u, at.inverse @ at.u
        own, squares = np.diag(M), np.sum(M * M, axis=0)
        member = (self.group[:, None] == np.arange(self.groups)).astype(float)
        found = np.zeros((len(x), len(x)))
        pairs = 2.0 * M * M + 4.0 * np.outer(u, u) * M
        found[:-1, :-1] = member.T @ pairs @ member
        t2 = np.exp(2.0 * x[:-1])
        single = member.T @ (2.0 * u**2 + 2.0 * own) + 4.0 * t2 / (1.0 + t2) ** 2
        found[:-1, :-1] -= np.diag(single)
        found[-1, :-1] = found[:-1, -1] = member.T @ (2.0 * (own - squares) - 4.0 * u * Mu)
        found[-1, -1] = 4.0 * float(u @ Mu) - 2.0 * at.left * float(np.exp(-2.0 * x[-1]))
        if self.readings - np.sum(1.0 - own) > _LEAST_FREE * self.readings:
            found[-1, -1] -= 2.0 * float(np.sum(own - squares))
        found[-1, -1] += self.noise.curvature(float(x[-1]))
        return found

    def solved(self, x: FloatArray) -> _Solved:
        """Return log evidence, its slope and what it is made of at log scales and log noise."""
        from scipy.linalg.lapack import dpotrf, dpotri

        sigma2 = float(np.exp(2.0 * x[-1]))
        D = np.ones(len(self.b))
        free = self.group >= 0
        D[free] = np.exp(x[self.group[free]])
        B = (D[:, None] * self.H * D) / sigma2
        B.flat[:: len(B) + 1] += 1.0
        half_log_det, inverse = 0.0, B
        if len(B):
            L, failed = dpotrf(B, lower=1)
            if failed:
                raise np.linalg.LinAlgError("the products of the columns are not positive")
            half_log_det = float(np.sum(np.log(np.diag(L))))
            half = dpotri(L, lower=1, overwrite_c=1)[0]
            inverse = half + half.T
            inverse.flat[:: len(B) + 1] *= 0.5
        v = D * self.b / sigma2
        u = inverse @ v
        theta = D * u
        left = max(self.square - float(theta @ (2.0 * self.b - self.H @ theta)), 0.0)
        taken = len(B) - float(np.trace(inverse))
        free_left = max(self.readings - taken, _LEAST_FREE * self.readings)
        quadratic = self.square / sigma2 - float(v @ u)
        value = -0.5 * quadratic - half_log_det - self.readings * float(x[-1])
        slope = np.zeros(len(x))
        per_number = u**2 + np.diag(inverse) - 1.0
        if self.groups:
            slope[:-1] = np.bincount(self.group[free], per_number[free], minlength=self.groups)
            t2 = np.exp(2.0 * x[:-1])
            value += float(np.sum(log_half_cauchy(x[:-1])))
            slope[:-1] += (1.0 - t2) / (1.0 + t2)
        slope[-1] = left / sigma2 - free_left
        prior, prior_slope = self.noise.value(float(x[-1]))
        slope[-1] += prior_slope
        return _Solved(value + prior, slope, u, inverse, left, D, quadratic)

    def result(self, x: FloatArray, keys: tuple[str, ...], parts: Sequence[Candidate]) -> Optimum:
        """Return the optimum at log scales and log noise."""
        at, free = self.solved(x), self.group >= 0
        seen = 1.0 - np.diag(at.inverse)
        scales, start = {}, 0
        for part in parts:
            if not part.fixed:
                scales[part.key] = np.asarray(x[start : start + part.families])
                start += part.families
        return Optimum(
            keys,
            at.value + volume(self.group[free], seen[free]),
            scales,
            float(np.exp(x[-1])),
            at.D * at.u,
            at.inverse * np.outer(at.D, at.D),
            at.D,
            at.left,
            max(self.readings - float(np.sum(seen)), _LEAST_FREE * self.readings),
            at.quadratic,
        )


def volume(family: IntArray, seen: FloatArray) -> float:
    """Return the logarithm of the volume of each scale about its optimum, summed [nats].

    Args:
        family: (p,) 0.. of numbers that share a scale.
        seen: (p,) how far the rows tell each number, 0..1.
    """
    determined = np.bincount(family, seen)
    return float(np.sum(0.5 * np.log(2.0 * np.pi / (2.0 * determined + 1.0))))


def held_out(
    equations: Equations, at: Optimum, without: Mapping[str, Sequence[str]], label: IntArray
) -> dict[str, FloatArray]:
    """Return what some candidates bring on each part of the rows, fitted to the others (k,) [nats].

    Half the fall of the squared misfit over the noise of the set that they are of.

    Args:
        equations: products.
        at: a set at its optimum; its scales stay.
        without: keys of the set that are judged together, by a name of theirs.
        label: (n,) 0..k-1 of the rows; -1: of none.
    """
    index = equations.among(at.keys)[0]
    A, z = equations.A[:, index] / at.sigma, equations.z / at.sigma
    every = np.arange(len(index))
    gone = {
        name: np.concatenate([every[:0], *(every[at.part(equations, key)] for key in keys)])
        for name, keys in without.items()
    }
    found = {name: np.zeros(int(label.max(initial=-1)) + 1) for name in without}
    for k, P, q, others, told in _without_each(A, z, at.deviation**-2, label[equations.row]):
        if k < 0:
            continue
        covariance = np.linalg.inv(others)
        theta = covariance @ told
        rest = q - P @ theta
        for name, part in gone.items():
            # these numbers at zero, all others where that moves them
            moved = covariance[:, part] @ np.linalg.solve(
                covariance[np.ix_(part, part)], theta[part]
            )
            found[name][k] = 0.5 * float(np.sum((rest + P @ moved) ** 2) - np.sum(rest**2))
    return found


def left_out(equations: Equations, at: Optimum, label: IntArray) -> tuple[float, float]:
    """Return by how much rows are missed by fits without their label, scales staying.

    Returns:
        3D rms [m]; and the sd [m] of a reading that tells it, beside what the numbers leave open.
    """
    index = equations.among(at.keys)[0]
    A, z = equations.A[:, index], equations.z
    prior, square, open_ = (at.sigma / at.deviation) ** 2, 0.0, 0.0
    for _, P, q, others, told in _without_each(A, z, prior, label[equations.row]):
        found = np.linalg.solve(others, np.column_stack([told, P.T]))
        square += float(np.sum((q - P @ found[:, 0]) ** 2))
        open_ += float(np.sum(P.T * found[:, 1:]))
    rows = max(len(np.unique(equations.row)), 1)
    return float(np.sqrt(square / rows)), float(np.sqrt(square / (len(z) + open_)))


def _without_each(
    A: FloatArray, z: FloatArray, prior: FloatArray, own: IntArray
) -> Iterator[tuple[int, FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Yield each label, its rows of A, z, and products summed over the others, with the prior."""
    labels = np.unique(own).tolist()
    rows = [(A[own == k], z[own == k]) for k in labels]
    H, b = np.stack([P.T @ P for P, _ in rows]), np.stack([P.T @ q for P, q in rows])
    for number, (k, (P, q)) in enumerate(zip(labels, rows, strict=True)):
        # summed, never taken from the whole: the difference may be rounding
        others = np.arange(len(labels)) != number
        yield k, P, q, H[others].sum(axis=0) + np.diag(prior), b[others].sum(axis=0)
