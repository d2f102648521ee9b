"""Wishes about the pose: away from limits and singular poses, near the reference spin, upright."""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.kinematics import smallest_singular_value, wrist_distance
from postproc.planning.states.costs import TRAVEL_UNIT, StateContext, objective
from postproc.units import DEG, TURN

AMPLE = 7.0 * DEG
"""Margin [rad] to limits and straight wrist of which more is not better."""
WELL_CONDITIONED = 0.3
"""Smallest singular value of the Jacobian (metres per radian) that counts as far from singular."""


@objective("limits")
def limits(context: StateContext) -> FloatArray:
    """Return the mean over the joints of (distance from mid range / half range)^4, 1 at a limit."""
    low, high = np.asarray(context.kinematics.q_min), np.asarray(context.kinematics.q_max)
    share = (context.q - 0.5 * (low + high)) / (0.5 * (high - low))
    return np.asarray((share**4).mean(axis=1))


@objective("margin")
def margin(context: StateContext) -> FloatArray:
    """Return the sum of (1 - margin / ``AMPLE``)^2 over limits and straight wrist within ``AMPLE``.

    The margin counts beyond what the cell keeps anyway: 1 for standing at a limit that it allows.
    """
    kinematics, kept = context.kinematics, context.cell.limits
    low, high = (np.asarray(end)[:, None] for end in (kinematics.q_min, kinematics.q_max))
    q = np.ascontiguousarray(context.q.T)
    free = q - low
    np.minimum(free, high - q, out=free)
    free -= kept.joint_margin
    wrist = wrist_distance(kinematics, context.q) - kept.singularity
    return np.asarray(_lack(free).sum(axis=0) + _lack(wrist))


def _lack(free: FloatArray) -> FloatArray:
    """Return (1 - margin / ``AMPLE``)^2 of margins [rad] within ``AMPLE``, in their place."""
    free /= -AMPLE
    free += 1.0
    np.maximum(free, 0.0, out=free)
    free *= free
    return free


@objective("measured")
def measured(context: StateContext) -> FloatArray:
    """Return how much more the tool may be off than where a model of the arm was measured.

    The log of the ratio of what is left after compensation: 0 inside and without a model.
    """
    doubt = context.cell.model_doubt
    return np.zeros(len(context.q)) if doubt is None else doubt(context.q)


@objective("wrist")
def wrist(context: StateContext) -> FloatArray:
    """Return the squares of A4 and A6 off the middle of their limits, in half turns."""
    middle = 0.5 * (np.asarray(context.kinematics.q_min) + np.asarray(context.kinematics.q_max))
    a4, a6 = ((context.q[:, axis] - middle[axis]) / np.pi for axis in (3, 5))
    return np.asarray(a4**2 + a6**2)


@objective("singularity")
def singularity(context: StateContext) -> FloatArray:
    """Return 0 for a bent wrist and a well conditioned arm, 1 at a singular pose."""
    wrist = 1.0 - np.sin(wrist_distance(context.kinematics, context.q))
    p_flange_tcp = np.asarray(context.cell.tool.T_flange_tcp)[:3, 3]
    smallest = smallest_singular_value(context.kinematics, context.q, p_flange_tcp)
    arm = 1.0 - np.minimum(smallest / WELL_CONDITIONED, 1.0)
    return np.asarray(0.5 * wrist + 0.5 * arm)


@objective("spin")
def spin(context: StateContext) -> FloatArray:
    """Return the squared spin against the reference, in units of 10 degrees."""
    off = np.mod(context.spin + np.pi, TURN) - np.pi
    return np.asarray((off / TRAVEL_UNIT) ** 2)


@objective("tilt", is_of_pose=True)
def tilt(context: StateContext) -> FloatArray:
    """Return the squared angle of the tool axis to that of the CAM data, in units of 10 degrees."""
    if context.tilt is None:
        return np.zeros(len(context.q))
    return np.asarray((context.tilt / TRAVEL_UNIT) ** 2)
