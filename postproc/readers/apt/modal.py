"""Modal values of a CL file as columns: what is in force at each point."""

from __future__ import annotations

from typing import Generic, TypeVar

import numpy as np

from postproc.arrays import FloatArray, IndexArray

T = TypeVar("T", int, float)


class Modal(Generic[T]):
    """A value that holds from one point of a block to the next change.

    ``value`` is the one in force now. ``set`` takes the index in the block of the next point.
    """

    def __init__(self, value: T) -> None:
        self.value: T = value
        self._first: T = value
        self._at: list[int] = []
        self._values: list[T] = []

    def set(self, at: int, value: T) -> None:
        """Let ``value`` hold from point ``at`` of the block on."""
        if value == self.value:
            return
        self.value = value
        self._at.append(at)
        self._values.append(value)

    def mark(self, at: int, value: T) -> None:
        """Set even an equal value, for what must be told apart by where it was set."""
        self.value = value
        self._at.append(at)
        self._values.append(value)

    def column(self, n: int) -> FloatArray:
        """Return the values (n,) at the block's points and begin the next block."""
        values, _ = self.column_with_origin(n)
        return values

    def column_with_origin(self, n: int) -> tuple[FloatArray, IndexArray]:
        """Return also the point (n,) from which on each value holds, -1 for the carried one."""
        counts = np.diff(np.array([0, *self._at, n]))
        values = np.repeat(np.array([self._first, *self._values], dtype=np.float64), counts)
        origin = np.repeat(np.array([-1, *self._at], dtype=np.int64), counts)
        self._at, self._values, self._first = [], [], self.value
        return values, origin
