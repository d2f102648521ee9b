"""The ortho-parallel arm with spherical wrist: its constants, chain and branch signs.

Source: Brandstoetter, Angerer, Hofbaur: An analytical solution of the inverse kinematics problem of
industrial serial manipulators with an ortho-parallel basis and a spherical wrist, 2014.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, frozen_floats
from postproc.cell import OpwGeometry
from postproc.geometry import inverse, rotation_y, rotation_z, transform
from postproc.kinematics.branches import Branches, wrapped
from postproc.kinematics.chain import SerialChain
from postproc.records import dataclass


@dataclass(frozen=True, slots=True)
class OpwArm(Branches):
    """Such an arm anywhere: ``T_robroot_foot`` and ``T_end_flange`` (4, 4) are constant."""

    geometry: OpwGeometry
    T_robroot_foot: FloatArray
    T_end_flange: FloatArray

    def __post_init__(self) -> None:
        """Check shapes and freeze."""
        frozen_floats(self, "T_robroot_foot", (4, 4))
        frozen_floats(self, "T_end_flange", (4, 4))

    @property
    def forearm(self) -> float:
        """Distance from axis 3 to the wrist centre in the plane of the arm [m]."""
        return float(np.hypot(self.geometry.c3, self.geometry.a2))

    @property
    def stretch(self) -> float:
        """Angle [rad] between the forearm's axis and the line from axis 3 to the wrist centre."""
        return float(np.arctan2(self.geometry.a2, self.geometry.c3))

    @property
    def elbow_threshold(self) -> float:
        """A3 [rad] where the arm is stretched; status bit 1 is set above it."""
        g = self.geometry
        return float(wrapped(g.signs[2] * (g.offsets[2] - self.stretch)))

    @property
    def wrist_threshold(self) -> float:
        """A5 [rad] where axes 4 and 6 fall together; status bit 2 is set below it."""
        return float(wrapped(self.geometry.signs[4] * self.geometry.offsets[4]))

    def theta(self, q: ArrayLike) -> FloatArray:
        """Return the angles (..., 6) [rad] of the source's convention."""
        g = self.geometry
        return np.asarray(q, dtype=np.float64) * g.signs - g.offsets

    def reach(self, q: ArrayLike) -> FloatArray:
        """Return x (...,) [m] of the wrist centre in the frame that turns with axis 1."""
        theta = self.theta(q)
        upper = theta[..., 1]
        lower = upper + theta[..., 2] + self.stretch
        g = self.geometry
        return np.asarray(g.a1 + g.c2 * np.sin(upper) + self.forearm * np.sin(lower))


def arm_of(geometry: OpwGeometry) -> OpwArm:
    """Return the arm that stands in robroot as the source draws it."""
    return OpwArm(geometry, np.eye(4), np.eye(4))


def chain_of(arm: OpwArm) -> SerialChain:
    """Return the chain of an arm; every link frame is parallel to robroot at q = 0.

    Link 1 sits in the foot on axis 1, links 2 and 3 on their axes in the plane of the arm, link 4
    where axis 4 passes axis 3, links 5 and 6 in the wrist centre.
    """
    g = arm.geometry
    zero = -g.offsets
    foot, upper = rotation_z(zero[0]), rotation_y(zero[1])
    lower = rotation_y(zero[1] + zero[2])
    hand = foot @ lower @ rotation_z(zero[3])
    shoulder = np.array([g.a1, g.b, g.c1])
    elbow = shoulder + upper @ np.array([0.0, 0.0, g.c2])
    pass_point = elbow + lower @ np.array([g.a2, 0.0, 0.0])
    wrist = pass_point + lower @ np.array([0.0, 0.0, g.c3])
    R_foot_end = hand @ rotation_y(zero[4]) @ rotation_z(zero[5])
    end = foot @ wrist + g.c4 * R_foot_end[:, 2]
    points = [np.zeros(3), *(foot @ p for p in (shoulder, elbow, pass_point, wrist, wrist))]
    directions = [
        np.array([0.0, 0.0, 1.0]),
        foot[:, 1],
        foot[:, 1],
        (foot @ lower)[:, 2],
        hand[:, 1],
        R_foot_end[:, 2],
    ]
    R, p = arm.T_robroot_foot[:3, :3], arm.T_robroot_foot[:3, 3]
    origins = np.array([R @ point + p for point in points])
    placements = np.tile(np.eye(4), (7, 1, 1))
    placements[:6, :3, 3] = np.diff(origins, axis=0, prepend=np.zeros((1, 3)))
    T_robroot_flange = arm.T_robroot_foot @ transform(R_foot_end, end) @ arm.T_end_flange
    placements[6] = inverse(transform(np.eye(3), origins[5])) @ T_robroot_flange
    axes = np.array([sign * (R @ d) for sign, d in zip(g.signs, directions, strict=True)])
    return SerialChain(placements, _rounded(axes))


def _rounded(axes: FloatArray) -> FloatArray:
    """Remove the 1e-17 that sine and cosine of right angles leave."""
    nearest = np.rint(axes)
    return np.where(np.abs(axes - nearest) < 1e-14, nearest, axes)
