"""The ladder: the cheapest way from the first rung of a graph to the last.

The search is exact dynamic programming: only values and back pointers stay.
Removing states (a collision found on the best way) repairs the values from the first changed rung
on and stops as soon as the values agree again up to a constant. Parts of a long chain that
never meet differ by another constant up to its end, so far behind a change the rest is put off: the
way found meanwhile can be run, and ``settle`` makes it the best one.
Between two wide rungs the steps are worked out in blocks, a chain's group by group, so that memory
stays bounded.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import NONE, BoolArray, FloatArray, IndexArray, members, taken
from postproc.ladder.graph import CHAIN, Graph, Joined
from postproc.ladder.listed import Listed
from postproc.records import dataclass

WIDE = 4_000_000
"""Largest matrix of steps that is worked out at once."""
_SPLIT = 30_000
"""From so many steps on those of a chain are worked out group by group."""
_SAME = 1e-11
NEAR = 20
"""So many rungs behind a change values are repaired at once, those farther off when asked for."""


@dataclass(slots=True)
class Ladder(Graph):
    """A graph with the values of the search; arguments as of ``Graph``."""

    value: FloatArray = field(init=False)
    back: NDArray[np.uint16] = field(init=False)
    broken: BoolArray = field(init=False)
    _solved: bool = field(init=False, default=False)
    _seen: dict[int, FloatArray] = field(init=False, default_factory=dict)

    def __post_init__(self) -> None:
        """Allocate the values of the search."""
        Graph.__post_init__(self)
        states = len(self.position)
        self.value = np.full(states, np.inf)
        self.back = np.zeros(states, dtype=np.uint16)
        self.broken = np.zeros(len(self), dtype=np.bool_)

    def settle(self) -> bool:
        """Repair what was put off behind changes; return whether anything was."""
        put_off = bool(self._seen)
        self._recompute(np.zeros(0, dtype=np.int64), len(self))
        return put_off

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
            moved: (N of ``known`` + 1,) the state that each became here, ``NONE`` if gone; all
                states of a rung stay or none.
            rungs: here, those that are new, and those behind them.
        """
        for steps in known.forbidden.values():
            ends = moved[steps]
            self.take_out(ends[(ends != NONE).all(axis=1)])
        if not known._solved:
            return
        if len(rungs) == len(self):
            self.solve()
            return
        old = np.flatnonzero(moved[:-1] != NONE)
        self.value[moved[old]], self.back[moved[old]] = known.value[old], known.back[old]
        rung_before, rung_now = known.rung_of(old), self.rung_of(moved[old])
        self.broken[rung_now] = known.broken[rung_before]
        self._solved = True
        known_rungs, first = np.unique(rung_before, return_index=True)
        became = dict(zip(known_rungs.tolist(), rung_now[first].tolist(), strict=True))
        kept = [i for i in became if became.get(i - 1, NONE) == became[i] - 1]
        for i in kept:
            if i in known._seen:
                self._seen[became[i]] = known._seen[i]
        anew = set(rungs.tolist())
        self.take_lists(known, {became[i]: i for i in kept if became[i] not in anew})
        self._reprice(moved[old], known.cost[old], rungs)
        self._repair(rungs)

    def _reprice(self, states: IndexArray, known: FloatArray, anew: IndexArray) -> None:
        """Bring in that states (m,), rising, had costs (m,), but on rungs to be solved anew.

        The best way into each stays the same.
        """
        with np.errstate(invalid="ignore"):
            more = np.where(self.cost[states] == known, 0.0, self.cost[states] - known)
        for i in np.setdiff1d(self.rung_of(states[more != 0.0]), anew).tolist():
            low, high = int(self.offsets[i]), int(self.offsets[i + 1])
            at = slice(*np.searchsorted(states, [low, high]).tolist())
            if i + 1 < len(self):
                self._seen.setdefault(i + 1, self.value[low:high].copy())
            self.value[states[at]] += more[at]
            lowest = self.value[low:high].min()
            if lowest < np.inf:
                self.value[low:high] -= lowest

    def renew(self, rungs: IndexArray) -> None:
        """Repair the values where other steps into rungs (m,) may be done than before."""
        self.forget_lists(rungs)
        self._repair(rungs)

    def remove(self, states: IndexArray) -> None:
        """Take states out and repair the values."""
        self.cost[states] = np.inf
        rungs = members(self.rung_of(np.asarray(states)), len(self))
        if self.joins is not None:  # less may be joined behind them as well
            self.joins.changed(rungs)
            behind = rungs[rungs + 1 < len(self)] + 1
            rungs = np.union1d(rungs, behind[self.rule[behind] == CHAIN])
        self._repair(rungs)

    def forbid(self, steps: list[tuple[int, int]]) -> None:
        """Take single steps (state from, state to) out and repair the values."""
        self._repair(self.take_out(np.array(steps)))

    def cheapest(self, i: int, most: int) -> IndexArray:
        """Return up to ``most`` steps (k, 2) that may lead into a rung, cheapest first.

        State from and state to, by what the best way to the one costs, the step and the other.
        """
        low, high = int(self.offsets[i]), int(self.offsets[i + 1])
        first = int(self.offsets[i - 1])
        listed = self.listed(i)
        if listed is not None:
            to = listed.now
            price = listed.prices(self.value[first:low]) + self.cost[low:high][to]
            some = np.argpartition(price, most)[:most] if len(price) > most else np.arange(len(to))
            some = some[price[some] < np.inf]
            some = some[np.lexsort((to[some], listed.before[some], price[some]))]
            return np.column_stack([first + listed.before[some].astype(np.int64), low + to[some]])
        a = first + np.flatnonzero(self.value[first:low] < np.inf)
        b = low + np.flatnonzero(self.cost[low:high] < np.inf)
        found, prices = [np.zeros((0, 2), dtype=np.int64)], [np.zeros(0)]
        joined = self.joined(i) if self.rule[i] == CHAIN else None
        size = max(1, WIDE // max(1, len(a)))
        for now in (b[k : k + size] for k in range(0, len(b) * bool(len(a)), size)):
            price = self.steps(i, self.value, a, now, joined)
            price += self.cost[now][:, None]
            of = price.ravel()
            steps = np.argpartition(of, most)[:most] if len(of) > most else np.arange(len(of))
            steps = steps[of[steps] < np.inf]
            found.append(np.column_stack([a[steps % len(a)], now[steps // len(a)]]))
            prices.append(of[steps])
        steps, of = np.concatenate(found), np.concatenate(prices)
        steps = steps[np.lexsort((steps[:, 1], steps[:, 0], of))[:most]]
        return steps[self.is_in_reach(i, *steps.T)] if self.rule[i] == CHAIN else steps

    def path(self) -> IndexArray:
        """Return the best state (n,) of every rung, ``NONE`` where a rung has none left."""
        chosen, follow = [NONE] * len(self), NONE
        offsets, is_last = self.offsets.tolist(), [True, *self.broken[1:].tolist()]
        for i in range(len(self) - 1, -1, -1):
            low, high = offsets[i], offsets[i + 1]
            if follow == NONE and high > low:
                best = low + int(np.argmin(self.value[low:high]))
                follow = best if np.isfinite(self.value[best]) else NONE
            chosen[i] = follow
            if follow == NONE or is_last[i]:
                follow = NONE
            else:
                follow = offsets[i - 1] + int(self.back[follow])
        return np.array(chosen, dtype=np.int64)

    def total(self, path: IndexArray) -> float:
        """Return the cost of a way: its states and its steps; broken steps are free."""
        return float(self.costs(path).sum())

    def costs(self, path: IndexArray) -> FloatArray:
        """Return what each rung (n,) of a way costs: its state and the step into it."""
        has = path != NONE
        costs = np.zeros(len(path))
        costs[has] = self.cost[path[has]]
        joined = np.append(False, has[1:] & has[:-1] & ~self.broken[1:])
        at = np.flatnonzero(joined)
        leap = taken(self.position, path[at]) - taken(self.position, path[at - 1])
        costs[at] += self.weight[at] * (leap**2).sum(axis=1)
        return costs + self.tolls_on(path)

    def tolls_on(self, path: IndexArray) -> FloatArray:
        """Return the tolls (n,) of the steps of a way into each rung."""
        paid, has = np.zeros(len(path)), path != NONE
        if self.tolls is not None:
            at = np.flatnonzero(np.append(False, has[1:] & has[:-1] & ~self.broken[1:]))
            left, entered = self.tolls.leaves[path[at - 1]], self.tolls.enters[path[at]]
            paid[at] = (left * entered).sum(axis=1)
        return paid

    def _repair(self, rungs: IndexArray) -> None:
        """Recompute from rungs (m,) of other states or steps on until the values agree again.

        What is ``NEAR`` rungs behind the last of them is put off, unless a state got lost.
        """
        self._recompute(rungs, NEAR)

    def _recompute(self, rungs: IndexArray, reach: int) -> None:
        """Recompute up to ``reach`` rungs behind a change; all: what was put off before as well."""
        if not self._solved:
            return
        changed = set(rungs.tolist())
        waiting = sorted(changed if reach < len(self) else changed.union(self._seen), reverse=True)
        i = last = 0
        while waiting:
            i = last = max(i, waiting[-1])
            self._seen.pop(i, None)
            while i < len(self):
                old = self._update(i)
                while waiting and waiting[-1] <= i:
                    last = waiting.pop()
                i += 1
                shift = self._since(i, old)
                if (np.abs(shift) <= _SAME).all():
                    break
                if i < len(self) and i - last > reach and np.isfinite(shift).all():
                    before = int(self.offsets[i - 1])
                    self._seen[i] = self.value[before : int(self.offsets[i])] - shift
                    break

    def _since(self, i: int, known: FloatArray) -> FloatArray:
        """Return by how much (b,) the values before rung ``i`` changed since it was worked out.

        ``known`` (b,): those it was worked out from unless that was put off.
        """
        now = self.value[int(self.offsets[i - 1]) if i else 0 : int(self.offsets[i])]
        known = self._seen.pop(i, known)
        with np.errstate(invalid="ignore"):
            return np.where(known == now, 0.0, now - known)

    def _update(self, i: int) -> FloatArray:
        """Compute the values of one rung anew, smallest 0; return those (m,) it had."""
        low, high = int(self.offsets[i]), int(self.offsets[i + 1])
        old = self.value[low:high].copy()
        value = None
        if self.is_given_up(i):
            self.broken[i], value = True, self.cost[low:high].copy()
        elif self._solved and i and (listed := self.listed(i)) is not None:
            value = self._from_list(i, listed)
        if value is None:
            value = self._step(i, low, high)
        lowest = value[value.argmin()] if high > low else np.inf
        if lowest < np.inf:
            value -= lowest
        self.value[low:high] = value
        return old

    def _from_list(self, i: int, listed: Listed) -> FloatArray:
        """Return the values (m,) of a rung, from all the steps into it one by one."""
        first, low, high = self.offsets[i - 1 : i + 2].tolist()
        least, back = listed.best(self.value[first:low])
        value = np.full(high - low, np.inf)
        value[listed.rows] = least + self.cost[low:high][listed.rows]
        self.back[low + listed.rows] = back
        self.broken[i] = not value.min(initial=np.inf) < np.inf
        return self.cost[low:high].copy() if self.broken[i] else value

    def _step(self, i: int, low: int, high: int) -> FloatArray:
        """Return the values (m,) of a rung, from all steps into it."""
        cost: FloatArray = self.cost[low:high]
        before = int(self.offsets[i - 1]) if i else 0
        value = np.full(high - low, np.inf)
        if i and high > low > before:
            joined = self.joined(i) if self.rule[i] == CHAIN else None
            if joined is not None and joined.is_sparse:
                self._by_class(i, joined, np.flatnonzero(cost < np.inf), value)
            else:
                self._by_group(i, joined, value)
        self.broken[i] = not value.min(initial=np.inf) < np.inf
        return cost.copy() if self.broken[i] else value

    def _by_class(self, i: int, joined: Joined, todo: IndexArray, value: FloatArray) -> None:
        """Work out the values of some states of a rung (k,), class by class, in place."""
        before, low = int(self.offsets[i - 1]), int(self.offsets[i])
        alive = self.value[before:low] < np.inf
        of = joined.now[todo]
        for k in np.flatnonzero(np.bincount(of)).tolist():
            a = before + np.flatnonzero(joined.may[k][joined.before] & alive)
            self._values(i, a, low + todo[of == k], value, None)

    def _by_group(self, i: int, joined: Joined | None, value: FloatArray) -> None:
        """Work out the values of a rung, all states of a group at once, in place."""
        before, low = int(self.offsets[i - 1]), int(self.offsets[i])
        high = low + len(value)
        alive = before + np.flatnonzero(self.value[before:low] < np.inf)
        wanted = low + np.flatnonzero(self.cost[low:high] < np.inf)
        some, most = len(alive) * len(wanted), (low - before) * (high - low)
        if joined is None and some <= WIDE and 2 * some > most:
            steps = self.steps(i, self.value, slice(before, low), slice(low, high), None)
            back = steps.argmin(axis=1)
            self.back[low:high] = back
            value[:] = steps[np.arange(high - low), back] + self.cost[low:high]
            return
        groups = [(alive, wanted)]
        if joined is not None and some > _SPLIT:
            of_before, of_now = self.group[alive], self.group[wanted]
            shared = np.intersect1d(of_before, of_now).tolist()
            groups = [(alive[of_before == group], wanted[of_now == group]) for group in shared]
        for a, b in groups:
            self._values(i, a, b, value, joined)

    def _values(
        self, i: int, a: IndexArray, b: IndexArray, value: FloatArray, joined: Joined | None
    ) -> None:
        """Lower the values of states b (m,) to those reached from states a (k,), in place."""
        if not len(a) or not len(b):
            return
        before, low, size = int(self.offsets[i - 1]), int(self.offsets[i]), max(1, WIDE // len(a))
        for first in range(0, len(b), size):
            now = b[first : first + size]
            steps = self.steps(i, self.value, a, now, joined)
            back = steps.argmin(axis=1)
            if self.rule[i] == CHAIN:
                self.reach_again(i, steps, a, now, back)
            found = steps[np.arange(len(now)), back] + self.cost[now]
            lower = found < value[now - low] - _SAME
            self.back[now[lower]] = a[back[lower]] - before
            value[now[lower] - low] = found[lower]
