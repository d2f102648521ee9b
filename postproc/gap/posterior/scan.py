"""What each candidate would bring to a set, or to what is left of a set without some of its own.

The scales of the set stay; a candidate comes at the scale that suits it. So the set is factored
once, and all that is asked of it costs products of columns: only sets that come near are then
brought to their own most probable scales.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.posterior.evidence import NoisePrior, Optimum, volume
from postproc.gap.posterior.prior import LOG_SCALES, log_half_cauchy
from postproc.gap.posterior.products import Equations
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Scan:
    """A set at its optimum, factored.

    root: (p, p) lower triangular whose square is the covariance of the numbers; V: (p, K) products
    of the set with all columns, through it; w: (p,) those with the gap; open: by block what the
    set leaves of the candidates' products, in its noise; floor: least variance of the noise, over
    that of the set.
    """

    equations: Equations
    at: Optimum
    root: FloatArray
    V: FloatArray
    w: FloatArray
    open: tuple[tuple[FloatArray, FloatArray], ...]
    floor: float

    @classmethod
    def of(cls, equations: Equations, at: Optimum, noise: NoisePrior) -> Scan:
        """Return what is asked of a set later."""
        from scipy.linalg.lapack import dtrtri

        s2, D = at.sigma**2, at.deviation
        index, H, b = equations.among(at.keys)
        root = np.zeros((len(D), len(D)))
        if len(D):
            B = np.eye(len(D)) + (D[:, None] * H * D) / s2
            root = dtrtri(np.linalg.cholesky(B), lower=1)[0] * D
        V, w = root @ (equations.H[index] / s2), root @ (b / s2)
        left = []
        for block in equations.blocks:
            part = V[:, block.index].transpose(1, 2, 0)
            own = block.own / s2 - part @ part.transpose(0, 2, 1)
            left.append((own, block.told / s2 - part @ w))
        floor = min(noise.sigma / at.sigma, 1.0) ** 2 if noise.freedom > 0.0 else 0.0
        return cls(equations, at, root, V, w, tuple(left), floor)

    def without(self, gone: Sequence[str] = ()) -> tuple[float, dict[str, tuple[float, float]]]:
        """Return what the set without some of its candidates is worth more than the set [nats].

        Returns:
            Of what is left alone; by each candidate that is not in it what that brings beside
            [nats], and its log scale. The noise is what suits each.
        """
        at, parts = self.at, [self.at.part(self.equations, key) for key in gone]
        every = np.arange(len(self.w))
        columns = np.concatenate([every[:0], *(every[part] for part in parts)])
        Q, R = np.linalg.qr(self.root[:, columns])
        X, x = Q.T @ self.V, Q.T @ self.w
        # the numbers that go are pressed to zero from their own posterior
        size = np.abs(np.diag(R)) / at.deviation[columns]
        alone = -float(np.sum(np.log(size)))
        for key, part in zip(gone, parts, strict=True):
            candidate = self.equations.by_key[key]
            seen = 1.0 - np.diag(at.covariance)[part] / at.deviation[part] ** 2
            alone -= volume(candidate.family, seen)
            alone -= float(np.sum(log_half_cauchy(at.log_scale[key])))
        quadratic = at.quadratic + float(x @ x)
        stays = set(at.keys).difference(gone)
        found: dict[str, tuple[float, float]] = {}
        for block, (own, told) in zip(self.equations.blocks, self.open, strict=True):
            asked = np.array([key not in stays for key in block.keys])
            keys = [key for key in block.keys if key not in stays]
            back = X[:, block.index[asked]].transpose(1, 2, 0)
            A, y = own[asked] + back @ back.transpose(0, 2, 1), told[asked] + back @ x
            each = self._brought(A, y, quadratic) + alone
            summed = each + log_half_cauchy(LOG_SCALES) + np.log(LOG_SCALES[1] - LOG_SCALES[0])
            top = summed.max(axis=1)
            value = top + np.log(np.sum(np.exp(summed - top[:, None]), axis=1))
            scale = LOG_SCALES[np.argmax(each, axis=1)]
            found |= dict(zip(keys, zip(value.tolist(), scale.tolist(), strict=True), strict=True))
        return alone + float(self._likely(np.array(quadratic))), found

    def _likely(self, quadratic: FloatArray) -> FloatArray:
        """Return the log likelihood over that of the set, at the noise that suits the rest."""
        usual = self.at.quadratic
        left = np.maximum(quadratic, 1e-6 * usual)
        variance = np.maximum(left / usual, self.floor)
        log_volume = self.equations.readings * np.log(variance)
        return np.asarray(0.5 * (usual - left / variance) - 0.5 * log_volume)

    def _brought(self, A: FloatArray, y: FloatArray, quadratic: float) -> FloatArray:
        """Return what candidates bring at each scale (m, t) [nats].

        Args:
            A: (m, k, k) products of what is left of their columns, in the noise of the set.
            y: (m, k) the same with the gap.
            quadratic: square of the gap in the covariance of what they come to.
        """
        values, vectors = np.linalg.eigh(A)
        values = np.maximum(values, 0.0)[:, None]
        y2 = np.einsum("mkj,mk->mj", vectors, y)[:, None] ** 2
        t2 = np.exp(2.0 * LOG_SCALES)[None, :, None]
        square = np.sum(y2 * t2 / (1.0 + t2 * values), axis=2)
        likely = self._likely(quadratic - square)
        return np.asarray(likely - 0.5 * np.sum(np.log1p(t2 * values), axis=2))
