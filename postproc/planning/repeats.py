"""Points that a toolpath repeats are planned once.

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
    source = np.searchsorted(distinct, np.arange(len(toolpath)), side="right") - 1
    findings = tuple(
        finding
        if finding.tag_index is None
        else replace(finding, tag_index=int(distinct[finding.tag_index]))
        for finding in plan.findings
    )
    behind = np.append(distinct, len(toolpath))
    of_file = dict(zip(map(id, plan.toolpath.events), toolpath.events, strict=True))
    events = tuple(
        (move, of_file.get(id(event)) or replace(event, index=int(behind[event.index])))
        for move, event in plan.events
    )
    return replace(
        plan,
        toolpath=toolpath,
        tag=np.where(plan.tag >= 0, distinct[plan.tag], -1).astype(np.int32),
        stiffness=plan.stiffness[source],
        stiffness_initial=plan.stiffness_initial[source],
        clearance=plan.clearance[source],
        restart=None if plan.restart is None else plan.restart[source],
        off_chord=None if plan.off_chord is None else plan.off_chord[source],
        off_axis=None if plan.off_axis is None else plan.off_axis[source],
        events=events,
        findings=findings,
    )
