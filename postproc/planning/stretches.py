"""A job of several tools and setups: each stretch planned with its own, joined at a safe posture.

The tool is changed at home, or where the cell has none in a folded posture that is free with every
tool. Every stretch begins and ends there, so that what happens at a change happens to an arm that
stands clear of everything.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import CellError, SourceRef
from postproc.kinematics import build
from postproc.model import Plan, ToolPath
from postproc.planning.external import plan_with_external_axes, travel_moves
from postproc.planning.job import Job, planned
from postproc.planning.retracts import with_retracts
from postproc.planning.route import FOLDED
from postproc.process import ToolStretch, switched_off
from postproc.units import DEG

_SIDES = np.array([0.0, 90.0, -90.0, 45.0, -45.0, 135.0, -135.0]) * DEG
"""A1 of a folded arm [rad], tried in turn."""


def plan_stretches(job: Job, toolpath: ToolPath, cell: Cell, stretches: list[ToolStretch]) -> Plan:
    """Return the plan of a toolpath; stretches that the cell does not claim are left out.

    Args:
        job: of the call.
        toolpath: points in the base of each tag.
        cell: all tools and bases.
        stretches: of one tool in one base, all tags in order.

    Raises:
        CellError: PLN210 if no posture to change tools in is found.
    """
    known = [stretch for stretch in stretches if stretch.is_assigned]
    plan_of = plan_with_external_axes if cell.external_axes else planned
    plan_of = with_retracts if cell.motion.retract_in_cuts else plan_of
    if len(known) < 2 and len(stretches) < 2:
        tool, base = (known[0].tool, known[0].base) if known else (0, 0)
        return _with_frames(plan_of(job, toolpath, cell.with_tool(tool, base)), tool, base)
    if len(known) > 1:
        cell = _with_home(cell, known)
    named = toolpath.named()
    pieces: list[Plan] = []
    before: Plan | None = None
    for stretch in known:
        here = cell.with_tool(stretch.tool, stretch.base)
        part = named.rows(np.arange(stretch.low, stretch.high))
        if _is_left(stretches, stretch):
            part = switched_off(part)
        own = plan_of(job, part, here).within(toolpath, stretch.low)
        own = _with_frames(own, stretch.tool, stretch.base)
        if before is not None and len(own) and (before.external[-1] != own.external[0]).any():
            tool, base = int(before.tool_of_moves[-1]), int(before.base_of_moves[-1])
            travel = travel_moves(job, part, cell.with_tool(tool, base), before, own)
            pieces.append(_with_frames(travel, tool, base))
        pieces.append(own)
        before = own if len(own) else before
    whole = Plan.concat(pieces)
    return replace(whole, settings={**whole.settings, "stretches": len(known)})


def _is_left(stretches: list[ToolStretch], stretch: ToolStretch) -> bool:
    """Return whether what follows a stretch is left out, with all that it switches off."""
    following = stretches[stretches.index(stretch) + 1 :]
    return bool(following) and not following[0].is_assigned


def _with_frames(plan: Plan, tool: int, base: int) -> Plan:
    if (tool, base) == (0, 0):
        return plan
    m = len(plan)
    return replace(plan, tool=np.full(m, tool), base=np.full(m, base))


def _with_home(cell: Cell, stretches: list[ToolStretch]) -> Cell:
    """Return the cell with a posture to change tools in."""
    if cell.motion.home is not None:
        return cell
    home = free_posture(cell, {(stretch.tool, stretch.base) for stretch in stretches})
    if home is None:
        raise CellError(
            "PLN210",
            "no folded posture was found that is free with every tool, to change them in",
            SourceRef(cell.path),
            hint="give [motion] home_deg, a posture in which the tools are changed",
        )
    return replace(cell, motion=replace(cell.motion, home=home))


def free_posture(cell: Cell, frames: Iterable[tuple[int, int]] = ((0, 0),)) -> FloatArray | None:
    """Return a folded posture (6,) [rad] within limits and free of collision; None: not found.

    Args:
        cell: with its tools and bases.
        frames: tools and bases with which it has to be free, as indices.
    """
    from postproc.collision import Scene

    kinematics = build(cell.robot)
    postures = np.array([(side, *FOLDED) for side in _SIDES])
    free = kinematics.within_limits(postures, cell.limits.joint_margin)
    for tool, base in sorted(frames):
        free &= ~Scene.shared(cell.with_tool(tool, base), kinematics).check(postures).hit
    return postures[int(np.argmax(free))] if free.any() else None
