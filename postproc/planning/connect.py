"""How the tool gets from one stretch to the next without touching anything.

Straight in joint space if that is free; else by backing off along the tool axes first; else by a
random tree in joint space from both ends (RRT-connect, Kuffner and LaValle 2000) with a fixed
seed, shortened afterwards. Checks are asked for in batches: one call costs far more than one row.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.model.arrays import BoolArray, FloatArray
from postproc.planning.feasible import Checker, Lines
from postproc.planning.ladder import IndexArray

BACK_OFF = (0.05, 0.1, 0.2, 0.4)
"""Heights [m] by which both ends back off along their tool axes, tried in turn."""
_SEED = 20220115
_BATCH = 48
_ROUNDS = 60
_STEP = 0.35
_AROUND = 1.2


@dataclass(slots=True)
class Ends:
    """Where m connections start and end.

    Args:
        tag_from: (m,); tag_to: (m,).
        height_from: (m,) [m] above the tag where the tool leaves; height_to: where it arrives.
        q_from: (m, 6); q_to: (m, 6) [rad].
    """

    tag_from: IndexArray
    tag_to: IndexArray
    height_from: FloatArray
    height_to: FloatArray
    q_from: FloatArray
    q_to: FloatArray

    def __len__(self) -> int:
        """Return the number of connections."""
        return len(self.tag_to)

    def take(self, rows: IndexArray) -> Ends:
        """Return some of the connections."""
        return Ends(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))


@dataclass(frozen=True, slots=True)
class Detour:
    """Points on the way: joints (k, 6), and whether the motion TO each is straight (LIN).

    ``last_is_line``: so is the motion from the last of them to the end.
    """

    q: FloatArray
    is_line: BoolArray
    last_is_line: bool


def detours(
    checker: Checker, ends: Ends, spin: FloatArray, branch: IndexArray
) -> dict[int, Detour]:
    """Return free ways round for connections (m,) by row; rows without one are missing."""
    ways: dict[int, Detour] = {}
    for height in BACK_OFF:
        rows = np.array([row for row in range(len(ends)) if row not in ways], dtype=np.int64)
        if not len(rows):
            return ways
        found = _by_backing_off(checker, ends.take(rows), spin, branch, height)
        ways.update({int(rows[row]): way for row, way in found.items()})
    for row in range(len(ends)):
        if row not in ways:
            points = rrt_connect(checker, ends.q_from[row], ends.q_to[row])
            if points is not None:
                ways[row] = Detour(points, np.zeros(len(points), dtype=np.bool_), False)
    return ways


def _by_backing_off(
    checker: Checker, ends: Ends, spin: FloatArray, branch: IndexArray, height: float
) -> dict[int, Detour]:
    up_from, from_free = _lifted(
        checker, ends.tag_from, ends.height_from, ends.q_from, spin, branch, height
    )
    up_to, to_free = _lifted(checker, ends.tag_to, ends.height_to, ends.q_to, spin, branch, height)
    options = (
        (from_free & to_free, up_from, up_to, (True, True)),
        (from_free, up_from, ends.q_to, (True, False)),
        (to_free, ends.q_from, up_to, (False, True)),
    )
    ways: dict[int, Detour] = {}
    for possible, start, end, lifted in options:
        rows = np.array([row for row in np.nonzero(possible)[0].tolist() if row not in ways])
        if not len(rows):
            continue
        free = checker.joint_moves(start[rows], end[rows]).good
        for row in rows[free].tolist():
            points = [q for q, up in zip((start[row], end[row]), lifted, strict=True) if up]
            lines = [True, False] if all(lifted) else [lifted[0]]
            ways[row] = Detour(np.array(points), np.array(lines), lifted[1])
    return ways


def _lifted(
    checker: Checker,
    tag: IndexArray,
    base: FloatArray,
    q: FloatArray,
    spin: FloatArray,
    branch: IndexArray,
    height: float,
) -> tuple[FloatArray, BoolArray]:
    """Return the joints (m, 6) ``height`` above where the tool stands, and if the way is free."""
    problem = checker.problem
    low = problem.placement.tcp(tag, spin[tag], base)
    high = problem.placement.tcp(tag, spin[tag], base + height)
    solved, reached = problem.solve(high, branch[tag], q)
    solved = np.where(reached[:, None], solved, q)
    good = reached & problem.within(solved) & problem.regular(solved)
    rows = np.nonzero(good)[0]
    lines = Lines(
        low[rows],
        high[rows],
        q[rows],
        solved[rows],
        branch[tag[rows]],
        np.zeros(len(rows), dtype=np.bool_),
    )
    good[rows] = checker.lines(lines)[0].good
    return solved, good


def free_way(checker: Checker, start: FloatArray, goal: FloatArray) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, none if it is straight."""
    if checker.joint_moves(start[None], goal[None]).good[0]:
        return np.zeros((0, 6))
    return rrt_connect(checker, start, goal)


def rrt_connect(checker: Checker, start: FloatArray, goal: FloatArray) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, None if none was found."""
    problem = checker.problem
    margin = problem.cell.limits.joint_margin
    low = np.minimum(start, goal) - _AROUND
    high = np.maximum(start, goal) + _AROUND
    low = np.maximum(low, np.asarray(problem.kinematics.q_min) + margin)
    high = np.minimum(high, np.asarray(problem.kinematics.q_max) - margin)
    rng = np.random.default_rng(_SEED)
    trees = (_Tree(start), _Tree(goal))
    for round_ in range(_ROUNDS):
        one, two = trees[round_ % 2], trees[1 - round_ % 2]
        new = one.grow(checker, rng.uniform(low, high, (_BATCH, 6)))
        met = two.meet(checker, one, new)
        if met is not None:
            way = [*one.way(met[0]), *two.way(met[1])[::-1]]
            return _shortened(checker, np.array(way[::-1] if round_ % 2 else way))[1:-1]
    return None


class _Tree:
    """Configurations reached from one end."""

    def __init__(self, root: FloatArray) -> None:
        self.nodes = np.asarray(root, dtype=np.float64)[None]
        self.parent = [-1]

    def grow(self, checker: Checker, targets: FloatArray) -> IndexArray:
        """Add nodes a step towards targets where that is free; return their numbers."""
        near = self.nearest(targets)
        way = targets - self.nodes[near]
        size = np.linalg.norm(way, axis=1, keepdims=True)
        ends = self.nodes[near] + way * np.minimum(1.0, _STEP / np.maximum(size, 1e-9))
        hopeful = np.nonzero(checker.free_poses(ends))[0]
        good = checker.joint_moves(self.nodes[near[hopeful]], ends[hopeful]).good
        free = hopeful[good]
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, ends[free]])
        self.parent += near[free].tolist()
        return np.arange(first, len(self.nodes))

    def meet(self, checker: Checker, other: _Tree, new: IndexArray) -> tuple[int, int] | None:
        """Return a new node of the other tree and the own node joined to it by a free move."""
        if not len(new):
            return None
        near = self.nearest(other.nodes[new])
        middle = 0.5 * (other.nodes[new] + self.nodes[near])
        hopeful = np.nonzero(checker.free_poses(middle))[0]
        start, end = other.nodes[new[hopeful]], self.nodes[near[hopeful]]
        good = hopeful[checker.joint_moves(start, end).good]
        if not len(good):
            return None
        gap = np.linalg.norm(other.nodes[new[good]] - self.nodes[near[good]], axis=1)
        best = good[int(np.argmin(gap))]
        return int(new[best]), int(near[best])

    def way(self, node: int) -> list[FloatArray]:
        """Return the nodes from the root to this one."""
        nodes = []
        while node >= 0:
            nodes.append(self.nodes[node])
            node = self.parent[node]
        return nodes[::-1]

    def nearest(self, targets: FloatArray) -> IndexArray:
        """Return the number (m,) of the node nearest to each target (m, 6)."""
        square = ((targets[:, None] - self.nodes[None]) ** 2).sum(axis=2)
        return np.asarray(np.argmin(square, axis=1))


def _shortened(checker: Checker, way: FloatArray) -> FloatArray:
    """Leave out nodes that straight joint moves can skip: fewest moves first, then shortest."""
    k = len(way)
    a, b = np.triu_indices(k, 1)
    free = checker.joint_moves(way[a], way[b]).good | (b == a + 1)
    best, before = [(0, 0.0)] + [(k + 1, 0.0)] * (k - 1), [0] * k
    for i, j in sorted(zip(a[free].tolist(), b[free].tolist(), strict=True)):
        cost = (best[i][0] + 1, best[i][1] + float(np.linalg.norm(way[j] - way[i])))
        if cost < best[j]:
            best[j], before[j] = cost, i
    kept = [k - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return way[kept[::-1]]
