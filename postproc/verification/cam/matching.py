"""Finds, for every point the CAM file asks for, the motion of the program that goes there.

The program may have any layout: more motions (approaches, pecks, re-entries, sub-programs) between
those of the CAM file, or fewer where the file repeats a point. What must hold is the order. First
the earliest embedding is tried, which is exact: if the points can be found in order at all within
the tolerance, it finds them. Only if it fails, all pairs within the tolerance are searched for the
longest chain that is in order on both sides; what is left over is missing or out of order.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, IntArray, longest_rising
from postproc.geometry import angle_between
from postproc.model import Cycle, MotionKind, ToolPath
from postproc.paths import Paths, Station
from postproc.process import LEAST_PECK, Assignment, apart
from postproc.records import dataclass
from postproc.verification.cam.real import FAR, RealPaths

SAME_AXIS = 1e-6
"""Two tool axes that differ by less than this [rad] are one; else the tool turns on the spot."""
MAX_PAIRS = 5_000_000
PLACE = 1e-5
"""Size [m] of the cells in which pairs are counted beforehand."""
_PECK_MOVES = 3
"""Most motions from one peck to the bottom of the next: up, back down, drill."""
_STREAK = 32
"""After so many points that were visited one after the other, more are looked at together."""
_STEPS = 4096
"""So many at most."""


@dataclass(frozen=True, slots=True)
class Wanted:
    """What the CAM file asks for: one row a tag (r = n).

    ``point`` (r, 3) [m] where the tip must go: the bottom of a hole, else the tag; ``axis`` (r, 3)
    unit, where the tool's axis must point (into the part); ``top`` (r, 3) the tag itself.
    ``clear``, ``retract``, ``depth`` (r,) [m] of holes, 0 else; ``peck_first``, ``peck`` (r,) [m]
    most to be drilled at once, infinite without pecks; ``break_chip`` (r,) short lifts will do.
    """

    point: FloatArray
    axis: FloatArray
    top: FloatArray
    clear: FloatArray
    retract: FloatArray
    depth: FloatArray
    dwell: FloatArray
    kind: IntArray
    peck_first: FloatArray
    peck: FloatArray
    break_chip: BoolArray

    @property
    def is_hole(self) -> np.ndarray:
        """(r,) holes with a cycle."""
        return np.asarray((self.kind == MotionKind.HOLE) & (self.depth + self.clear > 0.0))


def wanted_of(toolpath: ToolPath) -> Wanted:
    """Return what a toolpath asks for."""
    kind = np.asarray(toolpath.kind)
    table = np.array(
        [
            [c.depth, c.clearance, c.retract, c.dwell, *steps_of(c), c.break_chip]
            for c in toolpath.cycles
        ]
        + [[0.0] * 7]
    )
    rows = table[np.asarray(toolpath.cycle)] if len(toolpath) else np.zeros((0, 7))
    rows = np.where((kind == MotionKind.HOLE)[:, None], rows, 0.0)
    outward = np.asarray(toolpath.axes)
    point = np.asarray(toolpath.points) - outward * rows[:, :1]
    return Wanted(
        point=point,
        axis=-outward,
        top=np.asarray(toolpath.points),
        clear=rows[:, 1],
        retract=rows[:, 2],
        depth=rows[:, 0],
        dwell=rows[:, 3],
        kind=np.asarray(kind, dtype=np.int32),
        peck_first=rows[:, 4],
        peck=rows[:, 5],
        break_chip=rows[:, 6] > 0.0,
    )


def steps_of(cycle: Cycle) -> tuple[float, float]:
    """Return the most [m] that a cycle drills at once, first and later; infinite without pecks."""
    first, step = cycle.peck_first or cycle.peck, cycle.peck or cycle.peck_first
    return (first, step) if step > 0.0 else (np.inf, np.inf)


@dataclass(frozen=True, slots=True)
class Served:
    """Tags of a CAM file (n,), and the motions that go to each.

    ``first`` and ``last`` (n,): the first and the last that may be meant, -1 for none.
    """

    toolpath: ToolPath
    wanted: Wanted
    first: IntArray
    last: IntArray

    def spread(
        self, toolpath: ToolPath, kept: IndexArray, others: IndexArray, motion: IndexArray
    ) -> Served:
        """Return the same of all tags, where these are ``kept`` and motions pass the others."""
        if not len(others):
            return self
        place = np.argsort(np.concatenate([kept, others]))
        ends = (np.concatenate([own, motion])[place] for own in (self.first, self.last))
        return Served(toolpath, wanted_of(toolpath), *(np.asarray(e, np.int32) for e in ends))

    def name(self, row: int) -> str:
        """Return what a tag is called in findings."""
        return f"tag {self.toolpath.tag_name(row)} (line {int(self.toolpath.line[row])})"


@dataclass(frozen=True, slots=True)
class Visits:
    """Which motion goes to each wanted point: ``first`` and ``last`` (r,) possible, -1 for none.

    A place that the program passes more than once may serve a point early or late; both are in
    order with all others.
    """

    first: IntArray
    last: IntArray


def visits_of(
    real: RealPaths, wanted: Wanted, assigned: Assignment, tolerance: float, left: float
) -> Visits:
    """Return which motions go to the wanted points; ``left`` as ``most`` of ``match``."""
    paths = real.commanded
    own = np.isin(wanted.kind, (MotionKind.ARC, MotionKind.HOLE))
    own[1:] |= wanted.kind[:-1] == MotionKind.HOLE  # a stroke ends above the point
    own[1:] |= angle_between(wanted.axis[1:], wanted.axis[:-1]) > SAME_AXIS
    own[[stretch.low for stretch in assigned.stretches()]] = True
    moving = np.where(paths.stands[:, None], FAR, real.visited)
    visited, case = by_frames(moving, real.case, assigned, paths.station)
    pecks = passed_pecks(paths, tolerance)
    visited, case = bottoms_apart(visited, case, wanted.is_hole, pecks)
    return match(wanted.point, visited, tolerance, own, case, left)


def passed_pecks(paths: Paths, tolerance: float) -> BoolArray:
    """Return (m,) motions that end where the tool soon goes deeper by less than ``tolerance`` [m].

    Both places are within the tolerance of the bottom of a hole, which is the deeper one.
    """
    rows = np.flatnonzero(~paths.stands)
    point, axis = paths.end_point[rows], paths.end_axis[rows]
    is_cp, count = paths.trace.is_cp[rows], len(rows)
    passed = np.zeros(len(paths), dtype=np.bool_)
    for ahead in range(1, min(_PECK_MOVES, count - 1) + 1):
        step = point[ahead:] - point[:-ahead]
        along = np.einsum("ij,ij->i", step, axis[:-ahead])
        deeper = (along > LEAST_PECK / 2) & (np.linalg.norm(step, axis=1) <= tolerance)
        for motion in range(1, ahead + 1):
            deeper &= is_cp[motion : count - ahead + motion]
        passed[rows[:-ahead][deeper]] = True
    return passed


def match(
    wanted: FloatArray,
    visited: FloatArray,
    tolerance: float,
    is_own: BoolArray | None = None,
    case: IntArray | None = None,
    most: float = 0.0,
) -> Visits:
    """Return for each wanted point (r, 3) which visited point (v, 3) serves it, both in order [m].

    Visited points may be (c, v, 3) under each of c loads, of which ``case`` (r,) counts. Points
    ``is_own`` (r,) need a visit of their own (the end of a full circle, another tool axis); any
    other point that repeats the one before shares its visit. Up to ``most`` the tolerance [m] is
    doubled until all points are served.
    """
    visited = visited[None] if visited.ndim == 2 else visited
    if not len(wanted) or not visited.shape[1]:
        nothing = np.full(len(wanted), -1, dtype=np.int32)
        return Visits(nothing, nothing)
    new = apart(wanted)
    if is_own is not None:
        new |= is_own
    distinct = wanted[new]
    group = np.cumsum(new) - 1
    load = np.zeros(len(distinct), dtype=np.int32) if case is None else case[new]
    found, strict = _earliest(distinct, visited, tolerance, load), tolerance
    while found is None and tolerance < most:
        tolerance *= 2.0
        found = _earliest(distinct, visited, tolerance, load)
    tolerance = strict if found is None else tolerance
    if found is None:
        found = _longest_chain(distinct, visited, tolerance, load)
        return Visits(found[group], found[group])
    latest = _earliest(distinct[::-1], visited[:, ::-1], tolerance, load[::-1])
    count = visited.shape[1]
    last = found if latest is None else np.asarray(count - 1 - latest[::-1], dtype=np.int32)
    return Visits(found[group], last[group])


def by_frames(
    visited: FloatArray, case: IntArray, assigned: Assignment, station: Station
) -> tuple[FloatArray, IntArray]:
    """Return the end points by load, tool and base, far away where these are others, and cases.

    A tag is served with the tool and in the base that the file means, or not at all.
    """
    wanted = np.stack([case, assigned.tool, assigned.base])
    distinct, number = np.unique(wanted, axis=1, return_inverse=True)
    if distinct.shape[1] < 2 and len(station.cell.tools) == len(station.cell.bases) == 1:
        return visited, case
    own = [
        np.where(((station.tool == tool) & (station.base == base))[:, None], visited[load], FAR)
        for load, tool, base in distinct.T.tolist()
    ]
    return np.stack(own), number.reshape(-1).astype(np.int32)


def bottoms_apart(
    visited: FloatArray, case: IntArray, is_hole: BoolArray, passed: BoolArray
) -> tuple[FloatArray, IntArray]:
    """Return the end points by load, and cases, with holes kept off what is only passed in them.

    ``visited`` (c, v, 3) [m] in order under each of c loads, of which ``case`` (r,) counts for each
    point; ``is_hole`` (r,): at the bottom of a hole; ``passed`` (v,): ends at a peck.
    """
    if not passed.any() or not is_hole.any():
        return visited, case
    kept = np.where(passed[:, None], FAR, visited)
    cases = np.asarray(np.where(is_hole, case + len(visited), case), dtype=np.int32)
    return np.concatenate([visited, kept]), cases


def _earliest(
    wanted: FloatArray, visited: FloatArray, tolerance: float, case: IntArray
) -> IntArray | None:
    """Return the earliest visits in order, None if a point has none behind the one before."""
    limit = tolerance * tolerance
    found = np.empty(len(wanted), dtype=np.int32)
    row = at = streak = 0
    count = visited.shape[1]
    columns = [[column.tolist() for column in points.T] for points in visited]
    points, loads = wanted.tolist(), case.tolist()
    while row < len(points):
        if streak == _STREAK:
            more = _in_step(wanted[row:], visited[:, at:], limit, case[row:])
            found[row : row + more] = np.arange(at, at + more)
            row, at, streak = row + more, at + more, 0
            continue
        a, b, c = points[row]
        x, y, z = columns[loads[row]]
        first = at
        while at < count:
            d, e, f = x[at] - a, y[at] - b, z[at] - c
            if d * d + e * e + f * f <= limit:
                break
            at += 1
        else:
            return None
        streak = streak + 1 if at == first else 0
        found[row] = at
        row, at = row + 1, at + 1
    return found


def _in_step(wanted: FloatArray, visited: FloatArray, limit: float, case: IntArray) -> int:
    """Return how many wanted points are visited one after the other, from the first on."""
    count = min(len(wanted), visited.shape[1], _STEPS)
    off = visited[case[:count], np.arange(count)] - wanted[:count]
    d, e, f = off.T
    missed = np.flatnonzero(~(d * d + e * e + f * f <= limit))
    return int(missed[0]) if len(missed) else count


def _longest_chain(
    wanted: FloatArray, visited: FloatArray, tolerance: float, case: IntArray
) -> IntArray:
    """Return the visits of the longest common subsequence of points within the tolerance."""
    rows, visits = _pairs(wanted, visited, tolerance, case)
    found = np.full(len(wanted), -1, dtype=np.int32)
    # Within a row visits fall, so that no two pairs of a row can stand in one chain.
    chain = longest_rising(visits.tolist())
    found[rows[chain]] = visits[chain]
    return found


def _pairs(
    wanted: FloatArray, visited: FloatArray, tolerance: float, case: IntArray
) -> tuple[np.ndarray, np.ndarray]:
    """Return rows and visits of all pairs within the tolerance, by row, visits falling."""
    near: list[list[int]] = [[] for _ in range(len(wanted))]
    left = MAX_PAIRS
    for load in np.unique(case).tolist():
        own = np.flatnonzero(case == load)
        left -= _meetings(wanted[own], visited[load])
        if left < 0:
            # The path comes back to the same places over and over: keep the nearest in sequence.
            return _few_pairs(wanted, visited, tolerance, case)
        for row, found in zip(
            own.tolist(), neighbours(wanted[own], visited[load], tolerance), strict=True
        ):
            near[row] = found
    counts = np.array([len(item) for item in near])
    rows = np.repeat(np.arange(len(wanted)), counts)
    visits = np.array([v for item in near for v in sorted(item, reverse=True)], dtype=np.int64)
    return rows, visits


def neighbours(wanted: FloatArray, visited: FloatArray, tolerance: float) -> list[list[int]]:
    """Return for each wanted point (r, 3) the visited points (v, 3) within the tolerance."""
    from scipy.spatial import cKDTree  # slow to load, and seldom needed

    found: list[list[int]] = cKDTree(wanted).query_ball_tree(cKDTree(visited), tolerance)
    return found


def _meetings(wanted: FloatArray, visited: FloatArray) -> int:
    """Return about how many pairs share a place; counted in cells, as trees are slow at that."""
    places = np.rint(np.concatenate([wanted, visited]) / PLACE).astype(np.int64)
    _, cell = np.unique(places, axis=0, return_inverse=True)
    cell = cell.reshape(-1)
    count = int(cell.max()) + 1
    ours = np.bincount(cell[: len(wanted)], minlength=count)
    return int(ours @ np.bincount(cell[len(wanted) :], minlength=count))


def _few_pairs(
    wanted: FloatArray, visited: FloatArray, tolerance: float, case: IntArray
) -> tuple[np.ndarray, np.ndarray]:
    """Return pairs near the diagonal of equal progress only."""
    rows, visits = [], []
    share = visited.shape[1] / len(wanted)
    for row, point in enumerate(wanted):
        low = max(0, int(row * share) - 100)
        window = visited[case[row], low : low + 201]
        close = np.flatnonzero(np.linalg.norm(window - point, axis=1) <= tolerance)
        visits += (low + close[::-1]).tolist()
        rows += [row] * len(close)
    return np.array(rows, dtype=np.int64), np.array(visits, dtype=np.int64)
