"""The ladder graph: one rung of states per tag, the cheapest way from the first rung to the last.

Nothing here knows a robot. A state is a point of six coordinates with a cost of its own and a
group; a step costs the weighted square of the distance between two points. Inside a chain (CP
motion) a step must keep the group and no coordinate may move more than half a turn.

The search is exact dynamic programming. Edges are never stored: the costs of all steps between
two rungs are one matrix product, V(a) + |a|^2 - 2 a.b + |b|^2, and only the back pointers stay.
Removing states (a collision found on the best way) repairs the values from the first changed rung
on and stops as soon as the values agree again up to a constant. Between two wide rungs the matrix
is worked out in blocks, a chain's group by group, so that memory stays bounded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray

NONE = -1
"""No state: the rung is empty."""
WIDE = 4_000_000
"""Largest matrix of steps that is worked out at once."""
_SPLIT = 30_000
"""From so many steps on those of a chain are worked out group by group."""
_SAME = 1e-11
_HALF_TURN = np.pi + 1e-9


MayJoin = Callable[[int, IndexArray, IndexArray, FloatArray], BoolArray]


class Rule(IntEnum):
    """What a step into a rung may do."""

    FREE = 0
    """Any state to any state."""
    CHAIN = 1
    """Same group, no coordinate moves more than half a turn."""


_CHAIN = int(Rule.CHAIN)  # looking a member up costs as much as a row of the search


@dataclass(slots=True)
class Ladder:
    """States of all rungs behind each other, with the values of the search.

    Args:
        offsets: (n+1,) rung ``i`` holds the states ``offsets[i]:offsets[i+1]``.
        position: (N, d) coordinates, joint angles [rad].
        cost: (N,) cost of each state, infinite for one that is out.
        group: (N,) label that a chain must keep.
        rule: (n,) ``Rule`` of the step into each rung; the first is ignored.
        weight: (n,) weight of the squared distance of that step.
        may_join: rung, states (b,) of the one before, states (m,) of this one, costs (N,) to which
            of them (m, b) a chain may join, within a group; None: all.
    """

    offsets: IndexArray
    position: NDArray[np.floating[Any]]
    cost: FloatArray
    group: AnyIntArray
    rule: IndexArray
    weight: FloatArray
    may_join: MayJoin | None = None
    value: FloatArray = field(init=False)
    back: NDArray[np.uint16] = field(init=False)
    broken: BoolArray = field(init=False)
    _square: FloatArray = field(init=False)
    _forbidden: dict[int, IndexArray] = field(init=False, default_factory=dict)
    _solved: bool = field(init=False, default=False)

    def __post_init__(self) -> None:
        """Allocate the values of the search."""
        states = len(self.position)
        self.cost = np.array(self.cost, dtype=np.float64)
        self.value = np.full(states, np.inf)
        self.back = np.zeros(states, dtype=np.uint16)
        self.broken = np.zeros(len(self), dtype=np.bool_)
        self._square = np.einsum(
            "ij,ij->i", self.position, self.position, dtype=np.float64, casting="same_kind"
        )
        if len(self) and int(np.diff(self.offsets).max()) > np.iinfo(np.uint16).max:
            raise ValueError("Ladder: more than 65535 states on one rung")

    def __len__(self) -> int:
        """Return the number of rungs."""
        return len(self.offsets) - 1

    def rung_of(self, states: IndexArray) -> IndexArray:
        """Return the rung (m,) of each state."""
        rungs: IndexArray = np.searchsorted(self.offsets, states, side="right") - 1
        return rungs

    @property
    def solved(self) -> bool:
        """Whether the values are those of the graph as it is."""
        return self._solved

    def solve(self) -> None:
        """Find the value of every state from scratch."""
        for i in range(len(self)):
            self._update(i)
        self._solved = True

    def take_over(self, known: Ladder, moved: IndexArray, rungs: IndexArray) -> None:
        """Take values and forbidden steps of a solved ladder, and solve what is new.

        Args:
            known: the same graph before rungs were added or replaced.
            moved: (N of ``known`` + 1,) the state that each became here, ``NONE`` if gone.
            rungs: here, those that differ, and those behind them.
        """
        for steps in known._forbidden.values():
            ends = moved[steps]
            self._forbid(ends[(ends != NONE).all(axis=1)])
        if not known._solved:
            return
        old = np.flatnonzero(moved[:-1] != NONE)
        self.value[moved[old]], self.back[moved[old]] = known.value[old], known.back[old]
        rung_before, rung_now = known.rung_of(old), self.rung_of(moved[old])
        self.broken[rung_now] = known.broken[rung_before]
        self._solved = True
        self.value[self._within(rungs)] = np.nan
        self._repair(rungs)

    def _within(self, rungs: IndexArray) -> BoolArray:
        """Return which states stand on some rungs."""
        on = np.zeros(len(self), dtype=np.bool_)
        on[rungs] = True
        return np.repeat(on, np.diff(self.offsets))

    def renew(self, rungs: IndexArray) -> None:
        """Repair the values where other steps into rungs (m,) may be done than before."""
        self._repair(rungs)

    def remove(self, states: IndexArray) -> None:
        """Take states out and repair the values."""
        self.cost[states] = np.inf
        rungs = np.unique(self.rung_of(np.asarray(states)))
        if self.may_join is not None:
            rungs = np.unique(np.minimum([rungs, rungs + 1], len(self) - 1))
        self._repair(rungs)

    def forbid(self, steps: list[tuple[int, int]]) -> None:
        """Take single steps (state from, state to) out and repair the values."""
        self._repair(self._forbid(np.array(steps)))

    def _forbid(self, steps: IndexArray) -> IndexArray:
        """Keep steps (m, 2), state from and state to, as forbidden; return their rungs (m,)."""
        rungs = self.rung_of(steps[:, 1])
        for rung in np.unique(rungs).tolist():
            known = self._forbidden.get(rung, np.zeros((0, 2), dtype=np.int64))
            self._forbidden[rung] = np.concatenate([known, steps[rungs == rung]])
        return rungs

    def path(self) -> IndexArray:
        """Return the best state (n,) of every rung, ``NONE`` where a rung has none left."""
        chosen = np.full(len(self), NONE, dtype=np.int64)
        follow = NONE
        for i in range(len(self) - 1, -1, -1):
            low, high = int(self.offsets[i]), int(self.offsets[i + 1])
            if follow == NONE and high > low:
                best = low + int(np.argmin(self.value[low:high]))
                follow = best if np.isfinite(self.value[best]) else NONE
            chosen[i] = follow
            if follow == NONE or self.broken[i] or i == 0:
                follow = NONE
            else:
                follow = int(self.offsets[i - 1]) + int(self.back[follow])
        return chosen

    def total(self, path: IndexArray) -> float:
        """Return the cost of a way: its states and its steps; broken steps are free."""
        kept = path[path != NONE]
        states = float(self.cost[kept].sum())
        joined = (path[1:] != NONE) & (path[:-1] != NONE) & ~self.broken[1:]
        leap = self.position[path[1:][joined]] - self.position[path[:-1][joined]]
        return states + float((self.weight[1:][joined] * (leap**2).sum(axis=1)).sum())

    def _repair(self, rungs: IndexArray) -> None:
        """Recompute from every changed rung on until the values agree again."""
        if not self._solved:
            return
        waiting = sorted(set(rungs.tolist()), reverse=True)
        i = 0
        while waiting:
            i = max(i, waiting.pop())
            while i < len(self):
                changed = self._update(i)
                while waiting and waiting[-1] <= i:
                    waiting.pop()
                i += 1
                if not changed:
                    break

    def _update(self, i: int) -> bool:
        """Compute the values of one rung anew, smallest 0; return whether they changed."""
        low, high = int(self.offsets[i]), int(self.offsets[i + 1])
        value = self._step(i, low, high)
        lowest = value.min() if high > low else np.inf
        if lowest < np.inf:
            value -= lowest
        old = self.value[low:high]
        changed = not (self._solved and _equal(old, value))
        old[:] = value
        return changed

    def _step(self, i: int, low: int, high: int) -> FloatArray:
        cost: FloatArray = self.cost[low:high]
        before, after = int(self.offsets[i - 1]) if i else 0, int(self.offsets[i])
        if i == 0 or high == low or after == before:
            self.broken[i] = True
            return cost.copy()
        alive = before + np.flatnonzero(self.value[before:after] < np.inf)
        wanted = low + np.flatnonzero(cost < np.inf)
        some = len(alive) * len(wanted)
        if not some:
            self.broken[i] = True
            return cost.copy()
        is_chain = self.rule[i] == _CHAIN
        if (
            some <= WIDE
            and 2 * some > (after - before) * (high - low)
            and not (is_chain and some > _SPLIT)
        ):
            steps = self._steps(i, slice(before, after), slice(low, high))
            back = steps.argmin(axis=1)
            self.back[low:high] = back
            value = steps[np.arange(high - low), back] + cost
        else:
            value = np.full(high - low, np.inf)
            for a, b in self._blocks(i, alive, wanted):
                steps = self._steps(i, a, b)
                back = steps.argmin(axis=1)
                self.back[b] = a[back] - before
                value[b - low] = steps[np.arange(len(b)), back] + self.cost[b]
        self.broken[i] = not value.min(initial=np.inf) < np.inf
        return cost.copy() if self.broken[i] else value

    def _blocks(
        self, i: int, before: IndexArray, now: IndexArray
    ) -> Iterator[tuple[IndexArray, IndexArray]]:
        """Return states before and now whose steps are worked out at once; every state now once."""
        groups = [(before, now)]
        if self.rule[i] == _CHAIN:
            of_before, of_now = self.group[before], self.group[now]
            shared = np.intersect1d(of_before, of_now).tolist()
            groups = [(before[of_before == group], now[of_now == group]) for group in shared]
        for a, b in groups:
            size = max(1, WIDE // max(1, len(a)))
            for low in range(0, len(b), size):
                yield a, b[low : low + size]

    def _steps(self, i: int, before: IndexArray | slice, now: IndexArray | slice) -> FloatArray:
        """Return value + step cost (m now, m before) of states, both rising."""
        w = float(self.weight[i])
        a, b = self.position[before], self.position[now]
        d = a.shape[1]
        left = np.empty((len(b), d + 2))
        right = np.empty((len(a), d + 2))
        np.multiply(b, -2.0 * w, out=left[:, :d])
        left[:, d] = 1.0
        left[:, d + 1] = self._square[now]
        right[:, :d] = a
        np.multiply(self._square[before], w, out=right[:, d])
        right[:, d] += self.value[before]
        right[:, d + 1] = w
        steps: FloatArray = left @ right.T
        forbidden = self._forbidden.get(i)
        if self.rule[i] == _CHAIN or forbidden is not None:
            before, now = (
                np.arange(at.start, at.stop) if isinstance(at, slice) else at
                for at in (before, now)
            )
            self._take_out(i, steps, before, now, forbidden)
        return steps

    def _take_out(
        self,
        i: int,
        steps: FloatArray,
        before: IndexArray,
        now: IndexArray,
        forbidden: IndexArray | None,
    ) -> None:
        """Take out the steps that a chain may not do, and single ones that are forbidden."""
        if self.rule[i] == _CHAIN:
            self._keep_chain(i, steps, before, now)
        if forbidden is None or not len(before) or not len(now):
            return
        column = np.minimum(np.searchsorted(before, forbidden[:, 0]), len(before) - 1)
        row = np.minimum(np.searchsorted(now, forbidden[:, 1]), len(now) - 1)
        there = (before[column] == forbidden[:, 0]) & (now[row] == forbidden[:, 1])
        steps[row[there], column[there]] = np.inf

    def _keep_chain(self, i: int, steps: FloatArray, before: IndexArray, now: IndexArray) -> None:
        """Take out the steps that a chain may not do."""
        a, b = self.position[before], self.position[now]
        if self.may_join is None:
            barred = self.group[now][:, None] != self.group[before][None, :]
        else:
            barred = ~self.may_join(i, before, now, self.cost)
        np.putmask(steps, barred, np.inf)
        reach = np.maximum(b.max(axis=0) - a.min(axis=0), a.max(axis=0) - b.min(axis=0))
        for j in np.nonzero(reach > _HALF_TURN)[0]:
            gap = np.subtract.outer(b[:, j], a[:, j])
            np.putmask(steps, np.abs(gap, out=gap) > _HALF_TURN, np.inf)


def _equal(old: FloatArray, new: FloatArray) -> bool:
    with np.errstate(invalid="ignore"):
        return bool(((old == new) | (np.abs(old - new) < _SAME)).all())
