"""Cuts that no single arm configuration serves, left and entered again where the cell allows it.

The last point before the break is asked for twice: once as the end of a cut, once as the beginning
of another, which the route leaves and enters as it does all of them. That serves as long as the
tool can leave the point; where it cannot, points before it that the other configuration reaches too
are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from postproc.arrays import IndexArray
from postproc.cell import Cell
from postproc.errors import LISTED, Finding, Severity
from postproc.model import CUTS, MotionKind, Plan, ToolPath
from postproc.planning.repeats import as_of
from postproc.planning.states import REENTRY, Chosen, Problem, entered_anew
from postproc.units import DEG

_ROUNDS = 16
"""So often at most another place is taken once the cut has been left at the known ones."""


def with_retracts(toolpath: ToolPath, cell: Cell, plan_here: Callable[[ToolPath], Plan]) -> Plan:
    """Return the plan of a toolpath, its cuts left and entered again where nothing else helps.

    Args:
        toolpath: what is asked for.
        cell: says whether cuts may be left.
        plan_here: a toolpath to its plan, errors at tags that no cut enters.
    """
    refused = result = plan_here(toolpath)
    if not cell.motion.retract_in_cuts:
        return result
    places: dict[int, int] = {}
    stuck = broken = np.zeros(0, dtype=np.int64)
    for _ in range(_ROUNDS):
        if not result.errors:
            return result
        if not places:
            broken = result.failing_tags
        if not _is_left_elsewhere(toolpath, places, stuck, broken):
            return refused
        at = np.unique(np.array(list(places.values()), dtype=np.int64))
        result, stuck, broken = _left_at(toolpath, at, plan_here)
    return refused


def _is_left_elsewhere(
    toolpath: ToolPath, places: dict[int, int], stuck: IndexArray, broken: IndexArray
) -> bool:
    """Take other places at which cuts are left, in place; return whether that may help."""
    kind = np.asarray(toolpath.kind)
    known = any(place <= tag <= end for end, place in places.items() for tag in broken.tolist())
    if known or not (broken >= 1).all() or not np.isin(kind[broken], CUTS).all():
        return False
    for end in [end for end, place in places.items() if place in stuck]:
        place = end - max(1, 2 * (end - places[end]))
        if place < 2 or not np.isin(kind[place - 1 : end], CUTS).all():
            return False
        places[end] = place
    places |= {tag: tag for tag in broken.tolist()}
    return True


def changes_between(problem: Problem, chosen: Chosen) -> list[Finding]:
    """Return the note of cuts that begin in another arm configuration than the one before ended."""
    toolpath = problem.toolpath
    cuts = np.flatnonzero(np.isin(np.asarray(toolpath.kind), CUTS) & chosen.good)
    first = cuts[np.append(True, np.diff(cuts) > 1)[: len(cuts)]][1:] - 1
    last = cuts[np.searchsorted(cuts, first) - 1]
    leap = np.abs(chosen.q[first] - chosen.q[last]).max(axis=1, initial=0.0) > np.pi
    leap |= chosen.branch[first] != chosen.branch[last]
    leap &= chosen.good[first]  # else it is inside a cut, at a tag that cannot be run
    leap &= ~entered_anew(toolpath)[first]
    new = first[leap]
    if not len(new):
        return []
    lines = toolpath.line[new].tolist()
    more = f" and {len(lines) - LISTED} more" if len(lines) > LISTED else ""
    text = (
        "between cuts the tool is lifted off and the arm goes on in another configuration, or an "
        f"axis by more than half a turn: lines {', '.join(map(str, lines[:LISTED]))}{more}"
    )
    source = toolpath.source(int(new[0]))
    return [Finding(Severity.NOTE, "PLN311", text, int(new[0]), source)]


def _left_at(
    toolpath: ToolPath, places: IndexArray, plan_here: Callable[[ToolPath], Plan]
) -> tuple[Plan, IndexArray, IndexArray]:
    """Return the plan in which the cuts into tags ``places`` (k,) are left and entered again.

    With it the places that the tool cannot leave, and the tags at which other errors stand.
    """
    n, named = len(toolpath), toolpath.named()
    source = np.sort(np.concatenate([np.arange(n), places - 1]))
    row = np.searchsorted(source, np.arange(n))
    again = row[places - 1] + 1
    longer = named.rows(source)
    kind, feed = np.asarray(longer.kind).copy(), np.asarray(longer.feed).copy()
    kind[again], feed[again] = MotionKind.LINEAR, np.asarray(toolpath.feed)[places]
    anew = np.zeros(len(source), dtype=np.bool_)
    anew[again] = True
    joints = longer.joints
    if joints is not None:
        joints = np.where(anew[:, None], np.nan, joints)
    extra = {**longer.extra, REENTRY: anew}
    longer = replace(longer, kind=kind, feed=feed, joints=joints, extra=extra)
    found = plan_here(longer)
    tag = source + anew
    result, errors = as_of(found, toolpath, tag, row), found.failing_tags
    if len(errors):
        place = errors + np.isin(errors, again - 1)  # which it is left from fails, or entered at
        stuck = np.isin(place, again)
        others = np.where(errors < 0, -1, tag[errors])[~stuck]
        return result, tag[place[stuck]], others
    told = (_told(found, toolpath, int(place), int(row[place])) for place in places)
    return replace(result, findings=(*result.findings, *told)), errors, errors


def _told(found: Plan, toolpath: ToolPath, place: int, row: int) -> Finding:
    """Return the warning of a cut that is left before a tag, planned as ``row``."""
    last, down = (int(np.flatnonzero(found.tag == tag)[-1]) for tag in (row - 2, row - 1))
    turned = (found.q[down] - found.q[last]) / DEG
    axis = int(np.argmax(np.abs(turned)))
    text = (
        f"no arm configuration serves this cut: it is left at tag {toolpath.tag_name(place - 1)} "
        f"and entered there again, A{axis + 1} at {found.q[down, axis] / DEG:.0f} instead of "
        f"{found.q[last, axis] / DEG:.0f} deg"
    )
    source = toolpath.source(place)
    return Finding(Severity.WARNING, "PLN310", text, place, source)
