"""What a choice is made on: rows, gap, weights, folds, and the blocks that may explain it."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.data import Samples
from postproc.gap.fit.linear import Block, Gram
from postproc.gap.fit.select import Subset


@dataclass(frozen=True, slots=True)
class Bench:
    """Everything a choice is made on: rows, gap (n, 3) [m], weights, folds, blocks.

    ``barred``: effects that made sealed rows worse; their blocks are gone.
    """

    samples: Samples
    y: FloatArray
    weight: FloatArray
    fold: IntArray
    blocks: tuple[Block, ...]
    always: Subset
    barred: tuple[str, ...] = ()

    def without(self, names: Collection[str]) -> Bench:
        """Return the same rows with some effects barred for good."""
        blocks = tuple(b for b in self.blocks if b.name not in names)
        return replace(self, blocks=blocks, barred=(*self.barred, *sorted(names)))

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

    def gram(self) -> Gram:
        """Return the normal equations of all rows in use."""
        return Gram.of(self.blocks, self.y, self.weight)

    def fold_grams(self) -> list[Gram]:
        """Return the normal equations of each fold."""
        grams = []
        for k in range(int(self.fold.max()) + 1):
            rows = np.flatnonzero((self.fold == k) & (self.weight > 0))
            if len(rows) >= 3:
                part = [picked(block, rows) for block in self.blocks]
                grams.append(Gram.of(part, self.y[rows], self.weight[rows]))
        return grams


def picked(block: Block, rows: Rows) -> Block:
    """Return a block at some rows."""
    return replace(block, X=block.X[rows])
