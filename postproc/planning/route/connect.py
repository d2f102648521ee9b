"""How the tool gets from one stretch to the next without touching anything.

Straight in joint space if that is free; else by backing off along the tool axes first; else with
the arm folded; else through the points of a way found for another connection; else by a random tree
in joint space from both ends, shortened afterwards. The points of such ways are drawn in then, as
far as that saves time. Checks are asked for in batches: one call costs far more than one row.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, Table
from postproc.errors import Finding
from postproc.planning.checks import LEAD_OUT, Checker, Lines, Reason, failure
from postproc.planning.route.tree import ROUNDS, folded_ways, rrt_connect, seem_free, way_times
from postproc.planning.states import Chosen
from postproc.records import dataclass
from postproc.units import MM

BACK_OFF = ((0.0,), (0.05,), (0.1, 0.2, 0.4))
"""Heights [m] by which both ends back off along their tool axes, tried in turn.

What does not get away by the least of them is mostly in need of another way: the rest is asked for
at once, and the lowest is taken."""
_LONGER = 1.2
"""The points of a way serve another connection if its way gets no longer than this times."""
_DRAWN_IN = (0.5, 0.25, 0.1)
"""By these shares of the way to where it is drawn a point is drawn in, one after the other ..."""
_PULLS = 3
"""... so often each at most, ..."""
_GAIN = 0.02
"""... where that is worth so much time [s], ..."""
_LOOKS = 3
"""... the best so many of what seems to be free."""
_OFFERED = 64
"""Known ways are offered to connections at once up to so many pairs of them."""
_OFTEN_FAILED = 5
"""After so many trees that found no way ..."""
_FEW = 6
"""... the next ones grow no more often than this."""
_HEIGHTS = 100
"""So many heights are tried where the tool cannot back off as far as it must."""
GIVE_UP = 40
"""After so many no more are grown: what is left is walled in."""


@dataclass(slots=True)
class Ends(Table):
    """Where m connections start and end.

    Args:
        tag_from: (m,); tag_to: (m,).
        height_from: (m,) [m] above the tag where the tool leaves; height_to: where it arrives.
        q_from: (m, 6); q_to: (m, 6) [rad].
        external: (m, k) where the external axes stand all along [m or rad].
        lift: (m,) [m] by which the tool backs off at the start whatever comes then; 0: it need not.
    """

    tag_from: IndexArray
    tag_to: IndexArray
    height_from: FloatArray
    height_to: FloatArray
    q_from: FloatArray
    q_to: FloatArray
    external: FloatArray
    lift: FloatArray


@dataclass(frozen=True, slots=True)
class Detour:
    """Points on the way: joints (k, 6), and whether the motion TO each is straight (LIN).

    ``last_is_line``: so is the motion from the last of them to the end.
    """

    q: FloatArray
    is_line: BoolArray
    last_is_line: bool


def detours(checker: Checker, chosen: Chosen, ends: Ends) -> dict[int, Detour]:
    """Return free ways round for connections (m,) by row; rows without one are missing.

    Of those the first ``GIVE_UP`` were searched for by trees, the others were not.
    """
    ways: dict[int, Detour] = {}
    for heights in BACK_OFF:
        rows = np.setdiff1d(np.arange(len(ends)), list(ways))
        ways |= _by_backing_off(checker, chosen, ends, rows, heights)
    rows = np.setdiff1d(np.arange(len(ends)), list(ways))
    if not len(rows):
        return ways
    q, is_out = backed_off(checker, chosen, ends)
    out = replace(ends, q_from=np.where(is_out[:, None], q, ends.q_from))
    rows = rows[(is_out | ~(ends.lift > 0.0))[rows]]
    found = _folded(checker, out, rows)
    rows = np.setdiff1d(rows, list(found))
    found |= _by_trees(checker, out, rows, GIVE_UP)
    found = _drawn_in(checker, out.q_from, out.q_to, out.external, found)
    for row, points in found.items():
        first = out.q_from[row : row + 1] if ends.lift[row] else np.zeros((0, 6))
        is_line = np.arange(len(first) + len(points)) < len(first)
        ways[row] = Detour(np.vstack([first, points]), is_line, False)
    return ways


def backed_off(checker: Checker, chosen: Chosen, ends: Ends) -> tuple[FloatArray, BoolArray]:
    """Return the joints (m, 6) once the tool has backed off as it must, and where it can (m,)."""
    start = (ends.tag_from, ends.height_from, ends.q_from)
    q, is_free = _lifted(checker, chosen, *start, ends.lift, ends.lift > 0.0)
    return q, is_free & (ends.lift > 0.0)


def stuck(
    checker: Checker, chosen: Chosen, ends: Ends, row: int, tag: int, what: str
) -> Finding | None:
    """Return why the tool of a connection cannot back off as it must, None where it can.

    Args:
        checker: of the toolpath.
        chosen: poses of its tags.
        ends: of connections.
        row: which of them.
        tag: that the finding is about.
        what: it cannot do.
    """
    one = ends.rows(np.array([row]))
    if not one.lift[0] or backed_off(checker, chosen, one)[1][0]:
        return None
    problem, at = checker.problem, one.tag_from
    T = problem.placement.tcp(at, chosen.attitude[at], one.height_from + one.lift)
    q, reached = problem.solve(T, one.external, chosen.branch[at], one.q_from)
    why = Reason.COLLISION if problem.regular(q)[0] else Reason.SINGULAR
    if not reached[0] or not problem.within(q)[0]:
        why = Reason.JOINT_LIMIT if reached[0] else Reason.UNREACHABLE
    height = _way_up(checker, chosen, one)
    hint = f"{LEAD_OUT} to {height / MM:.0f}" if height else LEAD_OUT
    return failure(problem, tag, why, what, hint)


def _way_up(checker: Checker, chosen: Chosen, one: Ends) -> float:
    """Return how far [m] the tool of a connection can back off that cannot as it must.

    Whole millimetres, 0 where it is not one; of a long way some heights are tried.
    """
    most = int(np.ceil(one.lift[0] / MM)) - 1
    heights = np.unique(np.linspace(most, 1, min(max(most, 0), _HEIGHTS)).astype(int)) * MM
    some = one.rows(np.zeros(len(heights), dtype=np.int64))
    free = backed_off(checker, chosen, replace(some, lift=heights))[1]
    return float(heights[free].max(initial=0.0))


def _folded(checker: Checker, ends: Ends, rows: IndexArray) -> dict[int, FloatArray]:
    """Return the points (k, 6) of free ways by row, of some rows, on which the arm is folded."""
    ways = _by_folding(checker, ends.q_from[rows], ends.q_to[rows], ends.external[rows])
    return {int(rows[k]): points for k, points in ways.items()}


def _by_folding(
    checker: Checker, start: FloatArray, goal: FloatArray, external: FloatArray
) -> dict[int, FloatArray]:
    """Return the points (k, 6) of free ways by row on which the arm is folded.

    Between joints (m, 6) and (m, 6); the external axes stand at ``external`` (m, k) meanwhile.
    """
    ways = folded_ways(checker.problem, start, goal)
    at = np.tile(np.arange(len(start)), len(ways))
    points = ways.reshape(-1, 2, 6)
    legs = (start[at], points[:, 0]), (points[:, 0], points[:, 1]), (points[:, 1], goal[at])
    free = _first_free(checker, at, legs, external[at]).tolist()
    return {int(at[k]): points[k][: 1 + (points[k, 0] != points[k, 1]).any()] for k in free}


def _drawn_in(
    checker: Checker,
    start: FloatArray,
    goal: FloatArray,
    external: FloatArray,
    ways: dict[int, FloatArray],
) -> dict[int, FloatArray]:
    """Return free ways by row with their points (k, 6) drawn in as far as is free and quicker.

    The ends of the ways are joints (m, 6), and the external axes stand at ``external`` (m, k)
    meanwhile.
    """
    stops = {row: np.vstack([start[row], ways[row], goal[row]]) for row in sorted(ways)}
    for share in _DRAWN_IN:
        rows = list(stops)
        for _ in range(_PULLS):
            rows = _pulled(checker, stops, rows, external, share)
    return {row: way[1:-1] for row, way in stops.items()}


def _pulled(
    checker: Checker,
    stops: dict[int, FloatArray],
    rows: list[int],
    external: FloatArray,
    share: float,
) -> list[int]:
    """Draw in one point of each way (k, 6) of some rows, in place; return the rows where one is.

    By a share of the way to the point before it, to the one behind it, or to half way between both:
    where that is free and saves the most time.
    """
    at = [(row, k) for row in rows for k in range(1, len(stops[row]) - 1)]
    if not at:
        return []
    corner = np.stack([stops[row][k - 1 : k + 2] for row, k in at])
    before, point, behind = (corner[:, k] for k in range(3))
    drawn = np.tile(corner, (3, 1, 1, 1))
    drawn[:, :, 1] += share * (np.stack([before, behind, 0.5 * (before + behind)]) - point)
    gain = way_times(checker.problem, corner) - way_times(checker.problem, drawn)
    aim, which = np.nonzero(gain > _GAIN)
    owner = np.array([row for row, _ in at], dtype=np.int64)[which]
    order = np.lexsort((-gain[aim, which], owner))
    which, owner, tried = which[order], owner[order], drawn[aim, which][order]
    legs = (tried[:, 0], tried[:, 1]), (tried[:, 1], tried[:, 2])
    free = _first_free(checker, owner, legs, external[owner], _LOOKS).tolist()
    for i in free:
        row, k = at[which[i]]
        stops[row][k] = tried[i, 1]
    return sorted(int(owner[i]) for i in free)


def _by_trees(
    checker: Checker, ends: Ends, rows: IndexArray, give_up: int
) -> dict[int, FloatArray]:
    """Return the points (k, 6) between the ends of free ways by row, as far as there are some.

    What is in the way of one connection is mostly in the way of many: the points of every way found
    are offered to the connections that are left, there and back, before the next tree grows, and
    to those of later calls before the first one.
    """
    ways: dict[int, FloatArray] = {}
    known = list(checker.ways)
    while known and len(rows):
        count = max(1, _OFFERED // len(rows))
        rows, known = _offered(checker, ends, rows, known[:count], ways), known[count:]
    failures = 0
    while len(rows) and failures < give_up:
        row, rows = int(rows[0]), rows[1:]
        rounds = ROUNDS if failures < _OFTEN_FAILED else _FEW
        place = ends.external[row]
        way = rrt_connect(checker, ends.q_from[row], ends.q_to[row], place, rounds)
        if way is None:
            failures += 1
            continue
        ways[row] = way
        if len(way):
            limit = _LONGER * _length(ends.q_from[[row]], way, ends.q_to[[row]])[0]
            checker.ways.append((way, limit))
            rows = _offered(checker, ends, rows, checker.ways[-1:], ways)
    return ways


def _offered(
    checker: Checker,
    ends: Ends,
    rows: IndexArray,
    known: list[tuple[FloatArray, float]],
    ways: dict[int, FloatArray],
) -> IndexArray:
    """Note in ``ways`` the connections (m,) that known ways serve, and return the others."""
    start, end = ends.q_from[rows], ends.q_to[rows]
    offers = [(points, limit) for way, limit in known for points in (way, way[::-1])]
    fits = [np.flatnonzero(_length(start, way, end) <= limit) for way, limit in offers]
    at = np.concatenate(fits) if fits else rows[:0]
    which = np.repeat(np.arange(len(fits)), [len(found) for found in fits])
    if not len(at):
        return rows
    points = np.stack([[way[0], way[-1]] for way, _ in offers])[which]
    legs = (start[at], points[:, 0]), (points[:, 1], end[at])
    for k in _first_free(checker, at, legs, ends.external[rows[at]]).tolist():
        ways[int(rows[at[k]])] = offers[which[k]][0]
    return rows[[row not in ways for row in rows.tolist()]]


def _first_free(
    checker: Checker,
    owner: IndexArray,
    legs: tuple[tuple[FloatArray, FloatArray], ...],
    external: FloatArray,
    looks: int | None = None,
) -> IndexArray:
    """Return the numbers (k,) of candidates that are free, the first one of each owner."""
    every = np.tile(np.arange(len(owner)), len(legs))
    start, end = (np.concatenate(side) for side in zip(*legs, strict=True))
    left = np.ones(len(owner), dtype=np.bool_)
    left[every[~seem_free(checker, start, end, external[every])]] = False
    free: list[IndexArray] = [every[:0]]
    for _ in range(len(owner) if looks is None else looks):
        tried = np.flatnonzero(left)
        if not len(tried):
            break
        tried = tried[np.unique(owner[tried], return_index=True)[1]]
        moves = np.flatnonzero(np.isin(every, tried))
        proven = checker.joint_moves(start[moves], end[moves], external[every[moves]]).good
        left[tried] = False
        fails = every[moves[~proven]]
        free.append(np.setdiff1d(tried, fails))
        left &= ~np.isin(owner, owner[free[-1]])
    return np.concatenate(free)


def _length(start: FloatArray, way: FloatArray, end: FloatArray) -> FloatArray:
    """Return the lengths (m,) [rad] of ways from starts (m, 6) through points to ends (m, 6)."""
    inner = float(np.linalg.norm(np.diff(way, axis=0), axis=1).sum())
    outer = np.linalg.norm(way[0] - start, axis=1) + np.linalg.norm(end - way[-1], axis=1)
    return np.asarray(inner + outer)


def _by_backing_off(
    checker: Checker, chosen: Chosen, ends: Ends, rows: IndexArray, heights: tuple[float, ...]
) -> dict[int, Detour]:
    """Return free ways by row, of some rows, whose ends back off: by the first of heights [m]."""
    tried = [(row, height) for height in heights for row in rows if height or ends.lift[row]]
    if not tried:
        return {}
    rows, height = (np.array(column) for column in zip(*tried, strict=True))
    part, m = ends.rows(rows), len(rows)
    must = part.lift > 0.0
    q, free = _lifted(
        checker,
        chosen,
        np.concatenate([part.tag_from, part.tag_to]),
        np.concatenate([part.height_from, part.height_to]),
        np.concatenate([part.q_from, part.q_to]),
        np.concatenate([np.maximum(height, part.lift), height]),
        np.concatenate([must, np.zeros_like(must)]),
    )
    (up_from, up_to), (from_free, to_free) = (q[:m], q[m:]), (free[:m], free[m:])
    options = (
        (must & from_free, up_from, part.q_to, (True, False)),
        (from_free & to_free, up_from, up_to, (True, True)),
        (from_free, up_from, part.q_to, (True, False)),
        (to_free & ~must, part.q_from, up_to, (False, True)),
    )
    possible = np.stack([option[0] for option in options], axis=1)
    at, kind = np.nonzero(possible)
    start, end = (np.stack([option[side] for option in options])[kind, at] for side in (1, 2))
    ways: dict[int, Detour] = {}
    for k in _first_free(checker, rows[at], ((start, end),), part.external[at]).tolist():
        lifted = options[kind[k]][3]
        points = [q for q, up in zip((start[k], end[k]), lifted, strict=True) if up]
        lines = [True, False] if all(lifted) else [lifted[0]]
        ways[int(rows[at[k]])] = Detour(np.array(points), np.array(lines), lifted[1])
    return dict(sorted(ways.items()))


def _lifted(
    checker: Checker,
    chosen: Chosen,
    tag: IndexArray,
    base: FloatArray,
    q: FloatArray,
    height: FloatArray,
    contact: BoolArray,
) -> tuple[FloatArray, BoolArray]:
    """Return the joints (m, 6) ``height`` (m,) above where tools stand, and if the way is free."""
    problem, attitude, branch = checker.problem, chosen.attitude, chosen.branch
    low = problem.placement.tcp(tag, attitude[tag], base)
    high = problem.placement.tcp(tag, attitude[tag], base + height)
    external = problem.placement.external[tag]
    solved, reached = problem.solve(high, external, branch[tag], q)
    solved = np.where(reached[:, None], solved, q)
    good = reached & problem.within(solved) & problem.regular(solved)
    rows = np.nonzero(good)[0]
    lines = Lines(
        low[rows],
        high[rows],
        q[rows],
        solved[rows],
        branch[tag[rows]],
        contact[rows],
        (external[rows], external[rows]),
    )
    good[rows] = checker.lines(lines)[0].good
    return solved, good


def free_way(
    checker: Checker, start: FloatArray, goal: FloatArray, external: FloatArray
) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, none if it is straight.

    The external axes stand at ``external`` (k,) meanwhile.
    """
    if checker.joint_moves(start[None], goal[None], external).good[0]:
        return np.zeros((0, 6))
    ends = start[None], goal[None], external[None]
    way = _by_folding(checker, *ends).get(0)
    if way is None:
        way = rrt_connect(checker, start, goal, external)
    return None if way is None else _drawn_in(checker, *ends, {0: way})[0]
