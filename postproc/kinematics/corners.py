"""Where the arm may go while a corner is approximated: an outer bound, as triangles of joints.

The controller leaves the programmed path no earlier than the approximation distance before the
corner, comes back no later than that behind it (neither beyond the middle of a motion), and in
between it stays within the triangle of the two places and the corner: that of the joints between
joint motions; that of the tool point between path motions, with the orientation in the triangle of
the three orientations, not necessarily in step. Where a joint and a path motion meet, both
triangles are taken. KUKA does not publish the polynomial; every one that keeps to the tangents at
both ends with its control points between path and corner lies in the triangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from postproc.arrays import BoolArray, FloatArray, IndexArray
from postproc.geometry import axis_angle, inverse, rotation_from_vector, transform
from postproc.kinematics.model import Kinematics
from postproc.units import DEG

PIECE_LENGTH = 0.015
"""Longest side [m] of a piece of a triangle of the tool point; joints go straight on a piece."""
PIECE_ANGLE = 3.0 * DEG
"""Largest turn of the tool over a side of it [rad]."""
MOST_PARTS = 40
"""A corner whose sides would have to be cut into more parts is given up."""
IN_STEP = 0.05 * DEG
"""Where the tool turns less than this at a corner, point and orientation count as in step [rad]."""
_WIDER = 1.25
_TURN = 2.0 * np.pi
_LEAP = 40.0 * DEG
_HALF = 0.5


@dataclass(frozen=True, slots=True)
class Corners:
    """Corners (c) of approximated motions, as they are programmed.

    Args:
        q: (c, 3, 6) joints where approximation may begin, at the corner, where it may end [rad].
        T_robroot_tcp: (c, 3, 4, 4) TCP there [m].
        is_path: (c, 2) the motion before and the motion behind are path motions.
        T_flange_tcp: (c, 4, 4) or (4, 4) [m].
        external: (c, 3, k) external axes there.
        q_middle: (c, 2, 6) joints half way from the ends to the corner where the path is bent, NaN
            where it is straight; None: all are straight.
    """

    q: FloatArray
    T_robroot_tcp: FloatArray
    is_path: BoolArray
    T_flange_tcp: FloatArray
    external: FloatArray
    q_middle: FloatArray | None = None

    def __len__(self) -> int:
        """Return the number of corners."""
        return len(self.q)

    def rows(self, rows: IndexArray) -> Corners:
        """Return some of the corners."""
        tool, middle = self.T_flange_tcp, self.q_middle
        return Corners(
            self.q[rows],
            self.T_robroot_tcp[rows],
            self.is_path[rows],
            tool if tool.ndim == 2 else tool[rows],
            self.external[rows],
            None if middle is None else middle[rows],
        )

    def miss(self) -> FloatArray:
        """Return how far (c,) [m] the tool point may pass the corner."""
        return corner_miss(*np.moveaxis(self.T_robroot_tcp[..., :3, 3], 1, 0))


@dataclass(frozen=True, slots=True)
class Pieces:
    """Triangles of configurations (t, 3, 6 + k), straight in the joints, and their corners (t,).

    ``slack`` (t, 6 + k): how far each axis may be beside the triangle [rad]; ``lost`` (c,): corners
    of which a part cannot be reached without leaving the posture.
    """

    q: FloatArray
    slack: FloatArray
    corner: IndexArray
    lost: BoolArray


def corner_miss(a: FloatArray, corner: FloatArray, b: FloatArray) -> FloatArray:
    """Return how far (c,) [m] a tool point may pass corners.

    Args:
        a: (c, 3) where approximation may begin [m].
        corner: (c, 3) what is approximated [m].
        b: (c, 3) where it may end [m].
    """
    way = b - a
    square = np.maximum(np.einsum("ci,ci->c", way, way), 1e-24)
    share = np.clip(np.einsum("ci,ci->c", corner - a, way) / square, 0.0, 1.0)
    return np.asarray(np.linalg.norm(corner - a - share[:, None] * way, axis=1))


def joint_share(
    kinematics: Kinematics,
    q_far: FloatArray,
    q_corner: FloatArray,
    T_flange_tcp: FloatArray,
    distance: FloatArray,
) -> FloatArray:
    """Return the share (c,) of joint motions, from the corner, on which they may be approximated.

    At that share the tool point is at least ``distance`` (c,) [m] off the corner, if it gets so
    far within half of the motion.
    """
    p = (kinematics.fk(q_corner) @ T_flange_tcp)[:, :3, 3]
    share = np.zeros(len(q_corner))
    probe = np.full(len(share), 1e-3)
    open_ = np.arange(len(share))
    while len(open_):
        s = np.minimum(probe[open_], _HALF)
        q = q_corner[open_] + s[:, None] * (q_far - q_corner)[open_]
        T_tool = T_flange_tcp if T_flange_tcp.ndim == 2 else T_flange_tcp[open_]
        off = np.linalg.norm((kinematics.fk(q) @ T_tool)[:, :3, 3] - p[open_], axis=1)
        share[open_] = s
        short = (off < distance[open_]) & (s < _HALF)
        guess = _WIDER * s * distance[open_] / np.maximum(off, 1e-9)
        probe[open_] = np.maximum(np.minimum(guess, _HALF), _WIDER * s)
        open_ = open_[short]
    return share


def pieces_of(kinematics: Kinematics, corners: Corners) -> Pieces:
    """Return the triangles that bound where the arm may go at corners."""
    q = np.concatenate([corners.q, corners.external], axis=2)
    lost = ~np.isfinite(q).all(axis=(1, 2))
    slack = np.zeros((len(q), q.shape[2]))
    slack[:, :6], gone = _out_of_step(kinematics, corners, ~lost)
    lost |= gone
    parts = _parts(corners)
    lost |= parts > MOST_PARTS
    parts[lost] = 1
    one = np.flatnonzero(~lost & ((parts == 1) | ~corners.is_path.all(axis=1)))
    triangles, owners = [q[one]], [one]
    if corners.q_middle is not None:
        for side, end in ((0, 0), (1, 2)):
            bent = np.flatnonzero(~lost & np.isfinite(corners.q_middle[:, side, 0]))
            middle = np.concatenate(
                [corners.q_middle[bent, side], corners.external[bent][:, [end, 1]].mean(axis=1)],
                axis=1,
            )
            triangles.append(np.stack([q[bent, end], middle, q[bent, 1]], axis=1))
            owners.append(bent)
    for count in np.unique(parts[parts > 1]).tolist():
        rows = np.flatnonzero(~lost & (parts == count))
        if len(rows):
            cut, gone = _cut(kinematics, corners, rows, int(count))
            lost[rows[gone]] = True
            triangles.append(cut.reshape(-1, *cut.shape[2:]))
            owners.append(np.repeat(rows, cut.shape[1]))
    owner = np.concatenate(owners)
    return Pieces(np.concatenate(triangles), slack[owner], owner, lost)


def _out_of_step(
    kinematics: Kinematics, corners: Corners, known: BoolArray
) -> tuple[FloatArray, BoolArray]:
    """Return how far (c, 6) [rad] joints are off where the orientation is that of another place.

    The second value says which of the corners have such a pose out of reach.
    """
    slack, lost = np.zeros((len(corners), 6)), np.zeros(len(corners), dtype=np.bool_)
    angle = np.linalg.norm(_turns(np.nan_to_num(corners.T_robroot_tcp)), axis=2).max(axis=1)
    rows = np.flatnonzero(known & corners.is_path.all(axis=1) & (angle > IN_STEP))
    if not len(rows):
        return slack, lost
    T, q = corners.T_robroot_tcp[rows], corners.q[rows]
    tool = inverse(np.broadcast_to(corners.T_flange_tcp, (len(corners), 4, 4))[rows])
    for place in range(3):
        for other in range(3):
            pose = transform(T[:, other, :3, :3], T[:, place, :3, 3]) @ tool
            found, valid = _near(kinematics, pose, q[:, place])
            slack[rows] = np.maximum(slack[rows], np.abs(found - q[:, place]))
            lost[rows] |= ~valid
    return slack, lost


def _near(
    kinematics: Kinematics, T_robroot_flange: FloatArray, q_near: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return the joints (n, 6) in the posture of others, those themselves out of reach."""
    q, valid = kinematics.ik_in(T_robroot_flange, kinematics.slot(q_near))
    q = kinematics.split_wrist(q, q_near)
    q = q + _TURN * np.round((q_near - q) / _TURN)
    return np.where(valid[:, None], q, q_near), valid


def _parts(corners: Corners) -> IndexArray:
    """Return into how many parts (c,) the sides of each corner are cut."""
    T = corners.T_robroot_tcp
    p = T[..., :3, 3]
    ways = np.linalg.norm(p[:, [0, 2]] - p[:, [1]], axis=2)
    turns = np.linalg.norm(_turns(T), axis=2)
    most = np.maximum(ways / PIECE_LENGTH, turns / PIECE_ANGLE).max(axis=1)
    most = np.where(corners.is_path.any(axis=1), np.nan_to_num(most, nan=1.0), 1.0)
    return np.clip(np.ceil(most - 1e-9), 1, MOST_PARTS + 1).astype(np.int64)


def _turns(T: FloatArray) -> FloatArray:
    """Return the turns (c, 2, 3) [rad] from the corner to where approximation begins and ends."""
    found = [axis_angle(T[:, 1, :3, :3], T[:, end, :3, :3]) for end in (0, 2)]
    return np.stack([axis * angle[:, None] for axis, angle in found], axis=1)


def _cut(
    kinematics: Kinematics, corners: Corners, rows: IndexArray, count: int
) -> tuple[FloatArray, BoolArray]:
    """Return pieces (r, count^2, 3, 6 + k) of the triangles of tool poses, and which are lost."""
    weight, faces = _grid(count)
    T = corners.T_robroot_tcp[rows]
    turn = np.einsum("ne,rei->rni", weight, _turns(T))
    at = T[..., :3, 3]
    p = at[:, [1]] + np.einsum("ne,rei->rni", weight, at[:, [0, 2]] - at[:, [1]])
    R = T[:, None, 1, :3, :3] @ rotation_from_vector(turn)
    tool = np.broadcast_to(corners.T_flange_tcp, (len(corners), 4, 4))[rows]
    flange = transform(R, p) @ inverse(tool)[:, None]
    q_corner = np.repeat(corners.q[rows, 1], len(weight), axis=0)
    q, valid = _near(kinematics, flange.reshape(-1, 4, 4), q_corner)
    q = q.reshape(len(rows), len(weight), 6)
    ends = corners.external[rows][:, [0, 2]] - corners.external[rows][:, [1]]
    external = corners.external[rows][:, [1]] + np.einsum("ne,rek->rnk", weight, ends)
    pieces = np.concatenate([q, external], axis=2)[:, faces]
    leaps = np.ptp(pieces[..., :6], axis=2).max(axis=(1, 2)) > _LEAP
    return pieces, ~valid.reshape(len(rows), -1).all(axis=1) | leaps


def _grid(count: int) -> tuple[FloatArray, IndexArray]:
    """Return weights (n, 2) of both ends at the nodes of a cut triangle, and its faces (f, 3)."""
    number: dict[tuple[int, int], int] = {}
    for i in range(count + 1):
        for j in range(count + 1 - i):
            number[i, j] = len(number)
    faces = [[number[i, j], number[i + 1, j], number[i, j + 1]] for i, j in number if i + j < count]
    faces += [
        [number[i + 1, j], number[i, j + 1], number[i + 1, j + 1]]
        for i, j in number
        if i + j < count - 1
    ]
    return np.array(list(number), dtype=np.float64) / count, np.array(faces)
