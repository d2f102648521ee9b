"""The linear regression that a choice is made on: gap, weights, folds, blocks of candidates."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.data import Samples
from postproc.gap.fit.linear import Block, NormalEquations

Subset = tuple[str, ...]
"""Keys of blocks."""


@dataclass(frozen=True, slots=True)
class Regression:
    """The linearised problem: rows, gap (n, 3) [m], weights (n,) [1/m], folds, blocks.

    ``excluded``: effects that made sealed rows worse; their blocks are gone.
    """

    samples: Samples
    y: FloatArray
    weight: FloatArray
    fold: IntArray
    blocks: tuple[Block, ...]
    always: Subset
    excluded: tuple[str, ...] = ()

    def without(self, names: Collection[str]) -> Regression:
        """Return the same rows with some effects excluded for good."""
        blocks = tuple(b for b in self.blocks if b.name not in names)
        return replace(self, blocks=blocks, excluded=(*self.excluded, *sorted(names)))

    @property
    def sigma(self) -> float:
        """Noise [m] per axis."""
        return float(1.0 / np.max(self.weight))

    @property
    def rows(self) -> int:
        """Rows in use."""
        return int(np.count_nonzero(self.weight))

    def block(self, key: str) -> Block:
        """Return a block by its key."""
        return next(block for block in self.blocks if block.key == key)

    def name(self, key: str) -> str:
        """Return the effect's name of a block."""
        return self.block(key).name

    def normal_equations(self) -> NormalEquations:
        """Return the normal equations of all rows in use."""
        return NormalEquations.of(self.blocks, self.y, self.weight)

    def fold_equations(self) -> list[NormalEquations]:
        """Return the normal equations of each fold."""
        equations = []
        for k in range(int(self.fold.max()) + 1):
            rows = np.flatnonzero((self.fold == k) & (self.weight > 0))
            if len(rows) >= 3:
                equations.append(self.equations_at(rows))
        return equations

    def equations_at(self, rows: Rows) -> NormalEquations:
        """Return the normal equations of some rows."""
        part = [block.rows(rows) for block in self.blocks]
        return NormalEquations.of(part, self.y[rows], self.weight[rows])
