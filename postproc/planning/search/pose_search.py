"""The search for the best states of tags: its graph, its checks, and why states and steps fail.

A search is a record of key tags and of their states. What checks find out they note in columns, in
place. Other options make another search of it, as do more key tags or finer spins;
each keeps what is known.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property, partial
from typing import cast

import numpy as np

from postproc.arrays import AnyIntArray, BoolArray, IndexArray, Table
from postproc.ladder import NONE, Found, Ladder, Rule, free_path
from postproc.planning.checks import Checker, Evidence, Reason
from postproc.planning.search.between import Interpolation
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


@dataclass(slots=True)
class KeyTags(Table):
    """Key tags (n,): ``stride``, every how many of the finest spins each has; its stiffest pose.

    ``fast_turns``: whether the tool may turn into it as fast as it will.
    """

    tags: IndexArray
    stride: IndexArray
    fast_turns: BoolArray
    edges: Edges

    @classmethod
    def of(cls, tags: IndexArray, stride: IndexArray, edges: Edges) -> KeyTags:
        """Return tags (n,) into which the tool turns steadily."""
        return cls(tags, stride, np.zeros(len(tags), dtype=np.bool_), edges)


@dataclass(slots=True)
class Known(Table):
    """What is known of states (N,): ``reason`` and ``pair``, why each fails.

    ``asked``: bits ``CHECKED``, ``SEEN``, ``FREE``; ``passed``: the state before from which the
    step into it was found good.
    """

    reason: AnyIntArray
    pair: AnyIntArray
    asked: AnyIntArray
    passed: AnyIntArray

    @classmethod
    def nothing(cls, size: int) -> Known:
        """Return that nothing is known of states."""
        flags, none = np.zeros((2, size), dtype=np.int8), np.full((2, size), NONE, dtype=np.int32)
        return cls(flags[0], none[0], flags[1], none[1])


@dataclass(frozen=True)
class PoseSearch:
    """A search over key tags, and what is known of their states.

    Tags between key tags follow by interpolation. ``failing``: what became of steps and cuts that
    failed.
    """

    checker: Checker
    between: Interpolation
    options: SearchOptions
    keys: KeyTags
    states: States
    known: Known
    ladder: Ladder
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
        stride = np.full(len(tags), problem.fine)
        states, edges = states_on(problem, tags, stride, options)
        search = cls(
            checker,
            between,
            options,
            KeyTags.of(tags, stride, edges),
            states,
            Known.nothing(len(states.q)),
            ladder_of(problem, between, tags, states, options),
            FailingCuts(between, SHORT if options.stretch is None else 0.0),
        )
        search.ladder.joins = search.joins_anew()
        if options.window is not None:
            own = options.window.tilt[tags] * states.spins.shape[-1]
            is_own = states.column == own[states.tag_of(np.arange(len(states.q)))]
            search.known.asked[is_own] = SEEN | FREE
        return search

    @property
    def tags(self) -> IndexArray:
        """(n,) key tags."""
        return self.keys.tags

    def joins_anew(self) -> Joins:
        """Return what cuts may join, nothing of it worked out."""
        at = self.tags, self.states, self.keys.stride
        return joins_of(self.checker.problem, self.between, *at, self.pinned, self.keys.fast_turns)

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
        known = self.known
        fresh = states[(known.reason[states] == Reason.NONE) & (known.asked[states] & CHECKED == 0)]
        known.asked[fresh] |= CHECKED
        branch = self.states.branch[fresh].astype(np.int64)
        q = self.states.q[fresh].astype(np.float64)
        tags, first = self.tags[self.states.tag_of(fresh)], first_copies(self.states, fresh)
        attitude, free = self.states.attitude_of(fresh), known.asked[first] & FREE > 0
        verdict = self.checker.states(tags, q, attitude, branch, free)
        known.reason[fresh], known.pair[fresh] = verdict.reason, verdict.pair
        known.asked[first] |= SEEN
        known.asked[first[verdict.good]] |= FREE
        return np.asarray(known.reason[states] == Reason.NONE)

    def check_steps(self, before: IndexArray, after: IndexArray) -> BoolArray:
        """Return whether steps (m,) are to be kept.

        A cut that cannot be run is not, but for those between key tags that get more of them
        (``FailingCuts``). Joint moves always can be run; tags between them stand where they are
        checked like cuts.
        """
        good = np.ones(len(after), dtype=np.bool_)
        rungs = self.states.tag_of(after)
        first, last = self.tags[np.maximum(rungs - 1, 0)], self.tags[rungs]
        to_do = (self.known.passed[after] != before) & (
            self.between.is_cut[last] | (last > first + 1)
        )
        rows = np.flatnonzero(to_do)
        if not len(rows):
            return good
        spans = self.spans(before[rows], after[rows])
        judged = judge(self.checker, self.between, spans)
        fine = judged.good(len(rows))
        self.known.passed[after[rows[fine]]] = before[rows[fine]]
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
        good = self.known.passed[after] == before
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
            self.known.reason,
            self.known.pair,
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

    Args:
        known: what was searched.
        tags: (m,) rising.
        stride: (m,) every how many of the finest spins each has.
    """
    problem, between, options = known.checker.problem, known.between, known.options
    new, edges = states_on(problem, tags, stride, options)
    join = merged(known.states, known.tags, new, tags)
    old = np.flatnonzero(join.source >= 0)
    moved = np.full(len(known.states.q) + 1, NONE, dtype=np.int64)
    moved[join.source[old]] = old
    keys = known.keys.rows(np.isin(known.tags, tags, invert=True))
    keys = KeyTags.concat([keys, KeyTags.of(tags, stride, edges)])
    of_states = Known.concat([known.known, Known.nothing(1)]).rows(join.source)  # -1: the last row
    of_states.passed = moved[of_states.passed].astype(np.int32)
    search = PoseSearch(
        known.checker,
        between,
        options,
        keys.rows(np.argsort(keys.tags)),
        join.states,
        of_states,
        ladder_of(problem, between, join.tags, join.states, options),
        replace(known.failing, looked_at={}),
    )
    search.ladder.cost[np.append(known.out, False)[join.source]] = np.inf
    search.ladder.joins = search.joins_anew()
    anew = np.flatnonzero(join.is_new)[:, None] + np.arange(2)
    search.ladder.take_over(known.ladder, moved, np.unique(np.minimum(anew, len(join.tags) - 1)))
    return search


def travel(chosen: Chosen) -> float:
    """Return the sum of squared joint steps [rad^2] along the unbroken way."""
    good = chosen.good
    joined = good[1:] & good[:-1] & ~chosen.entry[1:]
    return float((np.diff(chosen.q, axis=0)[joined] ** 2).sum())
