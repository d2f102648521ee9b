"""Recognising an ortho-parallel arm with spherical wrist among chains of six joints.

The axes are taken as lines in space at q = 0: axis 2 parallel to axis 3 and square to axis 1,
axis 4 square to axis 3, axes 4, 5, 6 through one point and square to each other in turn. Lengths,
signs and offsets follow; what is left at both ends are the constant foot and flange transforms.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import FloatArray
from postproc.cell import OpwGeometry
from postproc.geometry import inverse, rotation_y, rotation_z, transform
from postproc.kinematics.chain import SerialChain
from postproc.kinematics.opw import OpwArm
from postproc.records import dataclass

LOOSE = 1e-3
"""Angle [rad] and length [m] up to which an arm counts as ortho-parallel with small errors."""


@dataclass(frozen=True, slots=True)
class _Lines:
    """Joint axes at q = 0 in robroot: points (6, 3) [m] and unit directions (6, 3)."""

    points: FloatArray
    directions: FloatArray


def ortho_parallel(chain: SerialChain) -> OpwArm | None:
    """Return the ortho-parallel arm nearest to a chain, None if it is another kind of arm.

    The match may be off by small errors of the chain (rounded numbers, calibrated axes); the
    caller compares forward kinematics to see whether it is exact.
    """
    frames = chain.link_frames(np.zeros(6))[1:]
    directions = np.einsum("nij,nj->ni", frames[:, :3, :3], chain.axes)
    lines = _Lines(frames[:, :3, 3], directions)
    wrist = _wrist_centre(lines)
    if wrist is None or not _is_ortho_parallel(lines.directions):
        return None
    return _fitted(lines, wrist, chain.fk(np.zeros(6)))


def _is_ortho_parallel(d: FloatArray) -> bool:
    square = [(0, 1), (2, 3), (3, 4), (4, 5)]
    is_parallel = float(np.linalg.norm(np.cross(d[1], d[2]))) < LOOSE
    return is_parallel and all(abs(float(d[i] @ d[j])) < LOOSE for i, j in square)


def _wrist_centre(lines: _Lines) -> FloatArray | None:
    """Return the point nearest to axes 4, 5 and 6, None if they do not meet."""
    d = lines.directions[3:]
    across = np.eye(3) - d[:, :, None] * d[:, None, :]
    centre = np.linalg.lstsq(
        across.sum(axis=0), np.einsum("nij,nj->i", across, lines.points[3:]), rcond=None
    )[0]
    missed = np.einsum("nij,nj->ni", across, centre - lines.points[3:])
    return centre if float(np.abs(missed).max()) < LOOSE else None


def _fitted(lines: _Lines, wrist: FloatArray, T_robroot_flange: FloatArray) -> OpwArm | None:
    d = lines.directions
    up = d[0] if d[0, 2] >= 0.0 else -d[0]
    up = up if abs(d[0, 2]) > LOOSE else d[0]
    side = _unit(d[1] - (d[1] @ up) * up)
    R_robroot_foot = np.stack([np.cross(side, up), side, up], axis=1)
    foot = lines.points[0] - (lines.points[0] @ up) * up
    a, e, w = ((p - foot) @ R_robroot_foot for p in (lines.points[1], lines.points[2], wrist))
    n = d @ R_robroot_foot
    c2 = float(np.hypot(e[0] - a[0], e[2] - a[2]))
    upper = float(np.arctan2(e[0] - a[0], e[2] - a[2]))
    reach = np.array([w[0] - e[0], 0.0, w[2] - e[2]])
    forward = n[3] if n[3] @ reach >= 0.0 else -n[3]
    lower = float(np.arctan2(forward[0], forward[2]))
    a2, _, c3 = rotation_y(lower).T @ reach
    hand = rotation_y(lower).T @ n[4]
    sign_5 = 1.0 if hand[1] >= 0.0 else -1.0
    twist = float(np.arctan2(-sign_5 * hand[0], sign_5 * hand[1]))
    end = (T_robroot_flange[:3, 3] - foot) @ R_robroot_foot
    out = n[5] if (end - w) @ n[5] >= 0.0 else -n[5]
    bent = (rotation_y(lower) @ rotation_z(twist)).T @ out
    bend = float(np.arctan2(bent[0], bent[2]))
    c4 = float((end - w) @ out)
    if c2 < LOOSE or np.hypot(a2, c3) < LOOSE:
        return None
    zero = np.array([0.0, upper, lower - upper, twist, bend, 0.0])
    signs = np.array([d[0] @ up, 1.0, d[2] @ side, n[3] @ forward, sign_5, n[5] @ out])
    geometry = OpwGeometry(
        a1=float(a[0]), a2=float(a2), b=float(w[1]), c1=float(a[2]), c2=c2, c3=float(c3), c4=c4,
        signs=np.sign(signs), offsets=-zero,
    )  # fmt: skip
    T_robroot_foot = transform(R_robroot_foot, foot)
    R_foot_end = rotation_y(lower) @ rotation_z(twist) @ rotation_y(bend)
    T_foot_end = transform(R_foot_end, w + c4 * R_foot_end[:, 2])
    T_end_flange = inverse(T_robroot_foot @ T_foot_end) @ T_robroot_flange
    return OpwArm(geometry, T_robroot_foot, T_end_flange)


def _unit(vector: FloatArray) -> FloatArray:
    return np.asarray(vector / np.linalg.norm(vector))
