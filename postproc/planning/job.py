"""One job for the arm: a toolpath in a cell whose axes stand or follow a course, to its plan."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import LISTED, Finding, Severity
from postproc.kinematics import build, is_coaxial_with_axis_6
from postproc.model import CUTS, Event, MoveRole, Plan, ToolPath
from postproc.paths import Externals
from postproc.planning.checks import MORE_CLEARANCE, Checker, near_solids, tag_clearances
from postproc.planning.route import Route, step_rows
from postproc.planning.solve import Solved, solve
from postproc.planning.states import (
    TRAVEL,
    UPRIGHT,
    Chosen,
    Moves,
    PlanOptions,
    Problem,
    Settings,
    entered_anew,
    evaluate,
    feed_directions,
    path_normals,
    place_given,
    stiffness_of,
    tilt_grid,
)
from postproc.process import NUMBER, hole_calls, hole_steps
from postproc.progress import Clock, Progress
from postproc.records import dataclass
from postproc.units import DEG, PERCENT


@dataclass(frozen=True, slots=True)
class Job:
    """What all plans of a call share: what the cell asks for, the options, and who is told."""

    settings: Settings
    options: PlanOptions
    progress: Progress | None

    def checker(
        self, toolpath: ToolPath, cell: Cell, external: FloatArray | None = None
    ) -> Checker:
        """Return the checks of a toolpath in a cell; arguments as ``problem_of``."""
        return checker_of(toolpath, cell, self.settings, external)

    def planned(
        self,
        toolpath: ToolPath,
        cell: Cell,
        external: FloatArray | None = None,
        *,
        goes_on: bool = False,
    ) -> Plan:
        """Return the plan of a toolpath in a cell; arguments as ``problem_of``.

        ``goes_on``: motions that are not planned here follow.
        """
        clock = Clock("place", self.progress)
        checker = self.checker(toolpath, cell, external)
        solved = solve(checker, clock, partial=self.options.partial, goes_on=goes_on)
        return _plan_of(solved, toolpath, clock, self.options)


def _plan_of(solved: Solved, toolpath: ToolPath, clock: Clock, options: PlanOptions) -> Plan:
    """Return the plan of a toolpath as it is read."""
    checker, choice, routed = solved.made
    problem, chosen = checker.problem, choice.chosen
    findings = [
        *_notes(checker),
        *_tilt_note(problem, chosen),
        *_changes_note(problem, chosen),
        *_model_note(problem, chosen, choice.best),
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
        {**choice.record, "tried": dict(solved.tried), "timing": clock.stages()},
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
                hint="an angle head or a tool across the flange makes the spin useful",
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


def _model_note(problem: Problem, chosen: Chosen, best: FloatArray) -> list[Finding]:
    """Return where tags stand for the sake of a model of the arm, and what of ``best`` that costs.

    Args:
        problem: what was asked.
        chosen: poses of the tags.
        best: (n,) [N/m] index that each tag could have by itself.
    """
    doubt, tags = problem.cell.model_doubt, np.flatnonzero(chosen.good & problem.is_contact)
    if doubt is None or not len(tags):
        return []
    inside = int((doubt(chosen.q[tags]) <= 0.0).sum())
    text = f"{inside} of {len(tags)} working poses lie where the model of the arm was measured"
    lost = 1.0 - _stiffness(problem, chosen)[0][tags] / best[tags]
    if np.isfinite(lost).any():
        mean, most = (max(float(f(lost)) / PERCENT, 0.0) for f in (np.nanmean, np.nanmax))
        text += (
            f": such poses come first, and these are {mean:.0f} % less stiff than the stiffest, "
            f"{most:.0f} % at most"
        )
    return [Finding(Severity.NOTE, "PLN314", text)]


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


def _changes_note(problem: Problem, chosen: Chosen) -> list[Finding]:
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
