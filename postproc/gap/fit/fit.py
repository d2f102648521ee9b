"""The joint nonlinear fit: all chosen effects at once, most probable numbers with intervals."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Arm, Samples
from postproc.gap.effect import Effect, Parameter, Setting, State
from postproc.gap.robot_model import States, columns, effect_of, evaluate
from postproc.records import dataclass

_STEPS = 6
_UNSEEN = 0.9
"""A number whose interval the data shrank by less than a tenth was not seen."""


@dataclass(frozen=True, slots=True)
class Free:
    """An effect to fit: its setting, how far its prior is widened, and where it starts.

    ``widen``: of all numbers or of each (p,) of unit prior.
    """

    setting: Setting
    widen: float | FloatArray = 1.0
    start: FloatArray | None = None


@dataclass(frozen=True, slots=True)
class Fit:
    """Result: states of all effects (given and fitted), in SI.

    covariance: (p, p) of the fitted numbers; slices: effect to its part; unseen: (p,) numbers
    that the data say nothing about; point: (n, 3) fitted points [m].
    """

    states: dict[str, State]
    theta: FloatArray
    covariance: FloatArray
    slices: dict[str, slice]
    parameters: tuple[Parameter, ...]
    unseen: BoolArray
    point: FloatArray

    def deviation(self, name: str) -> FloatArray:
        """Return the standard deviations (p,) of an effect's numbers."""
        part = self.slices[name]
        return np.sqrt(np.diag(self.covariance)[part])


def fit(
    samples: Samples,
    measured: FloatArray,
    weight: FloatArray,
    given: States,
    free: Mapping[str, Free],
) -> Fit:
    """Return the most probable numbers of the free effects.

    Gauss-Newton on the exact forward model, a Gaussian prior of the typical size around what the
    given model has (zero without one), bounds kept by an active set.

    Args:
        samples: rows.
        measured: (n, 3) measured points [m], robroot.
        weight: (n,) 1/sigma [1/m]; 0 leaves a row out; or (n, 3, 3) roots of the weight of rows.
        given: states that the model has already; those not free stay as they are.
        free: effects to fit.
    """
    effects = [(effect_of(name), options) for name, options in free.items()]
    parameters, slices, root, mean = layout(samples, given, effects)
    width = np.diag(root)
    # bounds hold where numbers are independent
    lower, upper = np.array([(p.lower, p.upper) for p in parameters]).reshape(-1, 2).T
    theta = mean.copy()
    for effect, options in effects:
        if options.start is not None:
            theta[slices[effect.name]] = options.start
    theta = np.clip(theta, lower, upper)
    H = np.eye(len(width))
    for _ in range(_STEPS if effects else 0):
        states = dict(given) | _states(theta, effects, slices)
        point, actual = evaluate(samples, states)
        X = columns_of_all(actual, effects) @ root
        A = weighed(X, weight).reshape(-1, X.shape[2])
        r = weighed(measured - point, weight).ravel()
        H = A.T @ A + np.eye(len(width))
        gradient = A.T @ r + np.linalg.solve(root, mean - theta)
        step = _bounded(H, gradient, (lower - theta) / width, (upper - theta) / width)
        theta = theta + root @ step
        if np.max(np.abs(step), initial=0.0) < 1e-4:
            break
    covariance = root @ np.linalg.inv(H) @ root.T
    unseen = np.sqrt(np.diag(covariance)) > _UNSEEN * np.sqrt(np.diag(root @ root.T))
    states = dict(given) | _states(theta, effects, slices)
    point = evaluate(samples, states)[0]
    return Fit(states, theta, covariance, slices, parameters, unseen, point)


def unit_root(effect: Effect, arm: Arm, setting: Setting) -> FloatArray:
    """Return the matrix (p, p) that makes an effect's numbers of independent standard normals."""
    root = effect.correlation_root(setting)
    typical = np.array([p.typical for p in effect.parameters(arm, setting)])
    return np.asarray(np.diag(typical) if root is None else typical[:, None] * root)


def variance(samples: Samples, fitted: Fit) -> FloatArray:
    """Return how unsure noise makes the fitted points of rows: sum over the axes (n,) [m²].

    Effects that were fitted and are no longer in the states do not count.
    """
    names = [name for name in fitted.slices if name in fitted.states]
    every = np.arange(len(fitted.theta))
    index = np.concatenate([every[:0], *(every[fitted.slices[name]] for name in names)])
    free = [(effect_of(name), Free(fitted.states[name].setting)) for name in names]
    X = columns_of_all(evaluate(samples, fitted.states)[1], free)
    C = fitted.covariance[np.ix_(index, index)]
    return np.asarray(np.einsum("nap,pq,naq->n", X, C, X, optimize=True))


def weighed(values: FloatArray, weight: FloatArray) -> FloatArray:
    """Return values (n, 3) or (n, 3, p) times the weights (n,) or their roots (n, 3, 3)."""
    if weight.ndim == 1:
        return values * weight.reshape(-1, *[1] * (values.ndim - 1))
    return np.asarray(np.einsum("nij,nj...->ni...", weight, values, optimize=True))


def layout(
    samples: Samples, given: States, effects: list[tuple[Effect, Free]]
) -> tuple[tuple[Parameter, ...], dict[str, slice], FloatArray, FloatArray]:
    """Return parameters, slices, the root (p, p) of the prior covariance, and its mean (p,)."""
    parameters: list[Parameter] = []
    slices: dict[str, slice] = {}
    roots: list[FloatArray] = []
    mean: list[FloatArray] = []
    for effect, options in effects:
        own = effect.parameters(samples.arm, options.setting)
        slices[effect.name] = slice(len(parameters), len(parameters) + len(own))
        parameters += own
        roots.append(unit_root(effect, samples.arm, options.setting) * options.widen)
        known = given.get(effect.name)
        same = known is not None and len(known.theta) == len(own)
        mean.append(np.nan_to_num(known.theta) if known and same else np.zeros(len(own)))
    root = np.zeros((len(parameters), len(parameters)))
    for part, block in zip(slices.values(), roots, strict=True):
        root[part, part] = block
    return tuple(parameters), slices, root, np.concatenate([np.zeros(0), *mean])


def _states(
    theta: FloatArray, effects: list[tuple[Effect, Free]], slices: dict[str, slice]
) -> dict[str, State]:
    return {e.name: State(theta[slices[e.name]].copy(), o.setting) for e, o in effects}


def columns_of_all(samples: Samples, effects: list[tuple[Effect, Free]]) -> FloatArray:
    """Return the columns (n, 3, p) of effects, per unit of their numbers."""
    parts = [columns(samples, e.basis(samples, o.setting)) for e, o in effects]
    return np.concatenate(parts, axis=2) if parts else np.zeros((len(samples), 3, 0))


def _bounded(H: FloatArray, g: FloatArray, low: FloatArray, high: FloatArray) -> FloatArray:
    """Return the step that minimises the quadratic with low <= step <= high."""
    step = np.zeros(len(g))
    held = np.zeros(len(g), dtype=bool)
    for _ in range(len(g) + 1):
        open_ = ~held
        if not np.any(open_):
            break
        right = g[open_] - H[np.ix_(open_, held)] @ step[held]
        step[open_] = np.linalg.solve(H[np.ix_(open_, open_)], right)
        out = open_ & ((step < low - 1e-12) | (step > high + 1e-12))
        if not np.any(out):
            break
        step[out] = np.clip(step[out], low[out], high[out])
        held |= out
    return step
