"""The search for the best states of tags: its graph, its checks, and why states and steps fail.

A search is a record of columns, of key tags and of their states. What checks find out they note in
the columns, in place. Other options make another search of it, as do more key tags or finer spins;
each keeps what is known.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from postproc.arrays import AnyIntArray, BoolArray, IndexArray
from postproc.ladder import NONE, Found, Ladder, Rule, free_path
from postproc.planning.checks import Checker, Evidence, Reason
from postproc.planning.search.between import Interpolation
from postproc.planning.search.bridges import Bridges
from postproc.planning.search.constants import SHORT, STUCK
from postproc.planning.search.cuts import Spans, fill, judge
from postproc.planning.search.edges import Edges
from postproc.planning.search.failing import (
    SEEN,
    FailingCuts,
    also_colliding,
    also_failing,
    break_at,
    first_copies,
    places_of,
)
from postproc.planning.search.rungs import Joins, SearchOptions, joins_of, ladder_of, states_on
from postproc.planning.states import Chosen, States, entered_anew, merged
from postproc.records import dataclass

CHECKED, FREE = 1, 4
"""What was asked of a state: all of it; and of the first turn copy of its configuration, beside
``SEEN``, whether it collides: that it is free, its stroke as well."""


@dataclass(frozen=True)
class PoseSearch:
    """A search over key tags, and what is known of their states.

    Tags between key tags follow by interpolation. Of each key tag (n,): ``stride``, every how many
    of the finest spins it has; ``fast_turns``: whether the tool may turn into it as fast as it
    will; ``edges``: its stiffest pose. Of each state (N,): ``reason`` and ``pair``, why it fails;
    ``asked``: bits ``CHECKED``, ``SEEN``, ``FREE``; ``passed``: the state before from which the
    step into it was found good. ``failing``: what became of steps and cuts that failed.
    """

    checker: Checker
    between: Interpolation
    options: SearchOptions
    tags: IndexArray
    stride: IndexArray
    fast_turns: BoolArray
    states: States
    edges: Edges
    ladder: Ladder
    reason: AnyIntArray
    pair: AnyIntArray
    asked: AnyIntArray
    passed: AnyIntArray
    failing: FailingCuts

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
        options, problem = options or SearchOptions(), checker.problem
        between = between or Interpolation.of(problem)
        stride, fast = np.full(len(tags), problem.fine), np.zeros(len(tags), dtype=np.bool_)
        states, edges = states_on(problem, tags, stride, options)
        size = len(states.q)
        search = cls(
            checker,
            between,
            options,
            tags,
            stride,
            fast,
            states,
            edges,
            ladder_of(problem, between, tags, states, options),
            reason=np.zeros(size, dtype=np.int8),
            pair=np.full(size, NONE, dtype=np.int32),
            asked=np.zeros(size, dtype=np.int8),
            passed=np.full(size, NONE, dtype=np.int32),
            failing=FailingCuts(between, SHORT if options.stretch is None else 0.0),
        )
        search.ladder.joins = search.joins_anew()
        if options.window is not None:
            own = options.window.tilt[tags] * states.spins.shape[-1]
            search.asked[states.column == own[states.tag_of(np.arange(size))]] = SEEN | FREE
        return search

    def joins_anew(self) -> Joins:
        """Return what cuts may join, nothing of it worked out."""
        at = self.tags, self.states, self.stride
        return joins_of(self.checker.problem, self.between, *at, self.pinned, self.fast_turns)

    @property
    def joins(self) -> Joins:
        """What cuts may join, beside the rules of the graph."""
        return cast("Joins", self.ladder.joins)

    @property
    def pinned(self) -> BoolArray:
        """(n,) key tags that stand at one spin, or where they stood."""
        pins = self.checker.problem.pins[self.tags]
        return np.asarray(~np.isnan(pins) | (self.options.window is not None))

    @property
    def out(self) -> BoolArray:
        """(N,) states that were taken out of the graph."""
        return np.asarray(~np.isfinite(self.ladder.cost) & np.isfinite(self.states.cost))

    @cached_property
    def places(self) -> IndexArray:
        """(N,) numbers of the configurations of all states, rising."""
        return places_of(self.states)

    @cached_property
    def found(self) -> Found:
        """The best sequence of states, each and every step checked.

        Of cuts between key tags apart from each other that cannot be run some stay in:
        ``failing.wanted`` names tags to make key instead.
        """
        self.failing.wanted.clear()
        return free_path(
            self.ladder,
            self.check_states,
            self.check_steps,
            partial(also_colliding, self),
            partial(also_failing, self),
            lambda: bool(self.failing.wanted),
        )

    def standing(self) -> IndexArray:
        """Return the best state (n,) of every key tag, the motions between them not checked."""
        return free_path(self.ladder, self.check_states, beside=partial(also_colliding, self)).path

    @property
    def broken(self) -> BoolArray:
        """(n,) the key tags into which a cut should lead but none does.

        None either but to a pose that the tool cannot back off from, where it must.
        """
        path = self.found.path
        has = path != NONE
        result = self.ladder.broken & has
        result[1:] &= has[:-1]
        result[has] |= self.states.cost[path[has]] >= STUCK
        result &= self.ladder.rule == Rule.CHAIN
        result[:1] = False
        return np.asarray(result)

    def check_states(self, states: IndexArray) -> BoolArray:
        """Return whether states (m,) can be run, strokes and all; keeps the reasons."""
        fresh = states[(self.reason[states] == Reason.NONE) & (self.asked[states] & CHECKED == 0)]
        self.asked[fresh] |= CHECKED
        branch = self.states.branch[fresh].astype(np.int64)
        q = self.states.q[fresh].astype(np.float64)
        tags, first = self.tags[self.states.tag_of(fresh)], first_copies(self.states, fresh)
        attitude, free = self.states.attitude_of(fresh), self.asked[first] & FREE > 0
        verdict = self.checker.states(tags, q, attitude, branch, free)
        self.reason[fresh], self.pair[fresh] = verdict.reason, verdict.pair
        self.asked[first] |= SEEN
        self.asked[first[verdict.good]] |= FREE
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

    @cached_property
    def chosen(self) -> Chosen:
        """The poses of all tags with exact joints, those between key tags filled in."""
        problem, path = self.checker.problem, self.found.path
        n, k = len(problem), len(self.tags)
        good = path != NONE
        rows, tags = path[good], self.tags[good]
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
        a, b = path[joined - 1], path[joined]
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

    def record(self) -> dict[str, object]:
        """Return what the search did, for the record of the plan."""
        return {
            "strategy": self.checker.problem.cell.optimize.strategy,
            "states": len(self.states.q),
            "checked": self.found.checked,
            "rounds": self.found.rounds,
            "cost": self.ladder.total(self.found.path),
            "travel_rad2": travel(self.chosen),
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


def with_options(known: PoseSearch, options: SearchOptions) -> PoseSearch:
    """Return a search over the same states by other prices of them and of steps."""
    ladder = ladder_of(known.checker.problem, known.between, known.tags, known.states, options)
    ladder.cost[known.out] = np.inf
    ladder.joins = known.joins
    same = np.append(np.arange(len(known.states.q)), NONE)
    ladder.take_over(known.ladder, same, np.arange(len(known.tags)))
    return replace(known, options=options, ladder=ladder)


def grown(known: PoseSearch, tags: IndexArray, stride: IndexArray) -> PoseSearch:
    """Return a search with more key tags (m,), or with those known on a finer grid of spins.

    Every column is that of the tags and states kept, with those of the new ones put in.

    Args:
        known: what was searched.
        tags: (m,) rising.
        stride: (m,) every how many of the finest spins each has.
    """
    problem, between, options = known.checker.problem, known.between, known.options
    new, edges = states_on(problem, tags, stride, options)
    join = merged(known.states, known.tags, new, tags)
    kept, old = np.isin(known.tags, tags, invert=True), np.flatnonzero(join.source >= 0)

    def by_tag(column: NDArray[Any], new: object) -> NDArray[Any]:
        result = np.empty((len(join.tags), *column.shape[1:]), dtype=column.dtype)
        result[join.is_new], result[~join.is_new] = new, column[kept]
        return result

    def by_state(column: NDArray[Any], new: object) -> NDArray[Any]:
        result = np.full(len(join.source), new, dtype=column.dtype)
        result[old] = column[join.source[old]]
        return result

    moved = np.full(len(known.states.q) + 1, NONE, dtype=np.int64)
    moved[join.source[old]] = old
    search = PoseSearch(
        known.checker,
        between,
        options,
        join.tags,
        by_tag(known.stride, stride),
        by_tag(known.fast_turns, False),
        join.states,
        known.edges.merged(edges, by_tag),
        ladder_of(problem, between, join.tags, join.states, options),
        by_state(known.reason, 0),
        by_state(known.pair, NONE),
        by_state(known.asked, 0),
        moved[by_state(known.passed, NONE)].astype(np.int32),
        replace(known.failing, looked_at={}),
    )
    ladder, joins = search.ladder, search.joins_anew()
    ladder.cost[by_state(known.out, False)] = np.inf
    ladder.joins, before = joins, known.joins
    if isinstance(joins, Bridges) and isinstance(before, Bridges):  # leans are told anew
        rung = np.where(join.is_new, NONE, known.tags.searchsorted(join.tags))
        joins.take_over(before, moved, rung)
    anew = np.flatnonzero(join.is_new)[:, None] + np.arange(2)
    ladder.take_over(known.ladder, moved, np.unique(np.minimum(anew, len(join.tags) - 1)))
    return search


def travel(chosen: Chosen) -> float:
    """Return the sum of squared joint steps [rad^2] along the unbroken way."""
    good = chosen.good
    joined = good[1:] & good[:-1] & ~chosen.entry[1:]
    return float((np.diff(chosen.q, axis=0)[joined] ** 2).sum())
