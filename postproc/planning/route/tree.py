"""Free ways in joint space by random trees from both ends (RRT-connect, Kuffner and LaValle 2000).

A pose costs a small part of what the proof of a motion costs, so the trees grow by poses alone, and
where they meet the moves of the way are proven (Lazy PRM, Bohlin and Kavraki 2000), each once. What
is refuted leaves the trees. Only a way that is free is shortened: moves between any two of its
points are looked at, and those proven that the shortest way is made of.

The seed is fixed and the tree depends on nothing but its two ends and the checks, so the same pair
of configurations gives the same way wherever and whenever it is asked for.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, BoolArray, FloatArray, IndexArray, numbered
from postproc.paths import joint_times
from postproc.planning.checks import Checker
from postproc.planning.states import Problem
from postproc.units import DEG

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
_AT_ONCE = 128
"""So few poses are looked at in one call; a call costs as much as about so many poses."""
_PROVEN = 2
"""So many ways, the shortest, are to be proven at once."""
_TRIES = 4
"""So often in a round, at most."""
_FOLDS = np.array([(20.0, 20.0), (40.0, 20.0)]) * DEG
"""By how much A2 swings back and A3 down [rad]."""


def seem_free(
    checker: Checker, start: FloatArray, end: FloatArray, external: FloatArray
) -> BoolArray:
    """Return which joint moves (m, 6) to (m, 6) are free at poses between their ends.

    At the middle first if there are many, for there most that are not meet something. The external
    axes stand at ``external`` (k,) or (m, k) meanwhile.
    """
    count = np.ceil(np.linalg.norm(end - start, axis=1) / _SAMPLE).astype(np.int64)
    inner = np.maximum(count - 1, 1)
    row, step = numbered(inner)
    share = (step + 1) / (inner[row] + 1)
    q = start[row] + share[:, None] * (end - start)[row]
    place = _at_each(external, start)[row]
    is_first = (step == inner[row] // 2) | (len(q) <= _AT_ONCE)
    free = np.ones(len(start), dtype=np.bool_)
    for wave in (is_first, ~is_first):
        asked = np.flatnonzero(wave & free[row])
        free[row[asked[~checker.free_poses(q[asked], place[asked])]]] = False
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

    The external axes stand at ``external`` (k,) meanwhile. Where an end is not free no tree grows,
    nor does one twice between the same ends unless more often than before.
    """
    ends = np.concatenate([start, goal, external]).tobytes()
    took, way = checker.trees.get(ends, (0, None))
    if way is None and took < rounds:
        took, way = _grown(checker, start, goal, external, rounds)
        checker.trees[ends] = took, way
    return way if took <= rounds else None


def _grown(
    checker: Checker, start: FloatArray, goal: FloatArray, external: FloatArray, rounds: int
) -> tuple[int, FloatArray | None]:
    """Return after how many rounds a tree ended, and the joints (k, 6) of the way that it found."""
    if not checker.free_poses(np.stack([start, goal]), external).all():
        return ROUNDS, None
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
        way = _joined(checker, one, two, new)
        if way is not None:
            return round_ + 1, (way[::-1] if round_ % 2 else way)[1:-1]
    return rounds, None


class _Tree:
    """Configurations reached from one end.

    ``parent`` (n,): number of the node before each; ``is_proven`` (n,): whether the move from there
    is known to be free; ``is_alive`` (n,): whether no move on the way from the root was refuted.
    """

    def __init__(self, root: FloatArray, external: FloatArray) -> None:
        self.external = external
        self.nodes = np.asarray(root, dtype=np.float64)[None]
        self.parent = np.array([-1])
        self.is_proven = np.array([True])
        self.is_alive = np.array([True])

    def grow(self, checker: Checker, targets: FloatArray, step: float) -> IndexArray:
        """Add nodes a step [rad] towards targets where poses are free; return their numbers."""
        near = self.nearest(targets)
        way = targets - self.nodes[near]
        size = np.linalg.norm(way, axis=1, keepdims=True)
        ends = self.nodes[near] + way * np.minimum(1.0, step / np.maximum(size, ROUNDING))
        free = np.flatnonzero(checker.free_poses(ends, self.external))
        free = free[seem_free(checker, self.nodes[near[free]], ends[free], self.external)]
        first = len(self.nodes)
        self.nodes = np.concatenate([self.nodes, ends[free]])
        self.parent = np.concatenate([self.parent, near[free]])
        self.is_proven = np.append(self.is_proven, np.zeros(len(free), dtype=np.bool_))
        self.is_alive = np.append(self.is_alive, np.ones(len(free), dtype=np.bool_))
        return np.arange(first, len(self.nodes))

    def way(self, node: int) -> list[int]:
        """Return the numbers of the nodes from the root to this one."""
        numbers = []
        while node >= 0:
            numbers.append(node)
            node = int(self.parent[node])
        return numbers[::-1]

    def open_moves(self, nodes: IndexArray) -> IndexArray:
        """Return the nodes on the ways to nodes (m,) that are not proven to be reached freely."""
        every = np.unique([node for end in nodes.tolist() for node in self.way(end)])
        return np.asarray(every[~self.is_proven[every]])

    def nearest(self, targets: FloatArray) -> IndexArray:
        """Return the number (m,) of the node nearest to each target (m, 6)."""
        alive = np.flatnonzero(self.is_alive)
        square = ((targets[:, None] - self.nodes[alive][None]) ** 2).sum(axis=2)
        return np.asarray(alive[np.argmin(square, axis=1)])

    def settle(self, nodes: IndexArray, free: BoolArray) -> None:
        """Note which moves to nodes (k,) are free; the others go, with what grew from them."""
        self.is_proven[nodes] = free
        self.is_alive[nodes[~free]] = False
        for node in range(int(nodes[~free].min(initial=len(self.nodes))) + 1, len(self.nodes)):
            self.is_alive[node] &= self.is_alive[self.parent[node]]


def _joined(checker: Checker, one: _Tree, two: _Tree, new: IndexArray) -> FloatArray | None:
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
        way = _proven(checker, one, two, new[tried], near[tried])
        if way is not None:
            return _shortened(checker, way, one.external)
    return None


def _proven(
    checker: Checker, one: _Tree, two: _Tree, there: IndexArray, back: IndexArray
) -> FloatArray | None:
    """Return the points (k, 6) of the first way all of whose moves are free.

    The ways join nodes ``there`` (m,) of one tree and ``back`` (m,) of the other. A move of a tree
    is proven once; what is refuted leaves the tree.
    """
    asked = [(tree, tree.open_moves(nodes)) for tree, nodes in ((one, there), (two, back))]
    legs = [(tree.nodes[tree.parent[to]], tree.nodes[to]) for tree, to in asked]
    legs.append((one.nodes[there], two.nodes[back]))
    start, end = (np.concatenate(side) for side in zip(*legs, strict=True))
    free = checker.joint_moves(start, end, one.external).good
    *parts, joins = np.split(free, np.cumsum([len(to) for _, to in asked]))
    for (tree, to), good in zip(asked, parts, strict=True):
        tree.settle(to, good)
    good = joins & one.is_alive[there] & two.is_alive[back]
    for k in np.flatnonzero(good)[:1].tolist():
        return np.vstack([one.nodes[one.way(there[k])], two.nodes[two.way(back[k])[::-1]]])
    return None


def _shortened(checker: Checker, way: FloatArray, external: FloatArray) -> FloatArray:
    """Return what is left of a free way (k, 6) by the points it cannot do without.

    All moves between two of its points are looked at; those on what would be the shortest way are
    proven, until all of them are free.
    """
    a, b = np.triu_indices(len(way), 1)
    number = np.zeros((len(way), len(way)), dtype=np.int64)
    number[a, b] = np.arange(len(a))
    is_proven = b == a + 1
    free = is_proven | seem_free(checker, way[a], way[b], external)
    while True:
        kept = _fewest(way, a[free], b[free])
        moves = number[kept[:-1], kept[1:]]
        moves = moves[~is_proven[moves]]
        if not len(moves):
            return way[kept]
        good = checker.joint_moves(way[a[moves]], way[b[moves]], external).good
        is_proven[moves] = free[moves] = good


def _fewest(way: FloatArray, a: IndexArray, b: IndexArray) -> list[int]:
    """Return the numbers of points of a way by which free moves a (m,) to b (m,) lead to its end.

    Fewest moves first, then shortest; the moves between neighbours are among the free ones.
    """
    k = len(way)
    best, before = [(0, 0.0)] + [(k + 1, 0.0)] * (k - 1), [0] * k
    for i, j in sorted(zip(a.tolist(), b.tolist(), strict=True)):
        cost = (best[i][0] + 1, best[i][1] + float(np.linalg.norm(way[j] - way[i])))
        if cost < best[j]:
            best[j], before[j] = cost, i
    kept = [k - 1]
    while kept[-1] > 0:
        kept.append(before[kept[-1]])
    return kept[::-1]


def folded_ways(problem: Problem, start: FloatArray, goal: FloatArray) -> FloatArray:
    """Return two points (w, m, 2, 6) [rad] of ways between ends (m, 6), the quickest ones first.

    A2 swings the upper arm back and A3 keeps the forearm about level, as far as limits let them;
    overhead the other way. Half way, near one end, where both points are the same, or near both.
    """
    margin = problem.cell.limits.joint_margin
    least = np.asarray(problem.kinematics.q_min) + margin
    most = np.asarray(problem.kinematics.q_max) - margin
    middle = 0.5 * (start + goal)
    near = [(middle, middle), (start, start), (goal, goal), (start, goal)] * len(_FOLDS)
    points = np.stack([np.stack(pair, axis=1) for pair in near])
    back = np.where(problem.kinematics.branches.reach(points) < 0.0, 1.0, -1.0)
    fold = np.repeat(_FOLDS, len(near) // len(_FOLDS), axis=0)
    folded = points.copy()
    folded[..., 1] += back * fold[:, :1, None]
    folded[..., 2] -= back * fold[:, 1:, None]
    folded = np.clip(folded, np.minimum(least, points), np.maximum(most, points))
    ends = np.broadcast_to(np.stack([start, goal], axis=1), folded.shape)
    stops = np.concatenate([ends[:, :, :1], folded, ends[:, :, 1:]], axis=2)
    order = np.argsort(way_times(problem, stops), axis=0, kind="stable")
    return np.asarray(np.take_along_axis(folded, order[:, :, None, None], axis=0))


def way_times(problem: Problem, stops: FloatArray) -> FloatArray:
    """Return the time (...) [s] of ways by joint moves from stop to stop (..., n, 6) [rad]."""
    start, end = stops[..., :-1, :], stops[..., 1:, :]
    share = problem.cell.motion.rapid
    time = joint_times(problem.cell, share, start.reshape(-1, 6), end.reshape(-1, 6))
    return np.asarray(time.reshape(start.shape[:-1]).sum(axis=-1))
