"""Forward kinematics and Jacobian of six joints in series, vectorised over configurations.

The arm is held as constants: where each joint sits in the link before it, and its axis. Work is
done in blocks of ``CHUNK`` configurations so that the intermediate columns stay in the cache, and
component by component (structure of arrays), which is several times faster than stacks of 4x4
matrices.
"""

from __future__ import annotations

from dataclasses import field

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import FloatArray, blocks, frozen_floats
from postproc.records import dataclass

CHUNK = 2000
"""Configurations handled at once."""
_EXACT = 1e-14
"""Constants nearer than this to 0 or +-1 are taken as such; multiplications fall away."""

Columns = tuple[FloatArray, FloatArray, FloatArray]
_Turn = tuple[FloatArray, FloatArray]
_Weights = tuple[float, float, float]
_Matrix = tuple[_Weights, _Weights, _Weights]


@dataclass(frozen=True, slots=True)
class SerialChain:
    """Six revolute joints between robroot and flange.

    Args:
        placements: (7, 4, 4) [m]: joint 1 in robroot, joint i+1 in link i, flange in link 6, all at
            angle zero.
        axes: (6, 3) unit axis of each joint in its own frame.
    """

    placements: FloatArray
    axes: FloatArray
    _steps: tuple[_Step, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        """Check shapes, freeze, and turn every joint axis onto z."""
        frozen_floats(self, "placements", (7, 4, 4))
        frozen_floats(self, "axes", (6, 3))
        object.__setattr__(self, "_steps", _steps_of(self.placements, self.axes))

    def fk(self, q: ArrayLike) -> FloatArray:
        """Return ``T_robroot_flange`` (..., 4, 4) [m] for joint angles (..., 6) [rad]."""
        angles = np.asarray(q, dtype=np.float64)
        flat = angles.reshape(-1, 6)
        T = np.zeros((len(flat), 4, 4))
        T[:, 3, 3] = 1.0
        steps = self._steps
        for block in blocks(len(flat), CHUNK):
            columns, origin = _identity()
            for step, cosine, sine in zip(steps[:6], *_trigonometry(flat[block]), strict=True):
                columns, origin = step.advance(columns, origin, cosine, sine)
            columns, origin = steps[6].advance(columns, origin)
            _write(T[block], columns, origin)
        return T.reshape(*angles.shape[:-1], 4, 4)

    def link_frames(self, q: ArrayLike) -> FloatArray:
        """Return the frames (..., 7, 4, 4) [m] in robroot of link 0 (robroot) and links 1..6."""
        angles = np.asarray(q, dtype=np.float64)
        links = self.links_of(angles.reshape(-1, 6))
        T = np.zeros((links.shape[-1], 7, 4, 4))
        T[..., :3, :] = np.moveaxis(links, -1, 0)
        T[..., 3, 3] = 1.0
        return T.reshape(*angles.shape[:-1], 7, 4, 4)

    def links_of(self, q: FloatArray) -> FloatArray:
        """Return ``link_frames`` of (n, 6) as (7, 3, 4, n): configurations last, row 4 left out."""
        links = np.empty((7, 3, 4, len(q)))
        links[0] = np.eye(4)[:3, :, None]
        for block in blocks(len(q), CHUNK):
            columns, origin = _identity()
            joints = zip(self._steps[:6], *_trigonometry(q[block]), strict=True)
            for link, (step, cosine, sine) in enumerate(joints, start=1):
                columns, origin = step.advance(columns, origin, cosine, sine)
                for place, column in enumerate((*_turned(columns, step.back), origin)):
                    links[link, :, place, block] = column
        return links

    def jacobian(self, q: ArrayLike, p_flange_tcp: ArrayLike = (0.0, 0.0, 0.0)) -> FloatArray:
        """Return the Jacobian (..., 6, 6) of the TCP, axes of robroot: linear [m/rad] then angular.

        At joint angles (..., 6) [rad]; ``p_flange_tcp`` (3,): TCP in the flange [m].
        """
        angles = np.asarray(q, dtype=np.float64)
        flat = angles.reshape(-1, 6)
        tcp = np.asarray(p_flange_tcp, dtype=np.float64)
        J = np.empty((len(flat), 6, 6))
        for block in blocks(len(flat), CHUNK):
            _write_jacobian(J[block], *self._turns(flat[block], tcp))
        return J.reshape(*angles.shape[:-1], 6, 6)

    def rates(self, q: ArrayLike, p_flange_tcp: ArrayLike, direction: ArrayLike) -> FloatArray:
        """Return how fast (n, 6) [m/rad] joints move the TCP along a direction: linear rows of J.

        At joint angles (n, 6) [rad]; ``direction`` (n, 3) unit, robroot; ``p_flange_tcp`` (3,) [m].
        """
        angles, along = np.asarray(q, dtype=np.float64), np.asarray(direction, dtype=np.float64)
        tcp = np.asarray(p_flange_tcp, dtype=np.float64)
        result = np.empty((len(angles), 6))
        for block in blocks(len(angles), CHUNK):
            turns, end = self._turns(angles[block], tcp)
            n = np.ascontiguousarray(along[block].T)
            before, lever = None, n
            for joint, (axis, origin) in enumerate(turns):
                if origin is not before:  # the axes of a wrist meet in one point
                    lever, before = _cross(end - origin, n), origin
                result[block, joint] = axis[0] * lever[0] + axis[1] * lever[1] + axis[2] * lever[2]
        return result

    def _turns(self, q: FloatArray, tcp: FloatArray) -> tuple[list[_Turn], FloatArray]:
        """Return axis and origin of each joint of a block, and the TCP; (3, n) or (3, 1)."""
        columns, origin = _identity()
        turns: list[_Turn] = []
        for step, cosine, sine in zip(self._steps[:6], *_trigonometry(q), strict=True):
            columns, origin = step.advance(columns, origin, cosine, sine)
            turns.append((columns[2], origin))
        columns, origin = self._steps[6].advance(columns, origin)
        return turns, origin + _combined(columns, _weights(tcp)) if tcp.any() else origin


@dataclass(frozen=True, slots=True)
class _Step:
    """From one joint's turned frame to the next one's, then about its z axis.

    ``turn``, ``shift`` [m]; ``back`` leads from the turned frame to the link frame. Matrices stand
    by columns, as plain numbers: whether one is 0 or 1 is asked for every block.
    """

    turn: _Matrix
    shift: _Weights
    back: _Matrix

    def advance(
        self,
        columns: Columns,
        origin: FloatArray,
        cosine: FloatArray | None = None,
        sine: FloatArray | None = None,
    ) -> tuple[Columns, FloatArray]:
        """Return the frame's columns (3, n) each and its origin (3, n)."""
        if any(self.shift):
            origin = origin + _combined(columns, self.shift)
        x, y, z = _turned(columns, self.turn)
        if cosine is None or sine is None:
            return (x, y, z), origin
        return (cosine * x + sine * y, cosine * y - sine * x, z), origin


def _steps_of(placements: FloatArray, axes: FloatArray) -> tuple[_Step, ...]:
    """Return the constants between joints whose axes are turned onto z."""
    steps: list[_Step] = []
    before = np.eye(3)
    for joint in range(7):
        after = _z_to(axes[joint]) if joint < 6 else np.eye(3)
        turn = before.T @ placements[joint, :3, :3] @ after
        shift = before.T @ placements[joint, :3, 3]
        steps.append(_Step(_by_columns(_cleaned(turn)), _weights(shift), _by_columns(after.T)))
        before = after
    return tuple(steps)


def _identity() -> tuple[Columns, FloatArray]:
    """Return columns and origin (3, 1) of robroot itself; those of all poses, until one turns."""
    x, y, z = np.eye(3)[:, :, None]
    return (x, y, z), np.zeros((3, 1))


def _trigonometry(q: FloatArray) -> tuple[FloatArray, FloatArray]:
    angles = np.ascontiguousarray(q.T)
    return np.cos(angles), np.sin(angles)


def _combined(columns: Columns, weights: _Weights) -> FloatArray:
    """Return the weighted sum of columns; weights 0, 1 and -1 cost no multiplication."""
    total: FloatArray | None = None
    for column, weight in zip(columns, weights, strict=True):
        if weight == 0.0:
            continue
        part = column if weight == 1.0 else weight * column
        total = part if total is None else total + part
    return np.zeros_like(columns[0]) if total is None else total


def _turned(columns: Columns, turn: _Matrix) -> Columns:
    x, y, z = turn
    return _combined(columns, x), _combined(columns, y), _combined(columns, z)


def _weights(vector: FloatArray) -> _Weights:
    x, y, z = vector.tolist()
    return x, y, z


def _by_columns(matrix: FloatArray) -> _Matrix:
    return _weights(matrix[:, 0]), _weights(matrix[:, 1]), _weights(matrix[:, 2])


def _cleaned(turn: FloatArray) -> FloatArray:
    nearest = np.rint(turn)
    return np.where(np.abs(turn - nearest) < _EXACT, nearest, turn)


def _z_to(axis: FloatArray) -> FloatArray:
    """Return a rotation (3, 3) whose third column is ``axis``."""
    other = np.eye(3)[int(np.argmin(np.abs(axis)))]
    x = np.cross(other, axis)
    x /= np.linalg.norm(x)
    return _cleaned(np.stack([x, np.cross(axis, x), axis], axis=1))


def _write(T: FloatArray, columns: Columns, origin: FloatArray) -> None:
    for place, column in enumerate((*columns, origin)):
        T[:, :3, place] = column.T


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """Return a x b (3, n)."""
    return np.stack(
        [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
    )


def _write_jacobian(J: FloatArray, turns: list[_Turn], end: FloatArray) -> None:
    for joint, (axis, origin) in enumerate(turns):
        x, y, z = end - origin
        ax, ay, az = axis
        J[:, 0, joint] = ay * z - az * y
        J[:, 1, joint] = az * x - ax * z
        J[:, 2, joint] = ax * y - ay * x
        J[:, 3:, joint] = axis.T
