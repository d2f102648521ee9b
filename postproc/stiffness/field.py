"""Joint stiffness as a function of where the arm is: constant, per grid cell, or continuous.

A field answers one question: which compliance does each joint have at these joint angles. All
fields keep compliances, not stiffnesses (a joint that gives nothing has 0, no infinity), and work
on ratios (logarithms), so that a compliance is never negative. A joint that the data could not
see has NaN inside the field and ``fallback`` outside of it.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import field, replace

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import TINY, BoolArray, FloatArray, IntArray, frozen_floats
from postproc.errors import StiffnessError
from postproc.records import dataclass

Locate = Callable[[FloatArray], FloatArray]
"""Joint angles (n, 6) [rad] to the tool point (n, 3) [m] in robroot."""


@dataclass(frozen=True, slots=True)
class StiffnessField(ABC):
    """Joint compliance over the configurations of one arm.

    ``fallback`` (6,) [rad/(N*m)]: what a joint has that the data could not see; 0 = rigid.
    """

    fallback: FloatArray = field(default_factory=lambda: np.zeros(6), kw_only=True)

    @property
    @abstractmethod
    def observed(self) -> BoolArray:
        """(6,) joints that the data could see somewhere."""

    @abstractmethod
    def known(self, q: FloatArray, p_robroot_tcp: FloatArray | None) -> FloatArray:
        """Return (n, 6) [rad/(N*m)], NaN where the data could not see the joint."""

    def compliance(self, q: ArrayLike, p_robroot_tcp: ArrayLike | None = None) -> FloatArray:
        """Return the compliance of each joint.

        Args:
            q: (n, 6) or (6,) joint angles [rad].
            p_robroot_tcp: (n, 3) or (3,) tool points [m]; only fields over space need them, and
                those made with ``locate`` find them alone.

        Returns:
            (n, 6) or (6,) [rad/(N*m)], finite and >= 0.
        """
        angles = np.asarray(q, dtype=np.float64)
        rows = angles.reshape(-1, 6)
        points = None
        if p_robroot_tcp is not None:
            points = np.broadcast_to(
                np.asarray(p_robroot_tcp, dtype=np.float64), (*angles.shape[:-1], 3)
            ).reshape(-1, 3)
        c = self.known(rows, points)
        return np.where(np.isnan(c), self.fallback, c).reshape(angles.shape)

    def stiffness(self, q: ArrayLike, p_robroot_tcp: ArrayLike | None = None) -> FloatArray:
        """Return joint stiffness [N*m/rad], infinite where the compliance is 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(1.0 / self.compliance(q, p_robroot_tcp))

    def with_fallback(self, k_joint: ArrayLike | None) -> StiffnessField:
        """Return the field with stiffness (6,) [N*m/rad] for unseen joints; None: rigid."""
        c = np.zeros(6) if k_joint is None else 1.0 / np.asarray(k_joint, dtype=np.float64)
        return replace(self, fallback=c)


@dataclass(frozen=True, slots=True)
class ConstantField(StiffnessField):
    """One compliance (6,) [rad/(N*m)] for the whole workspace."""

    c_joint: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "c_joint", (6,))
        frozen_floats(self, "fallback", (6,))

    @property
    def observed(self) -> BoolArray:
        """(6,) joints with a number."""
        return np.isfinite(self.c_joint)

    def known(self, q: FloatArray, p_robroot_tcp: FloatArray | None) -> FloatArray:
        """Return the same row for every configuration."""
        return np.tile(self.c_joint, (len(q), 1))


def lattice(counts: Sequence[int]) -> IntArray:
    """Return the indices (n, 3) of the cells of a box, z fastest, then y, then x."""
    return np.stack([axis.ravel() for axis in np.indices(counts)], axis=-1)


@dataclass(frozen=True, slots=True)
class Grid:
    """Equal cells that fill a box: ``origin`` (3,) lowest corner, ``size`` (3,) of a cell [m].

    Cells are numbered with z fastest, then y, then x. A point outside belongs to the nearest cell.
    """

    origin: FloatArray
    size: FloatArray
    counts: tuple[int, int, int]

    def __post_init__(self) -> None:
        """Check shapes and freeze.

        Raises:
            StiffnessError: STF005 if a size or count is not positive.
        """
        frozen_floats(self, "origin", (3,))
        frozen_floats(self, "size", (3,))
        if bool(np.any(self.size <= 0.0)) or min(self.counts) < 1:
            raise StiffnessError("STF005", f"a grid of {self.counts} cells of {self.size} m")

    def __len__(self) -> int:
        """Return the number of cells."""
        return int(np.prod(self.counts))

    @property
    def lowest(self) -> FloatArray:
        """(cells, 3) lowest corner of each cell [m]."""
        return np.asarray(self.origin + lattice(self.counts) * self.size)

    def number(self, index: IntArray) -> IntArray:
        """Return cell numbers (...,) of cell indices (..., 3)."""
        _, ny, nz = self.counts
        return np.asarray((index[..., 0] * ny + index[..., 1]) * nz + index[..., 2])

    def touching(self, points: FloatArray, tolerance: float = TINY) -> tuple[IntArray, BoolArray]:
        """Return the up to eight cells whose closed box holds each point (n, 3).

        Returns:
            Cell numbers (n, 8) and which of them count (n, 8): one inside a cell, two on a face,
            four on an edge, eight on a corner.
        """
        scaled = (points - self.origin) / self.size
        last = np.asarray(self.counts) - 1
        choices = []
        for shift in (-tolerance, tolerance):
            index = np.floor(scaled + shift / self.size).astype(np.int32)
            choices.append(np.clip(index, 0, last))
        corners = lattice((2, 2, 2))
        pick = np.stack(choices)
        index = np.stack([pick[corners[k], :, np.arange(3)].T for k in range(8)], axis=1)
        number = self.number(index)
        counts = np.ones(number.shape, dtype=bool)
        for k in range(1, 8):
            counts[:, k] = np.all(number[:, :k] != number[:, k : k + 1], axis=1)
        return number, counts

    def surrounding(self, points: FloatArray) -> tuple[IntArray, FloatArray]:
        """Return the eight cells whose centres surround each point and their trilinear weights.

        Returns:
            Cell numbers (n, 8), weights (n, 8) that sum to 1; constant beyond the outer centres.
        """
        last = np.asarray(self.counts) - 1
        scaled = np.clip((points - self.origin) / self.size - 0.5, 0.0, last)
        low = np.minimum(np.floor(scaled).astype(np.int32), np.maximum(last - 1, 0))
        part = scaled - low
        corners = lattice((2, 2, 2))
        index = np.minimum(low[:, None, :] + corners, last)
        weight = np.prod(np.where(corners == 1, part[:, None, :], 1.0 - part[:, None, :]), axis=-1)
        return self.number(index), weight


@dataclass(frozen=True, slots=True)
class GridField(StiffnessField):
    """A compliance per cell of space: ``c_joint`` (cells, 6) [rad/(N*m)], NaN where unseen.

    ``blend`` False is the paper's rule: the cell's own value, the mean of the touching cells'
    stiffness on faces, edges and corners; it jumps at every face. ``blend`` True runs
    continuously between cell centres (trilinear in the logarithm).

    Source: Jiao et al. 2022, Eqs. (11), (12) and the special positions of its Section 2.3.
    """

    grid: Grid
    c_joint: FloatArray
    blend: bool = True
    locate: Locate | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "c_joint", (len(self.grid), 6))
        frozen_floats(self, "fallback", (6,))

    @property
    def observed(self) -> BoolArray:
        """(6,) joints with a number in at least one cell."""
        return np.asarray(np.any(np.isfinite(self.c_joint), axis=0))

    def known(self, q: FloatArray, p_robroot_tcp: FloatArray | None) -> FloatArray:
        """Return the compliance of the cells at the tool points.

        Raises:
            StiffnessError: STF006 if the tool points are neither given nor known.
        """
        points = p_robroot_tcp
        if points is None:
            if self.locate is None:
                raise StiffnessError("STF006", "a stiffness per cell needs the tool point")
            points = self.locate(q)
        if self.blend:
            cells, weight = self.grid.surrounding(points)
            return np.exp(_mean(np.log(self.c_joint[cells]), weight))
        cells, counts = self.grid.touching(points)
        return np.asarray(1.0 / _mean(1.0 / self.c_joint[cells], counts.astype(np.float64)))


@dataclass(frozen=True, slots=True)
class ContinuousField(StiffnessField):
    """log c_i(q) = base_i + Σ_m k(q, node_m) weight_mi + Σ_p h(q_i, own_pi) own_weight_pi.

    ``nodes`` (m, 6) [rad]; ``lengths`` (6,) [rad] of the kernel
    k = exp(-½ Σ_j ((q_j - node_j)/length_j)²); ``weights`` (m, 6); ``base`` (6,) log of
    [rad/(N*m)], NaN for an unseen joint. ``own_nodes`` (p, 6), ``own_lengths`` (6,) and
    ``own_weights`` (p, 6): the same of each joint's own angle alone. Smooth in joint space; far
    from all nodes it returns to ``base``.
    """

    nodes: FloatArray
    lengths: FloatArray
    base: FloatArray
    weights: FloatArray
    own_nodes: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))
    own_lengths: FloatArray = field(default_factory=lambda: np.ones(6))
    own_weights: FloatArray = field(default_factory=lambda: np.zeros((0, 6)))

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "nodes", (None, 6))
        frozen_floats(self, "lengths", (6,))
        frozen_floats(self, "base", (6,))
        frozen_floats(self, "weights", (len(self.nodes), 6))
        frozen_floats(self, "own_nodes", (None, 6))
        frozen_floats(self, "own_lengths", (6,))
        frozen_floats(self, "own_weights", (len(self.own_nodes), 6))
        frozen_floats(self, "fallback", (6,))

    @property
    def observed(self) -> BoolArray:
        """(6,) joints with a number."""
        return np.isfinite(self.base)

    def known(self, q: FloatArray, p_robroot_tcp: FloatArray | None) -> FloatArray:
        """Return the compliance at the joint angles; the tool point is not used."""
        out = np.empty((len(q), 6))
        for start in range(0, len(q), 2000):
            part = slice(start, start + 2000)
            own = own_kernel(q[part], self.own_nodes, self.own_lengths)
            log = self.base + kernel(q[part], self.nodes, self.lengths) @ self.weights
            out[part] = np.exp(log + np.einsum("inp,pi->ni", own, self.own_weights))
        return out

    def extrapolation(self, q: ArrayLike) -> FloatArray:
        """Return how far configurations (n, 6) are from all that was measured, 0..1.

        1 - (largest kernel value to a node): 0 at a node, near 1 where the field says nothing.
        """
        rows = np.asarray(q, dtype=np.float64).reshape(-1, 6)
        return np.asarray(1.0 - kernel(rows, self.nodes, self.lengths).max(axis=1))


def kernel(q: FloatArray, nodes: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return exp(-½ |(q - node)/length|²) (n, m) for joint angles (n, 6) and nodes (m, 6)."""
    a, b = q / lengths, nodes / lengths
    square = np.sum(a * a, axis=1)[:, None] + np.sum(b * b, axis=1) - 2.0 * (a @ b.T)
    return np.asarray(np.exp(-0.5 * np.maximum(square, 0.0)))


def own_kernel(q: FloatArray, nodes: FloatArray, lengths: FloatArray) -> FloatArray:
    """Return exp(-½ ((q_i - node_i)/length_i)²) (6, n, p) for joint angles (n, 6), nodes (p, 6)."""
    away = (q[:, None, :] - nodes[None]) / lengths
    return np.asarray(np.exp(-0.5 * np.moveaxis(away, 2, 0) ** 2))


def _mean(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return the weighted mean (n, 6) over (n, 8, 6) that leaves NaN out; NaN where all are."""
    seen = np.isfinite(values)
    share = weight[..., None] * seen
    total = np.sum(share, axis=1)
    with np.errstate(invalid="ignore"):
        return np.asarray(np.sum(np.where(seen, values, 0.0) * share, axis=1) / total)
