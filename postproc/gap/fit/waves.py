"""Search for gear waves: which joint, how many periods per turn.

The number of periods is not linear, so it is scanned: every joint, many orders, on what a given
set of blocks leaves. A wave counts when it beats the largest that noise gives among all orders
tried.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.records import dataclass

LOWEST, HIGHEST = 2, 120
"""Orders scanned, whole numbers; refined to a hundredth afterwards."""
FRACTIONAL = 8
"""From this order on a gear ratio may give a number of periods that is not whole."""
TYPICAL = 1e-4
"""Amplitude [rad]."""
MOST = 11
"""As many waves are no gear error."""
STANDING = 1e-3
"""A joint that turns by less [rad] over all rows stands: nothing can be told to follow it."""
_UNMOVED = 1e-20
_PRICE = 5.0
"""Nats beyond the noise maximum that one more wave must bring."""

Wave = tuple[int, float]


class Projection:
    """What a set of blocks leaves of the gap, and of new columns once they are partialled out."""

    def __init__(self, X: FloatArray, y: FloatArray, weight: FloatArray) -> None:
        """Take columns (n, 3, p) [m] of unit prior, a gap (n, 3) [m] and weights (n,) [1/m]."""
        self.weight = weight
        self.y = (weight[:, None] * y).ravel()
        X = (X * weight[:, None, None]).reshape(len(self.y), X.shape[2])
        self._take(X, X.T @ X)

    def _take(self, X: FloatArray, G: FloatArray) -> None:
        self.X, self.G = X, G
        self.inverse = np.linalg.inv(G + np.eye(len(G)))

    @property
    def rest(self) -> FloatArray:
        """(3n,) what the blocks leave of the gap, in units of the noise."""
        return self.residual_of(self.y[:, None])[:, 0]

    def residual_of(self, columns: FloatArray) -> FloatArray:
        """Return columns (3n, k) without what the blocks explain of them."""
        return np.asarray(columns - self.X @ (self.inverse @ (self.X.T @ columns)))

    def gain(self, columns: FloatArray, rest: FloatArray) -> float:
        """Return the evidence [nats] that columns (3n, k) add, where the blocks leave ``rest``."""
        A = columns.T @ self.residual_of(columns) + np.eye(columns.shape[1])
        b = columns.T @ rest
        return float(0.5 * b @ np.linalg.solve(A, b) - 0.5 * np.linalg.slogdet(A)[1])

    def pair_gains(self, pairs: FloatArray, rest: FloatArray) -> FloatArray:
        """Return (m,) the evidence [nats] that each of m pairs of columns (3n, m, 2) adds."""
        seen = (self.X.T @ pairs.reshape(len(pairs), -1)).reshape(-1, *pairs.shape[1:])
        taken = np.einsum("pma,pmb->mab", seen, np.tensordot(self.inverse, seen, 1))
        A = np.einsum("nma,nmb->mab", pairs, pairs) - taken + np.eye(2)
        b = np.einsum("nma,n->ma", pairs, rest)
        brought = np.einsum("ma,ma->m", b, np.linalg.solve(A, b[:, :, None])[:, :, 0])
        return np.asarray(0.5 * (brought - np.log(np.linalg.det(A))))

    def extend(self, columns: FloatArray) -> None:
        """Take columns (3n, k), scaled by prior and noise, among the blocks."""
        across = self.X.T @ columns
        G = np.block([[self.G, across], [across.T, columns.T @ columns]])
        self._take(np.concatenate([self.X, columns], axis=1), G)


def find_waves(
    samples: Samples,
    y: FloatArray,
    weight: FloatArray,
    beside: FloatArray,
) -> tuple[Wave, ...]:
    """Return the waves in what other columns leave of the gap, strongest first.

    Args:
        samples: rows.
        y: (n, 3) gap [m].
        weight: (n,) 1/sigma [1/m].
        beside: (n, 3, p) columns [m] of unit prior.
    """
    context = Projection(beside, y, weight)
    scan = _Scan.of(samples, weight, np.arange(LOWEST, HIGHEST + 1, dtype=np.float64))
    tried = 6 * len(scan.orders)
    found: list[Wave] = []
    for _ in range(MOST):
        rest = context.rest
        gain, wave = scan.best(context, scan.strongest(rest), rest)
        if gain < np.log(tried) + _PRICE:
            break
        wave = _refined(context, scan, wave, rest, gain)
        found.append(wave)
        context.extend(scan.columns(wave))
    return tuple(found)


@dataclass(frozen=True, slots=True)
class _Scan:
    """What waves of the joints do to some rows, in units of the noise.

    q: (n, 6); push: (n, 3, 6) of a turn of each joint by the usual amplitude; orders (k,);
    phase: (6, k, n) of whole orders on the unit circle.
    """

    q: FloatArray
    push: FloatArray
    orders: FloatArray
    phase: NDArray[np.complex128]

    @classmethod
    def of(cls, samples: Samples, weight: FloatArray, orders: FloatArray) -> _Scan:
        """Return the scan of some rows; a joint that stands has no waves."""
        turning = np.ptp(samples.q, axis=0) > STANDING
        push = samples.jacobian * turning * (weight * TYPICAL)[:, None, None]
        return cls(samples.q, push, orders, np.exp(-1j * orders[:, None] * samples.q.T[:, None]))

    def columns(self, wave: Wave) -> FloatArray:
        """Return the cosine and the sine (3n, 2) of a wave."""
        joint, n = wave
        phase = n * self.q[:, joint - 1]
        both = np.stack([np.cos(phase), np.sin(phase)], axis=1)
        moved: FloatArray = self.push[:, :, joint - 1, None] * both[:, None]
        return moved.reshape(-1, 2)

    def best(
        self, context: Projection, waves: Sequence[Wave], rest: FloatArray
    ) -> tuple[float, Wave]:
        """Return the evidence [nats] that the best of some waves adds, and that wave."""
        gains = context.pair_gains(np.stack([self.columns(w) for w in waves], axis=1), rest)
        best = int(np.argmax(gains))
        return float(gains[best]), waves[best]

    def strongest(self, rest: FloatArray) -> list[Wave]:
        """Return the low orders of every joint and the high ones that stand out, roughly."""
        residual = rest.reshape(-1, 3)
        chosen: list[Wave] = [(joint, float(n)) for joint in range(1, 7) for n in range(LOWEST, 7)]
        signal = np.einsum("nij,ni->jn", self.push, residual)
        size = np.sum(self.push**2, axis=(0, 1))
        seen = np.abs((self.phase @ signal[:, :, None])[:, :, 0]) ** 2
        power = np.where(size > _UNMOVED, 1.0, 0.0)[:, None] * seen
        power /= np.maximum(size, _UNMOVED)[:, None]
        for flat in np.argsort(power, axis=None)[::-1][:12]:
            joint, index = np.unravel_index(flat, power.shape)
            chosen.append((int(joint) + 1, float(self.orders[index])))
        return list(dict.fromkeys(chosen))


def _refined(context: Projection, scan: _Scan, wave: Wave, rest: FloatArray, gain: float) -> Wave:
    """Return the order off the whole numbers if that is clearly better."""
    joint, n = wave
    if n < FRACTIONAL:
        return wave
    near = [(joint, n + d) for d in np.arange(-0.5, 0.51, 0.05) if n + d >= LOWEST]
    reached, best = scan.best(context, near, rest)
    for step in (0.02, 0.01):
        around = [(joint, best[1] + d * step) for d in (-1, 0, 1) if best[1] + d * step >= LOWEST]
        reached, best = scan.best(context, around, rest)
    return (joint, round(float(best[1]), 2)) if reached > gain + 4.0 else wave
