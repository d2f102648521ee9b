"""A synthetic KR 500 whose truth the product cannot see: own kinematics, own load equilibrium.

Nothing of ``postproc`` is used here, so that the product is not judged by its own formulas:
forward kinematics by products of exponentials (screws), deflection by the full equilibrium of
joint springs under a weight or force that moves with the tool, joint stiffness that varies
smoothly with the joint's own and a neighbouring angle. Metres, radians, newtons.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

AXES = np.array([[0, 0, -1], [0, 1, 0], [0, 1, 0], [-1, 0, 0], [0, 1, 0], [-1, 0, 0]], dtype=float)
POINTS = np.array(
    [
        *([0, 0, 0], [0.5, 0, 1.045], [1.8, 0, 1.045]),
        *([1.8, 0, 0.99], [2.825, 0, 0.99], [2.825, 0, 0.99]),
    ]
)
"""A point on each axis of the KR 500 R2830 with all angles 0 (arm stretched along x)."""
FLANGE = np.array([[0, 0, 1, 3.115], [0, 1, 0, 0], [-1, 0, 0, 0.99], [0, 0, 0, 1]], dtype=float)
K_PAPER = np.array([1.58e7, 6.12e6, 5.28e6, 4.66e5, 2.19e5, 3.49e5])
"""Joint stiffness [N*m/rad] without grid, Jiao et al. 2022, Eq. (38)."""
NEIGHBOUR = (1, 2, 1, 4, 5, 4)
G = 9.80665


def turn(axis: np.ndarray, angle: np.ndarray) -> np.ndarray:
    """Return rotations (n, 3, 3) about a unit axis by angles (n,)."""
    x, y, z = axis
    K = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    a = angle[:, None, None]
    return np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * (K @ K)


@dataclass
class Twin:
    """The hidden robot. ``amplitude`` 0: constant stiffness.

    tcp, com (3,): measured point and centre of gravity of the weight in the flange; periods [rad]:
    of the sinusoids in each joint's own and its neighbour's angle.
    """

    seed: int = 0
    amplitude: float = 0.0
    periods: tuple[float, float] = (np.radians(80), np.radians(180))
    tcp: np.ndarray = field(default_factory=lambda: np.array([0.107, 0.0, 0.362]))
    com: np.ndarray = field(default_factory=lambda: np.array([0.0535, 0.0, 0.362]))

    def __post_init__(self) -> None:
        """Draw the truth."""
        rng = np.random.default_rng(self.seed)
        self._period = rng.uniform(*self.periods, size=(6, 2))
        self._phase = rng.uniform(0.0, 2 * np.pi, size=(6, 2))
        self._share = rng.uniform(0.5, 1.0, size=(6, 2))

    def compliance(self, q: np.ndarray) -> np.ndarray:
        """Return the true joint compliance (n, 6) [rad/(N*m)]."""
        wave = np.empty_like(q)
        for i in range(6):
            own, other = q[:, i], q[:, NEIGHBOUR[i]]
            angle = 2 * np.pi * np.stack([own, other], axis=1) / self._period[i] + self._phase[i]
            wave[:, i] = np.sin(angle) @ self._share[i] / np.sqrt(1.2)
        return np.exp(self.amplitude * wave) / K_PAPER

    def chain(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return axes (n, 6, 3), points on them (n, 6, 3), flange poses (n, 4, 4)."""
        n = len(q)
        R, p = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3))
        axes, points = np.empty((n, 6, 3)), np.empty((n, 6, 3))
        for i in range(6):
            axes[:, i] = R @ AXES[i]
            points[:, i] = R @ POINTS[i] + p
            S = turn(AXES[i], q[:, i])
            p = p + np.einsum("nij,nj->ni", R, POINTS[i] - S @ POINTS[i])
            R = R @ S
        T = np.zeros((n, 4, 4))
        T[:, :3, :3] = R @ FLANGE[:3, :3]
        T[:, :3, 3] = R @ FLANGE[:3, 3] + p
        T[:, 3, 3] = 1.0
        return axes, points, T

    def point(self, q: np.ndarray, at: np.ndarray | None = None) -> np.ndarray:
        """Return the tool point (n, 3) of the unloaded arm."""
        T = self.chain(q)[2]
        return T[:, :3, :3] @ (self.tcp if at is None else at) + T[:, :3, 3]

    def loaded_point(self, q: np.ndarray, force: np.ndarray, at: np.ndarray) -> np.ndarray:
        """Return the tool point (n, 3) with a force (3,) or (n, 3) [N] at a flange point (3,)."""
        c = self.compliance(q)
        real = q.copy()
        for _ in range(6):
            axes, points, T = self.chain(real)
            arm = T[:, :3, :3] @ at + T[:, :3, 3]
            torque = np.einsum(
                "nij,nij->ni", np.cross(axes, arm[:, None] - points), force_rows(force, q)
            )
            real = q + c * torque
        return self.point(real)

    def weight(self, q: np.ndarray, mass: float = 50.0) -> np.ndarray:
        """Return the tool point under a hung weight."""
        return self.loaded_point(q, np.array([0.0, 0.0, -mass * G]), self.com)


def force_rows(force: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Return a force as (n, 6, 3), one row a joint."""
    return np.broadcast_to(np.asarray(force, dtype=float)[..., None, :], (len(q), 6, 3))
