"""Checking lazily finds the same cost as checking everything first."""

from __future__ import annotations

import numpy as np
import pytest

from postproc.ladder import NONE, Ladder, free_path
from tests.ladder.test_ladder import random_ladder


def copy(ladder):
    return Ladder(
        ladder.offsets, ladder.position, ladder.cost, ladder.group, ladder.rule, ladder.weight
    )


@pytest.mark.parametrize("share", [0.02, 0.4])
@pytest.mark.parametrize("seed", range(25))
def test_lazy_equals_eager(seed, share):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=30, most=20, dead=0.05, chain=0.4, least=5)
    bad = rng.uniform(size=len(ladder.position)) < share
    eager = copy(ladder)
    eager.cost[bad] = np.inf
    eager.solve()
    asked = []

    def check(states):
        asked.extend(states.tolist())
        return ~bad[states]

    found = free_path(ladder, check)
    assert ladder.total(found.path) == pytest.approx(eager.total(eager.path()), abs=1e-9)
    assert np.array_equal(ladder.broken, eager.broken)
    assert len(asked) == len(set(asked)) == found.checked
    assert not bad[found.path[found.path != NONE]].any()


@pytest.mark.parametrize("seed", range(10))
def test_known_failures_change_the_work_not_the_answer(seed):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=30, most=20, dead=0.05, chain=0.4, least=5)
    bad = rng.uniform(size=len(ladder.position)) < 0.3
    plain, told = copy(ladder), copy(ladder)
    one = free_path(plain, lambda s: ~bad[s])
    two = free_path(told, lambda s: ~bad[s], beside=lambda s: np.nonzero(bad)[0][:: 1 + len(s)])
    assert plain.total(one.path) == pytest.approx(told.total(two.path), abs=1e-9)
    assert two.rounds <= one.rounds


@pytest.mark.parametrize("seed", range(20))
def test_failing_steps_are_avoided(seed):
    rng = np.random.default_rng(seed)
    ladder = random_ladder(rng, rungs=8, most=6, dead=0.0, chain=0.0, least=3)
    verdict = rng.uniform(size=(len(ladder.position),) * 2) > 0.3
    # Oracle: the same graph with one state for each (state before, state) pair is not needed;
    # plain dynamic programming over explicit edges will do.
    best = ladder.cost[: ladder.offsets[1]].copy()
    for i in range(1, len(ladder)):
        before = np.arange(ladder.offsets[i - 1], ladder.offsets[i])
        now = np.arange(ladder.offsets[i], ladder.offsets[i + 1])
        leap = ladder.position[now][:, None] - ladder.position[before][None]
        step = ladder.weight[i] * (leap**2).sum(-1)
        step[~verdict[before][:, now].T] = np.inf
        best = (best[None, :] + step).min(axis=1) + ladder.cost[now]
    found = free_path(ladder, lambda s: np.ones(len(s), bool), lambda a, b: verdict[a, b])
    if np.isfinite(best.min()):
        assert ladder.total(found.path) == pytest.approx(best.min(), abs=1e-9)
    else:
        assert ladder.broken[1:].any()


def test_a_rung_into_which_too_many_steps_fail_is_given_up(monkeypatch):
    """All steps into one rung fail: so many are tried, and no more."""
    monkeypatch.setattr("postproc.ladder.graph.MOST_FAILING", 10)
    rng = np.random.default_rng(4)
    ladder = random_ladder(rng, rungs=4, most=9, dead=0.0, chain=0.0, least=8)
    tried = []

    def check(before, after):
        into = ladder.rung_of(after) == 2
        tried.extend(after[into].tolist())
        return ~into

    found = free_path(ladder, lambda s: np.ones(len(s), bool), check)
    assert len(tried) == 10
    assert ladder.is_given_up(2)
    assert ladder.broken[2]
    assert not ladder.broken[[1, 3]].any()
    assert (found.path != NONE).all()
