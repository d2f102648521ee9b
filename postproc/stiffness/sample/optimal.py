"""Choosing the postures that tell most: D-optimal subsets for a model and the possible loads.

The unknowns are the relative compliances of a model (constant, per cell, or weights of a smooth
function of the joint angles) with a Gaussian prior; the value of a set of postures is the fall of
the log determinant of their covariance. It has diminishing returns, so the greedy choice is within
63 % of the best, and a posture's stale gain bounds its true one: few have to be looked at again.
"""

from __future__ import annotations

import heapq

import numpy as np

from postproc.arrays import FloatArray, IntArray
from postproc.errors import StiffnessError
from postproc.stiffness.field import Grid, kernel
from postproc.units import DEG

LENGTH = 60.0 * DEG
"""Kernel length [rad] that is expected of joint stiffness before anything was measured."""
AMPLITUDE = 0.5
"""Expected sd of the logarithm of a compliance over the workspace."""
_CENTRES = 80


def features(model: str, q: FloatArray, points: FloatArray, grid: Grid | None = None) -> FloatArray:
    """Return features (n, f) whose weights are unknowns of sd 1 for each joint.

    Args:
        model: ``constant``, ``grid`` or ``continuous``.
        q: (n, 6) candidate postures [rad].
        points: (n, 3) their tool points [m].
        grid: for ``grid``.

    Raises:
        StiffnessError: STF023 for another model.
    """
    ones = np.ones((len(q), 1))
    if model == "constant":
        return ones
    if model == "grid" and grid is not None:
        cells, counts = grid.touching(points)
        own = np.zeros((len(q), len(grid)))
        share = counts / counts.sum(axis=1, keepdims=True)
        np.add.at(own, (np.arange(len(q))[:, None], cells), share)
        return np.hstack([ones, AMPLITUDE * own])
    if model == "continuous":
        step = max(len(q) // _CENTRES, 1)
        centres = q[::step][:_CENTRES]
        lengths = np.full(6, LENGTH)
        K = kernel(centres, centres, lengths) + 1e-6 * np.eye(len(centres))
        smooth = np.linalg.solve(np.linalg.cholesky(K), kernel(q, centres, lengths).T).T
        return np.hstack([ones, AMPLITUDE * smooth])
    raise StiffnessError("STF023", f"no measuring plan for the model {model!r}")


def choose(A: FloatArray, P: FloatArray, c_ref: FloatArray, sigma: float, count: int) -> IntArray:
    """Return the postures (count,) that tell most, the most telling first.

    Args:
        A: (n, m, 6) regressors of the m readings of each posture (3 for each load).
        P: (n, f) features.
        c_ref: (6,) expected compliances.
        sigma: sd of a reading [m].
        count: how many.
    """
    scaled = A * (c_ref / sigma)
    n, _, joints = scaled.shape
    S = np.eye(joints * P.shape[1])

    def rows(i: int) -> FloatArray:
        wide = scaled[i][:, :, None] * P[i]
        return np.asarray(wide.reshape(scaled.shape[1], -1))

    def gain(i: int) -> float:
        X = rows(i)
        return float(np.linalg.slogdet(np.eye(len(X)) + X @ S @ X.T)[1])

    # (minus gain, index, step at which it was computed)
    queue = [(-gain(i), i, 0) for i in range(n)]
    heapq.heapify(queue)
    chosen: list[int] = []
    while queue and len(chosen) < count:
        _, i, when = heapq.heappop(queue)
        if when < len(chosen):
            heapq.heappush(queue, (-gain(i), i, len(chosen)))
            continue
        chosen.append(i)
        X = rows(i)
        SX = S @ X.T
        S = S - SX @ np.linalg.solve(np.eye(len(X)) + X @ SX, SX.T)
    return np.asarray(chosen, dtype=np.int32)
