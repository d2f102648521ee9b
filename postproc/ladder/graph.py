"""The graph of a ladder: rungs of states, and what the steps between two of them cost.

Nothing here knows a robot. A state is a point of six coordinates with a cost of its own and a
group; a step costs the weighted square of the distance between two points. Inside a chain (CP
motion) a step must keep the group and no coordinate may move more than half a turn; any other may
cost a toll for where it leaves and where it enters.

Steps are never stored: the costs of all those between two rungs are one matrix product,
w |a|^2 - 2 w a.b + w |b|^2 + leaves(a).enters(b) with what leads to each a added to the first term.
"""

from __future__ import annotations

from dataclasses import field
from enum import IntEnum
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray, taken
from postproc.ladder.listed import Listed
from postproc.records import dataclass

_KEPT = 100_000
"""Up to so many steps are worked out where the last ones were: new memory costs as much as they."""
_BLOCK = 6000
"""A block of steps of its own costs as much as so many steps."""
MOST_LISTED = 40_000_000
"""So many steps are listed in all at most: 6 bytes each."""
MOST_FAILING = 20_000
"""A rung into which so many steps failed has none that leads on: the search gives it up, unproven.
The most that any rung of our tests needed which had one in the end is 7,000, where axes race."""
_HALF_TURN = np.pi + 1e-9


class Joined(NamedTuple):
    """Which states a step of a chain may join at most.

    ``now`` (m,), ``before`` (b,): the class of every state of a rung and of the one before;
    ``may`` (classes now, classes before).
    """

    now: IndexArray
    before: IndexArray
    may: BoolArray

    @property
    def is_sparse(self) -> bool:
        """Whether so few steps are joined that each class is better worked out alone."""
        now = np.bincount(self.now, minlength=self.may.shape[0])
        before = np.bincount(self.before, minlength=self.may.shape[1])
        work = int(now @ (self.may @ before)) + _BLOCK * int(self.may.any(axis=1).sum())
        return work < len(self.now) * len(self.before)


class Tolls(NamedTuple):
    """What steps cost beside their length: the product of what they leave and what they enter.

    ``leaves`` (N, k), ``enters`` (N, k): of every state; the latter zero where a chain enters.
    """

    leaves: NDArray[np.floating[Any]]
    enters: NDArray[np.floating[Any]]


class Joins(Protocol):
    """What steps of a chain may join, beside the rules of ``Graph``."""

    def classes(self, i: int, cost: FloatArray) -> Joined:
        """Return the classes of the states of rung ``i``; ``cost`` (N,): infinite if out."""

    def barred(self, i: int, before: IndexArray, now: IndexArray) -> BoolArray | None:
        """Return (now, before) which steps of joined classes may not be done; None: all may."""

    def changed(self, rungs: IndexArray) -> None:
        """Take note that states of rungs (m,) were taken out."""

    def is_lasting(self, i: int) -> bool:
        """Return whether what may be joined at rung ``i`` is never asked anew: it stays."""


class Rule(IntEnum):
    """What a step into a rung may do."""

    FREE = 0
    """Any state to any state."""
    CHAIN = 1
    """Same group, no coordinate moves more than half a turn."""


CHAIN = int(Rule.CHAIN)
"""Looking a member up costs as much as a row of the search."""


@dataclass(slots=True)
class Graph:
    """States of all rungs behind each other, and the steps between them.

    Args:
        offsets: (n+1,) rung ``i`` holds the states ``offsets[i]:offsets[i+1]``.
        position: (N, d) coordinates, joint angles [rad].
        cost: (N,) cost of each state, infinite for one that is out.
        group: (N,) label that a chain must keep.
        rule: (n,) ``Rule`` of the step into each rung; the first is ignored.
        weight: (n,) weight of the squared distance of that step.
        joins: which of them a chain may join, within a group; None: all.
        reach: (n, d) by how much each coordinate may move in a chain's step into each rung, half a
            turn at most; None: so much.
        tolls: what steps cost more by where they lead; None: nothing.
    """

    offsets: IndexArray
    position: NDArray[np.floating[Any]]
    cost: FloatArray
    group: AnyIntArray
    rule: IndexArray
    weight: FloatArray
    joins: Joins | None = None
    reach: FloatArray | None = None
    tolls: Tolls | None = None
    _square: FloatArray = field(init=False)
    _forbidden: dict[int, IndexArray] = field(init=False, default_factory=dict)
    _scratch: FloatArray = field(init=False, default_factory=lambda: np.empty(_KEPT))
    _lists: dict[int, tuple[Listed, int] | None] = field(init=False, default_factory=dict)
    _room_left: int = field(init=False, default=MOST_LISTED)

    def __post_init__(self) -> None:
        """Take costs of its own, and the squares of all positions."""
        self.cost = np.array(self.cost, dtype=np.float64)
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

    def joined(self, i: int) -> Joined:
        """Return which classes of states a step of a chain into a rung may join."""
        before, low, high = (int(self.offsets[k]) for k in (i - 1, i, i + 1))
        if self.joins is not None:
            return self.joins.classes(i, self.cost)
        label, of = np.unique(self.group[before:high], return_inverse=True)
        return Joined(of[low - before :], of[: low - before], np.eye(len(label), dtype=np.bool_))

    def take_out(self, steps: IndexArray) -> IndexArray:
        """Keep steps (m, 2), state from and state to, as forbidden; return their rungs (m,)."""
        rungs = self.rung_of(steps[:, 1])
        for rung in np.unique(rungs).tolist():
            known = self._forbidden.get(rung, np.zeros((0, 2), dtype=np.int64))
            self._forbidden[rung] = np.concatenate([known, steps[rungs == rung]])
        return rungs

    @property
    def forbidden(self) -> dict[int, IndexArray]:
        """Steps (m, 2), state from and state to, that are taken out, by rung."""
        return self._forbidden

    def is_given_up(self, i: int) -> bool:
        """Return whether so many steps into a rung failed that the search looks no further."""
        return len(self._forbidden.get(i, ())) >= MOST_FAILING

    def listed(self, i: int) -> Listed | None:
        """Return the steps into a rung where its chain may do but few; None elsewhere."""
        if i not in self._lists:
            self._lists[i] = self._list(i)
        known = self._lists[i]
        if known is None:
            return None
        steps, done = known
        out = self._forbidden.get(i)
        if out is not None and len(out) > done:
            ends = out[done:] - self.offsets[i - 1 : i + 1]
            steps.put_out(*ends.T)
            self._lists[i] = steps, len(out)
        return steps

    def take_lists(self, known: Graph, rungs: dict[int, int]) -> None:
        """Take the steps listed in a graph into rungs that it has under other numbers."""
        for i, before in rungs.items():
            steps = known._lists.get(before)
            if steps is not None:
                self._lists[i] = steps
                self._room_left -= len(steps[0].cost)

    def forget_lists(self, rungs: IndexArray) -> None:
        """List the steps into rungs (m,) anew where they are asked for."""
        for i in rungs.tolist():
            steps = self._lists.pop(i, None)
            self._room_left += 0 if steps is None else len(steps[0].cost)

    def _list(self, i: int) -> tuple[Listed, int] | None:
        """List the steps into a rung, as long as there is room; so many forbidden ones are out."""
        if self.joins is None or self.rule[i] != CHAIN or not self.joins.is_lasting(i):
            return None
        first, low, high = (int(self.offsets[k]) for k in (i - 1, i, i + 1))
        if not first < low < high:
            return None
        nothing, limit = np.zeros(low), np.broadcast_to(self._most(i), self.position.shape[1:])
        wide = np.flatnonzero(np.ptp(self.position[first:high], axis=0) > limit).tolist()
        none = np.zeros(0, dtype=np.uint16)
        found = [(none, none, np.zeros(0, dtype=np.float32))]
        for group in np.unique(self.group[low:high]).tolist():
            before = first + np.flatnonzero(self.group[first:low] == group)
            to = low + np.flatnonzero(self.group[low:high] == group)
            size = max(1, _KEPT // max(1, len(before)))
            for now in (to[k : k + size] for k in range(0, len(to) * bool(len(before)), size)):
                steps = self.steps(i, nothing, before, now, None)
                for k in wide:
                    gap = np.subtract.outer(self.position[now, k], self.position[before, k])
                    np.putmask(steps, np.abs(gap, out=gap) > limit[k], np.inf)
                row, column = np.nonzero(steps < np.inf)
                found.append(
                    (
                        (before[column] - first).astype(np.uint16),
                        (now[row] - low).astype(np.uint16),
                        steps[row, column].astype(np.float32),
                    )
                )
            if sum(len(part[0]) for part in found) > self._room_left:
                return None
        listed = Listed.of(*(np.concatenate(part) for part in zip(*found, strict=True)))
        self._room_left -= len(listed.cost)
        return listed, len(self._forbidden.get(i, ()))

    def steps(
        self,
        i: int,
        value: FloatArray,
        before: IndexArray | slice,
        now: IndexArray | slice,
        joined: Joined | None,
    ) -> FloatArray:
        """Return value + step cost (m now, m before) of states, both rising.

        Args:
            i: rung of the states now.
            value: (N,) of all states; those before count.
            before: on the rung before.
            now: on the rung.
            joined: steps that it does not join are taken out.

        Good until the next call.
        """
        weight, d = float(self.weight[i]), self.position.shape[1]
        left, right = self._factors(now, 1), self._factors(before, 0)
        left[:, :d] *= -2.0 * weight
        left[:, -2], left[:, -1] = 1.0, self._square[now]
        right[:, -2], right[:, -1] = self._square[before] * weight, weight
        right[:, -2] += value[before]
        room, shape = None, (len(left), len(right))
        if len(left) * len(right) <= _KEPT:
            room = self._scratch[: len(left) * len(right)].reshape(shape)
        steps: FloatArray = np.matmul(left, right.T, out=room)
        forbidden = self._forbidden.get(i)
        if self.rule[i] == CHAIN or forbidden is not None:
            start, to = (
                np.arange(at.start, at.stop) if isinstance(at, slice) else at
                for at in (before, now)
            )
            if self.rule[i] == CHAIN:
                self._keep_chain(i, steps, start, to, joined)
            if forbidden is not None:
                _put_out(steps, start, to, forbidden)
        return steps

    def _factors(self, states: IndexArray | slice, side: int) -> FloatArray:
        """Return the positions of states, their tolls on a side, and room for two columns more.

        All in double precision: joints in single place a state, and nothing is lost in between.
        """
        d, tolls = self.position.shape[1], self.tolls
        position = self.position[states]
        factors = np.empty((len(position), d + 2 + (tolls[side].shape[1] if tolls else 0)))
        factors[:, :d] = position
        if tolls is not None:
            factors[:, d:-2] = tolls[side][states]
        return factors

    def _keep_chain(
        self,
        i: int,
        steps: FloatArray,
        before: IndexArray,
        now: IndexArray,
        joined: Joined | None,
    ) -> None:
        """Take out the steps that a chain may not do."""
        if joined is not None:
            of_now = joined.now[now - int(self.offsets[i])]
            of_before = joined.before[before - int(self.offsets[i - 1])]
            np.putmask(steps, ~taken(joined.may, of_now).take(of_before, axis=1), np.inf)
        if self.joins is not None:
            barred = self.joins.barred(i, before, now)
            if barred is not None:
                np.putmask(steps, barred, np.inf)

    def reach_again(
        self, i: int, steps: FloatArray, before: IndexArray, now: IndexArray, back: IndexArray
    ) -> None:
        """Correct the best steps ``back`` (m,) where a coordinate moves too far, in place.

        Such steps are dear, and few are the best: they are taken out of the rows of those alone.
        """
        rows = np.flatnonzero(~self.is_in_reach(i, before[back], now))
        if not len(rows):
            return
        a, b = taken(self.position, before), taken(self.position, now[rows])
        some = taken(steps, rows)
        limit = np.broadcast_to(self._most(i), a.shape[1:])
        span = np.maximum(a.max(axis=0), b.max(axis=0)) - np.minimum(a.min(axis=0), b.min(axis=0))
        for j in np.flatnonzero(span > limit).tolist():
            gap = np.subtract.outer(b[:, j], a[:, j])
            np.putmask(some, np.abs(gap, out=gap) > limit[j], np.inf)
        steps[rows], back[rows] = some, some.argmin(axis=1)

    def is_in_reach(self, i: int, before: IndexArray, now: IndexArray) -> BoolArray:
        """Return in which steps (k,) into a rung, from state to state, no coordinate moves too far.

        Args:
            i: rung of the states now.
            before: (k,) on the rung before.
            now: (k,).
        """
        gap = np.abs(taken(self.position, now) - taken(self.position, before))
        return np.asarray((gap <= self._most(i)).all(axis=1))

    def _most(self, i: int) -> FloatArray | float:
        """Return how far each coordinate (d,) may move in a step of a chain into a rung."""
        return _HALF_TURN if self.reach is None else np.minimum(_HALF_TURN, self.reach[i])


def _put_out(steps: FloatArray, before: IndexArray, now: IndexArray, forbidden: IndexArray) -> None:
    """Take single steps (k, 2) out of those from states before to states now, both rising."""
    column = np.minimum(np.searchsorted(before, forbidden[:, 0]), len(before) - 1)
    row = np.minimum(np.searchsorted(now, forbidden[:, 1]), len(now) - 1)
    here = (before[column] == forbidden[:, 0]) & (now[row] == forbidden[:, 1])
    steps[row[here], column[here]] = np.inf
