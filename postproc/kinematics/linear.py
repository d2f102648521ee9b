"""Joints near a pose as linear functions of the pose, and a proven bound of what that leaves out.

Let the TCP go straight from a pose, s -> (p + s v, exp(s w) R) with 0 <= s <= 1: its velocity is
x = (v, w) all along, and the joints obey J(q(s)) q' = x. With q' = inv(J) x at the start kept, they
end off by d = -inv(J) times the integral of (J(q(s)) - J) q'. Let |q'_j| <= g_j on the way. The
second derivative of the TCP by joints i <= j is no longer than the lever of axis j on the way,
R_j = r_j + sum over m > j of g_m r_m, and the axis of joint j turns no more than the joints before
it, so that the integral is no longer than

    P = 1/2 sum over j of g_j R_j (g_j + 2 sum over i < j of g_i)   [m],
    W = 1/2 sum over j of g_j sum over i < j of g_i                 [rad],

and |d_k| <= e_k(g) = |inv(J)_k,linear| P + |inv(J)_k,angular| W. The same with twice the integral
bounds q' itself: where m + 2 e(g) < g for m_j >= |inv(J) x|_j no joint can come to be as fast as g
says, and J keeps its inverse. So a g that fulfils this proves itself, and the posture is kept.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.kinematics.model import Kinematics

_ROUNDS = 4
_SPARE = 1.1
_SAME_POSE = 1e-7
"""Joints whose pose is off by more [m or -] are not those of the pose."""
_SINGULAR = 1e-12
"""A Jacobian with a smaller determinant has no inverse."""


def linear_joints(
    kinematics: Kinematics,
    q: FloatArray,
    T_robroot_tcp: FloatArray,
    T_flange_tcp: FloatArray,
    ways: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Return how far the joints go to first order on ways of the TCP, and how far they may be off.

    From joints (n, 6) [rad] with the TCP at (n, 4, 4) [m] on ``ways`` (n, k, 6), how far the TCP
    goes [m] and turns [rad], axes of robroot; one of the k does not move. (n, k, 6) [rad]; and
    (n, 6) [rad] by how much the joints may differ at most from the same mixture of these wherever
    the TCP goes on a mixture of the ways, infinite where that is not known.
    """
    T_robroot_flange = kinematics.fk(q)
    off = np.abs(T_robroot_flange @ T_flange_tcp - T_robroot_tcp).max(axis=(1, 2), initial=0.0)
    arm = T_robroot_tcp[:, :3, 3] - T_robroot_flange[:, :3, 3]
    J = kinematics.jacobian(q)
    J[:, :3] += np.cross(J[:, 3:], arm[:, :, None], axis=1)
    known = (off <= _SAME_POSE) & (np.abs(np.linalg.det(J)) > _SINGULAR)
    J[~known] = np.eye(6)
    back, lever = np.linalg.inv(J), np.linalg.norm(J[:, :3], axis=1)
    moved = ways @ np.swapaxes(back, 1, 2)
    least = np.abs(moved).max(axis=1)
    linear, angular = (np.linalg.norm(part, axis=2) for part in (back[..., :3], back[..., 3:]))

    def left_out(fast: FloatArray) -> FloatArray:
        before, path = np.cumsum(fast, axis=1) - fast, fast * lever
        grown = lever + np.cumsum(path[:, ::-1], axis=1)[:, ::-1] - path
        way = 0.5 * (fast * grown * (fast + 2.0 * before)).sum(axis=1, keepdims=True)
        turn = 0.5 * (fast * before).sum(axis=1, keepdims=True)
        return np.asarray(linear * way + angular * turn)

    fast = least
    with np.errstate(over="ignore", invalid="ignore"):
        for _ in range(_ROUNDS):
            fast = least + 2.0 * left_out(fast)
        fast = _SPARE * fast
        proven = known & (least + 2.0 * left_out(fast) < fast).all(axis=1)
        return moved, np.where(proven[:, None], left_out(fast), np.inf)
