"""Search for gear waves: which joint, how many periods per turn.

The number of periods is not linear, so it is scanned: every joint, many orders, on what a given
set of blocks leaves. A wave counts when it beats the largest that noise gives among all orders
tried.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import FloatArray
from postproc.gap.data import Samples
from postproc.gap.fit.linear import Block, design_matrix

LOWEST, HIGHEST = 2, 120
"""Orders scanned, whole numbers; refined to a hundredth afterwards."""
FRACTIONAL = 8
"""From this order on a gear ratio may give a number of periods that is not whole."""
TYPICAL = 1e-4
"""Amplitude [rad]."""
MOST = 11
"""As many waves are no gear error."""
MOST_ON_A_JOINT = 3
_PRICE = 5.0
"""Nats beyond the noise maximum that one more wave must bring."""

Wave = tuple[int, float]


def is_gear_error(waves: Sequence[Wave]) -> bool:
    """Return whether waves are few enough to be a cause.

    Anything can be built from waves: where there is no end of them, or many on one joint, they
    are a way to write down something else, and do not hold on other poses.
    """
    joints = [joint for joint, _ in waves]
    crowded = any(joints.count(joint) > MOST_ON_A_JOINT for joint in joints)
    return 0 < len(waves) < MOST and not crowded


class Projection:
    """What a set of blocks leaves of the gap, and of new columns once they are partialled out."""

    def __init__(self, blocks: Sequence[Block], y: FloatArray, weight: FloatArray) -> None:
        self.weight = weight
        self.y = (weight[:, None] * y).ravel()
        self._take((design_matrix(blocks, len(y)) * weight[:, None, None]).reshape(len(self.y), -1))

    def _take(self, X: FloatArray) -> None:
        self.X = X
        self.inverse = np.linalg.inv(X.T @ X + np.eye(X.shape[1]))

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

    def extend(self, columns: FloatArray) -> None:
        """Take columns (3n, k), scaled by prior and noise, among the blocks."""
        self._take(np.concatenate([self.X, columns], axis=1))


def find_waves(
    samples: Samples,
    y: FloatArray,
    weight: FloatArray,
    blocks: Sequence[Block],
    at_most: int = MOST,
    highest: int = HIGHEST,
) -> tuple[Wave, ...]:
    """Return the waves in what ``blocks`` leave of the gap, strongest first.

    Args:
        samples: rows.
        y: (n, 3) gap [m].
        weight: (n,) 1/sigma [1/m].
        blocks: what explains the rest.
        at_most: largest number of waves.
        highest: largest order that is tried.
    """
    context = Projection(blocks, y, weight)
    orders = np.arange(LOWEST, highest + 1, dtype=np.float64)
    tried = 6 * len(orders)
    found: list[Wave] = []
    for _ in range(at_most):
        rest = context.rest
        candidates = _strongest(samples, weight, rest, orders)
        scored = [(_gain(context, samples, wave, rest), wave) for wave in candidates]
        gain, wave = max(scored, key=lambda item: item[0])
        if gain < np.log(tried) + _PRICE:
            break
        wave = _refined(context, samples, wave, rest, gain)
        found.append(wave)
        context.extend(_columns(samples, weight, wave))
    return tuple(found)


def _columns(samples: Samples, weight: FloatArray, wave: Wave) -> FloatArray:
    joint, n = wave
    phase = n * samples.q[:, joint - 1]
    push = samples.jacobian[:, :, joint - 1] * (weight * TYPICAL)[:, None]
    both = np.stack([push * np.cos(phase)[:, None], push * np.sin(phase)[:, None]], axis=2)
    return both.reshape(-1, 2)


def _gain(context: Projection, samples: Samples, wave: Wave, rest: FloatArray) -> float:
    """Return the evidence [nats] that a wave adds."""
    return context.gain(_columns(samples, context.weight, wave), rest)


def _strongest(
    samples: Samples, weight: FloatArray, rest: FloatArray, orders: FloatArray
) -> list[Wave]:
    """Return the low orders of every joint and the high ones that stand out, roughly."""
    residual = rest.reshape(-1, 3)
    chosen: list[Wave] = [(joint, float(n)) for joint in range(1, 7) for n in range(LOWEST, 7)]
    power = np.zeros((6, len(orders)))
    for joint in range(6):
        push = samples.jacobian[:, :, joint] * weight[:, None]
        size = np.sum(push * push)
        if size < 1e-12:
            continue
        signal = np.einsum("ni,ni->n", push, residual)
        waves = np.exp(-1j * orders[:, None] * samples.q[None, :, joint])
        power[joint] = np.abs(waves @ signal) ** 2 / size
    order = np.argsort(power, axis=None)[::-1][:12]
    for flat in order:
        joint, index = np.unravel_index(flat, power.shape)
        chosen.append((int(joint) + 1, float(orders[index])))
    return list(dict.fromkeys(chosen))


def _refined(
    context: Projection, samples: Samples, wave: Wave, rest: FloatArray, gain: float
) -> Wave:
    """Return the order off the whole numbers if that is clearly better."""
    joint, n = wave
    if n < FRACTIONAL:
        return wave
    near = [(joint, n + d) for d in np.arange(-0.5, 0.51, 0.05) if n + d >= LOWEST]
    best = max(near, key=lambda w: _gain(context, samples, w, rest))
    for step in (0.02, 0.01):
        around = [(joint, best[1] + d * step) for d in (-1, 0, 1) if best[1] + d * step >= LOWEST]
        best = max(around, key=lambda w: _gain(context, samples, w, rest))
    better = _gain(context, samples, best, rest) > gain + 4.0
    return (joint, round(float(best[1]), 2)) if better else wave
