"""What was recorded along a path: one row per sample, in columns of SI units.

A row belongs to a ``stretch``: rows of one repetition that follow each other without a pause. No
derivative, filter or interpolation reaches over the end of a stretch.
"""

from __future__ import annotations

from dataclasses import field
from typing import Any

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IntArray, column, columns_at
from postproc.arrays import freeze_columns as freeze
from postproc.arrays import runs as equal_runs
from postproc.records import dataclass

PAUSE_CYCLES = 10
"""Missing cycles from which the rows behind are a stretch of their own."""
MOST_ROWS = 300_000
"""Rows kept of a longer recording, in whole blocks evenly spread: 1 kB a row while it is judged."""
BLOCK = 4096
"""Rows that are kept or left out together."""
SHORTEST = 16
"""Rows of the shortest stretch that anything can be said about."""


@dataclass(frozen=True, slots=True)
class Recording:
    """Samples in columns of length n.

    Args:
        path: of the file.
        time: (n,) [s], rising within a stretch; stretch: (n,) number of the stretch, rising.
        run: (n,) number of the repetition.
        command: (n, 6) commanded joint angles [rad], without wraps.
        actual: (n, 6) at the motors; link: (n, 6) behind the gears, NaN for a joint without.
        point: (n, 3) measured tool point, robroot [m], NaN where the beam was broken.
        torque, current: (n, 6) of the motors [N m, A].
        line: (n,) of the program, -1 where none; is_cut: (n,) tool in the work, as a tag says.
        rows_read: rows of the file; more than n where a long recording was thinned.
        remarks: what was noticed while reading, in words.
    """

    path: str
    time: FloatArray = field(metadata=column("row"))
    stretch: IntArray = field(metadata=column("row", dtype=np.int32))
    run: IntArray = field(metadata=column("row", dtype=np.int32))
    command: FloatArray = field(metadata=column("row", 6))
    actual: FloatArray | None = field(default=None, metadata=column("row", 6))
    link: FloatArray | None = field(default=None, metadata=column("row", 6))
    point: FloatArray | None = field(default=None, metadata=column("row", 3))
    torque: FloatArray | None = field(default=None, metadata=column("row", 6))
    current: FloatArray | None = field(default=None, metadata=column("row", 6))
    line: IntArray | None = field(default=None, metadata=column("row", dtype=np.int32))
    is_cut: BoolArray | None = field(default=None, metadata=column("row", dtype=np.bool_))
    rows_read: int = 0
    remarks: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        freeze(self, row=len(self.time))

    def __len__(self) -> int:
        """Return the number of rows."""
        return len(self.time)

    @property
    def stretches(self) -> list[slice]:
        """The rows of each stretch."""
        return [slice(low, high) for low, high in equal_runs(self.stretch)]

    @property
    def cycle(self) -> float:
        """Time between two rows [s], the median."""
        step = np.diff(self.time)[np.diff(self.stretch) == 0]
        return float(np.median(step)) if len(step) else 0.0

    def rows(self, index: AnyIntArray) -> Recording:
        """Return the rows ``index`` (k,), rising; each gap in it ends a stretch."""
        columns = columns_at(self, "row", index)
        broken = (np.diff(index, prepend=index[:1]) > 1) | (
            np.diff(columns["stretch"], prepend=columns["stretch"][:1]) != 0
        )
        columns["stretch"] = np.cumsum(broken).astype(np.int32)
        return Recording(self.path, **columns, rows_read=self.rows_read, remarks=self.remarks)


class Thinned:
    """Collects blocks of rows; when they are too many, every second one goes.

    Memory stays below ``MOST_ROWS`` rows whatever the length of the file; what is kept is evenly
    spread, and the same for the same file.
    """

    def __init__(self) -> None:
        self.total = 0
        self._every = 1
        self._number = 0
        self._blocks: list[dict[str, Any]] = []

    def add(self, block: dict[str, Any]) -> None:
        """Take in a block of columns by name."""
        count = len(next(iter(block.values())))
        if self._number % self._every == 0:
            self._blocks.append(block)
        self._number += 1
        self.total += count
        if len(self._blocks) * BLOCK > MOST_ROWS:
            self._every *= 2
            self._blocks = self._blocks[::2]

    def columns(self) -> dict[str, Any]:
        """Return the kept columns by name."""
        names = list(self._blocks[0]) if self._blocks else []
        return {name: np.concatenate([block.pop(name) for block in self._blocks]) for name in names}
