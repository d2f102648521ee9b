"""Which pose every tag gets: the strategies ``global``, ``each`` and ``smooth``, one search.

They differ in which tags are key tags at first and in what travel weighs. Key tags take states of
the grid, the best sequence of all; the tags between follow by interpolation, each with its own tip
and axis. Where a cut between two of them cannot be run another is taken, or key tags are added, as
where it loses too much stiffness; then the poses leave the grid.

``smooth`` is the smoothing of Jiao et al. 2022: few key tags, as the cell names or spaces them.
With ``refine`` off these take the best spin of the grid each, as in the paper; with it they are
chosen together, travel counted, so that the way between two of them rarely crosses a trough.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.cell import Preset, Strategy
from postproc.errors import Finding, Severity
from postproc.ladder import Found
from postproc.planning.checks import Checker, explained, gave_up
from postproc.planning.route import has_ways
from postproc.planning.search.between import Interpolation
from postproc.planning.search.growth import Growth
from postproc.planning.search.keytags import dense_key_tags, key_tags, stretches
from postproc.planning.search.loss import (
    DEFAULT_BOUND,
    LossBound,
    along,
    best_index,
    loss_of,
    loss_report,
)
from postproc.planning.search.main_spin import main_spins
from postproc.planning.search.pose_search import PoseSearch, travel
from postproc.planning.search.roll import without_roll
from postproc.planning.search.round_spins import between_round, on_round_spins
from postproc.planning.search.rungs import ARM, TIE_TRAVEL, WRIST, Wish, changes_of
from postproc.planning.states import Chosen, take_joints
from postproc.records import dataclass

Step = Callable[[int, int, str], None]


@dataclass(frozen=True, slots=True)
class Choice:
    """The poses of all tags, the findings, a record of the work, and the search that chose them.

    ``q_grid`` (n, 6) [rad]: joints of the poses before they left the grid. ``best`` (n,) [N/m]:
    index that each tag could have by itself: with the strategy ``smooth`` free of collision, else
    within reach.
    """

    chosen: Chosen
    q_grid: FloatArray
    findings: list[Finding]
    record: dict[str, object]
    best: FloatArray
    search: PoseSearch


def choose(checker: Checker, step: Step, known: PoseSearch | None = None) -> Choice:
    """Return the pose of every tag.

    Args:
        checker: of the problem.
        step: told how far it is.
        known: a search of it that goes on; None: there is none yet.
    """
    problem = checker.problem
    wishes = problem.cell.optimize
    is_smooth = wishes.strategy is Strategy.SMOOTH
    between = Interpolation.of(problem)
    most = DEFAULT_BOUND if wishes.loss_bound is None else wishes.loss_bound
    bound = LossBound(best_index(checker, between), most) if is_smooth else None
    keys = key_tags(problem.toolpath, wishes) if is_smooth else dense_key_tags(problem)
    search = known or PoseSearch.of(checker, np.flatnonzero(keys), _wish(checker, bound), between)
    growth = Growth(between)
    found, chosen = _run(search, growth, step)
    if bound is not None:
        while len(more := bound.more_keys(_is_key(search), loss_of(problem, chosen, bound.best))):
            search.grow(more, np.full(len(more), problem.fine))
            found, chosen = _run(search, growth, step)
    record, q_grid = search.record(found, chosen), chosen.q
    is_bound = wishes.strategy is Strategy.EACH and wishes.loss_bound is not None
    moved = wishes.refine and (wishes.strategy is Strategy.GLOBAL or is_bound)
    if moved:
        step(0, 0, "refine")
        at_edges = isinstance(wishes.objective, str) and wishes.preset is Preset.STIFFEST
        at_edges |= wishes.loss_bound is not None
        chosen = on_round_spins(search, chosen, at_edges=at_edges)
        record |= {"travel_rad2_grid": record["travel_rad2"], "travel_rad2": travel(chosen)}
    findings = explained(checker, search.evidence(chosen))
    findings += between_round(problem, search.tags, chosen) if moved else []
    findings += gave_up(checker, chosen, findings, sorted(growth.gave_up))
    best = along(between, search.tags, search.edges.index) if bound is None else bound.best
    take_joints(problem, chosen)
    findings += without_roll(search, chosen, best)
    if is_smooth or wishes.loss_bound is not None:
        loss = loss_of(problem, chosen, best)
        told = loss_report(problem, loss, search.tags, most)
        if is_smooth or told.severity is Severity.WARNING:
            findings.insert(0, told)
        if is_smooth:
            record |= {"key_tags": search.tags.tolist(), "loss": loss.tolist()}
            if len(search.tags) > keys.sum():
                record["key_tags_added"] = len(search.tags) - int(keys.sum())
    return Choice(chosen, q_grid, findings, record, best, search)


def _wish(checker: Checker, bound: LossBound | None) -> Wish:
    wishes = checker.problem.cell.optimize
    if bound is None:
        return Wish(each=wishes.strategy is Strategy.EACH)
    least = bound.least if np.isfinite(bound.best).any() else None
    number = stretches(checker.problem.toolpath)
    return Wish(each=not wishes.refine, cut_travel=TIE_TRAVEL, least=least, stretch=number)


def _run(search: PoseSearch, growth: Growth, step: Step) -> tuple[Found, Chosen]:
    """Search, and look closer until all that fails is refuted.

    Cuts that roll the tool far are searched again: that has to pay. Where no free way is found by
    which the arm changes shoulder or elbow as the best sequence asks for, or turns the wrist over,
    another is looked for that does so only where it must.
    """
    n = len(search.checker.problem)
    found = search.run()
    while True:
        if search.may_hurry(found):
            found = search.run()
            continue
        tags, stride = growth.next(search, found)
        if len(tags):
            step(min(len(search.tags), n - 1), n, "search")
            search.grow(tags, stride)
        else:
            main = main_spins(search, found)
            if main is not None:
                search.keep_spin(main)
                found = search.run()
                continue
            chosen = search.chosen(found)
            bits = _without_ways(search, chosen)
            if not bits:
                return found, chosen
            search.keep(bits)
        found = search.run()


def _without_ways(search: PoseSearch, chosen: Chosen) -> int:
    """Return the bits of the branch that change where no free way is found, if any are left."""
    for bits in (ARM, WRIST):
        changes = changes_of(bits, chosen)
        if not search.wish.steady & bits and not has_ways(search.checker, chosen, changes):
            return bits
    return 0


def _is_key(search: PoseSearch) -> BoolArray:
    keys = np.zeros(len(search.checker.problem), dtype=np.bool_)
    keys[search.tags] = True
    return keys
