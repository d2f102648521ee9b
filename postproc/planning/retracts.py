"""Cuts that no single arm configuration serves, left and entered again where the cell allows it.

The last point before the break is asked for twice: once as the end of a cut, once as the beginning
of another, which the route leaves and enters as it does all of them. That serves as long as the
tool can leave the point; where it cannot, points before it that the other configuration reaches too
are tried.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from postproc.arrays import IndexArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity
from postproc.model import CUTS, MotionKind, Plan, ToolPath
from postproc.planning.attempt import Rank, rank
from postproc.planning.external import plan_with_external_axes
from postproc.planning.job import Job, planned
from postproc.planning.repairs import Level, repaired, with_tried
from postproc.planning.states import REENTRY
from postproc.units import DEG


def with_retracts(job: Job, toolpath: ToolPath, cell: Cell) -> Plan:
    """Return the plan of a toolpath of one tool in one base.

    Its cuts are left and entered again where nothing else helps.
    """
    return with_tried(*repaired(_Cuts(job, toolpath, cell), Level.CUTS))


class _Cuts:
    """The cuts of a toolpath, and at which tags they are left: last tag of each, and the place."""

    def __init__(self, job: Job, toolpath: ToolPath, cell: Cell) -> None:
        self._path = toolpath
        plan_of = plan_with_external_axes if cell.external_axes else planned
        self._serve = partial(plan_of, job, cell=cell)
        self._places: dict[int, int] = {}
        self._stuck = self._broken = np.zeros(0, dtype=np.int64)

    def make(self) -> tuple[Rank, Plan]:
        """Return the plan; note the places that the tool cannot leave, and where cuts break."""
        if self._places:
            at = np.unique(np.array(list(self._places.values()), dtype=np.int64))
            made, self._stuck, self._broken = _left_at(self._serve, self._path, at)
        else:
            made = self._serve(toolpath=self._path)
            self._broken = made.failing_tags
        return rank(made.findings, made.cycle_time), made

    def change(self) -> bool:
        """Take other places at which cuts are left; return whether that may help."""
        if not len(self._broken) + len(self._stuck):
            return False
        broken, places = self._broken, self._places
        kind = np.asarray(self._path.kind)
        known = any(place <= tag <= end for end, place in places.items() for tag in broken.tolist())
        if known or not (broken >= 1).all() or not np.isin(kind[broken], CUTS).all():
            return False
        for end in [end for end, place in places.items() if place in self._stuck]:
            place = end - max(1, 2 * (end - places[end]))
            if place < 2 or not np.isin(kind[place - 1 : end], CUTS).all():
                return False
            places[end] = place
        places |= {tag: tag for tag in broken.tolist()}
        return True


def _left_at(
    serve: Callable[..., Plan], toolpath: ToolPath, places: IndexArray
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
    found = serve(toolpath=longer)
    tag = source + anew
    result, errors = as_of(found, toolpath, tag, row), found.failing_tags
    ran = [at for at in places.tolist() if np.isin(row[at] - [1, 2], found.tag).all()]
    told = (_told(found, toolpath, at, int(row[at])) for at in ran)
    result = replace(result, findings=(*result.findings, *told))
    place = errors + np.isin(errors, again - 1)  # which it is left from fails, or entered at
    stuck = np.isin(place, again)
    others = np.where(errors < 0, -1, tag[errors])[~stuck]
    return result, tag[place[stuck]], others


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


def with_repeats(plan: Plan, toolpath: ToolPath, distinct: IndexArray) -> Plan:
    """Return a plan of the ``distinct`` tags (k,) alone as one of the toolpath itself.

    A repeated tag has no move of its own; its numbers are those of the tag that it repeats.
    """
    row = np.searchsorted(distinct, np.arange(len(toolpath)), side="right") - 1
    return as_of(plan, toolpath, distinct, row)


def as_of(plan: Plan, toolpath: ToolPath, tag: IndexArray, row: IndexArray) -> Plan:
    """Return a plan of other tags as one of the toolpath.

    Args:
        plan: of k tags, with all events of the toolpath.
        toolpath: of n tags.
        tag: (k,) rising: the tag of the toolpath that moves to each planned one serve.
        row: (n,) the planned tag whose numbers each tag of the toolpath has.
    """
    findings = tuple(
        finding
        if finding.tag_index is None
        else replace(finding, tag_index=int(tag[finding.tag_index]))
        for finding in plan.findings
    )
    behind = np.append(tag, len(toolpath))
    of_file = dict(zip(map(id, plan.toolpath.events), toolpath.events, strict=True))
    events = tuple(
        (move, of_file.get(id(event)) or replace(event, index=int(behind[event.index])))
        for move, event in plan.events
    )
    return replace(
        plan,
        toolpath=toolpath,
        tag=np.where(plan.tag >= 0, tag[plan.tag], -1).astype(np.int32),
        stiffness=plan.stiffness[row],
        stiffness_initial=plan.stiffness_initial[row],
        stiffness_best=np.asarray(plan.stiffness_best)[row],
        clearance=plan.clearance[row],
        restart=None if plan.restart is None else plan.restart[row],
        off_chord=None if plan.off_chord is None else plan.off_chord[row],
        off_axis=None if plan.off_axis is None else plan.off_axis[row],
        events=events,
        findings=findings,
    )
