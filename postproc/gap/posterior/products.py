"""Products of the columns of all candidates on weighted rows, from which evidence is told."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.gap.posterior.prior import Candidate
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Block:
    """Candidates of k numbers each: keys, columns (m, k), products (m, k, k) and with the gap."""

    keys: tuple[str, ...]
    index: IntArray
    own: FloatArray
    told: FloatArray


@dataclass(frozen=True, slots=True)
class Equations:
    """Products of the columns of all candidates on weighted rows.

    A: (m, K) columns; z: (m,) gap; both in metres times the root of the row's relative weight;
    row: (m,) number of the row of each reading; H: (K, K) products of the columns; b: (K,) those
    with the gap; blocks: candidates by their size.
    """

    candidates: Sequence[Candidate]
    A: FloatArray
    z: FloatArray
    row: IntArray
    H: FloatArray
    b: FloatArray
    slices: Mapping[str, slice]
    by_key: Mapping[str, Candidate]
    blocks: tuple[Block, ...]

    @classmethod
    def of(cls, candidates: Sequence[Candidate], z: FloatArray, root: FloatArray) -> Equations:
        """Return the products.

        Args:
            candidates: with columns (n, 3, k) [m].
            z: (n, 3) gap [m].
            root: (n, 3, 3) root of the relative weight of each row; 0 leaves a row out.
        """
        read = np.any(root != 0.0, axis=2).ravel()
        use = np.flatnonzero(np.any(root != 0.0, axis=(1, 2)))
        A = np.empty((int(read.sum()), sum(c.X.shape[2] for c in candidates)))
        slices, of_size, start = {}, dict[int, list[str]](), 0
        for c in candidates:
            size = c.X.shape[2]
            slices[c.key] = slice(start, start + size)
            weighted = (root[use] @ c.X[use]).reshape(3 * len(use), size)
            A[:, start : start + size] = weighted[read.reshape(-1, 3)[use].ravel()]
            if size:
                of_size.setdefault(size, []).append(c.key)
            start += size
        flat = np.einsum("nij,nj->ni", root, z).ravel()[read]
        row = np.repeat(np.arange(len(root)), 3).astype(np.int32)[read]
        H, b = A.T @ A, A.T @ flat
        blocks = []
        for size, keys in of_size.items():
            first = np.array([slices[key].start for key in keys])
            index = (first[:, None] + np.arange(size)).astype(np.int32)
            own = H[index[:, :, None], index[:, None, :]]
            blocks.append(Block(tuple(keys), index, own, b[index]))
        by_key = {c.key: c for c in candidates}
        return cls(candidates, A, flat, row, H, b, slices, by_key, tuple(blocks))

    @property
    def readings(self) -> int:
        """How many numbers were read."""
        return len(self.z)

    @property
    def square(self) -> float:
        """Square of the gap [m^2]."""
        return float(self.z @ self.z)

    def among(self, keys: Sequence[str]) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return columns (p,), products (p, p) and products with the gap (p,) of candidates."""
        every = np.arange(self.A.shape[1], dtype=np.int32)
        index = np.concatenate([every[:0], *(every[self.slices[key]] for key in keys)])
        return index, self.H[np.ix_(index, index)], self.b[index]
