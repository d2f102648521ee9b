"""Poses between which free ways lead: chosen, routed, and chosen anew where no way is found.

The search weighs poses and steps between them, not the ways round that connections may need. A
solid that parts the reach of the arm lets it stand on either side of a hole pattern, and leads
nowhere between: steps from the one side to the other are out of the question then, at all tags.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import Finding
from postproc.ladder import Rule
from postproc.planning.checks import Checker
from postproc.planning.route import HOME, Route, route
from postproc.planning.search import Choice, Parted, PoseSearch, choose, step_rules
from postproc.planning.states import Chosen
from postproc.progress import Clock

_PATIENCE, _MOST = 3, 10
"""So often at most poses are chosen anew without fewer gaps, and in all."""
_DROPS = 20
_PARTED = (
    "poses chosen otherwise (times tried: {times}) are not joined by free ways either: move what "
    "is in the way, or put the tags on its two sides into programs of their own"
)


def linked(
    checker: Checker, clock: Clock, *, partial: bool, goes_on: bool
) -> tuple[Choice, Route, list[Finding]]:
    """Return the poses with the fewest gaps between them, their route, and why tags are left out.

    Args:
        checker: of the toolpath.
        clock: told what is done.
        partial: whether stretches that cannot be got to are left out.
        goes_on: whether motions that are not planned here follow.
    """
    choice, routed = _chosen(checker, clock, None, partial=partial, goes_on=goes_on)
    search, best, anew, last = choice.search, (choice, routed), 0, 0
    while anew < min(last + _PATIENCE, _MOST) and _runs(choice, partial=partial):
        if not _part(checker, choice, routed):
            break
        choice, routed = _chosen(checker, clock, search, partial=partial, goes_on=goes_on)
        anew += 1
        if _errors(choice, routed) < _errors(*best):
            best, last = (choice, routed), anew
    choice, routed = best
    _tell(routed, anew)
    dropped: list[Finding] = []
    for _ in range(_DROPS if partial else 0):
        stuck = [finding for finding in routed.findings if finding.is_error]
        if not stuck:
            break
        dropped += stuck
        _leave_out(checker, choice.chosen, stuck)
        routed = route(checker, choice.chosen, goes_on=goes_on)
    return choice, routed, dropped


def _chosen(
    checker: Checker, clock: Clock, search: PoseSearch | None, *, partial: bool, goes_on: bool
) -> tuple[Choice, Route]:
    clock.begin("search")
    choice = choose(checker, clock.step, search)
    clock.begin("route")
    runs = _runs(choice, partial=partial)
    return choice, route(checker, choice.chosen, goes_on=goes_on, runs=runs)


def _runs(choice: Choice, *, partial: bool) -> bool:
    return partial or not any(finding.is_error for finding in choice.findings)


def _part(checker: Checker, choice: Choice, routed: Route) -> bool:
    """Let the search avoid what no free way was found for; return whether any of it is new."""
    home, good = checker.problem.cell.motion.home, np.flatnonzero(choice.chosen.good)
    q, is_break = choice.q_grid, np.zeros(len(choice.q_grid), dtype=np.bool_)
    is_break[[finding.tag_index or 0 for finding in routed.findings if finding.is_error]] = True
    stretch = np.cumsum(is_break)

    def side(tag: int) -> FloatArray:
        if tag == HOME:
            return np.asarray(home)[None]
        joined = good[(stretch[good] == stretch[tag]) & (good != tag)]
        return np.asarray(q[np.append(tag, joined)])

    gaps = [Parted.by(side(gap.before), side(gap.behind)) for gap in routed.gaps]
    return choice.search.part(gaps)


def _tell(routed: Route, anew: int) -> None:
    """Say in findings, in place, that poses were chosen ``anew`` so often and ways still miss."""
    stuck = [gap.finding for gap in routed.gaps]
    for at, finding in enumerate(routed.findings):
        if anew and any(finding is one for one in stuck):
            routed.findings[at] = replace(finding, hint=_PARTED.format(times=anew))


def _errors(choice: Choice, routed: Route) -> int:
    return sum(finding.is_error for finding in (*choice.findings, *routed.findings))


def _leave_out(checker: Checker, chosen: Chosen, stuck: list[Finding]) -> None:
    """Leave out tags that cannot be got to, in place, with the cuts that begin there."""
    rule = step_rules(checker.problem)
    for finding in stuck:
        tag = finding.tag_index or 0
        chosen.good[tag] = False
        while tag + 1 < len(rule) and rule[tag + 1] == Rule.CHAIN:
            tag += 1
            chosen.good[tag] = False
        chosen.entry[tag + 1 : tag + 2] = True
