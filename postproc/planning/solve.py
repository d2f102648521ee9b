"""The one loop of planning: make a plan, and where it fails repair what there is evidence for.

``REPAIRS`` says what may be tried, level by level: a search, the places of the external axes, cuts
that are left, ways to plan at all. Every plan is compared with the best so far, by one rule; what
was tried, and how often, is the record that users get.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Protocol, TypeVar, cast

import numpy as np

from postproc.errors import Finding
from postproc.ladder import Rule
from postproc.model import Plan
from postproc.planning.attempt import Attempt, Made
from postproc.planning.checks import Checker
from postproc.planning.repairs import REPAIRS, Level
from postproc.planning.route import Route, route
from postproc.planning.search import step_rules
from postproc.planning.states import Chosen
from postproc.progress import Clock
from postproc.records import dataclass

MOST_PLANS = 12
"""So many plans of a level are made at most, the first one with them."""
_DROPS = 20
_LOST = "PLN305"
"""More stiffness is lost than the bound allows."""
_PARTED = (
    "poses chosen otherwise (times tried: {times}) are not joined by free paths either: move what "
    "is in the way, or put the tags on its two sides into programs of their own"
)


Rank = tuple[int, int, float]
"""What plans are compared by, the least is best: findings that refuse it, bounds of loss that it
breaks, time [s]."""
M = TypeVar("M")


class State(Protocol[M]):
    """What repairs of a level change."""

    def make(self) -> M:
        """Return what comes of it as it is."""

    def rank_of(self, made: M) -> Rank:
        """Return the rank of what was made last."""


@dataclass(frozen=True, slots=True)
class Solved:
    """The best attempt, and why tags are left out; ``tried``: how often each repair was, in all."""

    made: Made
    tried: Counter[str]
    dropped: list[Finding]


def rank(findings: Iterable[Finding], seconds: float) -> Rank:
    """Return the rank of a plan by its findings and the time that it takes [s]."""
    known = list(findings)
    return sum(f.is_error for f in known), sum(f.code == _LOST for f in known), round(seconds, 3)


def repaired(state: State[M], level: Level) -> tuple[M, Counter[str]]:
    """Return the best that comes of repairs of a level, and how often each was tried."""
    rows = [repair for repair in REPAIRS if repair.level is level]
    best: tuple[Rank, M] | None = None
    in_vain, tried, plans = Counter[str](), Counter[str](), 0
    while True:
        for repair in rows:
            if not repair.price and repair.serve(state):
                break
        else:
            plans += 1
            made = state.make()
            now = state.rank_of(made), made
            if best is None or now[0][0] < best[0][0]:
                in_vain.clear()
            best = now if best is None or now[0] < best[0] else best
            left = rows if plans < MOST_PLANS else ()
            found = next((r for r in left if in_vain[r.name] < r.price and r.serve(state)), None)
            if found is None:
                return best[1], tried
            repair = found
            in_vain[repair.name] += 1
        tried[repair.name] += 1


class WholePlans:
    """A level that makes whole plans."""

    def rank_of(self, made: Plan) -> Rank:
        """Return the rank of a plan."""
        return rank(made.findings, made.cycle_time)


def tried_for(plan: Plan) -> Counter[str]:
    """Return how often each repair was tried for a plan."""
    return Counter(cast("dict[str, int]", plan.settings.get("tried", {})))


def with_tried(plan: Plan, tried: Counter[str]) -> Plan:
    """Return a plan with more repairs that were tried in its record."""
    total = dict(tried_for(plan) + tried)
    return replace(plan, settings={**plan.settings, "tried": total})


def repairs_tried(plan: Plan) -> list[dict[str, object]]:
    """Return what was tried for a plan, as documents say it: each repair, why, and how often."""
    tried = tried_for(plan)
    return [
        {"repair": row.name, "because": row.evidence, "times": tried[row.name]}
        for row in REPAIRS
        if row.name in tried
    ]


def solve(checker: Checker, clock: Clock, *, partial: bool, goes_on: bool) -> Solved:
    """Return the poses with the fewest errors and the moves between them.

    Args:
        checker: of the toolpath.
        clock: told what is done.
        partial: whether stretches that cannot be got to are left out.
        goes_on: whether motions that are not planned here follow.
    """
    attempt = _Search(checker, clock, partial=partial, goes_on=goes_on)
    made, tried = repaired(attempt, Level.SEARCH)
    _add_hints(made.routed, sum(tried[r.name] for r in REPAIRS if r.price))
    solved = Solved(made, tried, [])
    return _without_stuck(solved, goes_on=goes_on) if partial else solved


class _Search(Attempt):
    def rank_of(self, made: Made) -> Rank:
        """Return the rank of an attempt."""
        found = (*made.choice.findings, *made.routed.findings)
        return rank(found, float(made.routed.timed.duration.sum()))


def _add_hints(routed: Route, times: int) -> None:
    """Say in findings, in place, that poses were chosen ``times`` so often and ways still miss."""
    stuck = [gap.finding for gap in routed.gaps]
    for at, finding in enumerate(routed.findings):
        if times and any(finding is one for one in stuck):
            routed.findings[at] = replace(finding, hint=_PARTED.format(times=times))


def _without_stuck(solved: Solved, *, goes_on: bool) -> Solved:
    """Return a plan without the tags that cannot be got to or left, and why each is left out."""
    made, dropped = solved.made, list[Finding]()
    routed = made.routed
    for turn in range(_DROPS):
        stuck = [finding for finding in routed.findings if finding.is_error]
        if not stuck:
            break
        dropped += _leave_out(made.checker, made.choice.chosen, stuck, 2**turn)
        routed = route(made.checker, made.choice.chosen, goes_on=goes_on)
    return replace(solved, made=made._replace(routed=routed), dropped=dropped)


def _leave_out(
    checker: Checker, chosen: Chosen, stuck: list[Finding], most: int
) -> Iterator[Finding]:
    """Leave out stuck tags, in place, and say so of each tag.

    With a tag at which the tool comes in goes all that is cut from there on; at one from which it
    cannot get away the cut ends sooner, by ``most`` tags. What lies behind a tag that goes is
    looked at again: then the tool comes from elsewhere.
    """
    toolpath, ran = checker.problem.toolpath, chosen.good.copy()
    joined = (step_rules(checker.problem) == Rule.CHAIN) & ~chosen.entry & ran
    joined[1:] &= ran[:-1]
    for finding in sorted(stuck, key=lambda one: one.tag_index or 0):
        tag = finding.tag_index or 0
        before = int(np.flatnonzero(ran[:tag]).max(initial=-1))
        if not chosen.good[tag] or (before >= 0 and not chosen.good[before]):
            continue
        begin = int(np.flatnonzero(~joined[: tag + 1]).max(initial=0))
        end = tag + int(np.argmin(np.append(joined[tag + 1 :], False))) + 1
        gone = range(max(begin, tag + 1 - most) if begin < tag else tag, end)
        chosen.good[gone.start : gone.stop] = False
        chosen.entry[gone.stop : gone.stop + 1] = True
        yield finding
        why = f"left out: tag {toolpath.tag_name(tag)} in the same cut fails"
        for other in gone:
            if other != tag:
                text = f"tag {toolpath.tag_name(other)}: {why}"
                yield replace(
                    finding, message=text, tag_index=other, source=toolpath.source(other), hint=""
                )
