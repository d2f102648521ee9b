"""Where the arm may go while a corner is approximated: an outer bound, as hulls of joints.

The controller leaves the programmed path no earlier than the approximation distance before the
corner, comes back no later than that behind it (neither beyond the middle of a motion), and in
between it stays within the triangle of the two places and the corner: that of the joints between
joint motions; that of the tool point between path motions, with the orientation in the triangle of
the three orientations, not necessarily in step. Where a joint and a path motion meet, both
triangles are taken.

The triangles of the tool are cut into pieces on which the joints are nearly linear: point and
orientation are mixtures of three each, and the joints lie in the hull of the nine (three, where
they are in step), beside it by no more than the bulge of a parabola through the middles of its
sides. Small ones need no cut where the Jacobian at the corner proves as much (``linear``). KUKA
does not publish the polynomial; every one that keeps to the tangents at
both ends with its control points between path and corner lies in the triangle.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from postproc.arrays import AT_ONCE, BoolArray, FloatArray, IndexArray
from postproc.geometry import axis_angle, inverse, rotation_from_vector, transform
from postproc.kinematics.linear import linear_joints
from postproc.kinematics.model import Kinematics
from postproc.kinematics.singular import wrist_distance
from postproc.records import dataclass
from postproc.units import DEG, TURN

PIECE_LENGTH = 0.03
"""Longest side [m] of a piece of a triangle of the tool point; joints go straight on a piece."""
PIECE_ANGLE = 6.0 * DEG
"""Largest turn of the tool over a side of it [rad]."""
MOST_PARTS = 160
"""A corner is not cut into more parts of its sides, point times orientation."""
IN_STEP = 0.005 * DEG
"""Where the tool turns less than this at a corner, point and orientation count as in step [rad]:
half a metre off the tool point that is 0.04 mm."""
STRAIGHT = 1.05e-3
"""On sides no longer than this [m] the joints go straight."""
BULGE = 2e-3
"""Pieces on which the joints leave the straight way by more [rad] are cut again."""
NEARER = 0.9
"""The wrist may come to this share of its smallest angle where a corner is approximated: what the
bound is too wide by, and what a corner between two motions at the limit takes."""
NEARLY_LINEAR = 1e-4
"""A triangle on which the joints are proven to be linear but for so much [rad] is not cut."""
LARGEST_BULGE = 0.03
"""A corner that cannot be cut into pieces better than this [rad] is given up."""
_RESERVE = 1.7
"""What is seen in the middle of sides, times 4/3, holds all over a parabola; the rest is spare."""
_WIDER = 1.25
_HALVINGS = 8
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


@dataclass(frozen=True, slots=True)
class Pieces:
    """Hulls of configurations q (t, 3, n, 6 + k): mixtures of the three of mixtures of the n.

    The three are corners of a piece of the triangle of the point, the n (1 or 3) of one of the
    orientations. ``slack`` (t, 6 + k): how far each axis may be beside the hull [rad]; ``corner``
    (t,): the corner it is a part of.
    """

    q: FloatArray
    slack: FloatArray
    corner: IndexArray


@dataclass(frozen=True, slots=True)
class Bound:
    """Where the arm may go at corners (c,).

    ``lost`` (c,): corners at which the posture may be left: out of reach with point and orientation
    in step, or near a straight wrist. Where only what is not in step is out of reach the hulls end
    at the edge of it. ``wrist`` (c,): the least that A5 is off the straight and the folded wrist
    [rad] wherever the tool point may be led along the triangle of the tool; infinite between joint
    motions.
    """

    pieces: tuple[Pieces, ...]
    lost: BoolArray
    wrist: FloatArray


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


def bound_of(kinematics: Kinematics, corners: Corners) -> Bound:
    """Return the hulls that bound where the arm may go at corners."""
    q = np.concatenate([corners.q, corners.external], axis=2)
    lost = ~np.isfinite(q).all(axis=(1, 2))
    is_path = corners.is_path.any(axis=1)
    way, turn = _sides(corners)
    plain = is_path & (way <= STRAIGHT) & (turn <= IN_STEP)
    by_joints = np.flatnonzero(~lost & ~plain & ~corners.is_path.all(axis=1))
    led = np.flatnonzero(~lost & plain)
    found = [_straight(q[led], led)]
    if corners.q_middle is not None:
        found += _bent(corners, q, lost)
    rows = np.flatnonzero(~lost & is_path & ~plain)
    size = np.stack([way[rows] / PIECE_LENGTH, turn[rows] / PIECE_ANGLE], axis=1)
    counts: IndexArray = np.maximum(np.ceil(size - 1e-9), 1.0).astype(np.int64)
    counts[turn[rows] <= IN_STEP, 1] = 0
    easy = np.zeros(len(corners), dtype=np.bool_)
    for in_step in (False, True):
        same = rows[(counts[:, 1] == 0) == in_step]
        for low in range(0, len(same), AT_ONCE):
            pieces = _linear(kinematics, corners, q, same[low : low + AT_ONCE], in_step=in_step)
            easy[pieces.corner] = True
            found.append(pieces)
    rows, counts = rows[~easy[rows]], counts[~easy[rows]]
    while len(rows):
        last = 4 * counts.prod(axis=1, where=counts > 0) > MOST_PARTS
        again = []
        for points, turns, same in _alike(counts):
            pieces, gone, bulge = _cells(kinematics, corners, rows[same], points, turns)
            lost[rows[same[gone]]] = True
            lost[rows[same[last[same] & (bulge > LARGEST_BULGE)]]] = True
            coarse = ~gone & (bulge > BULGE) & ~last[same]
            again.append(same[coarse])
            good = np.repeat(~lost[rows[same]] & ~coarse, len(pieces.q) // len(same))
            found.append(Pieces(pieces.q[good], pieces.slack[good], pieces.corner[good]))
        kept = np.concatenate([np.zeros(0, dtype=np.int64), *again])
        rows, counts = rows[kept], 2 * counts[kept]
    wrist = np.full(len(corners), np.inf)
    for pieces in found:
        np.minimum.at(wrist, pieces.corner, _off_straight(kinematics, pieces))
    found.insert(0, _straight(q[by_joints], by_joints))
    return Bound(tuple(_joined(found)), lost, wrist)


def _off_straight(kinematics: Kinematics, pieces: Pieces) -> FloatArray:
    """Return the least (t,) [rad] that A5 is off straight in hulls: concave, least at corners."""
    at_corners = wrist_distance(kinematics, pieces.q[..., :6]).min(axis=(1, 2), initial=np.inf)
    return np.asarray(at_corners - pieces.slack[:, 4])


def _joined(found: list[Pieces]) -> Iterator[Pieces]:
    """Yield pieces, all that are mixtures of as many together, in order of their corners."""
    for n in sorted({pieces.q.shape[2] for pieces in found if len(pieces.q)}):
        same = [pieces for pieces in found if pieces.q.shape[2] == n]
        q, slack, corner = (
            np.concatenate([getattr(pieces, name) for pieces in same])
            for name in ("q", "slack", "corner")
        )
        order = np.argsort(corner, kind="stable")
        yield Pieces(q[order], slack[order], corner[order])


def _alike(counts: IndexArray) -> Iterator[tuple[int, int, IndexArray]]:
    """Yield each of counts (r, 2), points and turns, with rows that have it, not too many."""
    for points, turns in np.unique(counts, axis=0).tolist():
        same = np.flatnonzero((counts == (points, turns)).all(axis=1))
        size = max(1, AT_ONCE // (points * max(turns, 1)) ** 2)
        yield from ((points, turns, same[low : low + size]) for low in range(0, len(same), size))


def _straight(q: FloatArray, corner: IndexArray) -> Pieces:
    """Return triangles of configurations (t, 3, 6 + k)."""
    return Pieces(q[:, :, None], np.zeros((len(q), q.shape[2])), corner)


def _bent(corners: Corners, q: FloatArray, lost: BoolArray) -> list[Pieces]:
    """Return the triangles that bent motions take up beside the chord of their ends."""
    assert corners.q_middle is not None  # noqa: S101 - the caller has asked
    found = []
    for side, end in ((0, 0), (1, 2)):
        bent = np.flatnonzero(~lost & np.isfinite(corners.q_middle[:, side, 0]))
        external = corners.external[bent][:, [end, 1]].mean(axis=1)
        middle = np.concatenate([corners.q_middle[bent, side], external], axis=1)
        found.append(_straight(np.stack([q[bent, end], middle, q[bent, 1]], axis=1), bent))
    return found


def _linear(
    kinematics: Kinematics, corners: Corners, q: FloatArray, rows: IndexArray, *, in_step: bool
) -> Pieces:
    """Return the triangles (t, 3, 3 or 1, 6 + k) of those corners (r,) that need no cut."""
    T, count = corners.T_robroot_tcp[rows], len(rows)
    way = T[..., :3, 3]
    way = (way - way[:, [1]])[:, :, None]
    turn = np.zeros((count, 1, 3, 3))
    turn[:, 0, [0, 2]] = _turns(T) @ np.swapaxes(T[:, 1, :3, :3], 1, 2)
    if in_step:
        turn = np.swapaxes(turn, 1, 2)
    ways = np.concatenate(np.broadcast_arrays(way, turn), axis=3)
    moved, slack = linear_joints(
        kinematics,
        corners.q[rows, 1],
        T[:, 1],
        np.broadcast_to(corners.T_flange_tcp, (len(corners), 4, 4))[rows],
        ways.reshape(count, 3 * ways.shape[2], 6),
    )
    kept = np.flatnonzero(slack.max(axis=1, initial=0.0) <= NEARLY_LINEAR)
    hulls = np.repeat(q[rows[kept]][:, :, None], ways.shape[2], axis=2)
    hulls[..., :6] = q[rows[kept], None, None, 1, :6] + moved[kept].reshape(-1, *ways.shape[1:])
    beside = np.zeros((len(kept), q.shape[2]))
    beside[:, :6] = slack[kept]
    return Pieces(hulls, beside, rows[kept])


def _cells(
    kinematics: Kinematics, corners: Corners, rows: IndexArray, points: int, turns: int
) -> tuple[Pieces, BoolArray, FloatArray]:
    """Return pieces of corners (r,), which are lost (r,), and the largest bulge (r,) [rad]."""
    weight, nodes = _grid(points)
    at = corners.T_robroot_tcp[rows][..., :3, 3]
    p = at[:, [1]] + np.einsum("ne,rei->rni", weight, at[:, [0, 2]] - at[:, [1]])
    other, other_nodes = _grid(turns) if turns else (weight[:, None], np.zeros((1, 1), np.int64))
    shape = (len(rows), len(weight), other.shape[-2])
    mixed = np.broadcast_to(other, (*shape, 2))
    q, reached = _posed(kinematics, corners, rows, p, mixed)
    edge = np.zeros((len(rows), *nodes.shape[:1], *other_nodes.shape[:1]), dtype=np.bool_)
    gone = np.asarray(~reached.all(axis=(1, 2)))
    if turns and gone.any():
        out = np.flatnonzero(gone)
        q[out], gone[out] = _to_reach(
            kinematics, corners, rows[out], p[out], mixed[out], weight, q[out], reached[out]
        )
        edge = np.asarray(~reached[:, nodes][..., other_nodes].all(axis=(2, 4)))
    ends = corners.external[rows][:, [0, 2]] - corners.external[rows][:, [1]]
    external = corners.external[rows][:, [1]] + np.einsum("ne,rek->rnk", weight, ends)
    external = np.repeat(external[:, :, None], shape[2], axis=2)
    every = np.concatenate([q, external], axis=3)
    every = every[:, nodes][:, :, :, other_nodes]
    # (r, f, 6, g, 1 or 6, 6 + k) to (r, f, g, 6, 1 or 6, 6 + k)
    every = np.swapaxes(every, 2, 3)
    n = 3 if turns else 1
    hulls = every[:, :, :, :3, :n]
    middles = np.einsum("ai,rfgijd,bj->rfgabd", _MIDDLES, hulls, _MIDDLES if turns else np.eye(1))
    bulge = _RESERVE * np.abs(every - middles).max(axis=(3, 4))
    leaps = np.ptp(hulls[..., :6], axis=(3, 4)).max(axis=(1, 2, 3)) > _LEAP
    slack = np.where(edge[..., None], np.ptp(every, axis=(3, 4)), bulge)
    largest = np.where(edge, 0.0, bulge.max(axis=3)).max(axis=(1, 2))
    count = slack.shape[1] * slack.shape[2]
    pieces = Pieces(
        hulls.reshape(len(rows) * count, 3, n, -1),
        slack.reshape(len(rows) * count, -1),
        np.repeat(rows, count),
    )
    return pieces, gone, np.where(leaps, np.inf, largest)


def _posed(
    kinematics: Kinematics, corners: Corners, rows: IndexArray, p: FloatArray, mixed: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return the joints (r, n, m, 6) at points and orientations, and which are within reach."""
    T = corners.T_robroot_tcp[rows]
    rotation = np.einsum("rnme,rei->rnmi", mixed, _turns(T))
    R = T[:, None, None, 1, :3, :3] @ rotation_from_vector(rotation)
    poses = transform(R, np.broadcast_to(p[:, :, None], rotation.shape))
    tool = np.broadcast_to(corners.T_flange_tcp, (len(corners), 4, 4))[rows]
    flange = poses @ inverse(tool)[:, None, None]
    q_corner = np.repeat(corners.q[rows, 1], mixed.shape[1] * mixed.shape[2], axis=0)
    q, valid = _near(kinematics, flange.reshape(-1, 4, 4), q_corner)
    return q.reshape(*mixed.shape[:3], 6), valid.reshape(mixed.shape[:3])


def _to_reach(
    kinematics: Kinematics,
    corners: Corners,
    rows: IndexArray,
    p: FloatArray,
    mixed: FloatArray,
    in_step: FloatArray,
    q: FloatArray,
    reached: BoolArray,
) -> tuple[FloatArray, BoolArray]:
    """Return the joints, led to the edge of reach where beyond it, and which are lost (r,)."""
    wanted = np.broadcast_to(in_step[None, :, None], mixed.shape)
    found, valid = _posed(kinematics, corners, rows, p, wanted[:, :, :1])
    lost = np.asarray(~valid.all(axis=(1, 2)))
    q = np.where(reached[..., None], q, found)
    low, high = np.zeros(reached.shape), np.ones(reached.shape)
    for _ in range(_HALVINGS):
        share = 0.5 * (low + high)
        between = mixed + share[..., None] * (wanted - mixed)
        found, valid = _posed(kinematics, corners, rows, p, between)
        nearer = valid & ~reached
        q = np.where(nearer[..., None], found, q)
        low, high = np.where(nearer, low, share), np.where(nearer, share, high)
    return q, lost


def _near(
    kinematics: Kinematics, T_robroot_flange: FloatArray, q_near: FloatArray
) -> tuple[FloatArray, BoolArray]:
    """Return the joints (n, 6) in the posture of others, those themselves out of reach."""
    q, valid = kinematics.ik_in(T_robroot_flange, kinematics.slot(q_near))
    q = kinematics.split_wrist(q, q_near)
    q = q + TURN * np.round((q_near - q) / TURN)
    return np.where(valid[:, None], q, q_near), valid


def _sides(corners: Corners) -> tuple[FloatArray, FloatArray]:
    """Return the longest way (c,) [m] and turn (c,) [rad] of the two sides of each corner."""
    T = np.nan_to_num(corners.T_robroot_tcp)
    p = T[..., :3, 3]
    ways = np.linalg.norm(p[:, [0, 2]] - p[:, [1]], axis=2)
    return ways.max(axis=1), np.linalg.norm(_turns(T), axis=2).max(axis=1)


def _turns(T: FloatArray) -> FloatArray:
    """Return the turns (c, 2, 3) [rad] from the corner to where approximation begins and ends."""
    found = [axis_angle(T[:, 1, :3, :3], T[:, end, :3, :3]) for end in (0, 2)]
    return np.stack([axis * angle[:, None] for axis, angle in found], axis=1)


_MIDDLES = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [0, 0.5, 0.5], [0.5, 0, 0.5]])
"""Corners of a triangle and the middles of its sides, as mixtures of its corners."""


def _grid(count: int) -> tuple[FloatArray, IndexArray]:
    """Return the nodes of a triangle whose sides are cut, with the middles of all sides."""
    fine = 2 * count
    number: dict[tuple[int, int], int] = {}
    for i in range(fine + 1):
        for j in range(fine + 1 - i):
            number[i, j] = len(number)
    faces = []
    for i in range(0, fine, 2):
        for j in range(0, fine - i, 2):
            corners = [((i, j), (i + 2, j), (i, j + 2))]
            if i + j < fine - 2:
                corners.append(((i + 2, j), (i, j + 2), (i + 2, j + 2)))
            for a, b, c in corners:
                middles = [
                    ((u[0] + v[0]) // 2, (u[1] + v[1]) // 2) for u, v in ((a, b), (b, c), (c, a))
                ]
                faces.append([number[node] for node in (a, b, c, *middles)])
    return np.array(list(number), dtype=np.float64) / fine, np.array(faces)
