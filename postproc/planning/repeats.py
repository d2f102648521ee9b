"""Plans of other tags than those of the toolpath: repeated points left out, points put in.

A repeated point with a pose of its own would turn the tool on the spot, and stop the cut there.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import IndexArray
from postproc.model import Plan, ToolPath


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
