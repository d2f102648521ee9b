"""What every objective must keep: a number per state, the same whatever stands beside it.

The planner evaluates states in portions of its own choice and adds the values up with weights: an
objective whose value depends on the portion would change programs without a cause.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.planning import Objective, StateContext
from postproc.testing.contract import require
from postproc.testing.made import made_states

Check = Callable[[Objective, StateContext], None]
_CLOSE = 1e-7
_SAME_POSE = (
    np.array([0.0, 0.0, 0.0, 2.0 * np.pi, 0.0, 0.0]),
    np.array([0.0, 0.0, 0.0, 0.0, 0.0, -2.0 * np.pi]),
)
"""Added to the joints [rad], they leave the tool where it is."""


def check_values(objective: Objective, states: StateContext) -> None:
    """It gives one finite number per state, twice the same, also for no state at all."""
    before = {name: np.array(getattr(states, name)) for name in ("q", "spin", "tag", "normal")}
    values = objective(states)
    require(
        isinstance(values, np.ndarray) and values.shape == (len(states.q),),
        "the objective",
        "it does not give one number per state",
    )
    _require(bool(np.isfinite(values).all()), "it gives numbers that are not finite")
    _require(_same(objective(states), values), "it gives other numbers the second time")
    same = all(np.array_equal(getattr(states, name), kept) for name, kept in before.items())
    _require(same, "it changes the states that it looks at")
    _require(objective(_rows(states, np.arange(0))).shape == (0,), "it fails without any state")


def check_independence(objective: Objective, states: StateContext) -> None:
    """What a state is worth does not depend on the states that it is asked with, or their order."""
    values = objective(states)
    order = np.random.default_rng(3).permutation(len(values))
    _require(
        _same(objective(_rows(states, order)), values[order]),
        "the order of the states changes their values",
    )
    alone = np.concatenate([objective(_rows(states, order[k : k + 1])) for k in range(4)])
    _require(_same(alone, values[order[:4]]), "a state alone is worth something else")


def check_stiffness(objective: Objective, states: StateContext) -> None:
    """An index of stiffness is above zero and grows in proportion to the joint stiffness.

    A cost needs no joint stiffness.
    """
    if not objective.is_stiffness:
        values = objective(replace(states, c_joint=None))
        _require(_same(values, objective(states)), "a cost depends on joint stiffness")
        return
    values = objective(states)
    _require(bool((values > 0.0).all()), "an index of stiffness is not above zero")
    softer = objective(replace(states, c_joint=2.0 * np.asarray(states.c_joint)))
    _require(_same(2.0 * softer, values), "half the joint stiffness does not halve the index")


def check_pose(objective: Objective, states: StateContext) -> None:
    """A cost that says that it depends on the pose alone does not see turns of the joints."""
    if not objective.is_of_pose:
        return
    _require(not objective.is_stiffness, "it says that it is of the pose, and an index as well")
    for turn in _SAME_POSE:
        turned = objective(replace(states, q=states.q + turn))
        _require(_same(turned, objective(states)), "turns of the joints change a cost of the pose")


CHECKS: tuple[Check, ...] = (check_values, check_independence, check_stiffness, check_pose)
"""All that is asked of an objective."""


def check_objective(objective: Objective, states: StateContext | None = None) -> None:
    """Hold an objective to its contract.

    Args:
        objective: the part that the entry point names.
        states: with joint stiffness and a process force; default: made-up ones.

    Raises:
        PluginError: PLG004 with what it breaks.
    """
    require(isinstance(objective, Objective), "the objective", "it is no Objective")
    for check in CHECKS:
        check(objective, made_states() if states is None else states)


def _rows(states: StateContext, index: np.ndarray) -> StateContext:
    """Return some of the states."""
    count = len(states.q)
    picked = {}
    for column in fields(states):
        values = getattr(states, column.name)
        if column.init and isinstance(values, np.ndarray) and len(values) == count:
            picked[column.name] = values[index]
    return replace(states, **picked)


def _same(first: FloatArray, second: FloatArray) -> bool:
    return first.shape == second.shape and bool(np.allclose(first, second, rtol=_CLOSE, atol=1e-9))


def _require(good: bool, reason: str) -> None:
    require(good, "the objective", reason)
