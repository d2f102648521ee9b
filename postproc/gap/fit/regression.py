"""The linear regression that a choice is made on: gap, weights, folds, blocks of candidates."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IntArray, Rows
from postproc.gap.data import Samples
from postproc.gap.fit.linear import Block, NormalEquations, Subset
from postproc.gap.fit.memory import REST
from postproc.records import dataclass

_FEWEST = 3
"""Rows of a fold or a stretch."""


@dataclass(frozen=True, slots=True)
class Regression:
    """The linearised problem.

    Rows, gap (n, 3) [m], weights (n,) [1/m], folds of place and stretches of time (n,), blocks.
    ``memory``: correlated noise and a smooth rest, always there and never named; ``excluded``:
    effects that were ruled out for good; their blocks are gone.
    """

    samples: Samples
    y: FloatArray
    weight: FloatArray
    fold: IntArray
    blocks: tuple[Block, ...]
    always: Subset
    memory: tuple[Block, ...] = ()
    stretch: IntArray | None = None
    excluded: tuple[str, ...] = ()

    def without(self, names: Collection[str]) -> Regression:
        """Return the same rows with some effects excluded for good."""
        blocks = tuple(b for b in self.blocks if b.name not in names)
        return replace(self, blocks=blocks, excluded=(*self.excluded, *sorted(names)))

    @property
    def nuisance(self) -> Subset:
        """Keys of the memory."""
        return tuple(block.key for block in self.memory)

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
        return NormalEquations.of((*self.blocks, *self.memory), self.y, self.weight, self.nuisance)

    def fold_rows(self) -> list[Rows]:
        """Return the rows in use of each fold of neighbouring poses that has enough of them."""
        return self._rows_of(self.fold)

    def fold_equations(self) -> list[NormalEquations]:
        """Return the normal equations of each fold of neighbouring poses."""
        return [self.equations_at(rows) for rows in self.fold_rows()]

    def stretch_equations(self) -> list[NormalEquations]:
        """Return the normal equations of each stretch of time."""
        if self.stretch is None:
            return []
        return [self.equations_at(rows) for rows in self._rows_of(self.stretch)]

    def _rows_of(self, label: IntArray) -> list[Rows]:
        found = [
            np.flatnonzero((label == k) & (self.weight > 0)) for k in range(int(label.max()) + 1)
        ]
        return [rows for rows in found if len(rows) >= _FEWEST]

    def equations_at(self, rows: Rows) -> NormalEquations:
        """Return the normal equations of some rows, for what holds beyond them.

        A smooth rest would take to itself what an effect says of rows that it was not fitted to:
        of the memory the wander counts alone.
        """
        wander = [block for block in self.memory if block.key != REST]
        part = [block.rows(rows) for block in (*self.blocks, *wander)]
        names = tuple(block.key for block in wander)
        return NormalEquations.of(part, self.y[rows], self.weight[rows], names)
