"""Wishes about the joints: away from limits, away from singular poses, near the reference spin."""

from __future__ import annotations

import numpy as np

from postproc.model.arrays import FloatArray
from postproc.planning.costs import REGISTRY, TRAVEL_UNIT, StateContext


@REGISTRY.register("limits")
class LimitDistance:
    """Mean over the joints of (distance from mid range / half range)^4: 0 in the middle."""

    is_stiffness = False

    def __call__(self, context: StateContext) -> FloatArray:
        """Return (N,) costs, 1 with all joints at a limit."""
        low, high = np.asarray(context.cell.robot.q_min), np.asarray(context.cell.robot.q_max)
        share = (context.q - 0.5 * (low + high)) / (0.5 * (high - low))
        return np.asarray((share**4).mean(axis=1))


@REGISTRY.register("singularity")
class SingularityDistance:
    """Badness of the wrist and of the arm: 1 - |sin A5| and 1 - sigma_min/scale, averaged."""

    is_stiffness = False

    def __call__(self, context: StateContext) -> FloatArray:
        """Return (N,) costs between 0 and 1."""
        wrist = 1.0 - np.abs(np.sin(context.q[:, 4]))
        J = np.array(context.jacobian)
        J[:, :3] /= np.linalg.norm(J[:, :3], axis=(1, 2), keepdims=True)
        smallest = np.linalg.svd(J, compute_uv=False)[:, -1]
        return np.asarray(0.5 * wrist + 0.5 * (1.0 - np.minimum(smallest / 0.3, 1.0)))


@REGISTRY.register("spin")
class SpinDistance:
    """Squared turn about the tool axis against the reference, in units of 10 degrees."""

    is_stiffness = False

    def __call__(self, context: StateContext) -> FloatArray:
        """Return (N,) costs."""
        turn = np.mod(context.spin + np.pi, 2.0 * np.pi) - np.pi
        return np.asarray((turn / TRAVEL_UNIT) ** 2)
