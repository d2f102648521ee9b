"""How probable rows are under a set of candidates: Laplace at the most probable scales.

With columns A (m, k) of unit noise, D the prior standard deviations and sigma the noise, the
covariance of the readings is sigma^2 + A D^2 A'. Everything is written in B = 1 + D A'A D /
sigma^2, which stays regular however small a scale or a determined number is. The scales and sigma
are themselves found: the same noise for every set would make of a flaw in one formula a thousand
nats for any other.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import field

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.posterior.prior import LOG_SCALES, Candidate, log_half_cauchy
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


@dataclass(slots=True)
class Equations:
    """Products of the columns of all candidates on weighted rows, made when they are asked for.

    A: (m, K) columns; z: (m,) gap; both in metres times the root of the row's relative weight;
    row: (m,) number of the row of each reading.
    """

    candidates: Sequence[Candidate]
    A: FloatArray
    z: FloatArray
    row: IntArray
    slices: Mapping[str, slice] = field(default_factory=dict)
    by_key: Mapping[str, Candidate] = field(default_factory=dict)
    _cross: dict[str, FloatArray] = field(default_factory=dict)

    @classmethod
    def of(cls, candidates: Sequence[Candidate], z: FloatArray, root: FloatArray) -> Equations:
        """Return the products.

        Args:
            candidates: with columns (n, 3, k) [m].
            z: (n, 3) gap [m].
            root: (n, 3, 3) root of the relative weight of each row; 0 leaves a row out.
        """
        use = np.flatnonzero(np.any(root != 0.0, axis=(1, 2)))
        nothing = np.zeros((len(use), 3, 0))
        X = np.concatenate([nothing, *(c.X[use] for c in candidates)], axis=2)
        A = (root[use] @ X).reshape(3 * len(use), -1)
        flat = np.einsum("nij,nj->ni", root[use], z[use]).ravel()
        slices, start = {}, 0
        for c in candidates:
            slices[c.key] = slice(start, start + c.X.shape[2])
            start += c.X.shape[2]
        row = np.repeat(use, 3).astype(np.int32)
        read = np.any(root[use] != 0.0, axis=2).ravel()
        by_key = {c.key: c for c in candidates}
        return cls(candidates, A[read], flat[read], row[read], slices, by_key)

    @property
    def readings(self) -> int:
        """How many numbers were read."""
        return len(self.z)

    @property
    def square(self) -> float:
        """Square of the gap [m^2]."""
        return float(self.z @ self.z)

    def cross(self, key: str) -> FloatArray:
        """Return the products (K + 1, k) of all columns and the gap with those of one candidate."""
        if key not in self._cross:
            own = self.A[:, self.slices[key]]
            self._cross[key] = np.vstack([self.A.T @ own, (self.z @ own)[None]])
        return self._cross[key]

    def among(self, keys: Sequence[str]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return columns (p,), products (p, p) and products with the gap (p,) of candidates."""
        index = np.concatenate(
            [np.arange(s.start, s.stop) for s in (self.slices[k] for k in keys)]
            or [np.zeros(0, dtype=np.int64)]
        ).astype(np.int32)
        if not len(keys):
            return index, np.zeros((0, 0)), np.zeros(0)
        whole = np.concatenate([self.cross(k) for k in keys], axis=1)
        return index, whole[index], whole[-1]


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
    """Log evidence, its slope, u (p,), inverse of B (p, p), square of the rest, D (p,)."""

    value: float
    slope: FloatArray
    u: FloatArray
    inverse: FloatArray
    left: float
    D: FloatArray


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
        return _Solved(value + prior, slope, u, inverse, left, D)

    def result(self, x: FloatArray, keys: tuple[str, ...], parts: Sequence[Candidate]) -> Optimum:
        """Return the optimum at log scales and log noise."""
        at = self.solved(x)
        value, u, inverse, left, D = at.value, at.u, at.inverse, at.left, at.D
        seen = 1.0 - np.diag(inverse)
        free = self.group >= 0
        # volume of each scale about its optimum, as far as its numbers are seen
        if self.groups:
            determined = np.bincount(self.group[free], seen[free], minlength=self.groups)
            value += float(np.sum(0.5 * np.log(2.0 * np.pi / (2.0 * determined + 1.0))))
        scales, at = {}, 0
        for part in parts:
            if not part.fixed:
                scales[part.key] = np.asarray(x[at : at + part.families])
                at += part.families
        taken = float(np.sum(seen))
        covariance = inverse * np.outer(D, D)
        return Optimum(
            keys,
            value,
            scales,
            float(np.exp(x[-1])),
            D * u,
            covariance,
            D,
            left,
            max(self.readings - taken, _LEAST_FREE * self.readings),
            self.square * float(np.exp(-2.0 * x[-1]))
            - float((D * self.b * np.exp(-2.0 * x[-1])) @ u),
        )


def gains(equations: Equations, at: Optimum, noise: NoisePrior) -> dict[str, tuple[float, float]]:
    """Return by candidate outside of a set what it would bring there [nats], and its log scale.

    Scales of the set stay, the noise falls as far as it may; what the candidate brings is summed
    over its own scale.
    """
    from scipy.linalg import solve_triangular

    inside = list(at.keys)
    s2 = at.sigma**2
    index, H, b = equations.among(inside)
    out = [c for c in equations.candidates if c.key not in at.keys]
    if len(index):
        B = H / s2 + np.diag(at.deviation**-2)
        L = np.linalg.cholesky(B)
        whole = np.concatenate([equations.cross(k) for k in inside], axis=1)[:-1] / s2
        V = solve_triangular(L, whole.T, lower=True)
        w = solve_triangular(L, b / s2, lower=True)
    else:
        V, w = np.zeros((0, equations.A.shape[1])), np.zeros(0)
    weight = log_half_cauchy(LOG_SCALES) + np.log(LOG_SCALES[1] - LOG_SCALES[0])
    floor = min(noise.sigma / at.sigma, 1.0) ** 2 if noise.freedom > 0.0 else 0.0
    by_size: dict[int, list[str]] = {}
    for c in out:
        by_size.setdefault(c.X.shape[2], []).append(c.key)
    found: dict[str, tuple[float, float]] = {}
    for keys in by_size.values():
        A, y = [], []
        for key in keys:
            part = equations.slices[key]
            own, mine = _own(equations, key)
            A.append(own / s2 - V[:, part].T @ V[:, part])
            y.append(mine / s2 - V[:, part].T @ w)
        each = _brought(np.array(A), np.array(y), at, equations.readings, floor)
        summed = each + weight
        top = summed.max(axis=1)
        value = top + np.log(np.sum(np.exp(summed - top[:, None]), axis=1))
        scale = LOG_SCALES[np.argmax(each, axis=1)]
        found |= dict(zip(keys, zip(value.tolist(), scale.tolist(), strict=True), strict=True))
    return found


def _brought(A: FloatArray, y: FloatArray, at: Optimum, readings: int, floor: float) -> FloatArray:
    """Return what candidates bring at each scale (m, t) [nats].

    Args:
        A: (m, k, k) products of what the set leaves of their columns, in its noise.
        y: (m, k) the same with the gap.
        at: the set.
        readings: how many.
        floor: least variance of the noise, over that of the set.
    """
    values, vectors = np.linalg.eigh(A)
    values = np.maximum(values, 0.0)[:, None]
    y2 = np.einsum("mkj,mk->mj", vectors, y)[:, None] ** 2
    t2 = np.exp(2.0 * LOG_SCALES)[None, :, None]
    square = np.sum(y2 * t2 / (1.0 + t2 * values), axis=2)
    left = np.maximum(at.quadratic - square, 1e-6 * at.quadratic)
    variance = np.clip(left / at.quadratic, floor, 1.0)
    value = 0.5 * (at.quadratic - left / variance) - 0.5 * readings * np.log(variance)
    return np.asarray(value - 0.5 * np.sum(np.log1p(t2 * values), axis=2))


def _own(equations: Equations, key: str) -> tuple[FloatArray, FloatArray]:
    """Return the products (k, k) of a candidate's columns, and those with the gap (k,)."""
    known = equations._cross.get(key)
    part = equations.slices[key]
    if known is not None:
        return known[part], known[-1]
    cache = equations._cross
    short = f"own {key}"
    if short not in cache:
        A = equations.A[:, part]
        cache[short] = np.vstack([A.T @ A, (equations.z @ A)[None]])
    return cache[short][:-1], cache[short][-1]


def held_out(
    equations: Equations, at: Optimum, without: Sequence[str], label: IntArray
) -> FloatArray:
    """Return what some candidates bring on each part of the rows, fitted to the others (k,) [nats].

    Half the fall of the squared misfit over the noise of the set that they are of.

    Args:
        equations: products.
        at: a set at its optimum; its scales stay.
        without: keys of the set that are judged.
        label: (n,) 0..k-1 of the rows; -1: of none.
    """
    index = equations.among(at.keys)[0]
    A, z = equations.A[:, index] / at.sigma, equations.z / at.sigma
    stays = np.ones(len(index), dtype=bool)
    for key in without:
        stays[at.part(equations, key)] = False
    found = np.zeros(int(label.max(initial=-1)) + 1)
    for k, P, q, others, told in _without_each(A, z, at.deviation**-2, label[equations.row]):
        if k < 0:
            continue
        left = []
        for use in (stays, np.ones(len(index), dtype=bool)):
            theta = np.linalg.solve(others[np.ix_(use, use)], told[use])
            left.append(float(np.sum((q - P[:, use] @ theta) ** 2)))
        found[k] = 0.5 * (left[0] - left[1])
    return found


def left_out(equations: Equations, at: Optimum, label: IntArray) -> float:
    """Return by how much rows are missed by fits without their label, 3D rms [m]; scales stay."""
    index = equations.among(at.keys)[0]
    A, z = equations.A[:, index], equations.z
    prior, square = (at.sigma / at.deviation) ** 2, 0.0
    for _, P, q, others, told in _without_each(A, z, prior, label[equations.row]):
        theta = np.linalg.solve(others, told)
        square += float(np.sum((q - P @ theta) ** 2))
    return float(np.sqrt(square / max(len(np.unique(equations.row)), 1)))


def _without_each(
    A: FloatArray, z: FloatArray, prior: FloatArray, own: IntArray
) -> Iterator[tuple[int, FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Yield each label, its rows of A and z, and the products of all others with the prior.

    Others are summed, never taken from the whole: where only the rows left out see a number, the
    difference is rounding, which beside a wide prior is no small number.
    """
    labels = np.unique(own).tolist()
    rows = [(A[own == k], z[own == k]) for k in labels]
    products = [(P.T @ P, P.T @ q) for P, q in rows]
    nothing = np.zeros((A.shape[1], A.shape[1])), np.zeros(A.shape[1])
    behind = [nothing]
    for H, b in reversed(products[1:]):
        behind.append((behind[-1][0] + H, behind[-1][1] + b))
    H, b = np.diag(prior), nothing[1]
    for (k, (P, q)), own_products, (more, told) in zip(
        zip(labels, rows, strict=True), products, reversed(behind), strict=True
    ):
        yield k, P, q, H + more, b + told
        H, b = H + own_products[0], b + own_products[1]
