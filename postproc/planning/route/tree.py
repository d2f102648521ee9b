"""Free ways in joint space by random trees from both ends (RRT-connect, Kuffner and LaValle 2000).

The seed is fixed and the tree depends on nothing but its two ends and the checks, so the same pair
of configurations gives the same way wherever and whenever it is asked for.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray, IndexArray
from postproc.planning.checks import Checker

ROUNDS = 60
"""How often a tree grows at most."""
_SEED = 20220115
_BATCH = 48
_NEAREST = 12
"""Moves between two trees that are checked before all others: the nearest."""
_STEPS = (0.6, 0.3)
"""Longest move [rad] of a tree: in open space, and once that has not been enough."""
_SHORTER = 20
"""After so many rounds moves get shorter."""
_AROUND = 1.2


def rrt_connect(
    checker: Checker,
    start: FloatArray,
    goal: FloatArray,
    external: FloatArray,
    rounds: int = ROUNDS,
) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, None if none was found.

    The external axes stand at ``external`` (k,) meanwhile.
    """
    problem = checker.problem
    margin = problem.cell.limits.joint_margin
    low = np.minimum(start, goal) - _AROUND
    high = np.maximum(start, goal) + _AROUND
    low = np.maximum(low, np.asarray(problem.kinematics.q_min) + margin)
    high = np.minimum(high, np.asarray(problem.kinematics.q_max) - margin)
    rng = np.random.default_rng(_SEED)
    trees = (_Tree(start, external), _Tree(goal, external))
    for round_ in range(rounds):
        one, two = trees[round_ % 2], trees[1 - round_ % 2]
        step = _STEPS[round_ >= _SHORTER]
        new = one.grow(checker, rng.uniform(low, high, (_BATCH, 6)), step)
        met = two.meet(checker, one, new)
        if met is not None:
            way = [*one.way(met[0]), *two.way(met[1])[::-1]]
            points = np.array(way[::-1] if round_ % 2 else way)
            return _shortened(checker, points, external)[1:-1]
    return None


class _Tree:
    """Configurations reached from one end."""

    def __init__(self, root: FloatArray, external: FloatArray) -> None:
        self.external = external
        self.nodes = np.asarray(root, dtype=np.float64)[None]
        self.parent = [-1]

    def grow(self, checker: Checker, targets: FloatArray, step: float) -> IndexArray:
        """Add nodes a step [rad] towards targets where that is free; return their numbers."""
        near = self.nearest(targets)
        way = targets - self.nodes[near]
        size = np.linalg.norm(way, axis=1, keepdims=True)
        ends = self.nodes[near] + way * np.minimum(1.0, step / np.maximum(size, 1e-9))
        hopeful = np.nonzero(checker.free_poses(ends, self.external))[0]
        start = self.nodes[near[hopeful]]
        good = checker.joint_moves(start, ends[hopeful], self.external).good
        free = hopeful[good]
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, ends[free]])
        self.parent += near[free].tolist()
        return np.arange(first, len(self.nodes))

    def meet(self, checker: Checker, other: _Tree, new: IndexArray) -> tuple[int, int] | None:
        """Return a new node of the other tree and the own node joined to it by a free move.

        The shortest such move: the longer ones are checked where none of the nearest is free.
        """
        if not len(new):
            return None
        near = self.nearest(other.nodes[new])
        middle = 0.5 * (other.nodes[new] + self.nodes[near])
        hopeful = np.nonzero(checker.free_poses(middle, self.external))[0]
        gap = np.linalg.norm(other.nodes[new[hopeful]] - self.nodes[near[hopeful]], axis=1)
        hopeful = hopeful[np.argsort(gap, kind="stable")]
        for some in (hopeful[:_NEAREST], hopeful[_NEAREST:]):
            start, end = other.nodes[new[some]], self.nodes[near[some]]
            good = some[checker.joint_moves(start, end, self.external).good]
            if len(good):
                return int(new[good[0]]), int(near[good[0]])
        return None

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


def _shortened(checker: Checker, way: FloatArray, external: FloatArray) -> FloatArray:
    """Leave out nodes that straight joint moves can skip: fewest moves first, then shortest."""
    k = len(way)
    a, b = np.triu_indices(k, 1)
    free = checker.joint_moves(way[a], way[b], external).good | (b == a + 1)
    best, before = [(0, 0.0)] + [(k + 1, 0.0)] * (k - 1), [0] * k
    for i, j in sorted(zip(a[free].tolist(), b[free].tolist(), strict=True)):
        cost = (best[i][0] + 1, best[i][1] + float(np.linalg.norm(way[j] - way[i])))
        if cost < best[j]:
            best[j], before[j] = cost, i
    kept = [k - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return way[kept[::-1]]
