"""How the tool gets from one stretch to the next without touching anything.

Straight in joint space if that is free; else by backing off along the tool axes first; else by a
random tree in joint space from both ends (RRT-connect, Kuffner and LaValle 2000) with a fixed
seed, shortened afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.model.arrays import BoolArray, FloatArray
from postproc.planning.feasible import Checker, Lines, Verdict
from postproc.planning.ladder import IndexArray

BACK_OFF = (0.05, 0.1, 0.2, 0.4)
"""Heights [m] by which both ends back off along their tool axes, tried in turn."""
_TREE_STEP = 0.25
_TREE_NODES = 1500
_SEED = 20220115


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


@dataclass(frozen=True, slots=True)
class Detour:
    """Points on the way: joints (k, 6), and whether the motion TO each is straight (LIN).

    ``last_is_line``: so is the motion from the last of them to the end.
    """

    q: FloatArray
    is_line: BoolArray
    last_is_line: bool


def free_joint_moves(checker: Checker, ends: Ends) -> Verdict:
    """Return whether the straight joint moves are free."""
    return checker.joint_moves(ends.q_from, ends.q_to)


def detour(
    checker: Checker, ends: Ends, row: int, spin: FloatArray, branch: IndexArray
) -> Detour | None:
    """Return a free way round for one connection, None if none was found."""
    for height in BACK_OFF:
        for lifted in ((True, True), (True, False), (False, True)):
            found = _by_backing_off(checker, ends, row, spin, branch, height, lifted)
            if found is not None:
                return found
    points = rrt_connect(checker, ends.q_from[row], ends.q_to[row])
    if points is None:
        return None
    return Detour(points, np.zeros(len(points), dtype=np.bool_), last_is_line=False)


def _by_backing_off(
    checker: Checker,
    ends: Ends,
    row: int,
    spin: FloatArray,
    branch: IndexArray,
    height: float,
    lifted: tuple[bool, bool],
) -> Detour | None:
    points = []
    for end, up in enumerate(lifted):
        tag = (ends.tag_from if end == 0 else ends.tag_to)[row : row + 1]
        q = (ends.q_from if end == 0 else ends.q_to)[row : row + 1]
        if not up:
            points.append(q[0])
            continue
        base = (ends.height_from if end == 0 else ends.height_to)[row : row + 1]
        lifted_q = _lifted(checker, tag, base, q, spin[tag], branch[tag], height)
        if lifted_q is None:
            return None
        points.append(lifted_q)
    if not checker.joint_moves(points[0][None], points[1][None]).good[0]:
        return None
    chosen = [point for point, up in zip(points, lifted, strict=True) if up]
    straight = [lifted[0]] if lifted == (True, False) else [True, False] if lifted[0] else [False]
    return Detour(np.array(chosen), np.array(straight), last_is_line=lifted[1])


def _lifted(
    checker: Checker,
    tag: IndexArray,
    base: FloatArray,
    q: FloatArray,
    spin: FloatArray,
    branch: IndexArray,
    height: float,
) -> FloatArray | None:
    """Return the joints ``height`` above where the tool stands, None if the way up is not free."""
    problem = checker.problem
    low = problem.placement.tcp(tag, spin, base)
    high = problem.placement.tcp(tag, spin, base + height)
    solved, reached = problem.solve(high, branch, q)
    if not (reached & problem.within(solved) & problem.regular(solved))[0]:
        return None
    lines = Lines(low, high, q, solved, branch, np.zeros(1, dtype=np.bool_))
    return solved[0] if checker.lines(lines)[0].good[0] else None


def rrt_connect(checker: Checker, start: FloatArray, goal: FloatArray) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, None if none was found."""
    problem = checker.problem
    margin = problem.cell.limits.joint_margin
    low = np.maximum(np.asarray(problem.kinematics.q_min) + margin, np.minimum(start, goal) - 1.5)
    high = np.minimum(np.asarray(problem.kinematics.q_max) - margin, np.maximum(start, goal) + 1.5)
    rng = np.random.default_rng(_SEED)
    trees = [_Tree(start), _Tree(goal)]
    for round_ in range(_TREE_NODES):
        one, two = trees[round_ % 2], trees[1 - round_ % 2]
        target = rng.uniform(low, high)
        new = one.grow(checker, target)
        if new is None:
            continue
        other = two.reach(checker, one.nodes[new])
        if other is None:
            continue
        way_one, way_two = one.way(new), two.way(other)
        way = [*way_one, *way_two[::-1][1:]]
        if round_ % 2 == 1:
            way = way[::-1]
        return _shortened(checker, np.array(way))[1:-1]
    return None


class _Tree:
    """Configurations reached from one end."""

    def __init__(self, root: FloatArray) -> None:
        self.nodes: list[FloatArray] = [np.asarray(root, dtype=np.float64)]
        self.parent: list[int] = [-1]

    def grow(self, checker: Checker, target: FloatArray) -> int | None:
        """Add one node a step towards the target; None if the way is not free."""
        near = self._nearest(target)
        way = target - self.nodes[near]
        size = float(np.linalg.norm(way))
        if size < 1e-9:
            return None
        return self._add(checker, near, self.nodes[near] + way * min(1.0, _TREE_STEP / size))

    def reach(self, checker: Checker, target: FloatArray) -> int | None:
        """Grow step by step until the target is met; None if something is in the way."""
        while True:
            added = self.grow(checker, target)
            if added is None:
                near = self._nearest(target)
                met = float(np.linalg.norm(self.nodes[near] - target)) < 1e-9
                return near if met else None
            if float(np.linalg.norm(self.nodes[added] - target)) < 1e-9:
                return added

    def way(self, node: int) -> list[FloatArray]:
        """Return the nodes from the root to this one."""
        nodes = []
        while node >= 0:
            nodes.append(self.nodes[node])
            node = self.parent[node]
        return nodes[::-1]

    def _nearest(self, target: FloatArray) -> int:
        distance = ((np.array(self.nodes) - target) ** 2).sum(axis=1)
        return int(np.argmin(distance))

    def _add(self, checker: Checker, near: int, point: FloatArray) -> int | None:
        if not checker.joint_moves(self.nodes[near][None], point[None]).good[0]:
            return None
        self.nodes.append(point)
        self.parent.append(near)
        return len(self.nodes) - 1


def _shortened(checker: Checker, way: FloatArray) -> FloatArray:
    """Leave out nodes that a straight joint move can skip, farthest first."""
    kept = [0]
    while kept[-1] < len(way) - 1:
        here = kept[-1]
        for there in range(len(way) - 1, here, -1):
            if there == here + 1 or checker.joint_moves(way[here][None], way[there][None]).good[0]:
                kept.append(there)
                break
    return way[kept]
