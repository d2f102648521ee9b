"""Where the measuring device stands and which point of the tool it sees, both unknown."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from postproc.arrays import FloatArray
from postproc.errors import DataError
from postproc.gap.data import Samples
from postproc.gap.effect import registration_effects
from postproc.gap.robot_model import States, columns, effect_of, evaluate
from postproc.geometry import apply, inverse, rotation_about, transform
from postproc.model import Registration

_STEPS = 30
_REACH = 0.5
"""Prior of the point's place around the tool centre point [m]: decides only what no row tells."""
_FEWEST = 6


def register(samples: Samples, measured: FloatArray, given: States) -> Registration:
    """Fit the measured frame and the measured point.

    Args:
        samples: rows; their arm's point is the start.
        measured: (n, 3) points in the measured frame [m].
        given: effects that the model has already; they stay.

    Raises:
        DataError: GAP003 if there are too few rows.
    """
    if len(samples) < _FEWEST:
        raise DataError("GAP003", f"a registration needs {_FEWEST} rows, there are {len(samples)}")
    start = samples.arm.p_flange_point
    point = np.asarray(start)
    T = rigid(evaluate(samples, given)[0], measured)
    weight = np.ones(len(samples))
    rest = np.zeros(len(samples))
    for _ in range(_STEPS):
        here = _at_point(samples, point)
        p, actual = evaluate(here, given)
        r = apply(inverse(T), measured) - p
        rest = np.linalg.norm(r, axis=1)
        weight = 1.0 / np.maximum(rest / (2.0 * np.median(rest) + 1e-9), 1.0)
        shift, turn, moved = _step(actual, r, weight, start - point)
        T = T @ transform(
            rotation_about(turn / (np.linalg.norm(turn) + 1e-30), np.linalg.norm(turn)), shift
        )
        point = point + moved
        if max(np.linalg.norm(shift), np.linalg.norm(moved), np.linalg.norm(turn)) < 1e-9:
            break
    return Registration(T, point, float(np.sqrt(np.mean(rest**2))))


def in_robroot(registration: Registration, measured: FloatArray) -> FloatArray:
    """Return measured points (n, 3) in axes of the robot root [m]."""
    return apply(inverse(registration.T_measured_robroot), measured)


def moved_by(registration: Registration, states: States) -> Registration:
    """Return a registration that takes in what was fitted of its frames."""
    for name, state in states.items():
        registration = effect_of(name).registered(registration, state.theta)
    return registration


def _at_point(samples: Samples, point: FloatArray) -> Samples:
    return replace(samples, arm=replace(samples.arm, p_flange_point=point)).at(samples.q)


def _step(
    samples: Samples, r: FloatArray, weight: FloatArray, to_start: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return the next shift, turn of the frame and move of the point."""
    parts = [columns(samples, effect_of(n).basis(samples, {})) for n in registration_effects()]
    root = np.sqrt(weight)[:, None, None]
    A = (np.concatenate(parts, axis=2) * root).reshape(-1, 9)
    scale = float(np.median(np.abs(r))) + 1e-9
    H = A.T @ A
    g = A.T @ (r * root[:, :, 0]).ravel()
    hold = (scale / _REACH) ** 2
    H[6:, 6:] += hold * np.eye(3)
    g[6:] += hold * to_start
    H += 1e-12 * np.trace(H) / 9.0 * np.eye(9)
    step: FloatArray = np.asarray(np.linalg.solve(H, g))
    return step[:3], step[3:6], step[6:]


def rigid(points: FloatArray, measured: FloatArray) -> FloatArray:
    """Return the rigid motion (4, 4) that takes points (n, 3) to measured ones (Kabsch 1976)."""
    a, b = points.mean(axis=0), measured.mean(axis=0)
    u, _, vt = np.linalg.svd((points - a).T @ (measured - b))
    sign = np.diag([1.0, 1.0, float(np.sign(np.linalg.det(u @ vt)))])
    R = (u @ sign @ vt).T
    return transform(R, b - R @ a)
