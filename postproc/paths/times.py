"""How long executed motions take: an estimate from programmed speeds, ramps and axis limits."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from postproc.arrays import AT_ONCE, AnyIntArray, FloatArray
from postproc.cell import Cell, Robot, Tool
from postproc.controller import Blend, EventWord
from postproc.kinematics import dynamics_of
from postproc.paths.motion import Paths, top_speeds
from postproc.timing import (
    RAMP,
    SPEED_UP_TIME,
    Bends,
    JointPath,
    Torques,
    joint_move_time,
    path_times,
    slopes,
)

SLOWEST = 1e-7
"""A path speed [m/s] below this is none; times are finite with it."""


_TINY = 1e-12
_SLOWEST_AXIS = 1e-5
"""An axis speed [rad/s or m/s] below this is none."""


def motion_times(paths: Paths) -> FloatArray:
    """Return the time (m,) [s] of path motions at their programmed speed, NaN for PTP.

    The orientation may be what decides. A chain that is too short to reach the speed from rest
    with $ACC.CP is taken at the speed that it can reach.
    """
    trace, curves = paths.trace, paths.curves
    speed = np.maximum(np.minimum(trace.column("speed"), _reachable(paths)), SLOWEST)
    turning = np.maximum(trace.column("orientation_speed"), SLOWEST)
    way = np.where(curves.length > _TINY, curves.length / speed, 0.0)
    turn = np.where(curves.angle > _TINY, curves.angle / turning, 0.0)
    return np.where(trace.is_cp, np.maximum(way, turn), np.nan)


def _reachable(paths: Paths) -> FloatArray:
    """Return the largest speed (m,) [m/s] within the chain of blended motions of each motion."""
    trace = paths.trace
    chain = chains(paths)
    length = np.bincount(chain, weights=paths.curves.length) if len(chain) else np.zeros(0)
    return np.asarray(np.sqrt(trace.column("acceleration") * np.maximum(length[chain], _TINY)))


def chains(paths: Paths) -> AnyIntArray:
    """Return the number (m,) of the chain, from stop to stop, that each motion belongs to."""
    trace = paths.trace
    if len(trace) == 0:
        return np.zeros(0, dtype=np.int64)
    stops = (trace.blend == Blend.EXACT) | ~trace.is_cp
    begins = np.r_[True, stops[:-1] | ~trace.is_cp[1:]]
    for event in trace.events:
        if event.word is not EventWord.OUTPUT and event.motion < len(trace):
            begins[event.motion] = True
    return np.cumsum(begins) - 1


def cycle_time(paths: Paths, times: FloatArray) -> float:
    """Return an estimate of the run time [s]: motions with ramps, and waits; hooks take none.

    Args:
        paths: the run.
        times: (m,) ``durations`` of its motions.
    """
    events = paths.trace.events
    waits = sum(e.value for e in events if e.word is EventWord.DWELL and np.isfinite(e.value))
    return float(waits + times.sum())


def durations(paths: Paths, cell: Cell) -> FloatArray:
    """Return an estimate (m,) [s] of each motion, with ramps, jerk and torques."""
    trace = paths.trace
    times = np.zeros(len(trace))
    cp = np.flatnonzero(trace.is_cp)
    turning = paths.curves.angle / np.maximum(trace.column("orientation_speed"), SLOWEST)
    times[cp] = path_times(
        paths.curves.length[cp],
        np.maximum(trace.column("speed")[cp], SLOWEST),
        chains(paths)[cp],
        np.nan_to_num(turning[cp]),
        trace.column("acceleration")[cp],
        _joints_along(paths, cell, cp),
        bends_of(paths, cp),
    )
    joint = np.flatnonzero(~trace.is_cp)
    joint = joint[joint > 0]
    share = np.array([s.ptp for s in trace.settings]).reshape(-1, 6)[trace.setting[joint]]
    share = np.hstack([share, np.tile(share[:, :1], (1, len(cell.external_axes)))])
    places = np.nan_to_num(np.hstack([paths.q, paths.external]))
    speed = top_speeds(cell)
    push = np.append(cell.robot.qdd_max, speed[6:] / SPEED_UP_TIME)
    top = np.maximum(speed * share, _SLOWEST_AXIS)
    ramps = np.append(jerk_ramps(cell.robot), np.full(len(speed) - 6, RAMP))
    torques = torques_of(cell.robot, cell.tools, paths.station.tool[joint])
    times[joint] = joint_move_time(places[joint - 1], places[joint], top, push, ramps, torques)
    return times


def torques_of(
    robot: Robot, tools: Sequence[Tool], tool: AnyIntArray | None = None
) -> Torques | None:
    """Return what the joints need and have, None where nobody has said inertias or limits.

    Args:
        robot: the arm.
        tools: of the cell.
        tool: (m,) which of them is on the flange in each motion; None: the first in all.
    """
    if robot.torque_max is None:
        return None
    used = [0] if tool is None else np.unique(tool).tolist()
    arms = {index: dynamics_of(robot, tools[index]) for index in used}

    def of(row: AnyIntArray, q: FloatArray, qd: FloatArray, qdd: FloatArray) -> FloatArray:
        mine = np.zeros(len(row), dtype=np.int64) if tool is None else tool[row]
        found = np.zeros_like(q)
        for index, arm in arms.items():
            at = mine == index
            if arm is not None and at.any():
                found[at] = arm.torques(q[at], qd[at], qdd[at])
        return found

    return Torques(of, robot.torque_max)


def joint_times(
    cell: Cell, share: float | FloatArray, q_from: FloatArray, q_to: FloatArray
) -> FloatArray:
    """Return the time (m,) [s] of PTP moves of the arm from rest to rest.

    Args:
        cell: its robot moves with its first tool.
        share: of the axes' speeds, one or (m,).
        q_from: (m, 6) [rad].
        q_to: (m, 6) [rad].
    """
    robot = cell.robot
    speed = robot.qd_max * np.reshape(share, (-1, 1))
    torques = torques_of(robot, [cell.tool])
    return joint_move_time(q_from, q_to, speed, robot.qdd_max, jerk_ramps(robot), torques)


def jerk_ramps(robot: Robot) -> FloatArray:
    """Return the time (6,) [s] in which each axis builds its acceleration up."""
    return np.full(6, RAMP) if robot.qddd_max is None else robot.qdd_max / robot.qddd_max


def joint_path(
    robot: Robot,
    row: AnyIntArray,
    share: FloatArray,
    q: FloatArray,
    q_start: FloatArray,
    blend: FloatArray,
    torques: Torques | None,
) -> JointPath | None:
    """Return what bounds the axes along path motions.

    None where nobody has said accelerations or torques.

    Args:
        robot: the arm.
        row: (s,) motion of each sample.
        share: (s,) place on it [0, 1].
        q: (s, 6) [rad] there.
        q_start: (m, 6) where each motion starts.
        blend: (m,) distance [m] at the end of each, infinite for half the way.
        torques: of the motions.
    """
    if not robot.has_acceleration and torques is None:
        return None
    inner = share > 0.0
    ramp = float(jerk_ramps(robot).max())
    most = robot.qdd_max if robot.has_acceleration else np.full(6, np.inf)
    return JointPath(row[inner], share[inner], q[inner], q_start, blend, most, ramp, torques)


def _joints_along(paths: Paths, cell: Cell, cp: AnyIntArray) -> JointPath | None:
    mine = paths.trace.is_cp[paths.row]
    row = np.searchsorted(cp, paths.row[mine])
    q, start = np.nan_to_num(paths.q_sample[mine]), np.nan_to_num(paths.q)[np.maximum(cp - 1, 0)]
    blend = _blending_distances(paths)[cp]
    torques = torques_of(cell.robot, cell.tools, paths.station.tool[cp])
    return joint_path(cell.robot, row, paths.share[mine], q, start, blend, torques)


def bends_of(paths: Paths, cp: AnyIntArray) -> Bends:
    """Return where path motions ``cp`` (m,) turn; splines between points as their chords do."""
    curves = paths.curves
    start, end = curves.T_start[:, :3, 3], curves.T_end[:, :3, 3]
    begin = np.nan_to_num(end - start)
    leave, radius = begin.copy(), np.full(len(end), np.inf)
    rows = np.flatnonzero(curves.circle >= 0)
    arcs, number = curves.circles, curves.circle[rows]
    radius[rows] = arcs.radius[number]
    begin[rows] = np.cross(arcs.normal[number], start[rows] - arcs.centre[number])
    leave[rows] = np.cross(arcs.normal[number], end[rows] - arcs.centre[number])
    return Bends(begin[cp], leave[cp], radius[cp], _blending_distances(paths)[cp])


def _blending_distances(paths: Paths) -> FloatArray:
    """Return (m,) [m] how far before the end of each motion the next is approached at most."""
    trace = paths.trace
    return np.where(trace.blend == Blend.DISTANCE, trace.column("cdis"), np.inf)


def at_speed(paths: Paths) -> tuple[AnyIntArray, FloatArray, FloatArray, FloatArray]:
    """Return how the axes move along path motions, as if the programmed speed were held all along.

    The motion (k,) of each place, joints [rad], their speeds and accelerations (k, 6) there.
    """
    speed = paths.trace.column("speed")
    moves = paths.trace.is_cp & (paths.curves.length > SLOWEST) & np.isfinite(speed)
    moves[:1] = False
    rows = np.flatnonzero(moves)
    inner = moves[paths.row] & (paths.share > 0.0)
    row = np.concatenate([rows, paths.row[inner]])
    share = np.concatenate([np.zeros(len(rows)), paths.share[inner]])
    q = np.vstack([paths.q[rows - 1], paths.q_sample[inner]])
    order = np.lexsort((share, row))
    order = order[np.isfinite(q[order]).all(axis=1)]
    row, q = row[order], q[order]
    first, second = slopes(row, share[order] * paths.curves.length[row], q)
    rate = speed[row][:, None]
    return row, q, first * rate, second * rate**2


def feed_shares(paths: Paths, cell: Cell) -> FloatArray:
    """Return how much of its speed (s, 6 + k) each axis needs for the programmed path speed.

    As if the path speed were held all along: neither ramps nor the speed of the orientation make
    a motion slower. What a feed asks of the axes is a question of the path.
    """
    speed = np.maximum(paths.trace.column("speed"), SLOWEST)
    return _shares(paths, cell, np.where(paths.trace.is_cp, paths.curves.length / speed, np.nan))


def speed_shares(paths: Paths, cell: Cell) -> FloatArray:
    """Return how much of its speed (s, 6 + k) each axis needs at each sample, 1 = its limit.

    The external axes stand behind those of the arm.
    """
    return _shares(paths, cell, motion_times(paths))


def _shares(paths: Paths, cell: Cell, times: FloatArray) -> FloatArray:
    top = top_speeds(cell)
    needed = np.zeros((len(paths.row), len(top)))
    for low in range(0, len(needed), AT_ONCE):
        own = slice(max(low - 1, 0), low + AT_ONCE)  # with the sample before
        row, share = paths.row[own], paths.share[own]
        first = np.diff(row, prepend=-1) != 0
        sample = np.hstack(
            [paths.q_sample[own], paths.curves.external_at(row, share, paths.external)]
        )
        start = np.maximum(row - 1, 0)
        at_start = np.hstack([paths.q[start], paths.external[start]])
        before = np.where(first[:, None], at_start, np.roll(sample, 1, axis=0))
        dt = times[row] * np.where(first, share, share - np.roll(share, 1))
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = np.abs(sample - before) / dt[:, None] / top
        shares[(row == 0) | ~(dt > _TINY)] = np.nan
        needed[low : own.stop] = np.where(np.isfinite(shares), shares, 0.0)[low - own.start :]
    return needed
