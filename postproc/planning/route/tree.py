"""Free ways in joint space by random trees from both ends (RRT-connect, Kuffner and LaValle 2000).

A pose costs a small part of what the proof of a motion costs, so the trees grow by poses alone and
whole ways are proven (Lazy PRM, Bohlin and Kavraki 2000): all motions between any two points of a
way at once, which also tells which points it can do without. What is refuted leaves the trees.

The seed is fixed and the tree depends on nothing but its two ends and the checks, so the same pair
of configurations gives the same way wherever and whenever it is asked for.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray, numbered
from postproc.planning.checks import Checker

ROUNDS = 60
"""How often a tree grows at most."""
_SEED = 20220115
_BATCH = 48
_STEP = 0.6
"""Longest move [rad] of a tree in open space."""
_SHORTER = 20
"""After so many rounds moves get half as long."""
_AROUND = (0.2, 1.2)
"""How far [rad] around both ends a tree looks: at first as far as half the way between them, but
within these bounds; what is near needs no long way round."""
_WIDER = 4
"""After so many rounds it looks twice as far."""
_SAMPLE = 0.3
"""Motions are looked at in steps of this [rad] at most before they are proven."""
_PROVEN = 2
"""So many ways, the shortest, are to be proven at once."""
_TRIES = 4
"""So often in a round, at most."""


def seem_free(
    checker: Checker, start: FloatArray, end: FloatArray, external: FloatArray
) -> BoolArray:
    """Return which joint moves (m, 6) to (m, 6) are free at poses between their ends.

    The external axes stand at ``external`` (k,) or (m, k) meanwhile.
    """
    count = np.ceil(np.linalg.norm(end - start, axis=1) / _SAMPLE).astype(np.int64)
    inner = np.maximum(count - 1, 1)
    row, step = numbered(inner)
    share = (step + 1) / (inner[row] + 1)
    q = start[row] + share[:, None] * (end - start)[row]
    free = np.ones(len(start), dtype=np.bool_)
    free[row[~checker.free_poses(q, _at_each(external, start)[row])]] = False
    return free


def free_moves(
    checker: Checker, start: FloatArray, end: FloatArray, external: FloatArray
) -> BoolArray:
    """Return which joint moves (m, 6) to (m, 6) are free, looked at first where many are not.

    The external axes stand at ``external`` (k,) or (m, k) meanwhile.
    """
    free = seem_free(checker, start, end, external)
    place = _at_each(external, start)[free]
    free[free] = checker.joint_moves(start[free], end[free], place).good
    return free


def _at_each(external: FloatArray, moves: FloatArray) -> FloatArray:
    """Return where the external axes stand (m, k) at each of moves (m, 6), from (k,) or (m, k)."""
    return np.broadcast_to(external, (len(moves), external.shape[-1]))


def rrt_connect(
    checker: Checker,
    start: FloatArray,
    goal: FloatArray,
    external: FloatArray,
    rounds: int = ROUNDS,
) -> FloatArray | None:
    """Return the joints (k, 6) between start and goal of a free way, None if none was found.

    The external axes stand at ``external`` (k,) meanwhile. Where an end is not free no tree grows.
    """
    if not checker.free_poses(np.stack([start, goal]), external).all():
        return None
    problem = checker.problem
    margin = problem.cell.limits.joint_margin
    least = np.asarray(problem.kinematics.q_min) + margin
    most = np.asarray(problem.kinematics.q_max) - margin
    at_first = max(_AROUND[0], 0.5 * float(np.linalg.norm(goal - start)))
    rng = np.random.default_rng(_SEED)
    trees = (_Tree(start, external), _Tree(goal, external))
    for round_ in range(rounds):
        one, two = trees[round_ % 2], trees[1 - round_ % 2]
        around = min(_AROUND[1], at_first * 2.0 ** (round_ // _WIDER))
        low = np.maximum(np.minimum(start, goal) - around, least)
        high = np.minimum(np.maximum(start, goal) + around, most)
        step = min(around, _STEP if round_ < _SHORTER else 0.5 * _STEP)
        new = one.grow(checker, rng.uniform(low, high, (_BATCH, 6)), step)
        way = _proven(checker, one, two, new)
        if way is not None:
            return (way[::-1] if round_ % 2 else way)[1:-1]
    return None


class _Tree:
    """Configurations reached from one end.

    ``parent`` (n,): number of the node before each; ``is_alive`` (n,): whether no move on the way
    from the root was refuted.
    """

    def __init__(self, root: FloatArray, external: FloatArray) -> None:
        self.external = external
        self.nodes = np.asarray(root, dtype=np.float64)[None]
        self.parent = np.array([-1])
        self.is_alive = np.array([True])

    def grow(self, checker: Checker, targets: FloatArray, step: float) -> IndexArray:
        """Add nodes a step [rad] towards targets where poses are free; return their numbers."""
        near = self.nearest(targets)
        way = targets - self.nodes[near]
        size = np.linalg.norm(way, axis=1, keepdims=True)
        ends = self.nodes[near] + way * np.minimum(1.0, step / np.maximum(size, 1e-9))
        free = np.flatnonzero(checker.free_poses(ends, self.external))
        free = free[seem_free(checker, self.nodes[near[free]], ends[free], self.external)]
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, ends[free]])
        self.parent = np.concatenate([self.parent, near[free]])
        self.is_alive = np.concatenate([self.is_alive, np.ones(len(free), dtype=np.bool_)])
        return np.arange(first, len(self.nodes))

    def way(self, node: int) -> IndexArray:
        """Return the numbers of the nodes from the root to this one."""
        numbers = []
        while node >= 0:
            numbers.append(node)
            node = int(self.parent[node])
        return np.array(numbers[::-1])

    def nearest(self, targets: FloatArray) -> IndexArray:
        """Return the number (m,) of the node nearest to each target (m, 6)."""
        alive = np.flatnonzero(self.is_alive)
        square = ((targets[:, None] - self.nodes[alive][None]) ** 2).sum(axis=2)
        return np.asarray(alive[np.argmin(square, axis=1)])

    def leave_out(self, nodes: IndexArray) -> None:
        """Leave out nodes (k,) that no free move leads to, with what grew from them."""
        self.is_alive[nodes] = False
        for node in range(int(nodes.min()) + 1, len(self.nodes)) if len(nodes) else ():
            self.is_alive[node] &= self.is_alive[self.parent[node]]


def _proven(checker: Checker, one: _Tree, two: _Tree, new: IndexArray) -> FloatArray | None:
    """Return a free way (k, 6) from the root of one tree by its new nodes to that of the other."""
    if not len(new):
        return None
    near = two.nearest(one.nodes[new])
    free = seem_free(checker, one.nodes[new], two.nodes[near], one.external)
    new, near = new[free], near[free]
    gap = np.linalg.norm(one.nodes[new] - two.nodes[near], axis=1)
    order = np.argsort(gap, kind="stable")
    for _ in range(_TRIES):
        order = order[one.is_alive[new[order]] & two.is_alive[near[order]]]
        tried, order = order[:_PROVEN], order[_PROVEN:]
        if not len(tried):
            break
        ways = [(one.way(int(new[i])), two.way(int(near[i]))) for i in tried]
        way = _shortest(checker, one, two, ways)
        if way is not None:
            return way
    return None


def _shortest(
    checker: Checker, one: _Tree, two: _Tree, ways: list[tuple[IndexArray, IndexArray]]
) -> FloatArray | None:
    """Return what is left of the first way that is free, by the nodes it cannot do without."""
    points = [np.vstack([one.nodes[there], two.nodes[back[::-1]]]) for there, back in ways]
    pairs = [np.triu_indices(len(way), 1) for way in points]
    start = np.vstack([way[a] for way, (a, _) in zip(points, pairs, strict=True)])
    end = np.vstack([way[b] for way, (_, b) in zip(points, pairs, strict=True)])
    free = free_moves(checker, start, end, one.external)
    cuts = np.cumsum([len(a) for a, _ in pairs])[:-1]
    found = None
    for way, (there, back), (a, b), good in zip(
        points, ways, pairs, np.split(free, cuts), strict=True
    ):
        next_to = good[b == a + 1]
        one.leave_out(there[1:][~next_to[: len(there) - 1]])
        two.leave_out(back[1:][~next_to[len(there) :][::-1]])
        kept = _fewest(way, a[good], b[good])
        if found is None and kept is not None:
            found = way[kept]
    return found


def _fewest(way: FloatArray, a: IndexArray, b: IndexArray) -> list[int] | None:
    """Return the numbers of points of a way by which free moves a (m,) to b (m,) lead to its end.

    Fewest moves first, then shortest; None if none lead there.
    """
    k = len(way)
    best, before = [(0, 0.0)] + [(k + 1, 0.0)] * (k - 1), [0] * k
    for i, j in sorted(zip(a.tolist(), b.tolist(), strict=True)):
        cost = (best[i][0] + 1, best[i][1] + float(np.linalg.norm(way[j] - way[i])))
        if cost < best[j]:
            best[j], before[j] = cost, i
    if best[-1][0] > k:
        return None
    kept = [k - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return kept[::-1]
