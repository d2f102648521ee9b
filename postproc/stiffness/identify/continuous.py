"""Joint compliance as a smooth function of the joint angles: Gaussian processes on its logarithm.

log c_i(q) = log c0_i + b_i + h_i(q_i) + g_i(q) with b_i ~ N(0, 1), h_i a Gaussian process over the
joint's own angle, as gears and bearings make it, and g_i one over all six angles, kernel
amplitude² exp(-½ Σ_j ((q_j - q'_j)/length_j)²). In a wide workspace some tens of postures tell
little of six angles at once, but enough of each. Lengths, both amplitudes and noise come from the
marginal likelihood (linearised around the current fit) on a spread-out subset, which so decides how
much of either there is; the field itself from all load responses by damped Gauss-Newton on at most
``NODES`` kernel centres, so that a thousand configurations cost no more than a hundred. A
compliance is never negative, the field never jumps, and where nothing was measured it returns to
the constant.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IntArray
from postproc.records import dataclass
from postproc.stiffness.field import ContinuousField, kernel, own_kernel
from postproc.stiffness.identify.cases import LoadCases
from postproc.stiffness.identify.constant import ConstantFit, huber_weight
from postproc.stiffness.identify.observability import FINEST

NODES = 160
OWN_NODES = 16
"""Kernel centres of a joint's own angle, evenly over what was measured."""
SUBSET = 100
"""Cases that the marginal likelihood looks at."""
_OFFSET_SD = 1.0
_JITTER = 1e-6
_LOG_LENGTH = (-2.0, 2.5)
_LOG_AMPLITUDE = (-4.0, 1.0)
_ROUNDS = 3
_ROUNDS_SEEN = 3
"""The less a model leaves unexplained, the more joints it sees; so twice or three times."""
_STEPS = 40
HARDENING = 0.05
"""One sigma of the share by which a joint is stiffer at its usual load than without: gears of
robots give 10 percent more and beyond at low loads."""


@dataclass(frozen=True, slots=True)
class Hyper:
    """Kernel lengths (6,) [rad], amplitude of log c, and noise sigma [m].

    ``own_length`` [rad] and ``own_amplitude``: of what follows a joint's own angle.
    """

    lengths: FloatArray
    amplitude: float
    sigma: float
    own_length: float
    own_amplitude: float


@dataclass(frozen=True, slots=True)
class ContinuousFit:
    """A fitted field with what was learnt on the way.

    ``covariance`` (k*f, k*f) of the feature weights of the k seen joints; ``weight`` (n,) of the
    cases.
    """

    field: ContinuousField
    hyper: Hyper
    weight: FloatArray
    covariance: FloatArray
    features: _Features
    seen: BoolArray

    def log_sd(self, q: FloatArray) -> FloatArray:
        """Return one sigma of log c (n, 6) at joint angles (n, 6); NaN for an unseen joint."""
        sd = np.full((len(q), 6), np.nan)
        for place, P in enumerate(self.features.of(q, self.seen)):
            block = self._block(place, P.shape[1])
            sd[:, np.flatnonzero(self.seen)[place]] = np.sqrt(np.einsum("nf,fg,ng->n", P, block, P))
        return sd

    def relative_sd(self, cases: LoadCases) -> FloatArray:
        """Return one sigma (6,) of the mean compliance over the cases' postures, relative to it.

        A spring is stiffer under more load, by a rate that readings at one load a posture cannot
        show: they make the fit one for the larger loads of a joint, the mean is asked at the usual
        one. What such rates (``HARDENING``) do to the mean counts beside noise and prior. NaN for
        an unseen joint.
        """
        sd = np.full(6, np.nan)
        c = self.field.compliance(cases.q)[:, self.seen]
        weight = c / c.sum(axis=0)
        rows = np.einsum("ni,inf->if", weight, self.features.of(cases.q, self.seen))
        variance = np.array([row @ self._block(i, len(row)) @ row for i, row in enumerate(rows)])
        near = _Linear.around(cases, c, self.seen, np.log(c))
        for i, A in enumerate(np.moveaxis(cases.A[:, :, self.seen], 2, 0)):
            size = np.linalg.norm(A, axis=1)
            over = size / max(float(np.sqrt(np.mean(size**2))), 1e-300) - 1.0
            stiffer = replace(near, y=near.B[:, :, i] * over[:, None])
            variance += (HARDENING * stiffer.mean(self.hyper, weight)) ** 2
        sd[self.seen] = np.sqrt(variance)
        return sd

    def _block(self, place: int, size: int) -> FloatArray:
        own = slice(place * size, (place + 1) * size)
        return self.covariance[own, own]


def fit_continuous(
    cases: LoadCases, constant: ConstantFit, hyper: Hyper | None = None
) -> ContinuousFit:
    """Fit the field.

    Args:
        cases: load responses.
        constant: constant fit of the same cases: start, prior mean, and which joints are seen.
        hyper: kernel and noise; None: found from the data.
    """
    seen = constant.observability.seen
    noise = cases.floor.sigma if cases.floor else 0.3 * constant.sigma
    current = hyper or Hyper(np.ones(6), 0.3, max(noise, FINEST), 1.0, 0.3)
    for _ in range(_ROUNDS_SEEN):
        fit = _fit_seen(cases, constant, seen, current, search=hyper is None)
        current = fit.hyper
        more = constant.seen_with(cases, current.sigma)
        if bool(np.all(more == seen)):
            break
        seen = more
    return fit


def _fit_seen(
    cases: LoadCases, constant: ConstantFit, seen: BoolArray, current: Hyper, search: bool
) -> ContinuousFit:
    c0 = constant.centre[seen]
    centres = cases.q[cases.spread(NODES)]
    subset = cases.rows(_subset(cases))
    nodes = subset.q[subset.spread(len(subset))]
    log_ratio = np.zeros((len(subset), int(seen.sum())))
    for _ in range(_ROUNDS if search else 0):
        current = _maximise(subset, c0, seen, log_ratio, current, cases)
        part = _Fit(subset, c0, seen, _Features.over(subset.q, nodes, current))
        log_ratio = part.solve(np.ones(len(subset)))[0]
    fit = _Fit(cases, c0, seen, _Features.over(cases.q, centres, current))
    weight = np.ones(len(cases))
    v: FloatArray | None = None
    for _ in range(2):
        ratio, v = fit.solve(weight, v)
        left = cases.d - np.einsum("nij,nj->ni", cases.A[:, :, seen] * c0, np.exp(ratio))
        weight = huber_weight(np.linalg.norm(left, axis=1))
    _, v = fit.solve(weight, v)
    covariance = fit.covariance(v, weight)
    return ContinuousFit(fit.field(v), current, weight, covariance, fit.features, seen)


@dataclass(frozen=True, slots=True)
class _Features:
    """Whitened features of joint angles: weights of N(0, 1) make a field of the prior.

    ``nodes`` (m, 6) and ``own_nodes`` (p, 6) [rad]; ``factor`` (m, m), ``own_factor`` (6, p, p):
    Cholesky factors of the kernels between them.
    """

    hyper: Hyper
    nodes: FloatArray
    own_nodes: FloatArray
    factor: FloatArray
    own_factor: FloatArray

    @classmethod
    def over(cls, q: FloatArray, nodes: FloatArray, hyper: Hyper) -> _Features:
        """Return the features with nodes (m, 6), those of own angles over joint angles (n, 6)."""
        own_nodes = np.linspace(q.min(axis=0), q.max(axis=0), OWN_NODES)
        K = kernel(nodes, nodes, hyper.lengths) + _JITTER * np.eye(len(nodes))
        own = own_kernel(own_nodes, own_nodes, np.full(6, hyper.own_length))
        own = own + _JITTER * np.eye(OWN_NODES)
        factor, own_factor = (np.asarray(np.linalg.cholesky(k), np.float64) for k in (K, own))
        return cls(hyper, nodes, own_nodes, factor, own_factor)

    def of(self, q: FloatArray, seen: BoolArray) -> FloatArray:
        """Return the features (k, n, m + p + 1) of the k seen joints: all angles, own, constant."""
        K = kernel(q, self.nodes, self.hyper.lengths)
        smooth = self.hyper.amplitude * np.linalg.solve(self.factor, K.T).T
        own_K = own_kernel(q, self.own_nodes, np.full(6, self.hyper.own_length))[seen]
        own = np.linalg.solve(self.own_factor[seen], np.swapaxes(own_K, 1, 2))
        own = self.hyper.own_amplitude * np.swapaxes(own, 1, 2)
        constant = np.full((*own.shape[:2], 1), _OFFSET_SD)
        return np.concatenate(
            [np.broadcast_to(smooth, (len(own), *smooth.shape)), own, constant], axis=2
        )

    def field(self, v: FloatArray, c0: FloatArray, seen: BoolArray) -> ContinuousField:
        """Return the field of feature weights (k, f) around the compliances (k,)."""
        m, p = len(self.nodes), len(self.own_nodes)
        weights, own_weights = np.zeros((m, 6)), np.zeros((p, 6))
        base = np.full(6, np.nan)
        weights[:, seen] = self.hyper.amplitude * np.linalg.solve(self.factor.T, v[:, :m].T)
        back = np.swapaxes(self.own_factor[seen], 1, 2)
        own = np.linalg.solve(back, v[:, m : m + p, None])[:, :, 0]
        own_weights[:, seen] = self.hyper.own_amplitude * own.T
        base[seen] = np.log(c0) + _OFFSET_SD * v[:, -1]
        lengths = np.full(6, self.hyper.own_length)
        return ContinuousField(
            self.nodes, self.hyper.lengths, base, weights, self.own_nodes, lengths, own_weights
        )


class _Fit:
    """Damped Gauss-Newton on whitened feature weights v (k, f); the prior of v is N(0, 1)."""

    def __init__(
        self, cases: LoadCases, c0: FloatArray, seen: BoolArray, features: _Features
    ) -> None:
        self.features = features
        self.seen = seen
        self.c0 = c0
        self.P = features.of(cases.q, seen)
        self.A = cases.A[:, :, seen] * c0 / features.hyper.sigma
        self.d = cases.d / features.hyper.sigma

    def solve(
        self, weight: FloatArray, start: FloatArray | None = None
    ) -> tuple[FloatArray, FloatArray]:
        """Return the log ratios (n, k) to c0 and the feature weights v (k, f)."""
        v = np.zeros((len(self.c0), self.P.shape[2])) if start is None else start
        cost, left, ratio = self._cost(v, weight)
        damping = 1e-3
        for _ in range(_STEPS):
            H, gradient = self._normal(v, weight, left, ratio)
            before = cost
            while damping < 1e8:
                step = np.linalg.solve(H + damping * np.eye(len(H)), gradient).reshape(v.shape)
                tried = self._cost(v + step, weight)
                if tried[0] < cost:
                    v = v + step
                    cost, left, ratio = tried
                    damping = max(damping / 5.0, 1e-7)
                    break
                damping *= 5.0
            if before - cost < 1e-7 * abs(cost) + 1e-9:
                break
        return self._log_ratio(v), v

    def _log_ratio(self, v: FloatArray) -> FloatArray:
        """Return the log ratios (n, k) to c0 of feature weights (k, f)."""
        return np.asarray(np.einsum("inf,if->ni", self.P, v, optimize=True))

    def _cost(self, v: FloatArray, weight: FloatArray) -> tuple[float, FloatArray, FloatArray]:
        log_ratio = np.clip(self._log_ratio(v), -20.0, 20.0)
        ratio = np.exp(log_ratio)
        left = self.d - np.einsum("nij,nj->ni", self.A, ratio)
        with np.errstate(over="ignore"):
            data = float(np.sum(weight[:, None] * left * left))
        return 0.5 * data + 0.5 * float(np.sum(v * v)), left, ratio

    def _normal(
        self, v: FloatArray, weight: FloatArray, left: FloatArray, ratio: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        B = self.A * ratio[:, None, :] * np.sqrt(weight)[:, None, None]
        wide = np.einsum("nai,inf->naif", B, self.P).reshape(3 * len(B), -1)
        H = wide.T @ wide + np.eye(wide.shape[1])
        residual = (left * np.sqrt(weight)[:, None]).reshape(-1)
        return H, wide.T @ residual - v.reshape(-1)

    def covariance(self, v: FloatArray, weight: FloatArray) -> FloatArray:
        """Return the covariance of v around the optimum (Laplace)."""
        _, left, ratio = self._cost(v, weight)
        H, _ = self._normal(v, weight, left, ratio)
        return np.asarray(np.linalg.inv(H))

    def field(self, v: FloatArray) -> ContinuousField:
        """Return the field of feature weights."""
        return self.features.field(v, self.c0, self.seen)


def _maximise(
    cases: LoadCases,
    c0: FloatArray,
    seen: BoolArray,
    log_ratio: FloatArray,
    start: Hyper,
    whole: LoadCases,
) -> Hyper:
    """Return the hyper-parameters of largest marginal likelihood around the current field."""
    from scipy.optimize import minimize

    near = _Linear.around(cases, c0 * np.exp(log_ratio), seen, log_ratio)
    unit, known = start.sigma, whole.floor is not None and whole.floor.dof >= 30

    def objective(theta: FloatArray) -> tuple[float, FloatArray]:
        return near.cost(theta, unit, known)

    noise_range = (-0.7, 0.7) if known else (-4.0, 4.0)
    bounds = [_LOG_LENGTH] * 7 + [_LOG_AMPLITUDE] * 2 + [noise_range]
    rest = [start.own_length, start.amplitude, start.own_amplitude, start.sigma / unit]
    guess = np.log([*start.lengths, *rest])
    found = minimize(
        objective, guess, method="L-BFGS-B", jac=True, bounds=bounds, options={"maxiter": 30}
    )
    return _hyper(found.x, unit)


def _hyper(theta: FloatArray, unit: float) -> Hyper:
    """Return the hyper-parameters of their logarithms (10,), noise in ``unit`` [m]."""
    own_length, amplitude, own_amplitude, sigma = np.exp(theta[6:]).tolist()
    lengths = np.exp(theta[:6])
    return Hyper(lengths, amplitude, max(unit * sigma, FINEST), own_length, own_amplitude)


@dataclass(frozen=True, slots=True)
class _Linear:
    """The load responses around a field: y (n, 3) = sum of B (n, 3, k) times log ratios, and noise.

    q (n, 6); seen (6,): which joints the k are. Log ratios are those to a constant.
    """

    q: FloatArray
    B: FloatArray
    y: FloatArray
    seen: BoolArray

    @classmethod
    def around(
        cls, cases: LoadCases, c: FloatArray, seen: BoolArray, log_ratio: FloatArray
    ) -> _Linear:
        """Return the responses around compliances c (n, k) with these log ratios (n, k)."""
        B = cases.A[:, :, seen] * c[:, None, :]
        return cls(
            cases.q, B, cases.d - B.sum(axis=2) + np.einsum("nij,nj->ni", B, log_ratio), seen
        )

    def cost(self, theta: FloatArray, unit: float, known: bool) -> tuple[float, FloatArray]:
        """Return what is to be least over the logarithms (10,) of the hyper-parameters.

        And its gradient (10,).
        """
        # weak beliefs: lengths near a radian, ratios near e^0.3 of each kind, noise as it was read
        middle = np.repeat([0.0, -1.2, 0.0], [7, 2, 1])
        off = (theta - middle) / np.repeat([1.0, 0.2 if known else 2.0], [9, 1]) ** 2
        prior = 0.5 * float(off @ (theta - middle))
        hyper = _hyper(theta, unit)
        try:
            L, y, _ = self._whitened(hyper)
        except np.linalg.LinAlgError:
            return 1e12, off
        back = np.linalg.inv(L)
        z = back @ y
        size = np.log(np.diag(L)) + np.log(hyper.sigma / unit)
        slope = off + self._slope(hyper, back.T @ back, back.T @ z)
        return prior + 0.5 * float(z @ z) + float(np.sum(size)), slope

    def _slope(self, hyper: Hyper, precision: FloatArray, pull: FloatArray) -> FloatArray:
        """Return the gradient (10,) of half the squared misfit and half the log determinant."""
        q, n = self.q, len(self.q)
        rows = self.B / hyper.sigma
        # half the trace of (precision - pull pull') dS, by the change of each joint's prior
        half = 0.5 * (precision - np.outer(pull, pull)).reshape(n, 3, 3 * n)
        left = (np.swapaxes(rows, 1, 2) @ half).reshape(n, -1, n, 3)
        G = np.einsum("nkmb,mbk->knm", left, rows)
        K = hyper.amplitude**2 * kernel(q, q, hyper.lengths)
        own = hyper.own_amplitude**2 * own_kernel(q, q, np.full(6, hyper.own_length))[self.seen]
        apart = (q[:, None] - q[None]) ** 2
        smooth, single = G.sum(axis=0) * K, G * own
        lengths = np.einsum("nm,nmj->j", smooth, apart) / hyper.lengths**2
        own_length = np.einsum("knm,nmk->", single, apart[:, :, self.seen]) / hyper.own_length**2
        noise = float(np.trace(precision) - pull @ pull) if hyper.sigma > FINEST else 0.0
        return np.array([*lengths, own_length, 2.0 * smooth.sum(), 2.0 * single.sum(), noise])

    def mean(self, hyper: Hyper, weight: FloatArray) -> FloatArray:
        """Return the most probable weighted means (k,) of the log ratios; weight (n, k)."""
        L, y, K = self._whitened(hyper)
        v = np.linalg.solve(L.T, np.linalg.solve(L, y)).reshape(-1, 3)
        pull = np.einsum("na,nak->nk", v, self.B) / hyper.sigma
        return np.asarray(np.einsum("nk,knm,mk->k", weight, K, pull))

    def _whitened(self, hyper: Hyper) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return the Cholesky factor of y's covariance, y in sigma, and the priors (k, n, n)."""
        q, n = self.q, len(self.q)
        K = hyper.amplitude**2 * kernel(q, q, hyper.lengths) + _OFFSET_SD**2
        own = hyper.own_amplitude**2 * own_kernel(q, q, np.full(6, hyper.own_length))[self.seen]
        rows = self.B / hyper.sigma
        S = np.eye(3 * n)
        both = np.empty((n, 3, n, 3))
        for k, of_joint in enumerate(own + K):
            np.multiply(rows[:, :, None, None, k], rows[None, None, :, :, k], out=both)
            both *= of_joint[:, None, :, None]
            S += both.reshape(3 * n, 3 * n)
        return np.asarray(np.linalg.cholesky(S)), self.y.reshape(-1) / hyper.sigma, own + K


def _subset(cases: LoadCases) -> IntArray:
    """Return cases of spread-out postures, all loads of a posture together."""
    per_posture = max(len(cases) / len(np.unique(cases.posture)), 1.0)
    rows = cases.spread(max(int(SUBSET / per_posture), 8))
    return np.asarray(np.flatnonzero(np.isin(cases.posture, cases.posture[rows])))
