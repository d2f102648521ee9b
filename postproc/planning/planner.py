"""From a toolpath to a plan: place, sample, search, refine, route, time."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.cell import Cell, Preset
from postproc.errors import Finding, PlanError, Severity
from postproc.kinematics import build, is_coaxial_with_axis_6
from postproc.model import CUTS, Event, MoveRole, Plan, ToolPath
from postproc.paths import Externals
from postproc.planning.checks import MORE_CLEARANCE, Checker, near_solids, tag_clearances
from postproc.planning.external import plan_with_external_axes
from postproc.planning.repeats import with_repeats
from postproc.planning.retracts import changes_between, with_retracts
from postproc.planning.route import Route, step_rows
from postproc.planning.search import (
    ordered,
    ordered_by_place,
)
from postproc.planning.solve import Solved, solve
from postproc.planning.states import (
    TRAVEL,
    UPRIGHT,
    Chosen,
    Moves,
    PlanOptions,
    Problem,
    Settings,
    evaluate,
    feed_directions,
    path_normals,
    place_given,
    settle,
    stiffness_of,
    tilt_grid,
)
from postproc.planning.stretches import plan_stretches
from postproc.process import (
    LEAST_PECK,
    MOST_PECKS,
    NUMBER,
    ToolStretch,
    as_served,
    claimed,
    driven,
    hole_calls,
    hole_steps,
    holes_served,
    peck_count,
    reordered,
    with_turns,
    without_repeats,
)
from postproc.progress import Clock, Progress
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
    cell, _ = settle(cell, options)
    options = PlanOptions(partial=options.partial, name=options.name)
    _require_few_pecks(toolpath)
    plans = (_plan_in(toolpath, here, options, progress) for here in _ways_to_plan(cell))
    return min(plans, key=lambda made: (len(made.errors), round(made.cycle_time, 3)))


def _ways_to_plan(cell: Cell) -> list[Cell]:
    """Return the cells of which the one with the quickest plan counts, the usual one first.

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


def _plan_in(
    toolpath: ToolPath, cell: Cell, options: PlanOptions, progress: Progress | None
) -> Plan:
    """Return the plan in a cell as it is settled."""
    settings = settle(cell, options)[1]
    claims = claimed(driven(as_served(toolpath, cell), cell), cell)
    toolpath = with_turns(claims.toolpath)
    if any(finding.is_error for finding in claims.findings) and not options.partial:
        return Plan.nothing(toolpath, options.name or toolpath.name, claims.findings)
    stretches = claims.stretches()
    if cell.optimize.free_order:
        toolpath = reordered(toolpath, _order(toolpath, cell, settings, stretches))
        cell = replace(cell, optimize=replace(cell.optimize, free_order=False))
    toolpath = holes_served(toolpath, cell)
    part, distinct = without_repeats(toolpath)
    if len(distinct) < len(toolpath):
        return with_repeats(_plan_in(part, cell, options, progress), toolpath, distinct)
    result = plan_stretches(
        toolpath,
        cell,
        stretches,
        lambda part, here: with_retracts(
            part, here, lambda path: _served(path, here, settings, options, progress)
        ),
        lambda part, here: checker_of(part, here, settings),
    )
    notes = [*_left_out_note(result), *_home_note(result, cell)]
    return replace(result, findings=(*claims.findings, *result.findings, *notes))


def _home_note(result: Plan, cell: Cell) -> list[Finding]:
    """Return where a program without a home begins and ends."""
    if cell.motion.home is not None or not len(result):
        return []
    text = (
        "no [motion] home_deg: the first motion is a PTP from wherever the arm stands, which is "
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
        f"{cuts - int(left.sum())} of {cuts} points of cuts are written, the lines pass the others "
        f"within {chord / MM:.4f} mm and {axis / DEG:.4f} deg"
    )
    return [Finding(Severity.NOTE, "PLN309", text)]


def _order(
    toolpath: ToolPath, cell: Cell, settings: Settings, stretches: list[ToolStretch]
) -> IndexArray:
    """Return the order (n,) of the tags in which the holes of every stretch are done quickest."""
    order = np.arange(len(toolpath))
    for stretch in stretches:
        if not stretch.is_claimed:
            continue
        rows = order[stretch.low : stretch.high]
        part, here = toolpath.rows(rows), cell.with_tool(stretch.tool, stretch.base)
        if cell.external_axes:
            own = ordered_by_place(part)
        else:
            own = ordered(problem_of(part, here, settings))
        order[stretch.low : stretch.high] = rows[own]
    return order


def _served(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    options: PlanOptions,
    progress: Progress | None,
) -> Plan:
    """Return the plan of one tool in one base."""
    if not cell.external_axes:
        return _planned(toolpath, cell, settings, options, progress)
    return plan_with_external_axes(
        toolpath,
        cell,
        settings,
        lambda external: checker_of(toolpath, cell, settings, external),
        lambda here: checker_of(toolpath, here, settings),
        lambda part, here, goes_on, external: _planned(
            part, here, settings, options, progress, external, goes_on=goes_on
        ),
    )


def _require_few_pecks(toolpath: ToolPath) -> None:
    for number, cycle in enumerate(toolpath.cycles):
        count = peck_count(cycle)
        tags = np.flatnonzero(np.asarray(toolpath.cycle) == number)
        step = cycle.peck or cycle.peck_first
        if (count > MOST_PECKS or 0.0 < step <= LEAST_PECK) and len(tags):
            text = f"{count} pecks of {step / MM:g} mm in a hole, expected at most {MOST_PECKS}"
            raise PlanError("PLN209", text, toolpath.source(int(tags[0])))


def _planned(
    toolpath: ToolPath,
    cell: Cell,
    settings: Settings,
    options: PlanOptions,
    progress: Progress | None,
    external: FloatArray | None = None,
    *,
    goes_on: bool = False,
) -> Plan:
    """Return the plan with the external axes at ``external`` (n, k); None: the cell has none."""
    clock = Clock("place", progress)
    checker = checker_of(toolpath, cell, settings, external)
    solved = solve(checker, clock, partial=options.partial, goes_on=goes_on)
    return _plan_of(solved, toolpath, clock, options)


def _plan_of(solved: Solved, toolpath: ToolPath, clock: Clock, options: PlanOptions) -> Plan:
    """Return the plan of a toolpath as it is read."""
    checker, choice, routed = solved.checker, solved.choice, solved.routed
    problem, chosen = checker.problem, choice.chosen
    findings = [
        *_notes(checker),
        *_tilt_note(problem, chosen),
        *changes_between(problem, chosen),
        *choice.findings,
        *solved.dropped,
        *routed.findings,
    ]
    result = _assembled(
        problem,
        chosen,
        routed,
        findings,
        options,
        {**choice.record, "tried": solved.tried, "timing": clock.stages()},
    )
    return replace(
        result,
        toolpath=toolpath,
        stiffness_best=np.maximum(choice.best, result.stiffness),
        restart=_straight_ways(checker, chosen),
        off_chord=routed.left.chord,
        off_axis=routed.left.axis,
        clearance=_clearance(checker, replace(result, toolpath=toolpath)),
        settings={**_as_used(problem), **result.settings},
    )


def _as_used(problem: Problem) -> dict[str, object]:
    """Return the options that shaped the plan, in file units, for the record."""
    weights, wishes = problem.settings.weights, problem.cell.optimize
    return {
        "objective": {name: weight for name, weight, _ in weights.states}
        | {TRAVEL: weights.travel},
        "index": wishes.index,
        "step_deg": round(wishes.step / DEG, 6),
        "range_deg": [round(value / DEG, 6) for value in wishes.range],
        "turns": wishes.turns,
        "refine": wishes.refine,
        "spin_reference": problem.placement.reference,
    } | ({"tilts_deg": np.round(problem.tilts / DEG, 6).tolist()} if wishes.tilt else {})


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


def _straight_ways(checker: Checker, chosen: Chosen) -> FloatArray:
    """Return whether (n,) the way from home straight above a numbered hole is free, else NaN."""
    problem, strokes = checker.problem, checker.strokes
    result, home = np.full(len(chosen.good), np.nan), problem.cell.motion.home
    if NUMBER not in problem.toolpath.extra:
        return result
    numbers = np.asarray(problem.toolpath.extra[NUMBER])
    tags = np.nonzero(strokes.is_stroke & chosen.good & (numbers > 0))[0]
    if home is None:
        result[tags] = 1.0
        return result
    top = problem.placement.tcp(tags, chosen.attitude[tags], strokes.top[tags])
    external = problem.placement.external[tags]
    q, _ = problem.solve(top, external, chosen.branch[tags], chosen.q[tags])
    result[tags] = checker.joint_moves(np.broadcast_to(home, q.shape), q, external).good
    return result


def _scene(problem: Problem):  # type: ignore[no-untyped-def]  # noqa: ANN202
    from postproc.collision import Scene

    return Scene.shared(problem.cell, problem.kinematics).kept(MORE_CLEARANCE)


def _notes(checker: Checker) -> list[Finding]:
    """Return what the user should know about the cell."""
    problem = checker.problem
    notes = [Finding(Severity.NOTE, "PLN302", note) for note in problem.settings.weights.notes]
    tool = problem.cell.tool
    if is_coaxial_with_axis_6(problem.kinematics, tool.T_flange_tcp, tool.axis):
        notes.append(
            Finding(
                Severity.WARNING,
                "PLN303",
                "the tool axis lies on the axis of A6: a spin of the tool moves A6 only and gains "
                "no stiffness",
                hint="an angle head or a tool across the flange makes the spin worth something",
            )
        )
    return notes + list(checker.scene.findings if checker.scene is not None else ())


def _tilt_note(problem: Problem, chosen: Chosen) -> list[Finding]:
    """Return how much of the allowed tilt is used."""
    may = problem.placement.may_tilt & chosen.good
    if not may.any():
        return []
    tilts = chosen.attitude[may, 1:] / DEG
    tilted = int((tilts != 0.0).any(axis=1).sum())
    low, high = np.round(tilts.min(axis=0), 3) + 0.0, np.round(tilts.max(axis=0), 3) + 0.0
    text = (
        f"{tilted} of {len(tilts)} milling tags are tilted: lead {low[0]:g} to {high[0]:g} deg, "
        f"side tilt {low[1]:g} to {high[1]:g} deg, {len(problem.tilts)} tilts searched"
    )
    return [Finding(Severity.NOTE, "PLN306", text)]


def _assembled(
    problem: Problem,
    chosen: Chosen,
    routed: Route,
    findings: list[Finding],
    options: PlanOptions,
    record: dict[str, object],
) -> Plan:
    table, times = routed.moves, routed.timed
    index, initial = _stiffness(problem, chosen)
    toolpath = problem.toolpath
    return Plan(
        name=options.name or toolpath.name,
        toolpath=toolpath,
        kind=table.kind.astype(np.int32),
        role=table.role.astype(np.int32),
        tag=table.tag.astype(np.int32),
        T_base_tcp=table.T_base_tcp,
        aux=table.aux,
        q=table.q,
        spin=chosen.spin[table.tag],
        branch=chosen.branch[table.tag].astype(np.int32),
        speed=times.speed,
        ptp_fraction=times.fraction,
        blend=times.blend,
        dwell=table.dwell,
        duration=times.duration,
        external=table.external,
        stiffness=index,
        stiffness_initial=initial,
        clearance=np.full(len(toolpath), np.nan),
        events=_events(toolpath, table, problem.cell),
        findings=tuple(findings),
        settings=record,
        orientation_speed=times.orientation,
    )


def _events(toolpath: ToolPath, table: Moves, cell: Cell) -> tuple[tuple[int, Event], ...]:
    """Return the events of the file and of its holes, each with the move that it comes before.

    Before one move come first the spindle as it was before a hole (-2), the steps behind the hole
    (-1), what the next hole asks for (0), then what the file says there (1).
    """
    first = np.searchsorted(table.tag, [event.index for event in toolpath.events]).tolist()
    found = [(move, 1, event) for move, event in zip(first, toolpath.events, strict=True)]
    for tag, below, behind in hole_calls(toolpath, cell):
        rows = np.flatnonzero((table.tag == tag) & (table.role == MoveRole.RETRACT))
        if len(rows):
            found += [(int(rows[0]), 0, below), (int(rows[0]) + 1, -2, behind)]
    for tag, ahead, behind_ in hole_steps(toolpath, cell):
        places = step_rows(table, tag, standing=cell.process.unit_feeds)
        if places is not None:
            found += [(places[0], 0, event) for event in ahead]
            found += [(places[1], -1, event) for event in behind_]
    return tuple((move, event) for move, _, event in sorted(found, key=lambda item: item[:2]))


def _stiffness(problem: Problem, chosen: Chosen) -> tuple[FloatArray, FloatArray]:
    """Return the index (n,) [N/m] as chosen and at spin 0 in the same branch; NaN where none."""
    n = len(problem)
    index, initial = np.full(n, np.nan), np.full(n, np.nan)
    tags = np.nonzero(chosen.good)[0]
    if problem.settings.weights.main is None or not len(tags):
        return index, initial
    upright = np.zeros((len(tags), 3))
    for result, attitude in ((index, chosen.attitude[tags]), (initial, upright)):
        T = problem.placement.tcp(tags, attitude)
        external = problem.placement.external[tags]
        q, reached = problem.solve(T, external, chosen.branch[tags], chosen.q[tags])
        rows = np.nonzero(reached)[0]
        result[tags[rows]] = evaluate(problem, tags[rows], attitude[rows, 0], T[rows], q[rows])[1]
    return index, initial
