"""The one loop of planning: attempt, and where that fails repair what there is evidence for.

``REPAIRS`` says what may be tried. Every attempt whose poses are found and joined is compared with
the best so far; what was tried, and how often, is the record that users get.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.errors import Finding
from postproc.ladder import Rule
from postproc.planning.attempt import Attempt, Choice
from postproc.planning.checks import Checker
from postproc.planning.repairs import REPAIRS
from postproc.planning.route import Route, route
from postproc.planning.search import step_rules
from postproc.planning.states import Chosen
from postproc.progress import Clock
from postproc.records import dataclass

MOST_PLANS = 11
"""So many plans are made at most, the first one with them."""
_DROPS = 20
_PARTED = (
    "poses chosen otherwise (times tried: {times}) are not joined by free ways either: move what "
    "is in the way, or put the tags on its two sides into programs of their own"
)


@dataclass(frozen=True, slots=True)
class Solved:
    """The best attempt: by which checks, the poses, their moves, and why tags are left out.

    ``tried``: how often each repair was, in all.
    """

    checker: Checker
    choice: Choice
    routed: Route
    tried: dict[str, int]
    dropped: list[Finding]

    @property
    def errors(self) -> int:
        """How many findings refuse the plan."""
        found = (*self.choice.findings, *self.routed.findings)
        return sum(finding.is_error for finding in found)


def solve(checker: Checker, clock: Clock, *, partial: bool, goes_on: bool) -> Solved:
    """Return the poses with the fewest errors and the moves between them.

    Args:
        checker: of the toolpath.
        clock: told what is done.
        partial: whether stretches that cannot be got to are left out.
        goes_on: whether motions that are not planned here follow.
    """
    attempt = Attempt(checker, clock, partial=partial, goes_on=goes_on)
    best, in_vain, plans, tried = None, Counter[str](), 0, Counter[str]()
    while True:
        repair = next((r for r in REPAIRS if not r.price and r.serve(attempt)), None)
        if repair is None:
            plans += 1
            made = Solved(attempt.checker, attempt.choice, attempt.routed, {}, [])
            if best is None or made.errors < best.errors:
                best = made
                in_vain.clear()
            left = REPAIRS if plans < MOST_PLANS else ()
            repair = next((r for r in left if in_vain[r.name] < r.price and r.serve(attempt)), None)
            if repair is None:
                break
            in_vain[repair.name] += 1
        if attempt.widen():
            continue
        tried[repair.name] += 1
        attempt.renew()
    best = replace(best, tried=dict(tried))
    _add_hints(best.routed, plans - 1)
    return _without_stuck(best, goes_on=goes_on) if partial else best


def _add_hints(routed: Route, times: int) -> None:
    """Say in findings, in place, that poses were chosen ``times`` so often and ways still miss."""
    stuck = [gap.finding for gap in routed.gaps]
    for at, finding in enumerate(routed.findings):
        if times and any(finding is one for one in stuck):
            routed.findings[at] = replace(finding, hint=_PARTED.format(times=times))


def _without_stuck(solved: Solved, *, goes_on: bool) -> Solved:
    """Return a plan without the tags that cannot be got to or left, and why each is left out."""
    routed, dropped = solved.routed, list[Finding]()
    for turn in range(_DROPS):
        stuck = [finding for finding in routed.findings if finding.is_error]
        if not stuck:
            break
        dropped += _leave_out(solved.checker, solved.choice.chosen, stuck, 2**turn)
        routed = route(solved.checker, solved.choice.chosen, goes_on=goes_on)
    return replace(solved, routed=routed, dropped=dropped)


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
