"""From poses and moves to the plan that users get: its columns, events and notes."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import Cell
from postproc.errors import Finding, Severity, listed
from postproc.kinematics import is_coaxial_with_axis_6
from postproc.model import CUTS, Event, MoveRole, Plan, ToolPath
from postproc.planning.attempt import Choice
from postproc.planning.checks import Checker
from postproc.planning.route import Route, step_rows
from postproc.planning.states import TRAVEL, Chosen, Moves, Problem, entered_anew, evaluate
from postproc.process import NUMBER, hole_calls, hole_steps
from postproc.units import DEG, PERCENT


def finished(
    checker: Checker, choice: Choice, routed: Route, findings: list[Finding], name: str | None
) -> Plan:
    """Return the plan of poses and the moves between them.

    Args:
        checker: by which they were found.
        choice: the poses.
        routed: the moves.
        findings: on both.
        name: of the program; None: that of the toolpath.
    """
    problem, chosen, table, times = checker.problem, choice.chosen, routed.moves, routed.timed
    toolpath = problem.toolpath
    index, initial = _stiffness(problem, chosen)
    notes = [
        *_notes(checker),
        *_tilt_note(problem, chosen),
        *_changes_note(problem, chosen),
        *_model_note(problem, chosen, index, choice.best),
    ]
    return Plan(
        name=name or toolpath.name,
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
        stiffness_best=np.maximum(choice.best, index),
        clearance=np.full(len(toolpath), np.nan),
        restart=_straight_ways(checker, chosen),
        off_chord=routed.left.chord,
        off_axis=routed.left.axis,
        events=_events(toolpath, table, problem.cell),
        findings=(*notes, *findings),
        settings={**_as_used(problem), **choice.record},
        orientation_speed=times.orientation,
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


def _model_note(
    problem: Problem, chosen: Chosen, index: FloatArray, best: FloatArray
) -> list[Finding]:
    """Return where tags stand for the sake of a model of the arm, and what that costs.

    Of the index ``best`` (n,) [N/m] that each could have by itself, against theirs.
    """
    doubt, tags = problem.cell.model_doubt, np.flatnonzero(chosen.good & problem.is_contact)
    if doubt is None or not len(tags):
        return []
    inside = int((doubt(chosen.q[tags]) <= 0.0).sum())
    text = f"{inside} of {len(tags)} working poses lie where the model of the arm was measured"
    lost = 1.0 - index[tags] / best[tags]
    if np.isfinite(lost).any():
        mean, most = (max(float(f(lost)) / PERCENT, 0.0) for f in (np.nanmean, np.nanmax))
        text += (
            f": such poses come first, and these are {mean:.0f} % less stiff than the stiffest, "
            f"{most:.0f} % at most"
        )
    return [Finding(Severity.NOTE, "PLN314", text)]


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
    text = (
        "between cuts the tool is lifted off and the arm goes on in another configuration, or an "
        f"axis by more than half a turn: lines {listed(toolpath.line[new].tolist())}"
    )
    source = toolpath.source(int(new[0]))
    return [Finding(Severity.NOTE, "PLN311", text, int(new[0]), source)]
