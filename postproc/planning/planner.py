"""From a toolpath to a plan: place, sample, search, refine, route, time."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from postproc.arrays import IndexArray
from postproc.cell import Cell, Preset
from postproc.errors import Finding, PlanError, Severity
from postproc.model import CUTS, Plan, ToolPath
from postproc.planning.attempt import rank
from postproc.planning.job import Job, problem_of
from postproc.planning.retracts import with_repeats
from postproc.planning.search import ordered, ordered_by_place
from postproc.planning.states import PlanOptions, Settings, settle
from postproc.planning.stretches import plan_stretches
from postproc.process import (
    LEAST_PECK,
    MOST_PECKS,
    ToolStretch,
    as_served,
    assign,
    driven,
    holes_served,
    peck_count,
    reordered,
    with_turns,
    without_repeats,
)
from postproc.progress import Progress
from postproc.units import DEG, MM

__all__ = ["PlanOptions", "plan"]


def plan(
    toolpath: ToolPath,
    cell: Cell,
    options: PlanOptions | None = None,
    progress: Progress | None = None,
) -> Plan:
    """Return the moves that run a toolpath in a cell.

    Args:
        toolpath: what was read, frame part = workpiece frame.
        cell: robot, tool, workpiece, obstacles, wishes.
        options: of this call; None: all as the cell says.
        progress: called with (done, total, what).

    Returns:
        The plan; tags that cannot be run are errors among its ``findings``. Without
        ``options.partial`` such a plan has no moves worth running. Where the cell leaves the order
        of holes free, the plan's toolpath is the one read in the order found; what the file leaves
        on is switched off in it.

    Raises:
        PlanError: PLN201 if the path gives no reference for the spin; PLN209 for a cycle of too
            many pecks.
        CellError: if the cell asks for what does not exist.
    """
    options = options or PlanOptions()
    settle(cell)  # what is wrong with its options, before hours of work
    _require_few_pecks(toolpath)
    assigned = assign(driven(as_served(toolpath, cell), cell), cell)
    toolpath, stretches = with_turns(assigned.toolpath), assigned.stretches()
    if any(finding.is_error for finding in assigned.findings) and not options.partial:
        return Plan.nothing(toolpath, options.name or toolpath.name, assigned.findings)
    plans: list[Plan] = []
    for here in _ways(cell):
        job, path = Job(settle(here)[1], options, progress), toolpath
        if here.optimize.free_order:
            path = reordered(path, _order(path, here, job.settings, stretches))
            here = replace(here, optimize=replace(here.optimize, free_order=False))
        path = holes_served(path, here)
        part, distinct = without_repeats(path)
        result = plan_stretches(job, part, here, assigned.of(distinct).stretches())
        notes = (*result.findings, *_left_out_note(result), *_home_note(result, here))
        result = replace(result, findings=notes)
        plans.append(with_repeats(result, path, distinct) if len(distinct) < len(path) else result)
    best = min(plans, key=lambda plan: rank(plan.findings, plan.cycle_time))
    return replace(best, findings=(*assigned.findings, *best.findings))


def _ways(cell: Cell) -> list[Cell]:
    """Return the presets and orders of which the quickest plan counts, those asked for first.

    Neither an order that is looked for nor short ways for their own sake are always quicker.
    """
    wishes = cell.optimize
    is_fastest = wishes.preset is Preset.FASTEST and isinstance(wishes.objective, str)
    presets = (Preset.FASTEST, Preset.BALANCED) if is_fastest else (wishes.preset,)
    orders = (True, False) if wishes.free_order else (False,)
    return [
        replace(cell, optimize=replace(wishes, preset=preset, free_order=order))
        for preset, order in itertools.product(presets, orders)
    ]


def _home_note(result: Plan, cell: Cell) -> list[Finding]:
    """Return where a program without a home begins and ends."""
    if cell.motion.home is not None or not len(result):
        return []
    text = (
        "no [motion] home_deg: the first motion is a PTP from wherever the arm is, which is "
        "not checked, and the program ends above the last point"
    )
    return [Finding(Severity.NOTE, "PLN312", text)]


def _left_out_note(result: Plan) -> list[Finding]:
    """Return how many points of cuts are written, and what leaving out the others costs."""
    left = result.left_out
    if not left.any():
        return []
    cuts = int(np.isin(np.asarray(result.toolpath.kind), CUTS).sum())
    chord, axis = (np.nanmax(np.asarray(v)) for v in (result.off_chord, result.off_axis))
    text = (
        f"{cuts - int(left.sum())} of {cuts} points of cuts are written; their lines pass the rest "
        f"within {chord / MM:.4f} mm and {axis / DEG:.4f} deg"
    )
    return [Finding(Severity.NOTE, "PLN309", text)]


def _order(
    toolpath: ToolPath, cell: Cell, settings: Settings, stretches: list[ToolStretch]
) -> IndexArray:
    """Return the order (n,) of the tags in which the holes of every stretch are done quickest."""
    order = np.arange(len(toolpath))
    for stretch in stretches:
        if not stretch.is_assigned:
            continue
        rows = order[stretch.low : stretch.high]
        part, here = toolpath.rows(rows), cell.with_tool(stretch.tool, stretch.base)
        if cell.external_axes:
            own = ordered_by_place(part)
        else:
            own = ordered(problem_of(part, here, settings))
        order[stretch.low : stretch.high] = rows[own]
    return order


def _require_few_pecks(toolpath: ToolPath) -> None:
    for number, cycle in enumerate(toolpath.cycles):
        count = peck_count(cycle)
        tags = np.flatnonzero(np.asarray(toolpath.cycle) == number)
        step = cycle.peck or cycle.peck_first
        if (count > MOST_PECKS or 0.0 < step <= LEAST_PECK) and len(tags):
            text = f"{count} pecks of {step / MM:g} mm in a hole, expected at most {MOST_PECKS}"
            raise PlanError("PLN209", text, toolpath.source(int(tags[0])))
