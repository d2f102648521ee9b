"""Serial arms as products of exponentials, with elastic screws, in static equilibrium.

Source: Brockett's product of exponentials, T = exp(S1 t1) ... exp(Sm tm) M. Metres, radians,
newtons, axes of the robot root. Every elastic member (joint, bending link, leaning column) is one
more screw, so one sweep gives poses and torques of all.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
G = np.array([0.0, 0.0, -9.80665])
SCREWS = (
    *("lean_x", "lean_y", "j1", "j2", "bend2_x", "bend2_y", "bend2_z"),
    *("j3", "bend3_x", "bend3_y", "bend3_z", "j4", "j5", "j6"),
)
"""Screws from the floor to the flange; j1 to j6 are driven, the others only give."""
JOINTS = np.array([SCREWS.index(f"j{i}") for i in range(1, 7)])


@dataclass(frozen=True)
class Dimensions:
    """An arm in its zero pose.

    Args:
        axis: (6, 3) unit joint axes; point: (6, 3) a point on each.
        flange: (4, 4) pose of the flange.
        mass: (6,) of the links; com: (6, 3) their centres of gravity in the zero pose.
        give: (6,) joint compliance [rad/(N*m)].
    """

    axis: Array
    point: Array
    flange: Array
    mass: Array
    com: Array
    give: Array


@dataclass
class Geometry:
    """Screws of every row, so that each row may have its own temperature.

    Args:
        axis, point: (n, m, 3); flange_turn: (n, 3, 3); flange_p: (n, 3).
    """

    axis: Array
    point: Array
    flange_turn: Array
    flange_p: Array

    @staticmethod
    def of(arm: Dimensions, n: int) -> Geometry:
        """Return the geometry of an arm for n rows, elastic screws included."""
        axis, point = np.zeros((len(SCREWS), 3)), np.zeros((len(SCREWS), 3))
        axis[JOINTS], point[JOINTS] = arm.axis, arm.point
        for name, direction in (("x", 0), ("y", 1), ("z", 2)):
            for link in (2, 3):
                at = SCREWS.index(f"bend{link}_{name}")
                axis[at, direction] = 1.0
                point[at] = 0.5 * (arm.point[link - 1] + arm.point[link])
        for name, direction in (("lean_x", 0), ("lean_y", 1)):
            axis[SCREWS.index(name), direction] = 1.0
            point[SCREWS.index(name)] = [0.0, 0.0, -0.6]
        return Geometry(
            np.tile(axis, (n, 1, 1)),
            np.tile(point, (n, 1, 1)),
            np.tile(arm.flange[:3, :3], (n, 1, 1)),
            np.tile(arm.flange[:3, 3], (n, 1)),
        )


@dataclass
class Poses:
    """World axis and point of each screw (n, m, 3), motion of each body, and the flange."""

    axis: Array
    point: Array
    R: Array
    p: Array
    flange_turn: Array
    flange_p: Array

    def body_point(self, body: int, x: Array) -> Array:
        """Return where a point (3,) or (n, 3), given in the zero pose, is now (n, 3)."""
        moved: Array = (
            np.einsum("nij,...j->ni", self.R[:, body], x)
            if x.ndim == 1
            else _turn(self.R[:, body], x)
        )
        return moved + self.p[:, body]

    def tool_point(self, tool: Array) -> Array:
        """Return the point (3,) or (n, 3) of the flange frame in the root (n, 3)."""
        return _turn(self.flange_turn, np.broadcast_to(tool, self.flange_p.shape)) + self.flange_p


def rotation(axis: Array, angle: Array) -> Array:
    """Return rotations (n, 3, 3) about unit axes (n, 3) by angles (n,) (Rodrigues)."""
    zero = np.zeros(len(axis))
    x, y, z = axis.T
    K = np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)
    a = angle[:, None, None]
    turned: Array = np.eye(3) + np.sin(a) * K + (1.0 - np.cos(a)) * (K @ K)
    return turned


def _turn(R: Array, x: Array) -> Array:
    turned: Array = np.einsum("nij,nj->ni", R, x)
    return turned


def sweep(geometry: Geometry, theta: Array) -> Poses:
    """Return the poses of all bodies for screw angles (n, m)."""
    n, m = theta.shape
    R, p = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    axes, points = np.empty((n, m, 3)), np.empty((n, m, 3))
    all_R, all_p = np.empty((n, m, 3, 3)), np.empty((n, m, 3))
    for k in range(m):
        axes[:, k] = _turn(R, geometry.axis[:, k])
        points[:, k] = _turn(R, geometry.point[:, k]) + p
        R = R @ rotation(geometry.axis[:, k], theta[:, k])
        p = points[:, k] - _turn(R, geometry.point[:, k])
        all_R[:, k], all_p[:, k] = R, p
    return Poses(
        axes, points, all_R, all_p, R @ geometry.flange_turn, _turn(R, geometry.flange_p) + p
    )


def torques(poses: Poses, body: int, at: Array, force: Array, moment: Array | float = 0.0) -> Array:
    """Return the torque (n, m) that a force (n, 3) at a point (n, 3) of a body puts on each."""
    arm = at[:, None, :] - poses.point
    turning = np.cross(arm, np.broadcast_to(force, at.shape)[:, None, :])
    if not isinstance(moment, float):
        turning = turning + moment[:, None, :]
    torque: Array = np.einsum("nmi,nmi->nm", poses.axis, turning)
    torque[:, body + 1 :] = 0.0
    return torque


def settle(
    geometry: Geometry, theta: Array, deflect: Callable[[Poses, Array], Array]
) -> tuple[Poses, Array]:
    """Return poses and angles in equilibrium: angles = theta + deflect(poses, angles).

    Raises:
        ArithmeticError: if the arm is so soft that no equilibrium is found.
    """
    given = np.zeros_like(theta)
    for _ in range(60):
        poses = sweep(geometry, theta + given)
        new = deflect(poses, theta + given)
        change = float(np.max(np.abs(new - given)))
        given = new
        if change < 1e-13:
            return sweep(geometry, theta + given), theta + given
    raise ArithmeticError(f"no equilibrium, the last step was {change:g} rad")


def embed(q: Array) -> Array:
    """Return screw angles (n, m) of joint angles (n, 6)."""
    theta = np.zeros((len(q), len(SCREWS)))
    theta[:, JOINTS] = q
    return theta


def columns(poses: Poses, at: Array) -> Array:
    """Return the motion (n, 3, 6) of a point (n, 3) of the flange per radian of each joint."""
    arm = at[:, None, :] - poses.point[:, JOINTS]
    return np.swapaxes(np.cross(poses.axis[:, JOINTS], arm), 1, 2)


def solve_pose(arm: Dimensions, position: Array, R: Array, start: Array) -> tuple[Array, Array]:
    """Return joint angles (n, 6) of flange poses by Newton steps, and which were reached (n,).

    ``start``: (6,) for all, or (n, 6).
    """
    n = len(position)
    q = np.array(np.broadcast_to(start, (n, 6)), dtype=float)
    geometry = Geometry.of(arm, n)
    for _ in range(40):
        poses = sweep(geometry, embed(q))
        error = np.concatenate([position - poses.flange_p, _twist(R, poses.flange_turn)], axis=1)
        J = np.concatenate(
            [columns(poses, poses.flange_p), np.swapaxes(poses.axis[:, JOINTS], 1, 2)], axis=1
        )
        if np.max(np.abs(error), initial=0.0) < 1e-11:
            break
        normal = np.swapaxes(J, 1, 2) @ J + 1e-9 * np.eye(6)
        step = np.linalg.solve(normal, np.swapaxes(J, 1, 2) @ error[:, :, None])[:, :, 0]
        q += np.clip(step, -0.2, 0.2)
    return q, np.max(np.abs(error), axis=1) < 1e-8


def _twist(goal: Array, now: Array) -> Array:
    """Return the small rotation (n, 3) from ``now`` to ``goal``, axes of the root."""
    D = goal @ np.swapaxes(now, 1, 2)
    return 0.5 * np.stack(
        [D[:, 2, 1] - D[:, 1, 2], D[:, 0, 2] - D[:, 2, 0], D[:, 1, 0] - D[:, 0, 1]], axis=1
    )
