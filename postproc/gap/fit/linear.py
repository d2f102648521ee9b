"""The linearised gap: columns of every candidate, NormalEquations matrices, evidence of a subset.

Every column is scaled by the typical size of its parameter, so that the prior of each number is a
standard normal, and by the noise. With G = X^T X and b = X^T y the log evidence of a subset S
against "nothing" is 1/2 b^T (G + 1)^-1 b - 1/2 log det(G + 1): what it explains minus the price
of its freedom. One NormalEquations matrix serves all subsets and, part by part, all folds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import field, replace

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.data import Samples
from postproc.gap.effect import Effect, Parameter, Setting
from postproc.gap.robot_model import columns
from postproc.records import dataclass

Subset = tuple[str, ...]
"""Keys of blocks."""


@dataclass(frozen=True, slots=True)
class Block:
    """Columns of one candidate, (n, 3, p) in metres per typical size. ``key`` is its variant.

    ``start`` (p,): the numbers that the given model has already, None for zero.
    """

    effect: Effect
    setting: Setting
    parameters: tuple[Parameter, ...]
    X: FloatArray
    key: str
    start: FloatArray | None = None

    @property
    def name(self) -> str:
        """Name of the effect; two blocks of one name are alternatives."""
        return self.effect.name

    @property
    def is_alternative(self) -> bool:
        """Whether it is only a resemblance, never a named cause."""
        return self.effect.is_alternative

    @property
    def typical(self) -> FloatArray:
        """(p,) typical sizes."""
        return np.array([p.typical for p in self.parameters])

    def rows(self, index: Rows) -> Block:
        """Return the columns at some rows."""
        return replace(self, X=self.X[index])


def design_matrix(blocks: Sequence[Block], n: int) -> FloatArray:
    """Return the columns (n, 3, p) of blocks side by side."""
    return np.concatenate([block.X for block in blocks] or [np.zeros((n, 3, 0))], axis=2)


def block_of(
    effect: Effect,
    samples: Samples,
    setting: Setting,
    key: str = "",
    widen: float = 1.0,
    start: FloatArray | None = None,
) -> Block:
    """Return the columns of an effect at these samples; ``widen`` multiplies its prior."""
    parameters = effect.parameters(samples.arm, setting)
    typical = np.array([p.typical for p in parameters]) * widen
    X = columns(samples, effect.basis(samples, setting)) * typical
    if widen != 1.0:
        parameters = tuple(replace(p, typical=p.typical * widen) for p in parameters)
    return Block(effect, setting, parameters, X, key or effect.name, start)


@dataclass(slots=True)
class NormalEquations:
    """Normal equations of all blocks on some rows, in units of the noise.

    ``b`` and ``total`` follow from the gap ``y`` (n, 3) [m]; ``slices`` finds a block's columns.
    """

    blocks: Sequence[Block]
    G: FloatArray
    b: FloatArray
    total: float
    slices: dict[str, slice] = field(default_factory=dict)
    nuisance: tuple[str, ...] = ()
    rows: int = 0
    _reduced: tuple[FloatArray, FloatArray, float] | None = None
    _numbers: dict[Subset, FloatArray] = field(default_factory=dict)
    _freedom: dict[Subset, float] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        blocks: Sequence[Block],
        y: FloatArray,
        weight: FloatArray,
        nuisance: tuple[str, ...] = (),
    ) -> NormalEquations:
        """Return the normal equations.

        Args:
            blocks: candidates.
            y: (n, 3) gap [m].
            weight: (n,) 1/sigma [1/m]; 0 leaves a row out.
            nuisance: keys of blocks that are always there and integrated out: correlated noise.
        """
        n = len(y)
        flat = (weight[:, None] * y).ravel()
        X = (design_matrix(blocks, n) * weight[:, None, None]).reshape(3 * n, -1)
        slices, start = {}, 0
        for block in blocks:
            slices[block.key] = slice(start, start + block.X.shape[2])
            start += block.X.shape[2]
        return cls(
            blocks,
            X.T @ X,
            X.T @ flat,
            float(flat @ flat),
            slices,
            nuisance,
            int(np.count_nonzero(weight)),
        )

    def plus(self, other: NormalEquations, sign: float = 1.0) -> NormalEquations:
        """Return the normal equations of these rows and those of another."""
        return NormalEquations(
            self.blocks,
            self.G + sign * other.G,
            self.b + sign * other.b,
            self.total + sign * other.total,
            self.slices,
            self.nuisance,
            self.rows + int(sign) * other.rows,
        )

    def reduced(self) -> tuple[FloatArray, FloatArray, float]:
        """Return G, b and total with the nuisance integrated out; its own columns stay unused."""
        if not self.nuisance:
            return self.G, self.b, self.total
        if self._reduced is None:
            i = self._columns(self.nuisance)
            L = np.linalg.cholesky(self.G[np.ix_(i, i)] + np.eye(len(i)))
            A, z = np.linalg.solve(L, self.G[i]), np.linalg.solve(L, self.b[i])
            self._reduced = self.G - A.T @ A, self.b - A.T @ z, self.total - float(z @ z)
        return self._reduced

    def noise_of(self, keys: Sequence[str]) -> FloatArray:
        """Return the most probable numbers (p,) of the nuisance beside a fitted subset."""
        i = self._columns((*self.nuisance, *keys))
        whole = np.linalg.solve(self.G[np.ix_(i, i)] + np.eye(len(i)), self.b[i])
        return np.asarray(whole[: len(self._columns(self.nuisance))])

    def minus(self, other: NormalEquations) -> NormalEquations:
        """Return the normal equations without the rows of another."""
        return self.plus(other, -1.0)

    def index(self, keys: Sequence[str]) -> IntArray:
        """Return the columns of these blocks."""
        return self._columns(keys)

    def _columns(self, keys: Sequence[str]) -> IntArray:
        if not keys:
            return np.zeros(0, dtype=np.int32)
        return np.concatenate([np.arange(s.start, s.stop) for s in (self.slices[k] for k in keys)])

    def evidence(self, keys: Sequence[str]) -> float:
        """Return the log evidence of a subset against nothing, in nats."""
        if not keys:
            return 0.0
        i = self.index(keys)
        G, b, _ = self.reduced()
        theta, half_log_det = _solved(G[np.ix_(i, i)], b[i])
        return float(0.5 * b[i] @ theta - half_log_det)

    def numbers(self, keys: Subset) -> FloatArray:
        """Return the most probable numbers (p,) of a subset in typical sizes."""
        if keys not in self._numbers:
            i = self.index(keys)
            G, b, _ = self.reduced()
            self._numbers[keys] = _solved(G[np.ix_(i, i)], b[i])[0] if len(i) else np.zeros(0)
        return self._numbers[keys]

    def solve(self, keys: Sequence[str]) -> tuple[FloatArray, FloatArray]:
        """Return the most probable numbers (p,) in typical sizes and their covariance (p, p)."""
        i = self.index(keys)
        if len(i) == 0:
            return np.zeros(0), np.zeros((0, 0))
        G, b, _ = self.reduced()
        covariance = np.linalg.inv(G[np.ix_(i, i)] + np.eye(len(i)))
        return np.asarray(covariance @ b[i]), np.asarray(covariance)

    def misfit(self, keys: Sequence[str], theta: FloatArray) -> float:
        """Return the sum of squares that numbers leave on these rows, in noise units."""
        i = self.index(keys)
        G, b, total = self.reduced()
        if len(i) == 0:
            return total
        explained = float(2.0 * theta @ b[i] - theta @ G[np.ix_(i, i)] @ theta)
        return max(total - explained, 0.0)

    def left(self, keys: Subset) -> float:
        """Return the sum of squares that a fitted subset leaves, in noise units."""
        return self.misfit(keys, self.numbers(keys))

    def freedom(self, keys: Subset) -> float:
        """Return the effective number of fitted parameters."""
        if keys not in self._freedom:
            i = self.index(keys)
            G = self.reduced()[0][np.ix_(i, i)]
            unit = np.eye(len(i))
            share = len(i) - np.trace(_solved(G, unit)[0]) if len(i) else 0.0
            self._freedom[keys] = float(share)
        return self._freedom[keys]


def _solved(G: FloatArray, b: FloatArray) -> tuple[FloatArray, float]:
    """Return (G + 1)^-1 b and half the logarithm of the determinant of G + 1."""
    from scipy.linalg.lapack import dposv

    A = G.copy(order="F")
    A.flat[:: len(A) + 1] += 1.0
    L, theta, failed = dposv(A, b, lower=1, overwrite_a=1)
    if failed:
        raise np.linalg.LinAlgError("normal equations are not positive definite")
    return np.asarray(theta), float(np.sum(np.log(np.diag(L))))


def predicted(blocks: Sequence[Block], theta: FloatArray) -> FloatArray:
    """Return (n, 3) [m] of numbers (p,) in typical sizes."""
    return np.asarray(design_matrix(blocks, len(blocks[0].X)) @ theta)
