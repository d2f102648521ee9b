"""Steps of a chain into one rung, one by one: where few may be done of all that there are.

Tilted states are thousands on a rung, and of their steps one in twenty or so may be done. Listed
once, with what each costs, all ways into the rung are compared in a hundredth of the time that the
whole matrix takes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import FloatArray, IndexArray


class Listed(NamedTuple):
    """The steps (k,) into a rung that may be done, by the state they lead to.

    ``before`` (k,): the state they come from, from 0 on the rung before; ``cost`` (k,), infinite
    for a step that is out; ``rows`` (r,): the states that have any, from 0; ``starts`` (r+1,): the
    first step of each.
    """

    before: NDArray[np.uint16]
    cost: NDArray[np.float32]
    rows: IndexArray
    starts: IndexArray

    @classmethod
    def of(
        cls, before: NDArray[np.uint16], now: NDArray[np.uint16], cost: NDArray[np.float32]
    ) -> Listed:
        """Return steps (k,) from states to states, both from 0; those to a state one by one."""
        order = np.argsort(now, kind="stable")
        before, now, cost = before[order], now[order], cost[order]
        starts = np.flatnonzero(np.append(True, now[1:] != now[:-1])[: len(now)])
        ends = np.append(starts, len(now))
        return cls(before, cost, now[starts].astype(np.int64), ends)

    def best(self, value: FloatArray) -> tuple[FloatArray, IndexArray]:
        """Return what the best step to each of ``rows`` (r,) costs, and where it comes from.

        Args:
            value: (b,) of the states on the rung before.
        """
        if not len(self.rows):
            return np.zeros(0), np.zeros(0, dtype=np.int64)
        steps = self.prices(value)
        least = np.minimum.reduceat(steps, self.starts[:-1])
        of = np.repeat(np.arange(len(least)), np.diff(self.starts))
        hits = np.flatnonzero(steps == least[of])
        first = np.flatnonzero(np.diff(of[hits], prepend=-1))
        return least, self.before[hits[first]].astype(np.int64)

    def prices(self, value: FloatArray) -> FloatArray:
        """Return what leads to (b,) the states before and each step (k,) cost together."""
        return np.asarray(value[self.before] + self.cost)

    @property
    def now(self) -> IndexArray:
        """The state (k,) that each step leads to, from 0."""
        return np.repeat(self.rows, np.diff(self.starts))

    def put_out(self, before: IndexArray, now: IndexArray) -> None:
        """Take steps (m,) out."""
        row = np.searchsorted(self.rows, now)
        known = row < len(self.rows)
        known[known] = self.rows[row[known]] == now[known]
        code = (np.arange(len(self.rows)).repeat(np.diff(self.starts)) << 16) + self.before
        wanted = (row[known] << 16) + before[known]
        at = np.minimum(np.searchsorted(code, wanted), max(len(code) - 1, 0))
        if len(code):
            self.cost[at[code[at] == wanted]] = np.inf
