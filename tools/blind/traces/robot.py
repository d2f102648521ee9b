"""A robot that runs a path: planner, joints, recorder. Its own kinematics, integrated in time."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from tools.blind.chain import Array, Dimensions, G

FINE = 0.001
"""Step [s] of the simulation."""
AHEAD = 0.5
"""Standstill [s] before and after a run."""


def fk(arm: Dimensions, tool: Array, q: Array) -> tuple[Array, Array]:
    """Return tool points (n, 3) [m] and rotations (n, 3, 3) of joint angles (n, 6) [rad]."""
    points, R, _ = _chained(arm, tool, q)
    return points, R


def _chained(arm: Dimensions, tool: Array, q: Array) -> tuple[Array, Array, Array]:
    """Return tool points, rotations, and the Jacobian (n, 6, 6): point then rotation."""
    n = len(q)
    R, p = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    axes, places = np.empty((n, 3, 6)), np.empty((n, 3, 6))
    for k in range(6):
        turn = _rotation(arm.axis[k], q[:, k])
        axes[:, :, k] = R @ arm.axis[k]
        places[:, :, k] = p + R @ arm.point[k]
        p = p + np.einsum("nij,nj->ni", R, arm.point[k] - turn @ arm.point[k])
        R = R @ turn
    end = arm.flange[:3, 3] + arm.flange[:3, :3] @ tool
    points = p + R @ end
    J = np.empty((n, 6, 6))
    J[:, :3] = np.cross(axes, points[:, :, None] - places, axis=1)
    J[:, 3:] = axes
    return points, R @ arm.flange[:3, :3], J


def _rotation(axis: Array, angle: Array) -> Array:
    K = np.array([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    s, c = np.sin(angle)[:, None, None], np.cos(angle)[:, None, None]
    return np.eye(3) + s * K + (1.0 - c) * (K @ K)


def jacobian(arm: Dimensions, tool: Array, q: Array) -> Array:
    """Return (n, 6, 6): point then rotation."""
    return _chained(arm, tool, q)[2]


def torques(arm: Dimensions, load: Array, mass: float, q: Array, step: float = FINE) -> Array:
    """Return what the drives give (n, 6) [N m] for links and a load that are points of mass.

    By virtual work: each mass, its acceleration less gravity, along its way with each joint.

    ``load``: (3,) place of the mass [kg] in the flange [m]; ``q``: (n, 6) at equal steps [s].
    """
    n = len(q)
    R, p = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
    axes, places, found = np.empty((6, n, 3)), np.empty((6, n, 3)), np.zeros((n, 6))
    for k in range(6):
        turn = _rotation(arm.axis[k], q[:, k])
        axes[k], places[k] = R @ arm.axis[k], p + R @ arm.point[k]
        p = p + np.einsum("nij,nj->ni", R, arm.point[k] - turn @ arm.point[k])
        R = R @ turn
        weights = [(arm.mass[k], arm.com[k])]
        if k == 5:
            weights.append((mass, arm.flange[:3, 3] + arm.flange[:3, :3] @ load))
        for kg, at in weights:
            point = p + R @ at
            rate = np.gradient(np.gradient(point, step, axis=0), step, axis=0)
            for j in range(k + 1):
                way = np.cross(axes[j], point - places[j])
                found[:, j] += kg * np.sum(way * (rate - G), axis=1)
    return found


def ik(arm: Dimensions, tool: Array, start: Array, points: Array) -> Array:
    """Return joint angles (n, 6) at points (n, 3) in the orientation of ``start`` (6,)."""
    return follow(arm, tool, start, fk(arm, tool, start[None])[1][0], points)


def follow(arm: Dimensions, tool: Array, start: Array, R: Array, points: Array) -> Array:
    """Return joint angles (n, 6) at points (n, 3) and orientation, from near ``start``.

    ``R``: (3, 3), or (n, 3, 3).
    """
    R = np.broadcast_to(R, (len(points), 3, 3))
    every = max(1, len(points) // 400)
    knots = np.unique(np.append(np.arange(0, len(points), every), len(points) - 1))
    q = np.empty((len(points), 6))
    now = start.copy()
    for at in knots:
        now = _newton(arm, tool, now[None], R[at], points[at][None])[0]
        q[at] = now
    for k in range(6):
        q[:, k] = np.interp(np.arange(len(points)), knots, q[knots, k])
    return _newton(arm, tool, q, R, points)


def _newton(arm: Dimensions, tool: Array, q: Array, R: Array, points: Array) -> Array:
    for _ in range(7):
        p, now, J = _chained(arm, tool, q)
        E = R @ now.transpose(0, 2, 1)
        turn = 0.5 * np.stack(
            [E[:, 2, 1] - E[:, 1, 2], E[:, 0, 2] - E[:, 2, 0], E[:, 1, 0] - E[:, 0, 1]], axis=1
        )
        error = np.concatenate([points - p, turn], axis=1)
        if np.abs(error).max() < 1e-12:
            break
        q = q + np.linalg.solve(J, error[..., None])[..., 0]
    return q


@dataclass
class Path:
    """A polyline with rounded corners.

    Args:
        corners: (k, 3) [m]; cdis: where a corner is left [m], 0: exact stop, one or (k,);
        form of the corner; feed [m/s], one or (k,) of the leg to each; acceleration [m/s^2].
    """

    corners: Array
    cdis: float | Array
    form: str
    feed: float | Array
    acceleration: float
    points: Array = field(default_factory=lambda: np.zeros((0, 3)))
    limit: Array = field(default_factory=lambda: np.zeros(0))
    place: Array = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        """Lay out the way in steps of 0.1 mm, with the speed that each step allows.

        ``place``: number of the corner behind, and the share of the leg, once it is timed.
        """
        pieces, limits, places, begun = [], [], [], 0.0
        cdis, feed = (np.broadcast_to(v, len(self.corners)) for v in (self.cdis, self.feed))
        at = self.corners[0]
        for k in range(1, len(self.corners)):
            corner = self.corners[k]
            last = k == len(self.corners) - 1
            d = 0.0
            if not last and cdis[k] > 0.0:
                legs = [np.linalg.norm(self.corners[k + j] - corner) for j in (-1, 1)]
                d = min(cdis[k], 0.5 * min(legs))
            u = (corner - self.corners[k - 1]) / np.linalg.norm(corner - self.corners[k - 1])
            enter = corner - d * u
            share = d / np.linalg.norm(corner - self.corners[k - 1])
            line = _between(at, enter)
            pieces.append(line)
            limits.append(np.full(len(line), feed[k]))
            places.append(np.linspace(k - 1 + begun, k - share, len(line) + 1)[1:])
            begun = 0.0
            at = enter
            if d > 0.0:
                w = (self.corners[k + 1] - corner) / np.linalg.norm(self.corners[k + 1] - corner)
                bend, radius = _bend(corner, u, w, d, self.form)
                pieces.append(bend)
                slow = min(feed[k], np.sqrt(self.acceleration * radius))
                limits.append(np.full(len(bend), slow))
                begun = d / np.linalg.norm(self.corners[k + 1] - corner)
                places.append(np.linspace(k - share, k + begun, len(bend) + 1)[1:])
                at = corner + d * w
            else:
                limits[-1][-1] = 0.0
        self.points, self.limit = np.concatenate(pieces), np.concatenate(limits)
        self.place = np.concatenate(places)

    def timed(self) -> tuple[Array, Array]:
        """Return times (n,) at fine steps and points (n, 3), the jerk taken out of the ramps."""
        step = np.linalg.norm(np.diff(self.points, axis=0), axis=1)
        v2 = self.limit**2
        v2[0] = 0.0
        for order in (range(1, len(v2)), range(len(v2) - 2, -1, -1)):
            for k in order:
                other = k - 1 if order.step > 0 else k + 1
                ds = step[min(k, other)]
                v2[k] = min(v2[k], v2[other] + 2.0 * self.acceleration * ds)
        v = np.sqrt(v2)
        t = np.concatenate([[0.0], np.cumsum(2.0 * step / np.maximum(v[1:] + v[:-1], 1e-4))])
        way = np.concatenate([[0.0], np.cumsum(step)])
        time = np.arange(-AHEAD, t[-1] + AHEAD, FINE)
        s = np.interp(time, t, way)
        box = np.ones(40) / 40
        s = np.convolve(np.pad(s, (20, 19), "edge"), box, "valid")
        points = np.stack([np.interp(s, way, self.points[:, k]) for k in range(3)], axis=1)
        self.place = np.interp(s, way, self.place)
        return time + AHEAD, points


def _between(a: Array, b: Array) -> Array:
    count = max(2, int(np.linalg.norm(b - a) / 1e-4))
    return a + np.linspace(0.0, 1.0, count)[1:, None] * (b - a)


def _bend(corner: Array, u: Array, w: Array, d: float, form: str) -> tuple[Array, float]:
    """Return points of a rounded corner and its smallest radius."""
    a, b = corner - d * u, corner + d * w
    count = max(8, int(2.0 * d / 1e-4))
    half = max(0.5 * float(np.arccos(np.clip(u @ w, -1, 1))), 1e-6)
    if form == "parabola":
        t = np.linspace(0.0, 1.0, count)[1:, None]
        radius = d * np.cos(half) ** 2 / np.sin(half)
        return (1 - t) ** 2 * a + 2 * t * (1 - t) * corner + t**2 * b, float(max(radius, 1e-5))
    radius = d / np.tan(half)
    inward = (w - u) / max(np.linalg.norm(w - u), 1e-12)
    centre = corner + inward * radius / np.cos(half)
    angle = np.linspace(-half, half, count)[1:, None]
    out = -inward
    along = (u + w) / np.linalg.norm(u + w)
    return centre + radius * (np.cos(angle) * out + np.sin(angle) * along), float(radius)
