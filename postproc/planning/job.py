"""One job for the arm: a toolpath in a cell whose axes stand or follow a course, to its plan."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import Finding
from postproc.kinematics import build
from postproc.ladder import Rule
from postproc.model import Plan, ToolPath
from postproc.paths import Externals
from postproc.planning.attempt import Attempt
from postproc.planning.checks import MORE_CLEARANCE, Checker, near_solids, tag_clearances
from postproc.planning.finished import finished
from postproc.planning.repairs import REPAIRS, Level, repaired
from postproc.planning.route import Route, route
from postproc.planning.search import step_rules
from postproc.planning.states import (
    UPRIGHT,
    Chosen,
    PlanOptions,
    Problem,
    Settings,
    feed_directions,
    path_normals,
    place_given,
    stiffness_of,
    tilt_grid,
)
from postproc.progress import Clock, Progress
from postproc.records import dataclass

_PARTED = (
    "poses chosen otherwise (times tried: {times}) are not joined by free paths either: move what "
    "is in the way, or put the tags on its two sides into programs of their own"
)


@dataclass(frozen=True, slots=True)
class Job:
    """What all plans of a call share: what the cell asks for, the options, and who is told."""

    settings: Settings
    options: PlanOptions
    progress: Progress | None


def planned(
    job: Job,
    toolpath: ToolPath,
    cell: Cell,
    external: FloatArray | None = None,
    *,
    goes_on: bool = False,
) -> Plan:
    """Return the plan of a toolpath in a cell: the poses with the fewest errors, and their moves.

    Args:
        job: of the call.
        toolpath: what was read, of one tool in one base.
        cell: its cell; with external axes ``external`` says where they stand, as ``problem_of``.
        external: (n, k).
        goes_on: motions that are not planned here follow.
    """
    clock, partial = Clock("place", job.progress), job.options.partial
    checker = checker_of(toolpath, cell, job.settings, external)
    attempt = Attempt(checker, clock, partial=partial, goes_on=goes_on)
    (checker, choice, routed), tried = repaired(attempt, Level.SEARCH)
    _add_hints(routed, sum(tried[r.name] for r in REPAIRS if r.price))
    dropped: list[Finding] = []
    if partial:
        routed, dropped = _without_stuck(checker, choice.chosen, routed, goes_on=goes_on)
    findings = [*choice.findings, *dropped, *routed.findings]
    result = finished(checker, choice, routed, findings, job.options.name)
    record = {**result.settings, "tried": dict(tried), "timing": clock.stages()}
    result = replace(result, toolpath=toolpath, settings=record)
    return replace(result, clearance=_clearance(checker, result))


def _add_hints(routed: Route, times: int) -> None:
    """Say in findings, in place, that poses were chosen ``times`` so often and ways still miss."""
    stuck = [gap.finding for gap in routed.gaps]
    for at, finding in enumerate(routed.findings):
        if times and any(finding is one for one in stuck):
            routed.findings[at] = replace(finding, hint=_PARTED.format(times=times))


def _without_stuck(
    checker: Checker, chosen: Chosen, routed: Route, *, goes_on: bool
) -> tuple[Route, list[Finding]]:
    """Return the route without tags that cannot be got to or left, and why each is left out."""
    dropped, most = list[Finding](), 1
    while stuck := [finding for finding in routed.findings if finding.is_error]:
        gone = list(_leave_out(checker, chosen, stuck, most))
        if not gone:
            break
        dropped, most = dropped + gone, 2 * most
        routed = route(checker, chosen, goes_on=goes_on)
    return routed, dropped


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


def problem_of(
    toolpath: ToolPath, cell: Cell, settings: Settings, external: FloatArray | None = None
) -> Problem:
    """Return the planning problem of a toolpath in a cell.

    With external axes ``external`` (n, k) says where they stand at each tag [m or rad].
    """
    toolpath, placement = place_given(toolpath, cell)
    if external is not None:
        placement = replace(placement, external=external, axes=Externals.of(cell))
    tilts = UPRIGHT
    if cell.optimize.tilt:
        axis = placement.axis_base(np.arange(len(placement)))
        feed = feed_directions(toolpath, axis)
        feed[~placement.given] = np.nan
        placement = replace(placement, feed=feed)
        tags = int(placement.may_tilt.sum())
        tilts = tilt_grid(cell.optimize.tilt, len(settings.spins), tags)
    return Problem(
        toolpath,
        cell,
        build(cell.robot),
        placement,
        settings,
        path_normals(toolpath, placement),
        stiffness_of(cell),
        tilts,
    )


def checker_of(
    toolpath: ToolPath, cell: Cell, settings: Settings, external: FloatArray | None = None
) -> Checker:
    """Return the checks of a toolpath in a cell; arguments as ``problem_of``."""
    problem = problem_of(toolpath, cell, settings, external)
    return Checker(problem, _scene(problem))


def _clearance(checker: Checker, result: Plan) -> FloatArray:
    if checker.scene is None:
        return np.full(len(result.toolpath), np.nan)
    return tag_clearances(result, checker.scene, near_solids(checker.problem.cell))[0]


def _scene(problem: Problem):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from postproc.collision import Scene

    return Scene.shared(problem.cell, problem.kinematics).kept(MORE_CLEARANCE)
