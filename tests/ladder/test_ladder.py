"""The search is exact: against enumeration, networkx, and a fresh solve after every change."""

from __future__ import annotations

import itertools

import networkx as nx
import numpy as np
import pytest

from postproc.ladder import NONE, Joined, Ladder, Rule, Tolls
from postproc.ladder import ladder as ladder_module


def random_ladder(rng, rungs, most, dead=0.15, chain=0.5, least=1, width=2.5):
    sizes = rng.integers(least, most + 1, rungs)
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    states = int(offsets[-1])
    cost = rng.uniform(0, 1, states)
    cost[rng.uniform(size=states) < dead] = np.inf
    return Ladder(
        offsets=offsets,
        position=rng.uniform(-width, width, (states, 6)),
        cost=cost,
        group=rng.integers(0, 2, states),
        rule=np.where(rng.uniform(size=rungs) < chain, Rule.CHAIN, Rule.FREE),
        weight=rng.uniform(0.1, 2.0, rungs),
    )


def step_cost(ladder, i, a, b, forbidden=()):
    if (a, b) in forbidden:
        return np.inf
    leap = ladder.position[b] - ladder.position[a]
    if ladder.rule[i] == Rule.CHAIN and (
        ladder.group[a] != ladder.group[b] or np.abs(leap).max() > np.pi
    ):
        return np.inf
    toll = 0.0
    if ladder.tolls is not None:
        toll = ladder.tolls.leaves[a] @ ladder.tolls.enters[b]
    return ladder.weight[i] * (leap @ leap) + toll


def brute_force(ladder, forbidden=()):
    rungs = [range(ladder.offsets[i], ladder.offsets[i + 1]) for i in range(len(ladder))]
    best = np.inf
    for way in itertools.product(*rungs):
        total = sum(ladder.cost[s] for s in way)
        if not np.isfinite(total):
            continue
        total += sum(
            step_cost(ladder, i, way[i - 1], way[i], forbidden) for i in range(1, len(way))
        )
        best = min(best, total)
    return best


def with_tolls(rng, ladder, count):
    """Some states lie on one or the other side of walls; to go across costs much, but in chains."""
    side = rng.integers(-1, 2, (len(ladder.cost), count))
    leaves = np.hstack([side < 0, side > 0]).astype(float)
    enters = 20.0 * np.hstack([side > 0, side < 0])
    enters[np.repeat(ladder.rule == Rule.CHAIN, np.diff(ladder.offsets))] = 0.0
    ladder.tolls = Tolls(leaves, enters)
    return ladder


@pytest.mark.parametrize("seed", range(60))
def test_tolls_are_part_of_the_price(seed):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=int(rng.integers(2, 6)), most=4, chain=0.3, dead=0.0)
    with_tolls(rng, ladder, int(rng.integers(1, 4))).solve()
    for _ in range(3):
        if ladder.broken[1:].any() or not np.isfinite(ladder.cost).all():
            break
        path = ladder.path()
        assert ladder.total(path) == pytest.approx(brute_force(ladder), abs=1e-9)
        into = ladder.tolls_on(path)
        steps = itertools.pairwise(path)
        paid = [ladder.tolls.leaves[a] @ ladder.tolls.enters[b] for a, b in steps]
        assert into.tolist() == pytest.approx([0.0, *paid])
        wide = np.flatnonzero(np.diff(ladder.offsets)[ladder.rung_of(path)] > 1)
        if not len(wide):
            break
        ladder.remove(path[wide[:1]])


@pytest.mark.parametrize("seed", range(200))
def test_equals_enumeration(seed):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=int(rng.integers(1, 6)), most=4)
    ladder.solve()
    best = brute_force(ladder)
    path = ladder.path()
    if np.isfinite(best):
        assert not ladder.broken[1:].any()
        assert ladder.total(path) == pytest.approx(best, abs=1e-9)
    else:
        assert ladder.broken[1:].any() or (path == NONE).any()


def test_equals_networkx():
    rng = np.random.default_rng(5)
    ladder = random_ladder(rng, rungs=30, most=25, dead=0.2, chain=0.2, least=12, width=1.5)
    graph = nx.DiGraph()
    for i in range(len(ladder)):
        now = range(ladder.offsets[i], ladder.offsets[i + 1])
        before = range(ladder.offsets[i - 1], ladder.offsets[i]) if i else ["start"]
        for b in now:
            if not np.isfinite(ladder.cost[b]):
                continue
            for a in before:
                step = step_cost(ladder, i, a, b) if i else 0.0
                if np.isfinite(step):
                    graph.add_edge(a, b, weight=step + ladder.cost[b])
    for b in range(ladder.offsets[-2], ladder.offsets[-1]):
        graph.add_edge(b, "end", weight=0.0)
    ladder.solve()
    want = nx.shortest_path_length(graph, "start", "end", weight="weight")
    assert ladder.total(ladder.path()) == pytest.approx(want, rel=1e-12)


@pytest.mark.parametrize("seed", range(20))
def test_repair_equals_fresh_solve(seed):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=40, most=12, dead=0.1, chain=0.5)
    fresh = Ladder(
        ladder.offsets, ladder.position, ladder.cost, ladder.group, ladder.rule, ladder.weight
    )
    ladder.solve()
    for _ in range(15):
        path = ladder.path()
        kept = path[path != NONE]
        out = rng.choice(kept, size=min(3, len(kept)), replace=False)
        ladder.remove(out)
        fresh.cost[out] = np.inf
        fresh.solve()
        assert ladder.total(ladder.path()) == pytest.approx(fresh.total(fresh.path()), abs=1e-8)
        assert np.array_equal(ladder.broken, fresh.broken)


class SomeSteps:
    """Some steps of a ladder at random: told one by one, or as a matrix only."""

    def __init__(self, ladder, rng, *, listed):
        self.offsets, self.group, self.listed = ladder.offsets, ladder.group, listed
        self.may = rng.uniform(size=(len(ladder.cost),) * 2) < 0.3

    def classes(self, i, cost):
        before, low, high = self.offsets[i - 1 : i + 2]
        may = np.eye(2, dtype=bool)
        return Joined(self.group[low:high], self.group[before:low], may)

    def barred(self, i, before, now):
        return ~self.may[now][:, before]

    def changed(self, rungs):
        pass

    def is_lasting(self, i):
        return self.listed


@pytest.mark.parametrize("seed", range(20))
def test_listed_steps_give_what_the_matrix_gives(seed):
    ladders = []
    for listed in (False, True):
        rng = np.random.default_rng(seed)
        ladder = random_ladder(rng, rungs=30, most=25, dead=0.1, chain=0.7)
        ladder.joins = SomeSteps(ladder, rng, listed=listed)
        if seed % 3 == 0:
            ladder._room_left = 200  # only some of the rungs are listed
        ladder.solve()
        ladders.append(ladder)
    plain, ladder = ladders
    rng = np.random.default_rng(seed)
    for round_ in range(12):
        path = plain.path()
        assert ladder.total(path) == pytest.approx(plain.total(path), rel=1e-12)
        assert ladder.total(ladder.path()) == pytest.approx(plain.total(path), abs=1e-6)
        assert np.array_equal(ladder.broken, plain.broken)
        rung = int(rng.choice(np.flatnonzero(plain.rule[1:] == Rule.CHAIN))) + 1
        steps = plain.cheapest(rung, 5)
        assert np.array_equal(ladder.cheapest(rung, 5)[: len(steps)], steps)
        pairs = np.stack([path[:-1], path[1:]], axis=1)[(path[:-1] != NONE) & (path[1:] != NONE)]
        out = [*steps.tolist(), *rng.choice(pairs, size=2, replace=False).tolist()]
        dead = rng.choice(path[path != NONE], size=round_ % 3, replace=False)
        for each in ladders:
            each.forbid(out)
            each.remove(dead)
            each.settle()


@pytest.mark.parametrize("seed", range(20))
def test_what_was_put_off_is_made_good(monkeypatch, seed):
    monkeypatch.setattr(ladder_module, "NEAR", 1 + seed % 4)
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=60, most=12, dead=0.1, chain=0.7)
    fresh = Ladder(
        ladder.offsets, ladder.position, ladder.cost, ladder.group, ladder.rule, ladder.weight
    )
    ladder.solve()
    put_off = 0
    for _ in range(12):
        path = ladder.path()
        kept = path[path != NONE]
        out = rng.choice(kept, size=min(2, len(kept)), replace=False)
        ladder.remove(out)
        fresh.cost[out] = np.inf
        meanwhile = ladder.path()
        assert not np.isin(out, meanwhile).any()
        for i in np.flatnonzero((meanwhile[1:] != NONE) & ~ladder.broken[1:]) + 1:
            assert np.isfinite(step_cost(ladder, i, meanwhile[i - 1], meanwhile[i]))
        if rng.uniform() < 0.5:
            continue
        put_off += ladder.settle()
        assert not ladder.settle()
        fresh.solve()
        assert ladder.total(ladder.path()) == pytest.approx(fresh.total(fresh.path()), abs=1e-8)
        assert np.array_equal(ladder.broken, fresh.broken)
    assert put_off


@pytest.mark.parametrize("seed", range(20))
def test_taken_over_equals_fresh_solve(monkeypatch, seed):
    monkeypatch.setattr(ladder_module, "NEAR", 1 + seed % 4)
    rng = np.random.default_rng(seed)
    every = random_ladder(rng, rungs=60, most=12, dead=0.1, chain=0.7)
    parts = (every.offsets, every.position, every.cost, every.group, every.rule, every.weight)
    now, fresh = Ladder(*parts), Ladder(*parts)
    is_new = rng.uniform(size=60) < 0.2
    size = np.diff(every.offsets)
    kept = np.repeat(~is_new, size)
    cost = every.cost.copy()
    repriced = np.append(is_new[1:], False) & ~is_new
    cost[np.repeat(repriced, size)] *= rng.uniform(0.5, 2.0, int(size[repriced].sum()))
    known = Ladder(
        np.append(0, np.cumsum(size[~is_new])),
        every.position[kept],
        cost[kept],
        every.group[kept],
        every.rule[~is_new],
        every.weight[~is_new],
    )
    known.solve()
    path = known.path()
    out = path[path != NONE][::7]
    known.remove(out)
    moved = np.append(np.flatnonzero(kept), NONE)
    now.cost[moved[out]] = fresh.cost[moved[out]] = np.inf
    anew = np.unique(np.minimum(np.flatnonzero(is_new)[:, None] + np.arange(2), 59))
    now.take_over(known, moved, anew)
    now.settle()
    fresh.solve()
    assert now.value == pytest.approx(fresh.value, abs=1e-8)
    assert now.total(now.path()) == pytest.approx(fresh.total(fresh.path()), abs=1e-8)
    assert np.array_equal(now.broken, fresh.broken)


def test_forbidden_steps_are_not_taken():
    rng = np.random.default_rng(8)
    ladder = random_ladder(rng, rungs=4, most=4, dead=0.0, chain=0.0, least=3)
    ladder.solve()
    forbidden = []
    for _ in range(6):
        path = ladder.path()
        step = (int(path[1]), int(path[2]))
        forbidden.append(step)
        ladder.forbid([step])
        assert ladder.total(ladder.path()) == pytest.approx(brute_force(ladder, forbidden))
        assert not ladder.broken[1:].any()


def test_empty_and_single_rungs():
    offsets = np.array([0, 1, 1, 2])
    ladder = Ladder(
        offsets, np.zeros((2, 6)), np.zeros(2), np.zeros(2, int), np.zeros(3, int), np.ones(3)
    )
    ladder.solve()
    assert ladder.path().tolist() == [0, NONE, 1]
    assert ladder.broken.tolist() == [True, True, True]


@pytest.mark.parametrize("wide", [1, 7, 60])
@pytest.mark.parametrize("seed", range(10))
def test_wide_rungs_in_blocks_give_the_same(monkeypatch, seed, wide):
    rng = np.random.default_rng(seed)
    whole = random_ladder(rng, rungs=20, most=25, least=1)
    blocks = Ladder(
        whole.offsets, whole.position, whole.cost, whole.group, whole.rule, whole.weight
    )
    steps = [(int(whole.offsets[i]), int(whole.offsets[i + 1])) for i in range(3, 15)]
    paths = []
    for ladder, largest in ((whole, 10**9), (blocks, wide)):
        monkeypatch.setattr(ladder_module, "WIDE", largest)
        ladder.solve()
        ladder.forbid(steps)
        ladder.remove(ladder.path()[4:5])
        paths.append(ladder.path())
    assert np.array_equal(*paths)
    assert np.array_equal(whole.broken, blocks.broken)
    assert whole.total(paths[0]) == pytest.approx(blocks.total(paths[1]), abs=1e-12)
