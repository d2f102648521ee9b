"""The search for the best states of tags: its graph, its checks, and why states and steps fail."""

from __future__ import annotations

from dataclasses import field, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AnyIntArray, BoolArray, FloatArray, IndexArray, numbered
from postproc.ladder import NONE, Found, Ladder, Rule, free_path
from postproc.planning.checks import Checker, Evidence, Reason
from postproc.planning.search.between import Interpolation
from postproc.planning.search.bridges import Bridges
from postproc.planning.search.cuts import Spans, fill, judge
from postproc.planning.search.edges import Edges
from postproc.planning.search.failing import SHORT, FailingCuts, also_failing, break_at
from postproc.planning.search.prices import STUCK
from postproc.planning.search.rungs import (
    Parted,
    SearchOptions,
    beside,
    bridges_of,
    ladder_of,
    states_on,
)
from postproc.planning.states import Chosen, States, beside_in_grid, entered_anew, merged
from postproc.records import dataclass

_ALONG = 4
"""So many tags along from a colliding pose are checked, and one spin to each side of it: a round of
the search costs more than the poses that a narrow rim finds later, a wide rim of free ones too."""
_FLIP = 4
"""The bit of a branch that turns the wrist over: the arm before it and the tool stand alike."""


@dataclass(slots=True)
class PoseSearch:
    """A search over key tags: their states, the graph, and why states and steps failed.

    Tags between key tags follow by interpolation. ``stride`` (n,): every how many of the finest
    spins a tag has; ``edges``: the stiffest pose of each tag; ``passed`` (N,): the state before
    from which the step into a state was found good; ``free`` (N,): whether the first turn copy of a
    configuration stands for one found free of collision, its stroke as well; ``failing``: what
    became of cuts that failed between key tags. ``failed_into``: how often steps into a tag failed;
    ``looked_at``: numbers of those that were looked at along with them.
    """

    checker: Checker
    between: Interpolation
    options: SearchOptions
    tags: IndexArray
    stride: IndexArray
    states: States
    bridges: Bridges
    ladder: Ladder
    weight: FloatArray
    share: FloatArray
    pinned: BoolArray
    edges: Edges
    reason: AnyIntArray
    pair: AnyIntArray
    seen: BoolArray
    checked: BoolArray
    free: BoolArray
    passed: AnyIntArray
    out: BoolArray
    fast_turns: BoolArray
    failing: FailingCuts
    cells: IndexArray | None = None
    failed_into: dict[int, int] = field(default_factory=dict)
    looked_at: dict[int, IndexArray] = field(default_factory=dict)

    @classmethod
    def of(
        cls,
        checker: Checker,
        tags: IndexArray,
        options: SearchOptions | None = None,
        between: Interpolation | None = None,
    ) -> PoseSearch:
        """Return the search over key tags (n,), rising.

        Args:
            checker: of the problem.
            tags: (n,).
            options: what it is for; None: the best sequence of all.
            between: how attitudes run between key tags; None: as ``Interpolation.of``.
        """
        options = options or SearchOptions()
        problem = checker.problem
        between = between or Interpolation.of(problem)
        stride = np.full(len(tags), problem.fine)
        states, pinned, edges = states_on(problem, tags, stride, options)
        ladder, weight, share = ladder_of(problem, between, tags, states, options)
        fast_turns = np.zeros(len(tags), dtype=np.bool_)
        bridges = bridges_of(problem, between, tags, states, stride, pinned, fast_turns, ladder)
        size = len(states.q)
        return cls(
            checker,
            between,
            options,
            tags,
            stride,
            states,
            bridges,
            ladder,
            weight,
            share,
            pinned,
            edges,
            reason=np.zeros(size, dtype=np.int8),
            pair=np.full(size, NONE, dtype=np.int32),
            seen=np.zeros(size, dtype=np.bool_),
            checked=np.zeros(size, dtype=np.bool_),
            free=np.zeros(size, dtype=np.bool_),
            passed=np.full(size, NONE, dtype=np.int32),
            out=np.zeros(size, dtype=np.bool_),
            fast_turns=fast_turns,
            failing=FailingCuts(between, SHORT if options.stretch is None else 0.0),
        )

    def grow(self, tags: IndexArray, stride: IndexArray) -> None:
        """Take more key tags (m,), or those known on a finer grid of spins; keep what is known."""
        problem = self.checker.problem
        states, pinned, edges = states_on(problem, tags, stride, self.options)
        join = merged(self.states, self.tags, states, tags)
        known, kept = (self.ladder, self.bridges), np.isin(self.tags, tags, invert=True)
        rung = np.where(join.is_new, NONE, np.searchsorted(self.tags, join.tags))

        def by_tag(old: NDArray[Any], new: object) -> NDArray[Any]:
            column = np.empty((len(join.tags), *old.shape[1:]), dtype=old.dtype)
            column[join.is_new], column[~join.is_new] = new, old[kept]
            return column

        def by_state(old: NDArray[Any], new: object) -> NDArray[Any]:
            column = np.full(len(join.source), new, dtype=old.dtype)
            column[join.source >= 0] = old[join.source[join.source >= 0]]
            return column

        moved = np.full(len(self.states.q) + 1, NONE, dtype=np.int64)
        moved[join.source[join.source >= 0]] = np.flatnonzero(join.source >= 0)
        self.tags, self.states, self.cells = join.tags, join.states, None
        self.looked_at = {}
        self.stride, self.pinned = by_tag(self.stride, stride), by_tag(self.pinned, pinned)
        self.edges = self.edges.merged(edges, by_tag)
        self.fast_turns = by_tag(self.fast_turns, False)
        self.reason, self.pair = by_state(self.reason, 0), by_state(self.pair, NONE)
        self.seen, self.out = by_state(self.seen, False), by_state(self.out, False)
        self.checked, self.free = by_state(self.checked, False), by_state(self.free, False)
        self.passed = moved[by_state(self.passed, NONE)].astype(np.int32)
        parts = ladder_of(problem, self.between, self.tags, self.states, self.options)
        self.ladder, self.weight, self.share = parts
        self.ladder.cost[self.out] = np.inf
        self.bridges = bridges_of(
            problem,
            self.between,
            self.tags,
            self.states,
            self.stride,
            self.pinned,
            self.fast_turns,
            self.ladder,
        )
        self.bridges.take_over(known[1], moved, rung)
        anew = np.flatnonzero(join.is_new)[:, None] + np.arange(2)
        self.ladder.take_over(known[0], moved, np.unique(np.minimum(anew, len(self.tags) - 1)))

    def keep(self, bits: int) -> None:
        """Let the arm change bits of its branch between tags only where nothing else can be run."""
        self._restart_with(replace(self.options, steady=self.options.steady | bits))

    def keep_spin(self, main: FloatArray) -> None:
        """Let cuts roll the tool off main spins (N,) [rad] of the tags only where that pays."""
        self._restart_with(replace(self.options, main=main))

    def part(self, gaps: list[Parted]) -> bool:
        """Lead no step from near one side of gaps to near the other, where others can be run.

        Return whether that says more than is known.
        """
        known = list(self.options.parted)
        for gap in gaps:
            ends = np.stack([gap.before[0], gap.behind[0]])
            axes = ends.shape[1]
            near = [beside(other, ends) for other in known if other.before.shape[1] <= axes]
            if not any((n[0] & n[1, ::-1]).any() for n in near):
                known.append(gap)
        if len(known) == len(self.options.parted):
            return False
        self._restart_with(replace(self.options, parted=tuple(known)))
        return True

    def _restart_with(self, options: SearchOptions) -> None:
        self.options, known = options, self.ladder
        parts = ladder_of(self.checker.problem, self.between, self.tags, self.states, self.options)
        self.ladder, self.weight, self.share = parts
        self.ladder.cost[self.out] = np.inf
        self.ladder.joins = known.joins
        same = np.append(np.arange(len(self.states.q)), NONE)
        self.ladder.take_over(known, same, np.arange(len(self.tags)))

    @property
    def wanted(self) -> set[int]:
        """Tags that would have to be key tags for a cut to be run."""
        return self.failing.wanted

    def run(self, *, steps: bool = True) -> Found:
        """Search; without ``steps`` only states are checked, not the motions between them.

        Of cuts between key tags apart from each other that cannot be run some stay in: ``wanted``
        names tags to make key instead.
        """
        self.failing.wanted.clear()
        check_steps = self.check_steps if steps else None
        found = free_path(
            self.ladder,
            self.check_states,
            check_steps,
            self.beside,
            partial(also_failing, self),
            lambda: bool(self.wanted),
        )
        self.out |= ~np.isfinite(self.ladder.cost) & np.isfinite(self.states.cost)
        return found

    def allow_fast_turns(self, found: Found) -> bool:
        """Let cuts without a way turn the tool as fast as it takes; return whether that is new."""
        chain = np.cumsum(~self.between.is_cut)[self.tags]
        rungs = np.isin(chain, chain[self.broken(found)]) & ~self.fast_turns
        rungs &= self.bridges.loose & (self.bridges.turn < np.pi)
        if self.wanted or not rungs.any():
            return False
        self.fast_turns |= rungs
        self.bridges.turn[rungs] = np.pi
        self.ladder.renew(np.flatnonzero(rungs))
        return True

    def broken(self, found: Found) -> BoolArray:
        """Return (n,) the key tags into which a cut should lead but none does.

        None either but to a pose that the tool cannot back off from, where it must.
        """
        has = found.path != NONE
        result = self.ladder.broken & has
        result[1:] &= has[:-1]
        result[has] |= self.states.cost[found.path[has]] >= STUCK
        result &= self.ladder.rule == Rule.CHAIN
        result[:1] = False
        return np.asarray(result)

    def check_states(self, states: IndexArray) -> BoolArray:
        """Return whether states (m,) can be run, strokes and all; keeps the reasons."""
        fresh = states[(self.reason[states] == Reason.NONE) & ~self.checked[states]]
        self.checked[fresh] = True
        branch = self.states.branch[fresh].astype(np.int64)
        q = self.states.q[fresh].astype(np.float64)
        tags, first = self.tags[self.states.tag_of(fresh)], self._first_copy(fresh)
        attitude = self.states.attitude_of(fresh)
        verdict = self.checker.states(tags, q, attitude, branch, self.free[first])
        self.reason[fresh], self.pair[fresh] = verdict.reason, verdict.pair
        self.seen[first], self.free[first[verdict.good]] = True, True
        return np.asarray(self.reason[states] == Reason.NONE)

    def check_steps(self, before: IndexArray, after: IndexArray) -> BoolArray:
        """Return whether steps (m,) are to be kept.

        A cut that cannot be run is not, but for those between key tags that get more of them
        (``FailingCuts``). Joint moves always can be run; tags between them stand where they are
        checked like cuts.
        """
        good = np.ones(len(after), dtype=np.bool_)
        rungs = self.states.tag_of(after)
        first, last = self.tags[np.maximum(rungs - 1, 0)], self.tags[rungs]
        to_do = (self.passed[after] != before) & (self.between.is_cut[last] | (last > first + 1))
        rows = np.flatnonzero(to_do)
        if not len(rows):
            return good
        spans = self.spans(before[rows], after[rows])
        judged = judge(self.checker, self.between, spans)
        fine = judged.good(len(rows))
        self.passed[after[rows[fine]]] = before[rows[fine]]
        good[rows] = ~self.failing.taken_out(spans, judged)
        return good

    def spans(self, before: IndexArray, after: IndexArray) -> Spans:
        """Return the steps (m,) between states as spans."""
        rungs = self.states.tag_of(after)
        return Spans(
            self.tags[np.maximum(rungs - 1, 0)],
            self.tags[rungs],
            self.states.attitude_of(before),
            self.states.attitude_of(after),
            self.states.q[before].astype(np.float64),
            self.states.q[after].astype(np.float64),
            self.states.branch[after].astype(np.int64),
        )

    def beside(self, failing: IndexArray) -> IndexArray:
        """Return states that fail along with others: their turn copies, and colliding neighbours.

        From every failing pose the check spreads over the poses around it (spin and tag, wrist
        turned over), without their strokes, until it has found the whole colliding region and its
        rim: the next best way would mostly run into the next pose of the same region.
        """
        found = [failing[self.reason[failing] == Reason.COLLISION]]
        front = failing
        while len(front):
            poses, likely = self._around(front)
            fresh = ~self.seen[poses]
            poses, likely = poses[fresh], likely[fresh]
            self.seen[poses] = True
            tags, q = self.tags[self.states.tag_of(poses)], self.states.q[poses]
            verdict = self.checker.poses(tags, q.astype(np.float64), likely)
            fails = ~verdict.good
            front = poses[fails]
            self.reason[front], self.pair[front] = verdict.reason[fails], verdict.pair[fails]
            found.append(front)
        copies = self._copies(np.concatenate(found))
        self.bridges.changed(self.states.tag_of(np.concatenate([failing, copies])))
        return copies

    def _first_copy(self, states: IndexArray) -> IndexArray:
        """Return the first (m,) of the turn copies of each state."""
        return np.asarray(np.searchsorted(self.states.config, self.states.config[states]))

    def _copies(self, states: IndexArray) -> IndexArray:
        """Return the turn copies of colliding states, with the reason noted for each."""
        of_config = self._first_copy(states)
        ends = np.searchsorted(self.states.config, self.states.config[states], side="right")
        row, step = numbered(ends - of_config)
        copies = of_config[row] + step
        self.reason[copies] = Reason.COLLISION
        self.pair[copies] = self.pair[states[row]]
        return np.asarray(copies)

    def _around(self, states: IndexArray) -> tuple[IndexArray, IndexArray]:
        """Return one state (k,) of every configuration near to states, and by what one collides.

        Those of the same branch and tilt one spin and tag away, and of the same spin some tags
        away; those of the tilts next to it, and that with the wrist turned over.
        """
        width, n, fine = self.states.spins.shape[-1], len(self.tags), self.checker.problem.fine
        if self.cells is None:
            self.cells = self._all_cells()
        own, at = self.states.column[states].astype(np.int64), self.states.tag_of(states)
        branch, pair = self.states.branch[states].astype(np.int64), self.pair[states] + np.int64(1)
        tilt, spin = np.divmod(own, width)
        row, rung = _within(own * 8 + branch, at, _ALONG, n)
        near, by = [self._place(rung, own[row], branch[row])], [pair[row]]
        along, around = np.tile([-1, 0, 1], 2), np.repeat([-1, 1], 3)
        rung = at[:, None] + along
        column = tilt[:, None] * width + (spin[:, None] + fine * around) % width
        inside = (rung >= 0) & (rung < n)
        near.append(self._place(rung, column, branch[:, None])[inside])
        by.append(np.broadcast_to(pair[:, None], inside.shape)[inside])
        near.append(self._place(at, own, branch ^ _FLIP))
        by.append(pair)
        which, other = np.nonzero(beside_in_grid(self.states.tilts)[tilt])
        near.append(self._place(at[which], other * width + spin[which], branch[which]))
        by.append(pair[which])
        kinds = int(pair.max(initial=0)) + 1
        both = np.sort(np.concatenate(near) * kinds + np.concatenate(by))
        wanted, likely = np.divmod(both, kinds)
        last = np.append(wanted[1:] != wanted[:-1], True)
        wanted, likely = wanted[last], likely[last] - 1
        found = np.minimum(np.searchsorted(self.cells, wanted), len(self.cells) - 1)
        known = self.cells[found] == wanted
        return found[known], likely[known]

    def _all_cells(self) -> IndexArray:
        """Return ``_place`` (N,) of all states, in place: there are millions."""
        places = np.repeat(np.arange(len(self.tags)), np.diff(self.states.offsets))
        places *= self.states.spins.shape[-1] * len(self.states.tilts)
        places += self.states.column
        places *= 8
        places += self.states.branch
        return places

    def _place(self, rung: IndexArray, column: IndexArray, branch: IndexArray) -> IndexArray:
        """Return numbers of configurations that rise with rung, then column, then branch."""
        width = self.states.spins.shape[-1] * len(self.states.tilts)
        return np.asarray((rung * width + column) * 8 + branch)

    def chosen(self, found: Found) -> Chosen:
        """Return the poses of all tags with exact joints, those between key tags filled in."""
        problem = self.checker.problem
        n, k = len(problem), len(self.tags)
        good = found.path != NONE
        rows, tags = found.path[good], self.tags[good]
        attitude, q = np.zeros((n, 3)), np.zeros((n, 6))
        branch, is_good = np.zeros(n, dtype=np.int64), np.zeros(n, dtype=np.bool_)
        attitude[tags] = self.states.attitude_of(rows)
        branch[tags], is_good[tags] = self.states.branch[rows], True
        T = problem.placement.tcp(tags, attitude[tags])
        near, external = self.states.q[rows].astype(np.float64), problem.placement.external[tags]
        q[tags], _ = problem.solve(T, external, branch[tags], near)
        entry = np.zeros(n, dtype=np.bool_)
        entry[self.tags] = self.ladder.broken
        joined = np.flatnonzero(good[1:] & good[:-1] & ~self.ladder.broken[1:]) + 1
        a, b = found.path[joined - 1], found.path[joined]
        apart = self.tags[joined] - self.tags[joined - 1] > 1
        a, b = a[apart], b[apart]
        passed = self._have_passed(a, b)
        a, b = a[passed], b[passed]
        chosen = Chosen(attitude, branch, q, is_good, entry)
        fill(problem, self.between, self.spans(a, b), chosen)
        if k < n:
            chosen.entry[1:] |= ~is_good[:-1]
        chosen.entry |= entered_anew(problem.toolpath)
        return chosen

    def _have_passed(self, before: IndexArray, after: IndexArray) -> BoolArray:
        """Return which cuts (m,) over tags between can be run.

        A state remembers one cut into it alone: others that were found good are judged again.
        """
        good = self.passed[after] == before
        again = np.flatnonzero(~good)
        if len(again):
            spans = self.spans(before[again], after[again])
            good[again] = judge(self.checker, self.between, spans).good(len(again))
        return np.asarray(good)

    def record(self, found: Found, chosen: Chosen) -> dict[str, object]:
        """Return what the search did, for the record of the plan."""
        return {
            "strategy": self.checker.problem.cell.optimize.strategy,
            "states": len(self.states.q),
            "checked": found.checked,
            "rounds": found.rounds,
            "cost": self.ladder.total(found.path),
            "travel_rad2": travel(chosen),
        }

    def evidence(self, chosen: Chosen) -> Evidence:
        """Return why tags failed."""
        good, entry = chosen.good[self.tags], chosen.entry[self.tags]
        broken = np.flatnonzero(entry & good & (self.ladder.rule == Rule.CHAIN))
        broken = broken[(broken > 0) & good[broken - 1]]
        return Evidence(
            self.tags,
            self.states,
            self.reason,
            self.pair,
            {row: break_at(self, row) for row in broken.tolist()},
            chosen.at(self.tags),
        )


def _within(line: IndexArray, at: IndexArray, far: int, n: int) -> tuple[IndexArray, IndexArray]:
    """Return what lies within ``far`` of places (m,) of n on lines (m,), each once.

    By which of the places (k,) it is near, and where on the line of that (k,).
    """
    order = np.lexsort((at, line))
    at, line = at[order], line[order]
    first, last = np.maximum(at - far, 0), np.minimum(at + far, n - 1)
    first[1:] = np.where(line[1:] == line[:-1], np.maximum(first[1:], last[:-1] + 1), first[1:])
    row, step = numbered(last - first + 1)
    return order[row], first[row] + step


def travel(chosen: Chosen) -> float:
    """Return the sum of squared joint steps [rad^2] along the unbroken way."""
    good = chosen.good
    joined = good[1:] & good[:-1] & ~chosen.entry[1:]
    return float((np.diff(chosen.q, axis=0)[joined] ** 2).sum())
