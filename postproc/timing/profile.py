"""How long motions take: an estimate, not the controller's own planner.

Rest-to-rest motions (rapids, retracts, drill strokes) are time-optimal with limited jerk, by
ruckig. Axes of a joint motion speed up, keep their speed and slow down together, as a controller of
KUKA moves them (synchronous PTP: the way is the same at every speed): one profile for all, slow
enough for each. Along a chain of blended CP motions the speed is planned on the path: the
programmed feed and the axes' speed and acceleration limits give a cap at every point, a backward
and a forward pass make it reachable, and jerk is limited by averaging the profile over ``ramp``
seconds, which is what a controller's filter does: the way stays the same, every stretch from stop
to stop takes ``ramp`` longer.

ruckig's intermediate waypoints are never used: it would send them to a service on the network.
No source publishes jerk limits; jerk is taken as acceleration over ``RAMP``.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from postproc.arrays import ROUNDING, AnyIntArray, FloatArray, runs
from postproc.records import dataclass
from postproc.timing.bounded import JointPath, blending_distances, bounded_times, segment_times
from postproc.timing.torques import Torques

RAMP = 0.1
"""Time [s] in which acceleration is built up; assumed."""
PATH_ACCELERATION = 2.3
"""[m/s^2], the default of $ACC.CP on KUKA controllers."""
_MOMENTS = 33
"""Of a joint move at which torques are asked for: quarters of its time are among them, where it
speeds up most if it is short."""
SPEED_UP_TIME = 0.5
"""Time [s] in which an external axis reaches its speed; assumed."""
_TINY = 1e-12
_FAR = 1e5
"""A way [m or rad] of which the rest is made at even speed."""
_STOPS = 1e-7
"""A corner that turns back is passed at this speed [m/s]: times are finite."""


def joint_move_time(
    q_from: ArrayLike,
    q_to: ArrayLike,
    speed: ArrayLike,
    acceleration: ArrayLike,
    ramp: ArrayLike = RAMP,
    torques: Torques | None = None,
) -> FloatArray:
    """Return the time (m,) [s] of rest-to-rest joint moves whose axes share one phase profile.

    Args:
        q_from: (m, d) [rad] (or metres for a rail).
        q_to: (m, d) likewise.
        speed: (d,) or (m, d) limits [rad/s].
        acceleration: (d,) limits [rad/s^2].
        ramp: one or (d,), time in which full acceleration is built up [s]; the jerk of an axis is
            its acceleration / ramp.
        torques: of the first axes; a move that needs more than they have takes longer.
    """
    way = np.abs(np.atleast_2d(np.asarray(q_to, dtype=np.float64) - np.asarray(q_from)))
    top = np.broadcast_to(np.asarray(speed, dtype=np.float64), way.shape)
    push = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), way.shape)
    longest = way.max(axis=1, initial=0.0)
    share = way / np.maximum(longest, _TINY)[:, None]
    with np.errstate(divide="ignore"):
        speeds = (top / share).min(axis=1, initial=np.inf)
        pushes = (push / share).min(axis=1, initial=np.inf)
        jerks = (push / np.asarray(ramp) / share).min(axis=1, initial=np.inf)
    times = np.zeros(len(way))
    for row in np.flatnonzero(longest > _TINY).tolist():
        ramp_here = pushes[row] / jerks[row]
        times[row] = _RestToRest.time(longest[row], speeds[row], pushes[row], ramp_here)
        if torques is not None:
            d = len(torques.most)
            start, end = (np.atleast_2d(q)[row, :d] for q in (q_from, q_to))
            moments = [p[:, None] * (end - start) / longest[row] for p in _RestToRest.moments()]
            moments[0] += start
            at = np.array([row])
            times[row] *= torques.slower(at, *(values[None] for values in moments))[0]
    return times


def line_time(
    length: ArrayLike,
    speed: ArrayLike,
    acceleration: ArrayLike = PATH_ACCELERATION,
    ramp: float = RAMP,
) -> FloatArray:
    """Return the time (m,) [s] of straight moves from rest to rest.

    Args:
        length: (m,) [m].
        speed: (m,) or one [m/s].
        acceleration: (m,) or one, along the path [m/s^2].
        ramp: as in ``joint_move_time``.
    """
    way = np.atleast_1d(np.asarray(length, dtype=np.float64))
    top = np.broadcast_to(np.asarray(speed, dtype=np.float64), way.shape)
    push = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), way.shape)
    known: dict[tuple[float, float, float], float] = {}
    times = np.zeros(len(way))
    keys = zip(np.round(way, 9).tolist(), top.tolist(), push.tolist(), strict=True)
    for i, key in enumerate(keys):
        if key not in known:
            known[key] = _RestToRest.time(*key, ramp)
        times[i] = known[key]
    return times


@dataclass(frozen=True, slots=True)
class PathSpeed:
    """A speed profile over the knots of a chain.

    ``speed`` (k,) [m/s or per unit of the path] at the knots, ``duration`` (k-1,) [s] of the
    segments, the jerk ramp included.
    """

    speed: FloatArray
    duration: FloatArray


@dataclass(frozen=True, slots=True)
class Bends:
    """Where path motions (m,) turn, which costs speed: what turns them is acceleration too.

    Args:
        begin: (m, 3) heading at the start of each, of any length; end: (m, 3) at its end.
        radius: (m,) of arcs [m], infinite for straight motions.
        blend: (m,) distance [m] at the end of each from which on the next one is approached;
            infinite for half the way.
    """

    begin: FloatArray
    end: FloatArray
    radius: FloatArray
    blend: FloatArray

    def corner_speeds(self, length: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Return the largest speed (m - 1,) [m/s] between each motion and the next.

        A corner by an angle a is rounded as by the parabola that leaves both ways at the blending
        distance d; at its vertex the radius is d cos^2(a/2) / sin(a/2).

        Args:
            length: (m,) of the motions [m].
            acceleration: (m,) that may turn the motion [m/s^2].
        """
        end, begin = self.end[:-1], self.begin[1:]
        size = np.linalg.norm(end, axis=1) * np.linalg.norm(begin, axis=1)
        moves = size > _TINY
        cosine = np.einsum("ij,ij->i", end, begin) / np.where(moves, size, 1.0)
        half = 0.5 * np.arccos(np.clip(np.where(moves, cosine, 1.0), -1.0, 1.0))
        distance = blending_distances(self.blend, length)
        bend = np.maximum(np.sin(half), _TINY)
        square = np.minimum(acceleration[:-1], acceleration[1:]) * distance / bend
        return np.where(moves, np.maximum(np.sqrt(square) * np.cos(half), _STOPS), np.inf)

    def slowed(self, speed: FloatArray, acceleration: FloatArray) -> FloatArray:
        """Return the speeds (m,) [m/s], lowered on arcs to what turns at their radius."""
        return np.minimum(speed, np.sqrt(acceleration * self.radius))


def chain_profile(
    way: ArrayLike,
    cap: ArrayLike,
    acceleration: ArrayLike = PATH_ACCELERATION,
    ramp: float = RAMP,
    corner: ArrayLike = np.inf,
) -> PathSpeed:
    """Return the speed along a chain that starts and ends at rest.

    Args:
        way: (k,) path coordinate of the knots [m], not falling.
        cap: (k-1,) largest speed on each segment [m/s] (feed and axis speeds).
        acceleration: one or (k-1,) largest acceleration on each segment [m/s^2].
        ramp: jerk is acceleration / ramp.
        corner: one or (k-2,) largest speed at each knot inside the chain [m/s].
    """
    s = np.asarray(way, dtype=np.float64)
    step = np.diff(s)
    top = np.asarray(cap, dtype=np.float64)
    push = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), step.shape)
    limit = np.zeros(len(s))
    limit[1:-1] = np.minimum(np.minimum(top[:-1], top[1:]), corner)
    gain = (2.0 * push * step).tolist()
    square = (limit**2).tolist()
    for i in range(len(step)):
        square[i + 1] = min(square[i + 1], square[i] + gain[i])
    for i in range(len(step) - 1, -1, -1):
        square[i] = min(square[i], square[i + 1] + gain[i])
    speed = np.sqrt(np.array(square))
    duration = segment_times(step, speed, top, push)
    if len(step):
        total = float(duration.sum())
        duration = duration * (1.0 + ramp / total) if total > _TINY else duration
    return PathSpeed(speed, duration)


def path_times(
    length: FloatArray,
    speed: FloatArray,
    chain: AnyIntArray,
    turning: FloatArray,
    acceleration: ArrayLike = PATH_ACCELERATION,
    joints: JointPath | None = None,
    bends: Bends | None = None,
) -> FloatArray:
    """Return the time (m,) [s] of path motions in order.

    Args:
        length: (m,) [m].
        speed: (m,) largest speed [m/s].
        chain: (m,) equal from one stop to the next.
        turning: (m,) time that the orientation needs at least [s].
        acceleration: one or (m,) along the path [m/s^2].
        joints: of the motions, where the axes bound the acceleration as well.
        bends: of the motions, where they are not all in one line.
    """
    push = np.broadcast_to(np.asarray(acceleration, dtype=np.float64), length.shape)
    corner = np.full(max(len(length) - 1, 0), np.inf)
    if bends is not None:
        speed, corner = bends.slowed(speed, push), bends.corner_speeds(length, push)
    times, push = np.zeros(len(length)), push.copy()
    ramp = RAMP if joints is None else joints.ramp
    alone = []
    for low, high in runs(chain):
        part, needed = slice(low, high), None
        if joints is not None:
            needed = bounded_times(length, speed, push, joints, (low, high))
        if high - low == 1:
            alone.append(low)
            if needed is not None:
                push[low] = min(push[low], _even_push(length[low], speed[low], needed[0]))
            continue
        way = np.concatenate([[0.0], np.cumsum(length[part])])
        inner = corner[low : high - 1]
        times[part] = chain_profile(way, speed[part], push[part], ramp, inner).duration
        if needed is not None:
            needed *= 1.0 + ramp / max(float(needed.sum()), _TINY)
            times[part] = np.maximum(times[part], needed)
    times[alone] = line_time(length[alone], speed[alone], push[alone], ramp)
    return np.maximum(times, turning)


def _even_push(length: float, speed: float, time: float) -> float:
    """Return the even acceleration [m/s^2] that takes a time [s] from stop to stop."""
    if time * speed <= length + _TINY:
        return np.inf
    ramps = time - length / speed
    return speed / ramps if ramps * speed <= length else 4.0 * length / time**2


def axis_speed_cap(dq: ArrayLike, step: ArrayLike, q_speed: ArrayLike) -> FloatArray:
    """Return the largest path speed (k,) [m/s] at which no axis exceeds its speed.

    Args:
        dq: (k, d) joint change over each segment [rad].
        step: (k,) length of each segment [m].
        q_speed: (d,) limits [rad/s].
    """
    change = np.abs(np.asarray(dq, dtype=np.float64))
    length = np.asarray(step, dtype=np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        cap = np.where(change > _TINY, length[:, None] * np.asarray(q_speed) / change, np.inf)
    return np.asarray(cap.min(axis=1, initial=np.inf))


class _RestToRest:
    """One axis from rest to rest, by ruckig, with its objects made once."""

    _parts: tuple[object, object, object] | None = None

    @classmethod
    def time(cls, way: float, speed: float, acceleration: float, ramp: float) -> float:
        """Return the time-optimal duration [s] of a way >= 0 under speed, acceleration, jerk."""
        if way <= _TINY:
            return 0.0
        if way > _FAR:  # at even speed; absurd as it is, ruckig gives up
            return cls.time(_FAR, speed, acceleration, ramp) + (way - _FAR) / speed
        import ruckig

        if cls._parts is None:
            request = ruckig.InputParameter(1)
            cls._parts = (ruckig.Ruckig(1), request, ruckig.Trajectory(1))
        solver, request, trajectory = cls._parts
        request.current_position = [0.0]  # type: ignore[attr-defined]
        request.target_position = [float(way)]  # type: ignore[attr-defined]
        request.max_velocity = [float(speed)]  # type: ignore[attr-defined]
        request.max_acceleration = [float(acceleration)]  # type: ignore[attr-defined]
        request.max_jerk = [float(acceleration) / ramp]  # type: ignore[attr-defined]
        try:
            solver.calculate(request, trajectory)  # type: ignore[attr-defined]
        except ruckig.RuckigError:  # just where the acceleration is reached rounding finds no way
            request.target_position = [float(way) * (1.0 + ROUNDING)]  # type: ignore[attr-defined]
            solver.calculate(request, trajectory)  # type: ignore[attr-defined]
        return float(trajectory.duration)  # type: ignore[attr-defined]

    @classmethod
    def moments(cls) -> list[FloatArray]:
        """Return way, speed and acceleration (t,) at even moments of the last move timed."""
        if cls._parts is None:
            return [np.zeros(0)] * 3
        trajectory = cls._parts[2]
        at = np.linspace(0.0, trajectory.duration, _MOMENTS)  # type: ignore[attr-defined]
        rows = [trajectory.at_time(t) for t in at.tolist()]  # type: ignore[attr-defined]
        return list(np.array(rows)[:, :, 0].T)
