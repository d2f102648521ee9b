"""The best way whose states and steps are free, checking as little as possible (LazySP).

Checking whether a state collides costs a thousand times more than its place in the search. So
the search runs as if nothing collided, only the best way is checked, what fails is taken out,
and the search is repaired, near by first; when the best way passes and nothing is left to repair,
it is the best of all ways that pass. States beside a failing one are checked along with it, because
the next best way mostly runs there.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from postproc.arrays import NONE, BoolArray, IndexArray, members
from postproc.ladder.ladder import Ladder
from postproc.records import dataclass

CheckStates = Callable[[IndexArray], BoolArray]
CheckSteps = Callable[[IndexArray, IndexArray], BoolArray]
Beside = Callable[[IndexArray], IndexArray]
Steps = list[tuple[int, int]]
Failing = Callable[[Steps], Steps]
Widen = Callable[[Steps, Failing], Steps]


@dataclass(frozen=True, slots=True)
class Found:
    """The best free way: state (n,) of every rung or ``NONE``, and how much work it was."""

    path: IndexArray
    rounds: int
    checked: int
    forbidden: int


def free_path(
    ladder: Ladder,
    check_states: CheckStates,
    check_steps: CheckSteps | None = None,
    beside: Beside | None = None,
    widen: Widen | None = None,
    is_passing: Callable[[], bool] | None = None,
) -> Found:
    """Return the cheapest way of which every state and every step passes its check.

    Args:
        ladder: the graph; failing states and steps are taken out of it.
        check_states: states (m,) -> (m,) whether each passes; asked once for each state.
        check_steps: states from (m,), to (m,) -> (m,) whether each step passes; asked for the
            unbroken steps of ways whose states all pass, once for each.
        beside: failing states (m,) -> further states known to fail, in any order.
        widen: failing steps, and what returns those of some steps that fail -> further steps that
            fail, from a look at those that the search would try next.
        is_passing: whether the way that passes need not be the best, as the graph will change.

    Every round takes states or steps out, so there is an end; a rung into which no step is left is
    cut off from those before (``ladder.broken``).
    """
    if not ladder.solved:
        ladder.solve()
    known = np.zeros(len(ladder.position), dtype=np.bool_)
    passed: set[tuple[int, int]] = set()
    rounds = forbidden = 0
    while True:
        rounds += 1
        path = ladder.path()
        failing = _check(path[path != NONE], known, check_states)
        if len(failing):
            if beside is not None:
                failing = members(np.concatenate([failing, beside(failing)]), len(known))
                known[failing] = True
            ladder.remove(failing)
            continue
        bad = [] if check_steps is None else _bad_steps(ladder, path, passed, check_steps)
        is_final = is_passing is None or not is_passing()
        if not bad and is_final and ladder.settle():
            continue
        if not bad or check_steps is None:
            return Found(path, rounds, int(known.sum()), forbidden)
        if widen is not None:
            failing_of = partial(_failing_steps, passed=passed, check=check_steps)
            bad = sorted({*bad, *widen(bad, failing_of)})
        forbidden += len(bad)
        ladder.forbid(bad)


def _check(states: IndexArray, known: BoolArray, check: CheckStates) -> IndexArray:
    """Check the states not known yet; return those that fail."""
    todo = states[~known[states]]
    if not len(todo):
        return todo
    known[todo] = True
    return todo[~check(todo)]


def _bad_steps(
    ladder: Ladder, path: IndexArray, passed: set[tuple[int, int]], check: CheckSteps
) -> Steps:
    joined = (path[1:] != NONE) & (path[:-1] != NONE) & ~ladder.broken[1:]
    pairs = zip(path[:-1][joined].tolist(), path[1:][joined].tolist(), strict=True)
    return _failing_steps(list(pairs), passed, check)


def _failing_steps(steps: Steps, passed: set[tuple[int, int]], check: CheckSteps) -> Steps:
    todo = [step for step in steps if step not in passed]
    if not todo:
        return []
    ends = np.array(todo)
    good = check(ends[:, 0], ends[:, 1])
    passed.update(pair for pair, fine in zip(todo, good.tolist(), strict=True) if fine)
    return [pair for pair, fine in zip(todo, good.tolist(), strict=True) if not fine]
