"""The registration: where the measuring device stands and which point of the flange it sees.

    measured = T_measured_robroot · T_robroot_flange · p_flange_point

with six unknowns of the frame and three of the point (the reflector). Where the flange stands is
given, by the nominal arm or by a model of the real one; what the arm does beyond that stays in the
residual. Rows far off the others lose weight. The point has a wide prior around where it is
expected, which decides only what the postures cannot tell (all at one orientation: the point is
then a shift of the frame).

Each station has its own frame and each reflector its own place; rows of all are fitted together.
"""

from __future__ import annotations

import numpy as np

from postproc.arrays import ROUNDING, TINY, BoolArray, FloatArray
from postproc.errors import DataError, SourceRef
from postproc.geometry import apply, inverse, rotation_from_vector, transform
from postproc.measurement.rows import SetUps
from postproc.model import Registration

REACH = 0.5
"""Sd of the prior of the point around where it is expected [m]."""
FEWEST = 6
"""Postures that a registration needs."""
_FEWEST_OF_STATION = 3
"""The same of one station among several: the reflector is known from the others."""
ENOUGH = 12
"""Unloaded postures that suffice without the loaded ones."""
_STEPS = 50
_SETTLED = 1e-10
"""Change [m, rad] that ends the fit."""


def fit_registration(
    T_robroot_flange: FloatArray,
    measured: FloatArray,
    p_flange_start: FloatArray,
    source: SourceRef | None = None,
    rows: SetUps | None = None,
) -> Registration:
    """Return the registration of each station and each reflector.

    Args:
        T_robroot_flange: (n, 4, 4) where the flange stands [m].
        measured: (n, 3) points in the measured frame of each row's station [m].
        p_flange_start: (3,) where the measured point is expected in the flange [m].
        source: of the measurements, for the message.
        rows: station and reflector of each row; None: one of each.

    Raises:
        DataError: MEA012 with fewer than ``FEWEST`` postures, or all on one line, or a station or
            reflector with too few of its own.

    Source:
        The robust weights are those of Huber 1964, with the limit at twice the median.
    """
    none = np.zeros(len(measured), dtype=np.int32)
    rows = rows or SetUps(none, none, ("",), ("",), False)
    _require_spread(T_robroot_flange, measured, source, rows)
    start = np.asarray(p_flange_start, dtype=np.float64)
    points = np.tile(start, (len(rows.reflectors), 1))
    seen = apply(T_robroot_flange, points[rows.reflector])
    T = np.array(
        [
            rigid_motion(seen[rows.station == s], measured[rows.station == s])
            for s in range(len(rows.stations))
        ]
    )
    for _ in range(_STEPS):
        seen = apply(T_robroot_flange, points[rows.reflector])
        residual = apply(inverse(T[rows.station]), measured) - seen
        step = _step(T_robroot_flange[:, :3, :3], seen, residual, start - points, rows)
        frames = step[: 6 * len(T)].reshape(-1, 6)
        moved = step[6 * len(T) :].reshape(-1, 3)
        T = np.array(
            [
                one @ transform(rotation_from_vector(part[3:]), part[:3])
                for one, part in zip(T, frames, strict=True)
            ]
        )
        points = points + moved
        if np.abs(step).max() < _SETTLED:
            break
    rest = measured - apply(T[rows.station], apply(T_robroot_flange, points[rows.reflector]))
    return Registration(
        T[0],
        points[0],
        float(np.sqrt(np.mean(np.sum(rest**2, axis=1)))),
        stations=dict(zip(rows.stations, T, strict=True)) if rows.labelled else {},
        reflectors=dict(zip(rows.reflectors, points, strict=True)) if rows.labelled else {},
    )


def unloaded_rows(q: FloatArray, wrench: FloatArray | None) -> BoolArray:
    """Return the rows (n,) to register on where the give of the arm under loads is not known.

    A load moves the point off the arm of the model: those without one suffice where they are of
    ``ENOUGH`` postures; all count where they are not.

    Args:
        q: (n, 6) commanded joints [rad].
        wrench: (n, 6) ON the tool; None: no loads.
    """
    everything = np.ones(len(q), dtype=bool)
    if wrench is None:
        return everything
    free = ~np.any(wrench != 0.0, axis=1)
    return free if _distinct(q[free]) >= ENOUGH else everything


def in_robroot(
    registration: Registration, measured: FloatArray, rows: SetUps | None = None
) -> FloatArray:
    """Return measured points (n, 3) in axes of the robot root [m]."""
    return apply(inverse(frames_of(registration, rows)), measured)


def frames_of(registration: Registration, rows: SetUps | None) -> FloatArray:
    """Return the measured frame of each row (n, 4, 4), or the only one (4, 4).

    Raises:
        KeyError: a station that the registration does not know.
    """
    if rows is None or not registration.stations:
        return registration.T_measured_robroot
    if not rows.labelled and len(registration.stations) == 1:
        return registration.T_measured_robroot
    return np.array([registration.stations[name] for name in rows.stations])[rows.station]


def points_of(registration: Registration, rows: SetUps | None) -> FloatArray:
    """Return the measured point in the flange of each row (n, 3), or the only one (3,) [m].

    Raises:
        KeyError: a reflector that the registration does not know.
    """
    if rows is None or len(registration.reflectors) < 2:
        return registration.p_flange_point
    return np.array([registration.reflectors[name] for name in rows.reflectors])[rows.reflector]


def rigid_motion(
    points: FloatArray, measured: FloatArray, weight: FloatArray | None = None
) -> FloatArray:
    """Return the rigid motion (4, 4) that takes points (n, 3) to measured ones.

    Args:
        points: (n, 3).
        measured: (n, 3).
        weight: (n,) of each point, 1 / variance; None: all alike.

    Source:
        Kabsch 1976, Acta Cryst. A32, 922.
    """
    w = np.ones(len(points)) if weight is None else weight
    a, b = (np.average(at, axis=0, weights=w) for at in (points, measured))
    u, _, vt = np.linalg.svd((measured - b).T @ (w[:, None] * (points - a)))
    R = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return transform(R, b - R @ a)


def _require_spread(
    T_robroot_flange: FloatArray, measured: FloatArray, source: SourceRef | None, rows: SetUps
) -> None:
    postures = _distinct(T_robroot_flange[:, :3].reshape(-1, 12))
    own = FEWEST if len(rows.stations) == 1 else _FEWEST_OF_STATION
    for number, name in enumerate(rows.stations):
        here = rows.station == number
        found = _distinct(T_robroot_flange[here, :3].reshape(-1, 12))
        if postures >= FEWEST and found >= own:
            spread = np.linalg.svd(measured[here] - measured[here].mean(axis=0), compute_uv=False)
            if spread[1] > 1e-3 * spread[0]:
                continue
        what = f"{found} distinct posture(s)" if found < own else "all points on one line"
        of = f" of station {name!r}" if rows.labelled else ""
        raise DataError(
            "MEA012",
            f"{what}{of}, expected at least {own} postures that are not on one line to locate "
            "the measuring device",
            source,
        )


def _distinct(rows: FloatArray) -> int:
    return len(np.unique(np.round(rows / TINY), axis=0))


def _step(
    R_robroot_flange: FloatArray,
    seen: FloatArray,
    residual: FloatArray,
    to_start: FloatArray,
    rows: SetUps,
) -> FloatArray:
    """Return the Gauss-Newton step (6 S + 3 R,): shift and turn of each frame, then the points."""
    n, frames = len(seen), len(rows.stations)
    X = np.zeros((n, 3, 6 * frames + 3 * len(rows.reflectors)))
    row, at = np.arange(n), 6 * rows.station
    turn = np.cross(np.eye(3), seen[:, None, :]).swapaxes(1, 2)
    for axis in range(3):
        X[row, axis, at + axis] = 1.0
        X[row, :, at + 3 + axis] = turn[:, :, axis]
        X[row, :, 6 * frames + 3 * rows.reflector + axis] = R_robroot_flange[:, :, axis]
    size = np.linalg.norm(residual, axis=1)
    limit = 2.0 * float(np.median(size)) + ROUNDING
    root = np.sqrt(np.minimum(1.0, limit / np.maximum(size, ROUNDING)))
    pull = max(float(np.median(np.abs(residual))), ROUNDING) / REACH
    points = X.shape[2] - 6 * frames
    prior = np.hstack([np.zeros((points, 6 * frames)), pull * np.eye(points)])
    A = np.vstack([(X * root[:, None, None]).reshape(3 * n, -1), prior])
    y = np.concatenate([(residual * root[:, None]).ravel(), pull * to_start.ravel()])
    return np.asarray(np.linalg.lstsq(A, y, rcond=1e-12)[0])
