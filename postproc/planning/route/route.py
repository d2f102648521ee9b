"""From chosen poses to the moves of the controller, in order, with speeds, blends and times."""

from __future__ import annotations

from dataclasses import field
from typing import NamedTuple

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.cell import PathEntry
from postproc.errors import Finding
from postproc.geometry import inverse
from postproc.model import CUTS, EventKind, MotionKind, MoveKind, MoveRole
from postproc.planning.checks import Checker, Lines, Reason, Verdict, failure
from postproc.planning.route.connect import (
    GIVE_UP,
    Detour,
    Ends,
    backed_off,
    detours,
    free_way,
    stuck,
)
from postproc.planning.route.speeds import Timed, can_be_told, timed
from postproc.planning.route.thin import Left, corner_tolerances, thinned
from postproc.planning.route.working import ARRIVE, LEAVE, cut_moves, hole_moves, step_rows
from postproc.planning.states import Chosen, Moves, Problem, in_order, moves
from postproc.process import feeds_out, hole_steps, on_the_way_out
from postproc.records import dataclass

STOPS = frozenset(EventKind) - {EventKind.MESSAGE, EventKind.UNKNOWN}
"""Events before which the robot stands still."""
_HOME = -1000
_NOT_SEARCHED = (
    f"after {GIVE_UP} connections without a free path only backing off along the tool axis was "
    "tried"
)
_STUCK = "the tool cannot back off along its axis from the end of the cut"
_NO_WAY_IN = "the tool cannot come down along its axis to where the cut begins"


HOME = -1
"""Instead of a tag: home."""


class Gap(NamedTuple):
    """A connection for which no free path was found: the finding, the tags before and behind it."""

    finding: Finding
    before: int
    behind: int


@dataclass(slots=True)
class Route:
    """All moves in order with speeds and times, what is left out, and what was found on the way.

    ``gaps``: connections for which no free path was found.
    """

    moves: Moves
    timed: Timed
    left: Left
    gaps: list[Gap]
    findings: list[Finding] = field(default_factory=list)


def route(checker: Checker, chosen: Chosen, *, goes_on: bool = False, runs: bool = True) -> Route:
    """Return the moves that run the chosen poses.

    Connections that cannot be made free of collision are findings at their tag.

    Args:
        checker: of the toolpath.
        chosen: poses of its tags.
        goes_on: whether motions that are not planned here follow: no tool is left in material.
        runs: false where it is known that not all tags can be run: nothing is blended.
    """
    problem = checker.problem
    findings: list[Finding] = []
    gaps: list[Gap] = []
    arrives, leaves = _ends(checker, chosen)
    findings += _shut_in(checker, chosen, arrives)
    table = in_order(
        [
            *hole_moves(problem, checker.strokes, chosen),
            *cut_moves(problem, chosen, arrives, leaves),
            *_free_tags(problem, chosen),
            *_first_and_last(checker, chosen, arrives, leaves, findings, gaps, goes_on=goes_on),
        ]
    )
    first = np.flatnonzero(chosen.good).min(initial=len(chosen.good))
    arriving = np.nonzero((table.kind == MoveKind.PTP) & (table.order == ARRIVE))[0]
    arriving = arriving[table.tag[arriving] > first]
    ends = _ends_into(checker, chosen, table.tag[arriving], arrives, leaves)
    as_line, blocked = _decide(checker, chosen, ends, findings, gaps, runs=runs)
    rows = arriving[as_line]
    table.kind[rows], table.speed[rows] = MoveKind.LIN, problem.cell.motion.rapid_speed
    extra = [
        _detour_moves(problem, ends, row, way, table, arriving)
        for row, way in sorted(blocked.items())
    ]
    if extra:
        table = in_order([table, *extra])
    kept, left = thinned(checker, table, _stops_before(problem, table))
    table = table.rows(kept)
    tolerance = corner_tolerances(problem, table, left)
    result = timed(checker, table, _stops_before(problem, table), findings, tolerance, runs=runs)
    return Route(table, result, left, gaps, findings)


def _ends(checker: Checker, chosen: Chosen) -> tuple[FloatArray, FloatArray]:
    """Return the joints (n, 6) in which the tool arrives at and leaves tags."""
    problem, ends = checker.problem, []
    height = _arrival_heights(problem, chosen)
    for top in (height, checker.strokes.top):
        q, at = chosen.q.copy(), np.flatnonzero((top > 0.0) & chosen.good)
        T = problem.placement.tcp(at, chosen.attitude[at], top[at])
        external = problem.placement.external[at]
        solved, reached = problem.solve(T, external, chosen.branch[at], chosen.q[at])
        q[at] = np.where(reached[:, None], solved, chosen.q[at])
        ends.append(q)
    return ends[0], ends[1]


def _arrival_heights(problem: Problem, chosen: Chosen) -> FloatArray:
    """Return how high (n,) [m] above tags the tool arrives: at the top of a stroke or a way in."""
    return np.where(chosen.entry, problem.ways_in, 0.0) + problem.strokes.top


def _shut_in(checker: Checker, chosen: Chosen, arrives: FloatArray) -> list[Finding]:
    """Return why the tool cannot come down straight to tags at which cuts begin."""
    problem = checker.problem
    tags = np.flatnonzero(chosen.entry & chosen.good & (problem.ways_in > 0.0))
    none, height = np.zeros(len(tags)), problem.ways_in[tags]
    external = problem.placement.external[tags]
    ends = Ends(tags, tags, none, none, chosen.q[tags], arrives[tags], external, height)
    is_free = backed_off(checker, chosen, ends)[1]
    rows = np.flatnonzero(~is_free).tolist()
    why = (stuck(checker, chosen, ends, row, int(tags[row]), _NO_WAY_IN) for row in rows)
    return [finding for finding in why if finding]


def _free_tags(problem: Problem, chosen: Chosen) -> list[Moves]:
    """Return the moves to rapid and joint tags, as joint moves for now."""
    kind = np.asarray(problem.toolpath.kind)
    tags = np.nonzero(np.isin(kind, (MotionKind.RAPID, MotionKind.JOINT)) & chosen.good)[0]
    role = np.where(chosen.entry[tags], MoveRole.ENTRY, MoveRole.RAPID)
    T = problem.placement.tcp(tags, chosen.attitude[tags])
    external = problem.placement.external[tags]
    return [moves(tags, ARRIVE, MoveKind.PTP, role, (T, chosen.q[tags], external))]


def _first_and_last(
    checker: Checker,
    chosen: Chosen,
    q: FloatArray,
    leaves: FloatArray,
    findings: list[Finding],
    gaps: list[Gap],
    *,
    goes_on: bool,
) -> list[Moves]:
    """Return the moves from home to the first tag's approach and from the last back home."""
    problem = checker.problem
    tags = np.nonzero(chosen.good)[0]
    if not len(tags):
        return []
    first, last = int(tags[0]), int(tags[-1])
    by_joints = problem.cell.motion.path_entry is PathEntry.NONE
    if problem.cell.motion.home is None:
        what = _walled_in(checker, q[first], problem.placement.external[first])
        if what:
            findings.append(failure(problem, first, Reason.COLLISION, what))
        if by_joints and not goes_on and last == len(problem) - 1:
            return []  # the file itself ends here
    out = _out_of_material(checker, chosen, last, leaves, findings)
    parts = [_moves_to(problem, last, LEAVE + 1, out, MoveKind.LIN)]
    if problem.cell.motion.home is None:
        return parts
    home = np.asarray(problem.cell.motion.home)
    at_end = np.vstack([leaves[last : last + 1], out])[-1]
    for tag, start, goal, order in (
        (first, home, q[first], _HOME),
        (last, at_end, home, LEAVE + 2),
    ):
        place, end = problem.placement.external[tag], goal if order == _HOME else start
        between = free_way(checker, start, goal, place)
        if between is None:
            detail = _walled_in(checker, home, place, "no path leads from home")
            detail = detail or _walled_in(checker, end, place)
            so = "no free path was found between home and here"
            findings.append(failure(problem, tag, Reason.COLLISION, detail or so))
            if not detail:
                gaps.append(Gap(findings[-1], HOME, tag))
            between = np.zeros((0, 6))
        points = np.vstack([home[None], between] if order == _HOME else [between, home[None]])
        parts.append(_moves_to(problem, tag, order, points, MoveKind.PTP))
        if order == _HOME:
            parts[-1].role[0] = MoveRole.ENTRY
    return parts


def _out_of_material(
    checker: Checker, chosen: Chosen, tag: int, q: FloatArray, findings: list[Finding]
) -> FloatArray:
    """Return the joints (k, 6), one at most, to which the tool backs off from a tag."""
    at, none = np.array([tag]), np.zeros(1)
    lift = checker.problem.lifts[at]
    if not lift[0]:
        return np.zeros((0, 6))
    external = checker.problem.placement.external[at]
    ends = Ends(at, at, none, none, q[at], q[at], external, lift)
    up, is_free = backed_off(checker, chosen, ends)
    why = stuck(checker, chosen, ends, 0, tag, _STUCK)
    findings += [why] if why else []
    return up[is_free]


def _moves_to(problem: Problem, tag: int, order: int, q: FloatArray, kind: MoveKind) -> Moves:
    """Return rapid moves to joints (k, 6) one after the other."""
    speed = problem.cell.motion.rapid_speed if kind is MoveKind.LIN else np.nan
    tags, numbers = np.full(len(q), tag), order + np.arange(len(q))
    external = problem.placement.external[tags]
    there = (_poses(problem, q, external), q, external)
    return moves(tags, numbers, kind, MoveRole.RAPID, there, speed)


def _poses(problem: Problem, q: FloatArray, external: FloatArray) -> FloatArray:
    """Return T_base_tcp (k, 4, 4) of joints (k, 6) and external axes (k, e)."""
    T_robroot_tcp = problem.kinematics.fk(q) @ np.asarray(problem.cell.tool.T_flange_tcp)
    return np.asarray(inverse(problem.placement.base(external)) @ T_robroot_tcp)


def _ends_into(
    checker: Checker, chosen: Chosen, to: IndexArray, arrives: FloatArray, leaves: FloatArray
) -> Ends:
    """Return the ends of the connections into tags (m,) from the ones run before them."""
    good = np.flatnonzero(chosen.good)
    before = good[np.searchsorted(good, to) - 1]
    problem = checker.problem
    heights = checker.strokes.top[before], _arrival_heights(problem, chosen)[to]
    external, lift = problem.placement.external[to], problem.lifts[before]
    return Ends(before, to, *heights, leaves[before], arrives[to], external, lift)


def _decide(
    checker: Checker,
    chosen: Chosen,
    ends: Ends,
    findings: list[Finding],
    gaps: list[Gap],
    *,
    runs: bool,
) -> tuple[BoolArray, dict[int, Detour]]:
    """Return which connections run straight (LIN), and the detours of those that are not free.

    Into a cut that is known to be broken (not ``runs``) none is missed: that is said already.
    """
    problem = checker.problem
    is_cut = np.isin(np.asarray(problem.toolpath.kind)[ends.tag_to], CUTS)
    is_broken = is_cut & chosen.entry[ends.tag_to] & (not runs)
    as_line = _straight_rapids(checker, chosen, ends)
    rest = np.nonzero(~as_line)[0]
    verdict = checker.joint_moves(ends.q_from[rest], ends.q_to[rest], ends.external[rest])
    met = np.nonzero(~verdict.good | (ends.lift[rest] > 0.0))[0]
    found = detours(checker, chosen, ends.rows(rest[met]))
    for count, i in enumerate(i for i in range(len(met)) if i not in found):
        row = int(rest[met[i]])
        if is_broken[row]:
            continue
        before, tag = int(ends.tag_from[row]), int(ends.tag_to[row])
        if why := stuck(checker, chosen, ends, row, before, _STUCK):
            findings.append(why)
            continue
        walled = _walled_in(checker, ends.q_to[row], ends.external[row])
        name = problem.toolpath.tag_name(before)
        detail = walled or _blocked(checker, verdict, int(met[i]), name)
        hint = _NOT_SEARCHED if count >= GIVE_UP else ""
        findings.append(failure(problem, tag, Reason.COLLISION, detail, hint))
        if not walled and not hint:
            gaps.append(Gap(findings[-1], before, tag))
    return as_line, {int(rest[met[i]]): way for i, way in found.items()}


def _walled_in(
    checker: Checker, q: FloatArray, external: FloatArray, so: str = "the tool cannot come here"
) -> str:
    """Return in words that a pose (6,) collides by itself, and what follows; empty if it is free.

    The external axes stand at ``external`` (k,).
    """
    what = checker.standing_in(q, external)
    return f"{so}: {what}" if what else ""


def _blocked(checker: Checker, verdict: Verdict, row: int, name: str) -> str:
    so, pair = f"no free path was found here from tag {name}", int(verdict.pair[row])
    if verdict.good[row]:
        return f"{so}, once the tool is out of the cut there"
    what = " and ".join(checker.pairs[pair]) if 0 <= pair < len(checker.pairs) else "solids"
    return f"{so}: {what} collide on the direct one"


def _straight_rapids(checker: Checker, chosen: Chosen, ends: Ends) -> BoolArray:
    """Return (m,) the rapids that run straight: same branch, every pose between feasible."""
    kind = np.asarray(checker.problem.toolpath.kind)
    straight: BoolArray = (
        (kind[ends.tag_to] == MotionKind.RAPID)
        & ~chosen.entry[ends.tag_to]
        & (chosen.branch[ends.tag_from] == chosen.branch[ends.tag_to])
    )
    rows = np.nonzero(straight)[0]
    if not len(rows):
        return straight
    place = checker.problem.placement
    a, b = ends.tag_from[rows], ends.tag_to[rows]
    T = place.tcp(a, chosen.attitude[a], ends.height_from[rows])
    T_to = place.tcp(b, chosen.attitude[b], ends.height_to[rows])
    lines = Lines(
        T,
        T_to,
        ends.q_from[rows],
        ends.q_to[rows],
        chosen.branch[b],
        _on_the_way_out(checker, chosen, a, T, T_to),
        (ends.external[rows], ends.external[rows]),
    )
    verdict, track = checker.lines(lines)
    straight[rows] = verdict.good & can_be_told(checker.problem, lines, track)
    return straight


def _on_the_way_out(
    checker: Checker, chosen: Chosen, tags: IndexArray, *ends: FloatArray
) -> BoolArray:
    """Return which lines (m,) from behind tags run out along the axis of what was cut last.

    ``ends``: T_base_tcp (m, 4, 4) at the start and at the end.
    """
    place, depth = checker.problem.placement, checker.strokes.depth
    cuts = checker.problem.is_working & chosen.good & ~feeds_out(checker.problem.toolpath)
    last = np.maximum.accumulate(np.where(cuts, np.arange(len(cuts)), -1))[tags]
    poses = [place.tcp(last, chosen.attitude[last], -depth[last]), *ends]
    (cut, cut_axis), *others = [(T[:, :3, 3], T[:, :3, :3] @ place.tool_axis) for T in poses]
    out = last >= 0
    for point, axis in others:
        out &= on_the_way_out(cut, cut_axis, point, axis)
    return out


def _detour_moves(
    problem: Problem,
    ends: Ends,
    row: int,
    way: Detour,
    table: Moves,
    arriving: IndexArray,
) -> Moves:
    tag = int(ends.tag_to[row])
    if way.last_is_line:
        table.kind[arriving[row]] = MoveKind.LIN
        table.speed[arriving[row]] = problem.cell.motion.rapid_speed
        table.role[arriving[row]] = MoveRole.APPROACH
    tags = np.full(len(way.q), tag)
    external = problem.placement.external[tags]
    speed = np.where(way.is_line, problem.cell.motion.rapid_speed, np.nan)
    return moves(
        tags,
        np.arange(len(tags)),
        np.where(way.is_line, MoveKind.LIN, MoveKind.PTP),
        MoveRole.RAPID,
        (_poses(problem, way.q, external), way.q, external),
        speed,
    )


def _stops_before(problem: Problem, table: Moves) -> BoolArray:
    """Return (m,) whether the robot stands still before a move because of an event."""
    stops = np.zeros(len(table), dtype=np.bool_)
    for event in problem.toolpath.events:
        if event.kind in STOPS:
            row = int(np.searchsorted(table.tag, event.index))
            if row < len(table):
                stops[row] = True
    standing = problem.cell.process.unit_feeds
    for tag, _, _ in hole_steps(problem.toolpath, problem.cell):
        for row in step_rows(table, tag, standing=standing) or ():
            stops[row : row + 1] = True
    return stops
