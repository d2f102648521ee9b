"""What is left after the fit: is it noise, and if not, what does it depend on.

Every test asks whether the residual follows smooth functions of one column, as a shift in space
or as a turn of a joint, by more than as many functions of anything would take of white noise.
"""

from __future__ import annotations

from math import erfc, sqrt

import numpy as np

from postproc.arrays import BoolArray, FloatArray
from postproc.gap.data import Samples, column_functions
from postproc.gap.fit import Projection
from postproc.records import dataclass

_NEAREST = 4
"""Neighbours of a pose that its residual is held against."""
_LEAST = 1e-12
"""Probability below which none is told."""


@dataclass(frozen=True, slots=True)
class Dependence:
    """One test: name of the condition, p-value, and how much of the residual follows it [m].

    ``rms`` is the 3D root mean square of the part that follows the condition beyond chance.
    ``logged``: a column of the file beside the pose.
    """

    name: str
    p_value: float
    rms: float
    logged: bool = False


def dependences(
    samples: Samples,
    residual: FloatArray,
    weight: FloatArray,
    context: Projection,
    free: float,
) -> tuple[Dependence, ...]:
    """Return the tests of every condition, clearest first.

    Args:
        samples: rows.
        residual: (n, 3) [m] of the final fit.
        weight: (n,) 1/sigma [1/m], 0 for rows left out.
        context: blocks of the fit; what they can imitate is taken out of the test functions.
        free: degrees of freedom of the residual.
    """
    found, poses = [], _of_pose(samples)
    for name, functions in (poses | _of_columns(samples)).items():
        is_per_joint = name in ("approach", "speed")
        test = _test(samples, residual, weight, context, functions, is_per_joint, free)
        if test is not None:
            found.append(Dependence(name, *test, name not in poses))
    found.append(_neighbours(samples, residual, weight > 0))
    return tuple(sorted(found, key=lambda d: (d.p_value, -d.rms, d.name)))


def _of_pose(samples: Samples) -> dict[str, FloatArray]:
    """Return functions (n, k) of the pose by name."""
    found: dict[str, FloatArray] = {}
    for i in range(6):
        q = samples.q[:, i]
        if np.ptp(q) > 1e-6:
            found[f"q{i + 1}"] = np.column_stack(
                [np.cos(q), np.sin(q), np.cos(2 * q), np.sin(2 * q)]
            )
    place = (samples.point - samples.point.mean(axis=0)) / (np.std(samples.point) + 1e-9)
    found["position"] = np.column_stack([place, place**2, place[:, :1] * place[:, 1:]])
    return found


def _of_columns(samples: Samples) -> dict[str, FloatArray]:
    """Return functions (n, k) of each column that was logged; per-joint ones give one a joint."""
    found: dict[str, FloatArray] = {}
    if samples.direction is not None and np.any(samples.direction):
        found["approach"] = samples.direction
    if samples.qd is not None and np.any(samples.qd):
        found["speed"] = samples.qd / np.std(samples.qd)
    if samples.wrench is not None and np.any(samples.wrench):
        force = samples.wrench[:, :3]
        size = np.linalg.norm(force, axis=1, keepdims=True)
        scale = np.std(force) + 1e-9
        found["load"] = np.column_stack([force, force * size / scale, size]) / scale
    for name, values in (("time", samples.course), ("temperature", samples.temperature)):
        if values is not None and np.ptp(values) > 0:
            found[name] = column_functions(values)
    extra = {name: column_functions(values) for name, values in samples.extra.items()}
    return {name: functions for name, functions in (found | extra).items() if functions.size}


def _test(
    samples: Samples,
    residual: FloatArray,
    weight: FloatArray,
    context: Projection,
    functions: FloatArray,
    is_per_joint: bool,
    free: float,
) -> tuple[float, float] | None:
    """Return the probability by chance of what the residual follows, and its 3D rms [m]."""
    from scipy.special import fdtrc

    use = weight > 0
    Z = _columns(samples, functions, is_per_joint)
    Z = context.residual_of((Z * weight[:, None, None]).reshape(-1, Z.shape[2]))
    Z = Z.reshape(len(samples), 3, -1)[use].reshape(3 * int(use.sum()), -1)
    u, s, _ = np.linalg.svd(Z, full_matrices=False)
    u = u[:, s > 1e-6 * s[0]] if len(s) and s[0] > 0 else u[:, :0]
    k = u.shape[1]
    if k == 0 or k > 0.5 * free:
        return None
    rest = (residual * weight[:, None])[use].ravel()
    seen = float(np.sum((u.T @ rest) ** 2))
    chance = max(float(rest @ rest) - seen, 0.0) / (free - k)
    p = max(float(fdtrc(k, free - k, seen / k / max(chance, 1e-300))), _LEAST)
    excess = max(seen - k * chance, 0.0)
    return p, float(np.sqrt(excess / use.sum()) / np.median(weight[use]))


def _columns(samples: Samples, functions: FloatArray, per_joint: bool) -> FloatArray:
    """Return (n, 3, m): functions as shifts along x, y, z and as turns of each joint."""
    J = samples.jacobian / (np.sqrt(np.mean(samples.jacobian**2)) + 1e-9)
    if per_joint:
        own = J * functions[:, None, :]
        gravity = np.abs(np.sin(samples.q))
        return np.concatenate([own, own * gravity[:, None, :]], axis=2)
    n, k = functions.shape
    shifts = np.einsum("ij,nk->nijk", np.eye(3), functions).reshape(n, 3, 3 * k)
    turns = np.einsum("nij,nk->nijk", J, functions).reshape(n, 3, 6 * k)
    return np.concatenate([shifts, turns], axis=2)


def _neighbours(samples: Samples, residual: FloatArray, use: BoolArray) -> Dependence:
    """Test whether neighbours in joint space have like residuals (Moran 1950, Biometrika 37)."""
    rows = np.flatnonzero(use)
    rest = residual[rows]
    q = samples.q[rows]
    feature = np.concatenate([np.cos(q), np.sin(q)], axis=1) * np.array([2, 2, 2, 1, 1, 0.3] * 2)
    square = np.sum(feature**2, axis=1)
    distance = square[:, None] + square - 2.0 * feature @ feature.T
    np.fill_diagonal(distance, np.inf)
    distance[distance < 1e-9] = np.inf
    near = np.argpartition(distance, _NEAREST, axis=1)[:, :_NEAREST]
    W = np.zeros_like(distance)
    np.put_along_axis(W, near, 1.0 / _NEAREST, axis=1)
    seen = float(np.sum(rest * (W @ rest)))
    scatter = rest.T @ rest / len(rows)
    chance = float(np.sum(scatter**2) * np.sum(W * (W + W.T)))
    return Dependence(
        "neighbouring poses",
        max(0.5 * erfc(seen / sqrt(2.0 * max(chance, 1e-300))), _LEAST),
        float(np.sqrt(max(seen, 0.0) / len(rows))),
    )
