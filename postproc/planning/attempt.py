"""A plan in the making: which pose every tag gets, and the way between them, stage by stage.

The strategies ``global``, ``each`` and ``smooth`` are one search. They differ in which tags are key
tags at first and in what travel weighs. Key tags take states of the grid, the best sequence of all;
the tags between follow by interpolation, each with its own tip and axis; then the poses leave the
grid.

``smooth`` is the smoothing of Jiao et al. 2022: few key tags, as the cell names or spaces them.
With ``refine`` off these take the best spin of the grid each, as in the paper; with it they are
chosen together, travel counted, so that the way between two of them rarely crosses a trough.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import NamedTuple

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Preset, Strategy
from postproc.errors import Finding, Severity
from postproc.planning.checks import Checker, explained, gave_up
from postproc.planning.route import Route, route
from postproc.planning.search import (
    DEFAULT_BOUND,
    LOST,
    TIE_TRAVEL,
    Interpolation,
    PoseSearch,
    Refinement,
    SearchOptions,
    along,
    best_index,
    between_round,
    dense_key_tags,
    key_tags,
    least_index,
    loss_of,
    loss_report,
    on_round_spins,
    searched,
    stretches,
    travel,
    without_roll,
)
from postproc.planning.states import Chosen, take_joints
from postproc.progress import Clock
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class Choice:
    """The poses of all tags, the findings, and a record of the work.

    ``q_grid`` (n, 6) [rad]: joints of the poses before they left the grid. ``best`` (n,) [N/m]:
    index that each tag could have by itself: with the strategy ``smooth`` free of collision, else
    within reach.
    """

    chosen: Chosen
    q_grid: FloatArray
    findings: list[Finding]
    record: dict[str, object]
    best: FloatArray


class Made(NamedTuple):
    """A whole attempt: by which checks, the poses, and the moves between them."""

    checker: Checker
    choice: Choice
    routed: Route


Rank = tuple[int, int, float]
"""What plans are compared by, the least is best: findings that refuse it, bounds of loss that it
breaks, time [s]."""


def rank(findings: Iterable[Finding], seconds: float) -> Rank:
    """Return the rank of a plan by its findings and the time that it takes [s]."""
    known = list(findings)
    return sum(f.is_error for f in known), sum(f.code == LOST for f in known), round(seconds, 3)


class Attempt:
    """The stages of a plan: those of its search, then, each when it is asked for, choice and route.

    A repair asks to ``use`` another search: then they are worked out again.

    Args:
        checker: of the toolpath.
        clock: told what is done.
        partial: whether stretches that cannot be got to are left out.
        goes_on: whether motions that are not planned here follow.
    """

    def __init__(self, checker: Checker, clock: Clock, *, partial: bool, goes_on: bool) -> None:
        self.clock, self.partial, self.goes_on = clock, partial, goes_on
        self.begin(checker)

    def begin(self, checker: Checker | None = None) -> None:
        """Begin anew: with other checks, or with what is known of these."""
        self.clock.begin("search")
        if checker is not None:
            self._search_by(checker)
        self._forget()
        self.refinement = Refinement(self.between)

    def _search_by(self, checker: Checker) -> None:
        self.checker = checker
        problem, wishes = checker.problem, checker.problem.cell.optimize
        self.is_smooth = wishes.strategy is Strategy.SMOOTH
        self.between = Interpolation.of(problem)
        self.bound = DEFAULT_BOUND if wishes.loss_bound is None else wishes.loss_bound
        self.best = best_index(checker, self.between) if self.is_smooth else None
        keys = key_tags(problem.toolpath, wishes) if self.is_smooth else dense_key_tags(problem)
        self._asked = int(keys.sum())
        self.search = searched(checker, np.flatnonzero(keys), self._search_options(), self.between)

    def _search_options(self) -> SearchOptions:
        problem, best = self.checker.problem, self.best
        if best is None:
            return SearchOptions(each=problem.cell.optimize.strategy is Strategy.EACH)
        least = least_index(best, self.bound) if np.isfinite(best).any() else None
        number = stretches(problem.toolpath)
        each = not problem.cell.optimize.refine
        return SearchOptions(each=each, cut_travel=TIE_TRAVEL, least=least, stretch=number)

    def use(self, search: PoseSearch) -> None:
        """Search by another one; that of a job done lap by lap is done anew as a whole."""
        if search.options.window is not None:
            options = self._search_options()
            search = PoseSearch.of(self.checker, search.tags, options, self.between)
        self.search = search
        self._forget()

    def _forget(self) -> None:
        """Forget what was worked out."""
        for stage in ("choice", "routed"):
            self.__dict__.pop(stage, None)

    @cached_property
    def choice(self) -> Choice:
        """The poses of all tags, off the grid, and what stands against them."""
        problem, search, chosen = self.checker.problem, self.search, self.search.chosen
        wishes = problem.cell.optimize
        record, q_grid = search.record(), chosen.q
        is_bound = wishes.strategy is Strategy.EACH and wishes.loss_bound is not None
        moved = wishes.refine and (wishes.strategy is Strategy.GLOBAL or is_bound)
        if moved:
            self.clock.step(0, 0, "refine")
            at_edges = isinstance(wishes.objective, str) and wishes.preset is Preset.STIFFEST
            at_edges |= wishes.loss_bound is not None
            chosen = on_round_spins(search, chosen, at_edges=at_edges)
            record |= {"travel_rad2_grid": record["travel_rad2"], "travel_rad2": travel(chosen)}
        findings = explained(self.checker, search.evidence(chosen))
        findings += between_round(problem, search.tags, chosen) if moved else []
        findings += gave_up(self.checker, chosen, findings, sorted(self.refinement.gave_up))
        best = self.best
        if best is None:
            best = along(self.between, search.tags, search.keys.edges.index)
        take_joints(problem, chosen)
        findings += without_roll(search, chosen, best)
        if self.is_smooth or wishes.loss_bound is not None:
            loss = loss_of(problem, chosen, best)
            told = loss_report(problem, loss, search.tags, self.bound)
            if self.is_smooth or told.severity is Severity.WARNING:
                findings.insert(0, told)
            if self.is_smooth:
                record |= {"key_tags": search.tags.tolist(), "loss": loss.tolist()}
                if len(search.tags) > self._asked:
                    record["key_tags_added"] = len(search.tags) - self._asked
        return Choice(chosen, q_grid, findings, record, best)

    @property
    def runs(self) -> bool:
        """Whether every tag has a pose, or may be left out."""
        return self.partial or not any(finding.is_error for finding in self.choice.findings)

    @cached_property
    def routed(self) -> Route:
        """The moves between the poses."""
        chosen, runs = self.choice.chosen, self.runs
        self.clock.begin("route")
        return route(self.checker, chosen, goes_on=self.goes_on, runs=runs)

    def make(self) -> tuple[Rank, Made]:
        """Return all of it with its rank."""
        choice, routed = self.choice, self.routed
        known = (*choice.findings, *routed.findings)
        seconds = float(routed.timed.duration.sum())
        return rank(known, seconds), Made(self.checker, choice, routed)
