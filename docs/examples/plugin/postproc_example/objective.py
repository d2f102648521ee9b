"""An objective: the shoulder low, so that the arm stands compact under the hall's crane.

What an objective owes: one number per state, the same whatever states are evaluated beside it.
``postproc.testing.check_objective`` holds it to that.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.planning import Objective, StateContext

A2 = 1


def arm_height(context: StateContext) -> FloatArray:
    """Return the squared angle [rad^2] of A2 above the horizontal, a cost: lower is better."""
    return np.asarray(np.minimum(context.q[:, A2], 0.0) ** 2)


LOW_ARM = Objective(arm_height)
